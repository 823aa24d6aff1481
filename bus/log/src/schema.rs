//! The JSON schemas of a log's messages, as viewers take them.
//!
//! Foxglove and Lichtblick do not open a channel whose schema has a list of lists in it, an object whose properties are
//! not given, or what may be of several types. A property that is not in the schema is in the message all the same.

use elk_spatial::catalogue::PayloadType;
use serde_json::{Map, Value, json};

/// That of the logger's own losses.
pub(crate) const DROPPED: &str = r#"{"type":"object","properties":{"dropped":{"type":"integer","description":"messages that are missing from the log so far"},"received":{"type":"number","description":"noticed, s"}},"required":["dropped","received"]}"#;

/// That of numbers.
pub(crate) fn double() -> String {
    value(json!({"type": "number", "description": "not finite: its bits as 16 hexadecimal digits"}))
}

/// That of texts.
pub(crate) fn text() -> String {
    value(json!({"type": "string"}))
}

fn value(schema: Value) -> String {
    with_envelope([("value", schema)], &["value"])
}

/// That of the values of a type that the catalogue knows: what of its fields can be plotted or read.
pub(crate) fn known(payload: &PayloadType) -> String {
    // Every example is a value of its type; the catalogue's tests see to it.
    let example: Value = serde_json::from_str(payload.example).unwrap_or_default();
    let fields = like(&example).unwrap_or_else(|| json!({"type": "object", "properties": {}}));
    let bytes = json!({"type": "string", "description": "the value's bytes"});
    with_envelope([("elk", bytes), ("value", fields)], &["elk", "value"])
}

fn with_envelope<const N: usize>(own: [(&str, Value); N], required: &[&str]) -> String {
    let envelope = [
        ("time", json!({"type": "number", "description": "published, s"})),
        ("received", json!({"type": "number", "description": "recorded, s"})),
        ("sequence", json!({"type": "integer", "description": "the publisher's count"})),
        ("order", json!({"type": "integer", "description": "place in the broker's order"})),
        ("aux", json!({"type": "string", "description": "auxiliary source"})),
    ];
    let properties: Map<_, _> = own.into_iter().chain(envelope).map(|(name, one)| (name.to_owned(), one)).collect();
    let required: Vec<_> = required.iter().chain(&["time", "received", "sequence", "order"]).collect();
    json!({"type": "object", "properties": properties, "required": required}).to_string()
}

/// The schema of what is like `example`; nothing: there is none that viewers take.
fn like(example: &Value) -> Option<Value> {
    match example {
        Value::Null => None,
        Value::Bool(_) => Some(json!({"type": "boolean"})),
        Value::String(_) => Some(json!({"type": "string"})),
        Value::Number(number) if number.is_f64() => Some(json!({"type": "number"})),
        Value::Number(_) => Some(json!({"type": "integer"})),
        Value::Array(entries) => match entries.first() {
            None | Some(Value::Array(_)) => None,
            Some(first) => like(first).map(|items| json!({"type": "array", "items": items})),
        },
        Value::Object(fields) if is_variant(fields) => None,
        Value::Object(fields) => {
            let properties = fields.iter().filter_map(|(name, field)| Some((name.clone(), like(field)?)));
            Some(json!({"type": "object", "properties": properties.collect::<Map<_, _>>()}))
        }
    }
}

/// Takes out of a value what is not there: `null` is of no type that a schema gives.
pub(crate) fn leave_out_nulls(value: &mut Value) {
    match value {
        Value::Object(fields) => {
            fields.retain(|_, field| !field.is_null());
            fields.values_mut().for_each(leave_out_nulls);
        }
        Value::Array(entries) => entries.iter_mut().for_each(leave_out_nulls),
        _ => {}
    }
}

/// Whether this is an enum's variant with its fields: other values of the type have other properties, or are texts.
fn is_variant(fields: &Map<String, Value>) -> bool {
    let mut names = fields.keys();
    let first = names.next().and_then(|name| name.chars().next());
    names.next().is_none() && first.is_some_and(char::is_uppercase)
}

#[cfg(test)]
mod tests {
    use super::*;
    use elk_spatial::catalogue::{CATALOGUE, named};

    /// Fails where viewers would.
    fn take(schema: &Value, at: &str) {
        match schema["type"].as_str() {
            Some("boolean" | "string" | "number" | "integer") => {}
            Some("object") => {
                let properties = schema["properties"].as_object().unwrap_or_else(|| panic!("no properties at {at}"));
                properties.iter().for_each(|(name, one)| take(one, &format!("{at}.{name}")));
            }
            Some("array") => {
                assert_ne!(schema["items"]["type"], "array", "a list of lists at {at}");
                take(&schema["items"], &format!("{at}[]"));
            }
            other => panic!("{other:?} at {at}"),
        }
    }

    #[test]
    fn viewers_take_every_schema() {
        let known = CATALOGUE.iter().map(|payload| (payload.name, known(payload)));
        for (name, schema) in known.chain([("double", double()), ("text", text()), ("dropped", DROPPED.into())]) {
            take(&serde_json::from_str(&schema).unwrap(), name);
        }
    }

    /// Fails if `value` is not what `schema` says.
    fn fits(value: &Value, schema: &Value, at: &str) {
        let is = match schema["type"].as_str().unwrap() {
            "boolean" => value.is_boolean(),
            "string" => value.is_string(),
            "number" => value.is_number(),
            "integer" => value.is_u64() || value.is_i64(),
            "array" => value.as_array().is_some_and(|entries| {
                entries.iter().for_each(|entry| fits(entry, &schema["items"], at));
                true
            }),
            _ => value.as_object().is_some_and(|fields| {
                let known =
                    fields.iter().filter_map(|(name, field)| Some((name, field, schema["properties"].get(name)?)));
                known.for_each(|(name, field, schema)| fits(field, schema, &format!("{at}.{name}")));
                true
            }),
        };
        assert!(is, "{value} at {at} is not {}", schema["type"]);
    }

    #[test]
    fn values_fit_their_schema_whatever_is_missing_in_them() {
        for payload in CATALOGUE {
            let schema: Value = serde_json::from_str(&known(payload)).unwrap();
            let example: Value = serde_json::from_str(payload.example).unwrap();
            fits(&example, &schema["properties"]["value"], payload.name);
        }
        let memory = named("MotionMemory").unwrap();
        let mut value: Value = serde_json::from_str(memory.example).unwrap();
        value["leg"] = Value::Null;
        value["samples"][0]["path_length_m"] = Value::Null;
        leave_out_nulls(&mut value);
        fits(&value, &serde_json::from_str::<Value>(&known(memory)).unwrap()["properties"]["value"], memory.name);
        assert_eq!(value["samples"], json!([{"scans": 1, "free": 8}]));
    }

    #[test]
    fn what_can_be_plotted_is_in_the_schema_and_what_may_be_anything_is_not() {
        let of = |name: &str| serde_json::from_str::<Value>(&known(named(name).unwrap())).unwrap();
        let progress = &of("Progress")["properties"]["value"]["properties"];
        assert_eq!(progress["path_length_m"]["type"], "number");
        assert_eq!(progress["finished"]["type"], "boolean");
        let report = &of("ExplorationReport")["properties"]["value"]["properties"];
        assert_eq!(report["frontiers_left"]["properties"]["invisible"]["type"], "integer");
        assert!(report.get("cpu_secs").is_none(), "a list of pairs");
        let memory = &of("MotionMemory")["properties"]["value"]["properties"];
        assert_eq!(memory["samples"]["items"]["properties"]["free"]["type"], "integer");
        assert!(memory.get("awaited").is_none(), "an object or a text");
    }
}
