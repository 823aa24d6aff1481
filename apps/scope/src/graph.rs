//! `elk graph`: who says what to whom.

use std::collections::BTreeMap;

use elk_bus::broker::table::CommunityTable;
use elk_outside::text::name;
use serde_json::{Value, json};

use crate::error::ScopeError;
use crate::output::{Output, in_columns};
use crate::session::Scope;
use crate::show;

/// How to draw it.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Drawing {
    /// For people: each writer, its variables, and who hears them.
    Text,
    /// For Graphviz' `dot`.
    Dot,
    /// For programs: one JSON object.
    Json,
}

/// What one client says under one name, and who hears it.
#[derive(Debug, Clone, PartialEq, Eq)]
struct Saying {
    writer: String,
    variable: String,
    readers: Vec<String>,
}

/// Draws who says what to whom. The broker's own variables are left out.
pub fn graph(scope: &mut Scope, output: &mut Output<'_>, drawing: Drawing) -> Result<(), ScopeError> {
    let table = scope.table()?;
    let sayings = sayings(&table);
    match drawing {
        Drawing::Text => as_text(&table, &sayings).iter().try_for_each(|line| output.line(line))?,
        Drawing::Dot => as_dot(&table, &sayings).iter().try_for_each(|line| output.line(line))?,
        Drawing::Json => output.json(&as_json(&table, &sayings))?,
    }
    output.flush()
}

#[cfg(test)]
pub(crate) fn drawn(table: &CommunityTable) -> Vec<String> {
    let sayings = sayings(table);
    [as_text(table, &sayings), as_dot(table, &sayings)].concat()
}

/// By writer, then by variable.
fn sayings(table: &CommunityTable) -> Vec<Saying> {
    let own = format!("MOOSDB_{}", table.community);
    let mut sayings: Vec<Saying> = table
        .variables
        .iter()
        .flat_map(|variable| variable.routes.iter().map(move |route| (variable, route)))
        .filter(|(_, route)| route.source != own)
        .map(|(variable, route)| Saying {
            writer: route.source.clone(),
            variable: variable.name.clone(),
            readers: route.readers.clone(),
        })
        .collect();
    sayings.sort_by(|one, other| (&one.writer, &one.variable).cmp(&(&other.writer, &other.variable)));
    sayings
}

fn is_there(table: &CommunityTable, name: &str) -> bool {
    table.clients.iter().any(|client| client.name == name)
}

fn as_text(table: &CommunityTable, sayings: &[Saying]) -> Vec<String> {
    let mut lines = Vec::new();
    for of_one in sayings.chunk_by(|one, other| one.writer == other.writer) {
        let gone = if is_there(table, &of_one[0].writer) { "" } else { " (gone)" };
        lines.push(format!("{}{gone}", name(&of_one[0].writer)));
        let rows = of_one.iter().map(|one| vec![one.variable.clone(), format!("→ {}", show::or_nobody(&one.readers))]);
        lines.extend(in_columns(&rows.collect::<Vec<_>>(), &[]).into_iter().map(|row| format!("  {row}")));
    }
    let silent = table.clients.iter().filter(|client| !sayings.iter().any(|one| one.writer == client.name));
    lines.extend(silent.map(|client| format!("{} says nothing", name(&client.name))));
    if lines.is_empty() {
        lines.push("nobody has said anything yet".to_owned());
    }
    lines
}

fn as_dot(table: &CommunityTable, sayings: &[Saying]) -> Vec<String> {
    let mut said: BTreeMap<(&str, &str), Vec<&str>> = BTreeMap::new();
    for one in sayings {
        for reader in &one.readers {
            said.entry((&one.writer, reader)).or_default().push(&one.variable);
        }
    }
    let mut lines =
        vec![format!("digraph {} {{", quoted(&table.community)), "  rankdir=LR; node [shape=box];".to_owned()];
    lines.extend(table.clients.iter().map(|client| format!("  {};", quoted(&client.name))));
    let gone = sayings.iter().filter(|one| !is_there(table, &one.writer)).map(|one| one.writer.as_str());
    let gone: std::collections::BTreeSet<&str> = gone.collect();
    lines.extend(gone.into_iter().map(|name| format!("  {} [style=dashed];", quoted(name))));
    lines.extend(said.iter().map(|((writer, reader), variables)| {
        format!("  {} -> {} [label={}];", quoted(writer), quoted(reader), quoted(&variables.join("\n")))
    }));
    lines.push("}".to_owned());
    lines
}

/// A name as Graphviz takes it.
fn quoted(name: &str) -> String {
    format!("\"{}\"", name.replace('\\', "\\\\").replace('"', "\\\"").replace('\n', "\\n"))
}

fn as_json(table: &CommunityTable, sayings: &[Saying]) -> Value {
    let said = |one: &Saying| json!({"writer": one.writer, "variable": one.variable, "readers": one.readers});
    json!({
        "community": table.community,
        "clients": table.clients.iter().map(|client| client.name.as_str()).collect::<Vec<_>>(),
        "says": sayings.iter().map(said).collect::<Vec<_>>(),
    })
}
