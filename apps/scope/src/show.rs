//! How values and figures are shown: short for people, whole for programs.

use std::collections::BTreeMap;

use elk_bus::broker::table::{ClockEntry, CommunityTable, LatestValue, VariableEntry, VariableKind};
use elk_bus::clock::Date;
use elk_bus::{Type, TypeRef, Value as BusValue, ValueRef};
use elk_outside::text::{name, printable};
use serde_json::{Map, Value, json};

/// Lists with more entries are counted where people read.
const LONGEST_FOR_PEOPLE: usize = 8;
/// Lists with more entries are counted where programs read.
const LONGEST_FOR_PROGRAMS: usize = 100_000;
/// Bytes of a value of unknown type that people are shown.
const BYTES_FOR_PEOPLE: usize = 16;
/// Bytes of a value of unknown type that programs are given.
const BYTES_FOR_PROGRAMS: usize = 64 << 10;

/// A value as people read it, in one line.
pub fn value_for_people(value: ValueRef<'_>) -> String {
    match value {
        ValueRef::Double(number) => number.to_string(),
        ValueRef::Text(text) => printable(text).into_owned(),
        ValueRef::Binary { type_, bytes } => match type_.to_json(bytes, LONGEST_FOR_PEOPLE) {
            Ok(Value::Object(fields)) => in_words(&fields),
            Ok(other) => json_in_words(&other),
            Err(_) => raw(type_, bytes),
        },
    }
}

/// A value as programs read it.
pub fn value_for_programs(value: ValueRef<'_>) -> Value {
    let shown = value.to_json(LONGEST_FOR_PROGRAMS);
    shown.unwrap_or_else(|error| match value {
        ValueRef::Binary { type_, bytes } => {
            let layout = format!("{:016x}", type_.layout());
            let first: String = bytes.iter().take(BYTES_FOR_PROGRAMS).map(|byte| format!("{byte:02x}")).collect();
            json!({"unreadable": error.to_string(), "layout": layout, "bytes": bytes.len(), "hex": first})
        }
        _ => Value::Null,
    })
}

/// The name of what a value is: `number`, `text`, or its type's.
pub fn type_name<'a>(value: &ValueRef<'a>) -> &'a str {
    match *value {
        ValueRef::Double(_) => "number",
        ValueRef::Text(_) => "text",
        ValueRef::Binary { type_, .. } => type_.name(),
    }
}

/// Who drives the community's clock, if anybody does.
pub fn clock(table: &CommunityTable) -> Option<String> {
    let ClockEntry { driver, time, rate } = table.clock.as_ref()?;
    let Date { year, month, day, hour, minute, second, .. } = Date::of(*time);
    let pace = if *rate == 0.0 { "standing still".to_owned() } else { format!("running at {rate}x") };
    let driver = name(driver);
    Some(format!(
        "time is driven by {driver}: {year:04}-{month:02}-{day:02} {hour:02}:{minute:02}:{second:02} UTC, {pace}"
    ))
}

/// As [`clock`], for programs; `null`: nobody.
pub fn clock_as_json(table: &CommunityTable) -> Value {
    table
        .clock
        .as_ref()
        .map_or(Value::Null, |clock| json!({"driver": clock.driver, "time": clock.time, "rate": clock.rate}))
}

/// The name of what a variable carries.
pub fn kind_name(kind: &VariableKind) -> &str {
    match kind {
        VariableKind::Number => "number",
        VariableKind::Text => "text",
        VariableKind::Typed { name, .. } => name,
    }
}

/// The types of a community, their descriptions read once.
pub struct Types(BTreeMap<(String, u64), Type>);

impl Types {
    /// Those that a table has.
    pub fn of(table: &CommunityTable) -> Self {
        Self(table.types.iter().map(|entry| ((entry.name.clone(), entry.layout), entry.to_type())).collect())
    }

    /// The type of this name and layout, as far as it is described.
    pub fn get(&self, name: &str, layout: u64) -> Type {
        let found = self.0.get(&(name.to_owned(), layout)).cloned();
        found.unwrap_or_else(|| Type::undescribed(name, layout))
    }
}

/// A variable's latest value, as far as the table has it.
pub fn latest(types: &Types, variable: &VariableEntry) -> Option<BusValue> {
    match (&variable.kind, &variable.latest) {
        (_, LatestValue::Number(number)) => Some(BusValue::Double(*number)),
        (_, LatestValue::Text(text)) => Some(BusValue::Text(text.clone())),
        (VariableKind::Typed { name, layout }, LatestValue::Typed(bytes)) => {
            Some(BusValue::Binary { type_: types.get(name, *layout), bytes: bytes.clone() })
        }
        _ => None,
    }
}

/// Names in a line, each as much as people read of it.
pub fn names<T: AsRef<str>>(names: &[T], between: &str) -> String {
    names.iter().map(|one| name(one.as_ref())).collect::<Vec<_>>().join(between)
}

fn raw(type_: TypeRef<'_>, bytes: &[u8]) -> String {
    let first: Vec<String> = bytes.iter().take(BYTES_FOR_PEOPLE).map(|byte| format!("{byte:02x}")).collect();
    let more = if bytes.len() > BYTES_FOR_PEOPLE { " …" } else { "" };
    let (type_name, layout) = (name(type_.name()), type_.layout());
    format!("{type_name} (layout {layout:016x}), {} bytes: {}{more}", bytes.len(), first.join(" "))
}

fn in_words(fields: &Map<String, Value>) -> String {
    let field = |(name, value): (&String, &Value)| format!("{name}: {}", json_in_words(value));
    fields.iter().map(field).collect::<Vec<_>>().join(", ")
}

fn json_in_words(value: &Value) -> String {
    match value {
        Value::Object(fields) => format!("{{{}}}", in_words(fields)),
        Value::Array(entries) => format!("[{}]", entries.iter().map(json_in_words).collect::<Vec<_>>().join(", ")),
        Value::String(text) => printable(text).into_owned(),
        Value::Number(number) => match number.as_f64().filter(|_| number.is_f64()) {
            Some(real) => rounded(real),
            None => number.to_string(),
        },
        other => other.to_string(),
    }
}

/// A number of a typed value with as many digits as a person reads.
fn rounded(real: f64) -> String {
    if real != 0.0 && !(1e-3..1e9).contains(&real.abs()) {
        return format!("{real:.3e}");
    }
    let digits = format!("{real:.4}");
    digits.trim_end_matches('0').trim_end_matches('.').to_owned()
}

/// A rate: `12.5 Hz`.
pub fn hertz(rate: f64) -> String {
    format!("{} Hz", three_digits(rate))
}

/// A number of bytes: `1.21 MB`.
pub fn bytes(count: f64) -> String {
    const UNITS: [&str; 4] = ["B", "kB", "MB", "GB"];
    let unit = (0..UNITS.len() - 1).find(|unit| count < 999.5 * 1e3_f64.powi(*unit as i32)).unwrap_or(UNITS.len() - 1);
    format!("{} {}", three_digits(count / 1e3_f64.powi(unit as i32)), UNITS[unit])
}

/// A time: `1.2 ms`, `3.45 s`, `12 min`, `3.1 h`.
pub fn duration(secs: f64) -> String {
    match secs.abs() {
        s if s < 1e-3 => format!("{} µs", three_digits(secs * 1e6)),
        s if s < 1.0 => format!("{} ms", three_digits(secs * 1e3)),
        s if s < 120.0 => format!("{} s", three_digits(secs)),
        s if s < 7200.0 => format!("{} min", three_digits(secs / 60.0)),
        _ => format!("{} h", three_digits(secs / 3600.0)),
    }
}

fn three_digits(number: f64) -> String {
    let decimals = match number.abs() {
        n if n >= 99.95 || n == 0.0 => 0,
        n if n >= 9.995 => 1,
        _ => 2,
    };
    format!("{number:.decimals$}")
}

/// Names, or that there are none.
pub(crate) fn or_nobody(readers: &[String]) -> String {
    if readers.is_empty() { "nobody".to_owned() } else { names(readers, ", ") }
}

#[cfg(test)]
mod tests {
    use elk_spatial::samples;

    use super::*;

    #[test]
    fn typed_values_are_shown_decoded() {
        let scan = samples::named("Scan").unwrap();
        let bytes = scan.bytes();
        let value = ValueRef::Binary { type_: scan.type_, bytes: &bytes };
        assert_eq!(
            value_for_people(value),
            "id: 1, command: 1, pose: {rotation: [0, 0, 0, 1], translation: [1, 2, 0.5]}, \
             camera: {columns: 100, rows: 100, fov_x: 1.309, fov_y: 1.309, range_m: 5, inverse_depth_sigma: 0}, measured: 1, pixel_runs: [{outcome: 0, pixels: 2}, {outcome: 1, pixels: 9998}], no_return: [[0, 0, 1]], points: [[0.1, -0.2, 3]]"
        );
        assert_eq!(value_for_programs(value)["points"][0][1], -0.2);
        let many = json!({"id": 1, "command": 1, "pose": {"rotation": [0, 0, 0, 1], "translation": [0, 0, 0]},
                          "camera": scan.value()["camera"], "measured": 7312, "pixel_runs": [], "no_return": [],
                          "points": vec![[0.0, 0.0, 1.0]; 7312]});
        let bytes = scan.bytes_of(&many).unwrap();
        let value = ValueRef::Binary { type_: scan.type_, bytes: &bytes };
        assert!(value_for_people(value).ends_with("points: 7312 points"));
        assert_eq!(value_for_programs(value)["points"].as_array().unwrap().len(), 7312);
    }

    #[test]
    fn unknown_types_are_shown_as_name_layout_and_bytes() {
        let value = ValueRef::Binary { type_: TypeRef::undescribed("Theirs", 0xbeef), bytes: &[1, 2, 255] };
        assert_eq!(value_for_people(value), "Theirs (layout 000000000000beef), 3 bytes: 01 02 ff");
        let shown = value_for_programs(value);
        assert_eq!((&shown["hex"], &shown["bytes"]), (&json!("0102ff"), &json!(3)));
    }

    #[test]
    fn texts_cannot_take_over_a_terminal() {
        assert_eq!(value_for_people(ValueRef::Text("a\x1b[2J\nb„ä“'")), "a\\u{1b}[2J\\nb„ä“'");
    }

    #[test]
    fn figures_have_three_digits_and_a_unit() {
        let shown: Vec<String> = [0.0, 12.0, 999.4, 999.6, 1234.0, 2.5e6, 3e12].map(bytes).into();
        assert_eq!(shown, ["0 B", "12.0 B", "999 B", "1.00 kB", "1.23 kB", "2.50 MB", "3000 GB"]);
        let shown: Vec<String> = [4.2e-5, 0.0123, 1.5, 119.0, 600.0, 1e5].map(duration).into();
        assert_eq!(shown, ["42.0 µs", "12.3 ms", "1.50 s", "119 s", "10.0 min", "27.8 h"]);
        assert_eq!([0.5, 100_123.0].map(hertz), ["0.50 Hz", "100123 Hz"]);
        assert_eq!([0.1 + 0.2, 2.0, 1e-5, 0.0].map(rounded), ["0.3", "2", "1.000e-5", "0"]);
    }
}
