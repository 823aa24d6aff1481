//! What reading, writing and comparing have in common.

use serde_json::Value;

/// A list of `what` that is too long to be shown.
pub fn counted(count: u64, what: &str) -> Value {
    format!("{count} {what}").into()
}

/// The number that people write for an f32: 0.1 and not 0.10000000149011612. It reads back as the same f32.
pub fn shortest(single: f32) -> f64 {
    let exact = f64::from(single);
    single.to_string().parse().ok().filter(|short: &f64| *short as f32 == single).unwrap_or(exact)
}

/// A field with its way from the outermost value.
pub fn joined(field: &str, name: &str) -> String {
    if field.is_empty() { name.to_owned() } else { format!("{field}.{name}") }
}

/// A number, or what [`Description::to_json`](crate::Description::to_json) says of one that JSON does not have.
pub fn float(json: &Value) -> Option<f64> {
    match json.as_str() {
        Some("inf") => Some(f64::INFINITY),
        Some("-inf") => Some(f64::NEG_INFINITY),
        Some("NaN") => Some(f64::NAN),
        _ => json.as_f64(),
    }
}
