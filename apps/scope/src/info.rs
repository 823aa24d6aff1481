//! `elk info`: clients and variables, whichever have the name.

use std::borrow::Cow;
use std::collections::BTreeSet;
use std::time::Duration;

use elk_bus::broker::table::{
    ClientEntry, CommunityTable, LONGEST_VALUE, RegistrationEntry, VariableEntry, VariableKind,
};
use elk_bus::clock::Stopwatch;
use elk_bus::{Description, Value as BusValue};
use elk_outside::text::name;
use serde_json::{Value, json};

use crate::definition;
use crate::error::ScopeError;
use crate::list::variable_as_json;
use crate::output::Output;
use crate::pattern::Pattern;
use crate::session::{LOOK_EVERY, Scope, unknown};
use crate::show::{self, Types, names};

/// How long the latest value is waited for.
const PATIENCE: Duration = Duration::from_secs(5);

/// Whom to ask about.
#[derive(Debug, Clone)]
pub struct Info {
    /// The clients' and the variables' names.
    pub pattern: Pattern,
    /// Write JSON, an object a name.
    pub json: bool,
}

/// What is known of a name.
struct Known<'a> {
    name: &'a str,
    client: Option<&'a ClientEntry>,
    /// What the client last said of itself.
    status: Option<String>,
    variable: Option<&'a VariableEntry>,
    value: Option<BusValue>,
    /// Who has registered for the variable, and not only for everything.
    waiting: Vec<&'a str>,
}

impl Info {
    /// Says what is known of each client and variable that matches.
    ///
    /// # Errors
    /// Nobody has the name.
    pub fn run(&self, scope: &mut Scope, output: &mut Output<'_>) -> Result<(), ScopeError> {
        let table = scope.table()?;
        let types = Types::of(&table);
        let mut first = true;
        for name in self.names(&table)? {
            let known = Known::of(&table, &types, name, scope)?;
            if self.json {
                output.json(&known.as_json(&table, &types))?;
                continue;
            }
            if !std::mem::take(&mut first) {
                output.line("")?;
            }
            known.as_text(&table).iter().try_for_each(|line| output.line(line))?;
        }
        output.flush()
    }

    /// The names that match: those who are there, or one that is waited for.
    fn names<'a>(&'a self, table: &'a CommunityTable) -> Result<Vec<&'a str>, ScopeError> {
        let clients = table.clients.iter().map(|client| client.name.as_str());
        let all: BTreeSet<&str> = clients.chain(table.variables.iter().map(|v| v.name.as_str())).collect();
        let matching: Vec<&str> = all.iter().copied().filter(|name| self.pattern.matches(name)).collect();
        match self.pattern.literal() {
            Some(name) if matching.is_empty() && waiting_for(table, name).is_empty() => {
                let all: Vec<&str> = all.into_iter().collect();
                Err(unknown("there is no client and no variable", name, &all))
            }
            Some(name) => Ok(vec![name]),
            None => Ok(matching),
        }
    }
}

impl<'a> Known<'a> {
    fn of(table: &'a CommunityTable, types: &Types, name: &'a str, scope: &mut Scope) -> Result<Self, ScopeError> {
        let client = table.clients.iter().find(|client| client.name == name);
        let variable = table.variables.iter().find(|variable| variable.name == name);
        let value = variable.map(|variable| latest_value(scope, types, variable)).transpose()?.flatten();
        let status =
            client.and_then(|client| latest_text(table, types, &format!("{}_STATUS", client.name.to_uppercase())));
        Ok(Self { name, client, status, variable, value, waiting: waiting_for(table, name) })
    }

    fn as_text(&self, table: &CommunityTable) -> Vec<String> {
        let mut lines = Vec::new();
        lines.extend(self.client.iter().flat_map(|c| client_as_text(table, c, self.status.as_deref())));
        lines.extend(self.variable.iter().flat_map(|v| variable_as_text(table, v, self.value.as_ref())));
        if lines.is_empty() {
            lines.push(format!(
                "{}: nobody has written it yet; waiting for it: {}",
                name(self.name),
                names(&self.waiting, ", ")
            ));
        }
        lines
    }

    fn as_json(&self, table: &CommunityTable, types: &Types) -> Value {
        json!({
            "name": self.name,
            "client": self.client.map(|client| client_as_json(table, client, self.status.as_deref())),
            "variable": self.variable.map(|v| whole_variable_as_json(table, types, v, self.value.as_ref())),
            "waited_for_by": self.waiting,
        })
    }
}

/// Those who have registered for a variable by its name, or have a pattern for it that does not match everything.
fn waiting_for<'a>(table: &'a CommunityTable, name: &str) -> Vec<&'a str> {
    let meant = |one: &RegistrationEntry| one.key_pattern != "*" && elk_bus::pattern::matches(&one.key_pattern, name);
    let waiting = table.clients.iter().filter(|client| client.registrations.iter().any(meant));
    waiting.map(|client| client.name.as_str()).collect()
}

fn latest_text(table: &CommunityTable, types: &Types, name: &str) -> Option<String> {
    let variable = table.variables.iter().find(|variable| variable.name == name)?;
    Some(show::value_for_people(show::latest(types, variable)?.as_ref()))
}

/// The latest value, whole: the broker gives it to whoever registers.
fn latest_value(scope: &mut Scope, types: &Types, variable: &VariableEntry) -> Result<Option<BusValue>, ScopeError> {
    if variable.latest_bytes <= LONGEST_VALUE as u64 {
        return Ok(show::latest(types, variable));
    }
    let Ok(name) = variable.name.parse::<Pattern>() else { return Ok(None) };
    scope.register(&[name], &Pattern::any())?;
    let (mut value, waited) = (None, Stopwatch::start());
    // A value in shared memory may be overwritten before it is read; the next command may have more luck.
    while value.is_none() && scope.missed() == 0 && waited.elapsed() < PATIENCE {
        scope.receive(LOOK_EVERY, |mail| {
            if mail.key() == variable.name {
                value = Some(mail.value().to_value());
            }
        })?;
    }
    Ok(value)
}

/// Who reads what a client writes, and so on: the variables that it is told of.
fn reads<'a>(table: &'a CommunityTable, client: &str) -> Vec<&'a str> {
    let told = |variable: &&VariableEntry| variable.routes.iter().any(|r| r.readers.iter().any(|one| one == client));
    table.variables.iter().filter(told).map(|variable| variable.name.as_str()).collect()
}

pub(crate) fn client_as_text(table: &CommunityTable, client: &ClientEntry, status: Option<&str>) -> Vec<String> {
    let ms = |secs: f64| format!("{:.3} ms", secs * 1e3);
    let latency = client.latency;
    let mut lines = vec![format!("{}: a client of community {}", name(&client.name), table.community)];
    if !client.build.is_empty() {
        lines.push(format!("  build       {}", name(&client.build)));
    }
    lines.extend([
        format!("  writes      {}", or_nothing(&client.writes)),
        format!("  registered  {}", or_nothing(&client.registrations.iter().map(registration).collect::<Vec<_>>())),
        format!("  reads       {}", or_nothing(&reads(table, &client.name))),
        format!("  said        {} messages", client.messages),
        format!(
            "  latency     last {}, min {}, mean {}, max {} (from it to the broker)",
            ms(latency.recent_secs),
            ms(latency.min_secs),
            ms(latency.mean_secs),
            ms(latency.max_secs)
        ),
        format!(
            "  mail        {} messages, of which {} were dropped and {} wait",
            client.mail,
            client.dropped,
            show::bytes(client.waiting_bytes as f64)
        ),
    ]);
    lines.extend(status.map(|status| format!("  status      {status}")));
    lines
}

fn registration(one: &RegistrationEntry) -> String {
    let mut text = one.key_pattern.clone();
    if one.source_pattern != "*" {
        text += &format!(" from {}", one.source_pattern);
    }
    if one.min_interval_secs > 0.0 {
        text += &format!(" every {}", show::duration(one.min_interval_secs));
    }
    if one.lossless {
        text += " (lossless)";
    }
    text
}

fn or_nothing<T: AsRef<str>>(some: &[T]) -> String {
    match some {
        [] => "nothing".to_owned(),
        some => names(some, ", "),
    }
}

fn carries(kind: &VariableKind, description: Option<&Description>) -> String {
    match kind {
        VariableKind::Number => "numbers".to_owned(),
        VariableKind::Text => "texts".to_owned(),
        VariableKind::Typed { name: type_name, layout } => {
            let undescribed = if description.is_none() { "; nobody has described it" } else { "" };
            format!("{} (layout {layout:016x}{undescribed})", name(type_name))
        }
    }
}

/// What the values of a variable are, if they are of a type that somebody has described.
fn description(table: &CommunityTable, variable: &VariableEntry) -> Option<Description> {
    let VariableKind::Typed { name, layout } = &variable.kind else { return None };
    table.type_of(name, *layout).as_ref().description().map(Cow::into_owned)
}

pub(crate) fn variable_as_text(
    table: &CommunityTable,
    variable: &VariableEntry,
    value: Option<&BusValue>,
) -> Vec<String> {
    let description = description(table, variable);
    let mut lines = vec![
        format!("{}: a variable of community {}", name(&variable.name), table.community),
        format!("  carries     {}", carries(&variable.kind, description.as_ref())),
    ];
    lines.extend(description.iter().flat_map(definition::lines).map(|line| format!("              {line}")));
    lines.extend([
        format!(
            "  written     {}, last by {} {} ago, {}",
            if variable.messages == 1 { "once".to_owned() } else { format!("{} times", variable.messages) },
            name(&variable.writer),
            show::duration(table.time - variable.written),
            show::hertz(variable.rate_hz)
        ),
        format!(
            "  size        {} now, {} on average",
            show::bytes(variable.latest_bytes as f64),
            show::bytes(variable.bytes as f64 / variable.messages.max(1) as f64)
        ),
    ]);
    for route in &variable.routes {
        lines.push(format!("  {} tells {}", name(&route.source), show::or_nobody(&route.readers)));
    }
    let value = value.map_or("could not be read in time".to_owned(), |value| show::value_for_people(value.as_ref()));
    lines.push(format!("  latest      {value}"));
    lines
}

fn client_as_json(table: &CommunityTable, client: &ClientEntry, status: Option<&str>) -> Value {
    json!({
        "name": client.name,
        "build": client.build,
        "writes": client.writes,
        "registrations": client.registrations,
        "reads": reads(table, &client.name),
        "messages": client.messages,
        "latency": client.latency,
        "mail": client.mail,
        "dropped": client.dropped,
        "waiting_bytes": client.waiting_bytes,
        "status": status,
    })
}

fn whole_variable_as_json(
    table: &CommunityTable,
    types: &Types,
    variable: &VariableEntry,
    value: Option<&BusValue>,
) -> Value {
    let mut json = variable_as_json(table.time, types, variable);
    if let VariableKind::Typed { layout, .. } = variable.kind {
        json["layout"] = format!("{layout:016x}").into();
    }
    json["description"] = json!(description(table, variable));
    json["routes"] = json!(variable.routes);
    json["value"] = value.map_or(Value::Null, |value| show::value_for_programs(value.as_ref()));
    json
}
