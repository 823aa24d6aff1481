//! The `DB_*` variables that MOOS' tools know, and `DB_DROPS`, which MOOS has no word for.

use std::fmt::Write;

use super::state::Broker;
use super::state::client::Client;
use crate::wire::{self, BULK, ValueKind};

/// How often they are refreshed (s), as in the MOOSDB.
pub(super) const PERIOD_SECS: f64 = 2.0;

/// The longest of these texts (bytes, about): of more it says how much.
const LONGEST: usize = 256 << 10;

impl Broker {
    pub(super) fn summarise(&mut self, now: f64) {
        self.publish_own(now, "DB_TIME", ValueKind::Double, &self.time.of_community(now).to_le_bytes());
        self.publish_own(now, "DB_UPTIME", ValueKind::Double, &(now - self.time.started).to_le_bytes());
        self.publish_clients(now);
        let drops = self.per_client(|c| format!("{}={}", c.name, c.mailbox.lost()));
        self.publish_own(now, "DB_DROPS", ValueKind::Text, drops.as_bytes());
        let quality = self.per_client(|c| format!("{}={}", c.name, c.latency.text()));
        self.publish_own(now, "DB_QOS", ValueKind::Text, quality.as_bytes());
        let reads_and_writes = self.summary_of_reads_and_writes();
        self.publish_own(now, "DB_RWSUMMARY", ValueKind::Text, reads_and_writes.as_bytes());
        let table = self.variable_table();
        self.publish_own(now, "DB_VARSUMMARY", ValueKind::Text, table.as_bytes());
    }

    /// `DB_CLIENTS`: the names of all clients.
    pub(super) fn publish_clients(&mut self, now: f64) {
        let names = self.per_client(|c| c.name.clone());
        self.publish_own(now, "DB_CLIENTS", ValueKind::Text, names.as_bytes());
    }

    fn per_client(&self, text: impl Fn(&Client) -> String) -> String {
        self.sessions.present().map(|(_, c)| text(c) + ",").collect()
    }

    /// `client=read:read&written:written,…`
    fn summary_of_reads_and_writes(&self) -> String {
        let all: Vec<_> = self.reads_and_writes().collect();
        let most = LONGEST / (2 * all.len()).max(1);
        let line = |(name, read, written): &(&str, Vec<&str>, Vec<&str>)| {
            format!("{name}={}&{}", joined(read, most), joined(written, most))
        };
        all.iter().map(line).collect::<Vec<_>>().join(",")
    }

    /// A table for people: name, time, writer, rate, type, value.
    fn variable_table(&mut self) -> String {
        let (mut table, mut left_out) = (String::new(), 0);
        for (key, variable) in (0..).zip(self.variables.iter_mut()) {
            let rate = (variable.writes - variable.summarised_writes) as f64 / PERIOD_SECS;
            variable.summarised_writes = variable.writes;
            variable.rate_hz = rate;
            let Ok(frame) = wire::first_frame(&variable.latest) else {
                continue;
            };
            if table.len() >= LONGEST {
                left_out += 1;
                continue;
            }
            let source = self.names.sources.name(frame.header.source);
            let age = variable.last_write - self.time.started;
            let (kind, value) = match frame.header.value_kind {
                ValueKind::Double => ('D', wire::double(frame.value).map_or_else(String::new, |v| v.to_string())),
                ValueKind::Text if frame.header.flags & BULK != 0 => ('S', String::new()),
                ValueKind::Text => {
                    ('S', first_chars(&String::from_utf8_lossy(&frame.value[..frame.value.len().min(100)]), 25))
                }
                ValueKind::Binary => ('B', self.names.types.name(frame.header.type_).to_owned()),
            };
            let name = self.names.keys.name(key);
            let _ = writeln!(table, "{name:<20} {age:<20.3} {source:<20} {rate:<8.1}Hz {kind} {value}");
        }
        if left_out > 0 {
            let _ = writeln!(table, "and {left_out} more");
        }
        table
    }
}

/// Names with colons between them, up to about `most` bytes; then how many more there are.
fn joined(names: &[&str], most: usize) -> String {
    let (mut text, mut left_out) = (String::new(), 0);
    for name in names {
        if text.len() >= most {
            left_out += 1;
            continue;
        }
        if !text.is_empty() {
            text.push(':');
        }
        text.push_str(name);
    }
    if left_out > 0 {
        let _ = write!(text, ":+{left_out}");
    }
    text
}

fn first_chars(text: &str, n: usize) -> String {
    text.chars().take(n).map(|c| if c.is_control() { ' ' } else { c }).collect()
}
