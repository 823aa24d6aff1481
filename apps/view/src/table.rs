//! The broker's table, as the page's list of variables.

use elk_bus::broker::table::{CommunityTable, VariableEntry, VariableKind};
use serde_json::{Value, json};

/// The most variables that are listed.
const MOST: usize = 1_000;

/// The message that lists them, by name.
pub(crate) fn variables(table: &CommunityTable) -> Value {
    let mut variables: Vec<&VariableEntry> = table.variables.iter().collect();
    variables.sort_by(|one, other| one.name.cmp(&other.name));
    let left_out = table.left_out + variables.len().saturating_sub(MOST) as u64;
    let rows: Vec<Value> = variables.into_iter().take(MOST).map(|variable| row(table, variable)).collect();
    json!({"type": "variables", "rows": rows, "left_out": left_out})
}

fn row(table: &CommunityTable, variable: &VariableEntry) -> Value {
    let kind = match &variable.kind {
        VariableKind::Number => "number",
        VariableKind::Text => "text",
        VariableKind::Typed { name, .. } => name,
    };
    let readers: usize = variable.routes.iter().map(|route| route.readers.len()).sum();
    json!({
        "key": variable.name, "type": kind, "writer": variable.writer, "age": table.time - variable.written,
        "rate": variable.rate_hz, "bytes": variable.latest_bytes, "count": variable.messages, "readers": readers,
    })
}
