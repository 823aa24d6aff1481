//! The JSON schemas of a log's messages, as viewers take them.
//!
//! Foxglove and Lichtblick do not open a channel whose schema has a list of lists in it, an object whose properties are
//! not given, or what may be of several types. A property that is not in the schema is in the message all the same.

use elk_bus::Description;
use elk_bus::describe::{Content, Field, Kind};
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

/// That of the values of a type that describes itself: what of its fields can be plotted or read.
pub(crate) fn described(description: &Description) -> String {
    let bytes = json!({"type": "string", "description": "the value's bytes"});
    match like(description.kind()) {
        Some(value) => with_envelope([("elk", bytes), ("value", value)], &["elk"]),
        // What is not in the schema is in the message all the same.
        None => with_envelope([("elk", bytes)], &["elk"]),
    }
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

/// The schema of a kind of value; nothing: there is none that viewers take.
fn like(kind: &Kind) -> Option<Value> {
    let simple = |name: &str| Some(json!({"type": name}));
    match kind {
        Kind::Bool => simple("boolean"),
        Kind::Text | Kind::Symbols { .. } => simple("string"),
        Kind::Float(_) => simple("number"),
        Kind::Unsigned(_) | Kind::Signed(_) => simple("integer"),
        Kind::Rotation => Some(json!({"type": "array", "items": {"type": "number"}})),
        // An option in an option is a list where it is there.
        Kind::Option(inner) if matches!(inner.plain(), Kind::Option(_) | Kind::Unit) => None,
        Kind::Option(inner) => like(inner),
        Kind::Unnamed(one) => like_field(one),
        Kind::List(inner) | Kind::Packed(inner) | Kind::Array { of: inner, .. } => match like(inner) {
            Some(items) if items["type"] != "array" => Some(json!({"type": "array", "items": items})),
            _ => None,
        },
        Kind::Struct(one) => {
            let properties = one.fields.iter().filter_map(property);
            Some(json!({"type": "object", "properties": properties.collect::<Map<_, _>>()}))
        }
        // All of them are names only where none holds anything.
        Kind::Enum(one) if one.variants.iter().all(|variant| variant.content == Content::Unit) => simple("string"),
        Kind::Enum(_) | Kind::Tuple(_) | Kind::Unit => None,
    }
}

fn property(field: &Field) -> Option<(String, Value)> {
    like_field(field).map(|schema| (field.name.clone(), schema))
}

/// A field's schema, with its unit and what it means.
fn like_field(field: &Field) -> Option<Value> {
    let mut schema = like(&field.kind)?;
    let unit = if field.unit.is_empty() { String::new() } else { format!(" ({})", field.unit) };
    let words = format!("{}{unit}", field.docs.trim_end_matches('.'));
    if !words.is_empty() {
        schema["description"] = words.trim().into();
    }
    Some(schema)
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

#[cfg(test)]
mod tests {
    use super::*;
    use elk_spatial::samples::{SAMPLES, Sample, named};

    fn schema_of(sample: &Sample) -> String {
        described(&sample.type_.description().unwrap())
    }

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
        let known = SAMPLES.iter().map(|sample| (sample.name(), schema_of(sample)));
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
        for sample in SAMPLES {
            let schema: Value = serde_json::from_str(&schema_of(sample)).unwrap();
            let mut value = sample.value();
            leave_out_nulls(&mut value);
            fits(&value, &schema["properties"]["value"], sample.name());
        }
        let memory = named("MotionMemory").unwrap();
        let mut value = memory.value();
        value["leg"] = Value::Null;
        value["samples"][0]["path_length_m"] = Value::Null;
        leave_out_nulls(&mut value);
        fits(&value, &serde_json::from_str::<Value>(&schema_of(memory)).unwrap()["properties"]["value"], memory.name());
        assert_eq!(value["samples"], json!([{"scans": 1, "free": 8}]));
    }

    #[test]
    fn what_can_be_plotted_is_in_the_schema_and_what_may_be_anything_is_not() {
        let of = |name: &str| serde_json::from_str::<Value>(&schema_of(named(name).unwrap())).unwrap();
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

    #[test]
    fn what_has_no_fields_is_what_it_is() {
        use elk_bus::describe::{Describe, Shape};
        let of = |shape: Shape| serde_json::from_str::<Value>(&described(&Description::of(&shape))).unwrap();
        assert_eq!(of(f64::SHAPE)["properties"]["value"]["type"], "number");
        assert_eq!(of(Vec::<String>::SHAPE)["properties"]["value"]["items"]["type"], "string");
        assert!(of(<(u8, bool)>::SHAPE)["properties"].get("value").is_none(), "viewers take none");
    }
}
