//! `elk top`: who says most, and who is slow to read.
//!
//! It takes its figures from the broker's table, once a second, and hears no mail at all: a community pays no more for
//! it when more is said.

use std::collections::BTreeMap;
use std::sync::atomic::AtomicBool;

use elk_bus::broker::table::{ClientEntry, CommunityTable, VariableEntry};
use elk_bus::clock::Stopwatch;
use serde_json::{Value, json};

use crate::error::ScopeError;
use crate::output::{Line, Output, Table};
use crate::quit::Quit;
use crate::rates::PERIOD;
use crate::session::{LOOK_EVERY, Scope};
use crate::show;

/// What to show, and for how long.
#[derive(Debug, Clone)]
pub struct Top {
    /// End after so many pages, of which there is one a second.
    pub count: Option<u64>,
    /// Write JSON, an object a page.
    pub json: bool,
}

impl Top {
    /// Writes a page a second, until enough are written, or `stop` is set.
    pub fn run(&self, scope: &mut Scope, output: &mut Output<'_>, stop: &AtomicBool) -> Result<(), ScopeError> {
        let mut before = scope.table()?;
        let (mut pages, mut quit) = (0, Quit::new(stop, output));
        while self.count.is_none_or(|count| pages < count) {
            if !pause(scope, &mut quit)? {
                return Ok(());
            }
            let now = scope.table()?;
            let change = Change::between(&before, &now);
            match self.json {
                true => output.whole_json(&change.as_json())?,
                false => {
                    output.look();
                    let page = change.as_text(output.columns());
                    output.page(&page)?;
                }
            }
            before = now;
            pages += 1;
        }
        Ok(())
    }
}

#[cfg(test)]
pub(crate) fn change_as_json(before: &CommunityTable, now: &CommunityTable) -> Value {
    Change::between(before, now).as_json()
}

#[cfg(test)]
pub(crate) fn change_as_text(before: &CommunityTable, now: &CommunityTable) -> Vec<Line> {
    Change::between(before, now).as_text(None)
}

/// Waits for the next page; `false`: there is to be none.
fn pause(scope: &mut Scope, quit: &mut Quit<'_>) -> Result<bool, ScopeError> {
    let waited = Stopwatch::start();
    while let Some(left) = PERIOD.checked_sub(waited.elapsed()).filter(|left| !left.is_zero()) {
        if quit.is_asked_for() {
            return Ok(false);
        }
        scope.receive(left.min(LOOK_EVERY), |_| {})?;
    }
    Ok(true)
}

/// What happened from one table to the next.
struct Change<'a> {
    table: &'a CommunityTable,
    secs: f64,
    /// The most often written first.
    variables: Vec<VariableChange<'a>>,
    clients: Vec<ClientChange<'a>>,
}

struct VariableChange<'a> {
    variable: &'a VariableEntry,
    rate_hz: f64,
    bytes_per_sec: f64,
}

struct ClientChange<'a> {
    client: &'a ClientEntry,
    said_hz: f64,
    mail_hz: f64,
    dropped: u64,
}

impl<'a> Change<'a> {
    fn between(before: &CommunityTable, table: &'a CommunityTable) -> Self {
        let secs = (table.time - before.time).max(1e-3);
        // A broker that was started anew counts from zero.
        let grown = |now: u64, then: u64| now.checked_sub(then).unwrap_or(now);
        let per_sec = |now: u64, then: u64| grown(now, then) as f64 / secs;
        let old: BTreeMap<&str, (u64, u64)> =
            before.variables.iter().map(|v| (v.name.as_str(), (v.messages, v.bytes))).collect();
        let mut variables: Vec<_> = table
            .variables
            .iter()
            .map(|variable| {
                let (messages, bytes) = old.get(variable.name.as_str()).copied().unwrap_or_default();
                let rate_hz = per_sec(variable.messages, messages);
                VariableChange { variable, rate_hz, bytes_per_sec: per_sec(variable.bytes, bytes) }
            })
            .collect();
        variables.sort_by(|one, other| {
            other.rate_hz.total_cmp(&one.rate_hz).then_with(|| one.variable.name.cmp(&other.variable.name))
        });
        let old: BTreeMap<&str, &ClientEntry> = before.clients.iter().map(|c| (c.name.as_str(), c)).collect();
        let clients = table.clients.iter().map(|client| {
            let then = old.get(client.name.as_str()).map_or((0, 0, 0), |c| (c.messages, c.mail, c.dropped));
            ClientChange {
                client,
                said_hz: per_sec(client.messages, then.0),
                mail_hz: per_sec(client.mail, then.1),
                dropped: grown(client.dropped, then.2),
            }
        });
        Self { table, secs, variables, clients: clients.collect() }
    }

    fn as_text(&self, columns: Option<usize>) -> Vec<Line> {
        let (all, bytes) =
            (self.variables.iter().map(|v| v.rate_hz).sum(), self.variables.iter().map(|v| v.bytes_per_sec).sum());
        let up = show::duration(self.table.time - self.table.started);
        let (community, clients) = (&self.table.community, self.clients.len());
        let head = format!(
            "community {community}, up {up}, clients: {clients}, {}, {}/s",
            show::hertz(all),
            show::bytes(bytes)
        );
        let mut lines = vec![Line::from(head)];
        lines.extend(show::clock(self.table).map(Line::from));
        let mut rows = vec![
            ["CLIENT", "SAYS", "MAIL", "DROPPED", "NOW", "WAITING", "LATENCY", "MEAN"].map(str::to_owned).to_vec(),
        ];
        rows.extend(self.clients.iter().map(ClientChange::row));
        let losing = self.clients.iter().zip(1..).filter(|(client, _)| client.dropped > 0).map(|(_, row)| row);
        let clients = Table {
            rows,
            right: &[1, 2, 3, 4, 5, 6, 7],
            spare: &[7, 3, 5, 4, 6],
            bad: losing.collect(),
            ..Table::default()
        };
        lines.extend(clients.lines(columns));
        let mut rows =
            vec![["VARIABLE", "TYPE", "WRITER", "RATE", "BANDWIDTH", "MESSAGES"].map(str::to_owned).to_vec()];
        rows.extend(self.variables.iter().map(VariableChange::row));
        lines.push(String::new().into());
        lines.extend(Table { rows, right: &[3, 4, 5], spare: &[5, 1, 2, 4], ..Table::default() }.lines(columns));
        lines
    }

    fn as_json(&self) -> Value {
        json!({
            "community": self.table.community,
            "time": self.table.time,
            "clock": show::clock_as_json(self.table),
            "uptime_secs": self.table.time - self.table.started,
            "period_secs": self.secs,
            "clients": self.clients.iter().map(ClientChange::as_json).collect::<Vec<_>>(),
            "variables": self.variables.iter().map(VariableChange::as_json).collect::<Vec<_>>(),
        })
    }
}

impl VariableChange<'_> {
    fn row(&self) -> Vec<String> {
        vec![
            self.variable.name.clone(),
            show::kind_name(&self.variable.kind).to_owned(),
            self.variable.writer.clone(),
            show::hertz(self.rate_hz),
            format!("{}/s", show::bytes(self.bytes_per_sec)),
            self.variable.messages.to_string(),
        ]
    }

    fn as_json(&self) -> Value {
        json!({
            "name": self.variable.name,
            "type": show::kind_name(&self.variable.kind),
            "writer": self.variable.writer,
            "rate_hz": self.rate_hz,
            "bytes_per_sec": self.bytes_per_sec,
            "messages": self.variable.messages,
        })
    }
}

impl ClientChange<'_> {
    fn row(&self) -> Vec<String> {
        let latency = self.client.latency;
        vec![
            self.client.name.clone(),
            show::hertz(self.said_hz),
            show::hertz(self.mail_hz),
            self.client.dropped.to_string(),
            format!("+{}", self.dropped),
            show::bytes(self.client.waiting_bytes as f64),
            show::duration(latency.recent_secs),
            show::duration(latency.mean_secs),
        ]
    }

    fn as_json(&self) -> Value {
        json!({
            "name": self.client.name,
            "says_hz": self.said_hz,
            "mail_hz": self.mail_hz,
            "dropped": self.client.dropped,
            "dropped_now": self.dropped,
            "waiting_bytes": self.client.waiting_bytes,
            "latency": self.client.latency,
        })
    }
}
