//! `elk list`: who is there, and what was said.

use elk_bus::broker::table::{CommunityTable, VariableEntry};
use elk_outside::text;
use serde_json::{Value, json};

use crate::error::ScopeError;
use crate::output::{Line, Output, Table};
use crate::pattern::Pattern;
use crate::session::{Scope, matching};
use crate::show::{self, Types, names};

/// Characters of a value that a table shows.
const VALUE_CHARACTERS: usize = 60;

/// What to list.
#[derive(Debug, Clone)]
pub struct List {
    /// The variables.
    pub pattern: Pattern,
    /// Write one JSON object.
    pub json: bool,
}

impl List {
    /// Lists clients and variables.
    ///
    /// # Errors
    /// The pattern is a name, and nobody has written such a variable.
    pub fn run(&self, scope: &mut Scope, output: &mut Output<'_>) -> Result<(), ScopeError> {
        let table = scope.table()?;
        let variables = matching(&table, &self.pattern)?;
        match self.json {
            true => output.json(&as_json(&table, &variables))?,
            false => {
                let lines = as_text(&table, &variables, output.columns());
                lines.iter().try_for_each(|line| output.styled(line))?;
            }
        }
        output.flush()
    }
}

pub(crate) fn as_text(table: &CommunityTable, variables: &[&VariableEntry], columns: Option<usize>) -> Vec<Line> {
    let clients: Vec<&str> = table.clients.iter().map(|client| client.name.as_str()).collect();
    let head = match clients.as_slice() {
        [] => format!("community {}: no clients", table.community),
        some => format!("community {}: clients {}", table.community, names(some, " ")),
    };
    let types = Types::of(table);
    let mut rows = vec![["VARIABLE", "TYPE", "WRITER", "AGE", "RATE", "VALUE"].map(str::to_owned).to_vec()];
    rows.extend(variables.iter().map(|variable| row(table.time, &types, variable)));
    let mut lines = vec![Line::from(head)];
    lines.extend(show::clock(table).map(Line::from));
    match variables {
        [] => lines.push("no variables".to_owned().into()),
        _ => lines.extend(Table { rows, right: &[3, 4], spare: &[1, 3, 2, 4], ..Table::default() }.lines(columns)),
    }
    lines
}

fn row(now: f64, types: &Types, variable: &VariableEntry) -> Vec<String> {
    vec![
        variable.name.clone(),
        show::kind_name(&variable.kind).to_owned(),
        variable.writer.clone(),
        show::duration(now - variable.written),
        show::hertz(variable.rate_hz),
        value(types, variable),
    ]
}

/// A variable's latest value in a few words.
pub(crate) fn value(types: &Types, variable: &VariableEntry) -> String {
    match show::latest(types, variable) {
        Some(value) => text::clipped(&show::value_for_people(value.as_ref()), VALUE_CHARACTERS).into_owned(),
        None => format!("({})", show::bytes(variable.latest_bytes as f64)),
    }
}

fn as_json(table: &CommunityTable, variables: &[&VariableEntry]) -> Value {
    let types = Types::of(table);
    json!({
        "community": table.community,
        "time": table.time,
        "clock": show::clock_as_json(table),
        "clients": table.clients.iter().map(|client| client.name.as_str()).collect::<Vec<_>>(),
        "variables": variables.iter().map(|variable| variable_as_json(table.time, &types, variable)).collect::<Vec<_>>(),
    })
}

/// A variable as programs read it; `value` is missing where it is too long for a table.
pub(crate) fn variable_as_json(now: f64, types: &Types, variable: &VariableEntry) -> Value {
    let mut json = json!({
        "name": variable.name,
        "type": show::kind_name(&variable.kind),
        "writer": variable.writer,
        "age_secs": now - variable.written,
        "rate_hz": variable.rate_hz,
        "messages": variable.messages,
        "bytes": variable.bytes,
        "latest_bytes": variable.latest_bytes,
    });
    if let Some(value) = show::latest(types, variable) {
        json["value"] = show::value_for_programs(value.as_ref());
    }
    json
}
