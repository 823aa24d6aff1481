//! Numbers for spreadsheets: one line a number, `time,key,source,value`.
//!
//! Besides the doubles of the bus these are the numbers in the fields of typed values and of texts that are JSON: a
//! pose as `SIM_SENSOR.pose.x`, `.y`, `.z` (m) and `.qx`, `.qy`, `.qz`, `.qw`, the entries of a list by their index
//! (`POINT[2]`) as long as there are at most [`LONGEST_LIST`], what is true or false as 1 or 0. Times count from the
//! log's earliest message (s). A text of more than [`LONGEST_JSON`] bytes, or deeper than 127 levels, is a text; a
//! field to which a name of more than [`LONGEST_NAME`] bytes leads has no line, so that a small text does not make a
//! large table.

use std::io::Write;

use elk_bus::ValueRef;
use serde_json::{Map, Value as Json};

use crate::plain::without_nan;
use crate::record::RecordRef;

/// A list with more entries than this is nothing that is plotted.
pub const LONGEST_LIST: usize = 16;

/// A longer text (bytes) is not looked into for numbers.
pub const LONGEST_JSON: usize = 1 << 20;
/// Names of fields take at most so many bytes beside their variable's.
pub const LONGEST_NAME: usize = 256;

/// What a pose is made of, in JSON, and how its numbers are called.
const POSE: [(&str, &[&str]); 2] = [("translation", &["x", "y", "z"]), ("rotation", &["qx", "qy", "qz", "qw"])];

/// The first line.
pub const HEADER: &str = "time,key,source,value\n";

/// Writes the numbers of a record that was published `secs` after the log's earliest message.
pub fn put_csv(out: &mut impl Write, secs: f64, record: &RecordRef<'_>) -> std::io::Result<()> {
    let mut line =
        |name: &str, number: &str| writeln!(out, "{secs:.6},{},{},{number}", quoted(name), quoted(record.source));
    let fields = match record.value {
        ValueRef::Double(number) => return line(record.key, &digits(number)),
        ValueRef::Text(text) if text.starts_with(['{', '[']) && text.len() <= LONGEST_JSON => {
            // A number that is none has no line.
            let meant = || serde_json::from_str(&without_nan(text)?).ok();
            serde_json::from_str(text).ok().or_else(meant)
        }
        ValueRef::Text(_) => None,
        // Of a type of somebody else no field is known.
        ValueRef::Binary { type_, bytes } => type_.to_json(bytes, LONGEST_LIST).ok(),
    };
    let most = record.key.len() + LONGEST_NAME;
    fields.map_or(Ok(()), |fields| each_number(record.key, most, &fields, &mut line))
}

/// Hands every number in `value` to `line`, under the name that leads to it, if that has at most so many bytes.
fn each_number(
    name: &str,
    most: usize,
    value: &Json,
    line: &mut impl FnMut(&str, &str) -> std::io::Result<()>,
) -> std::io::Result<()> {
    // Names below it are longer still.
    if name.len() > most {
        return Ok(());
    }
    match value {
        Json::Object(fields) if is_pose(fields) => POSE.iter().try_for_each(|(part, axes)| {
            let numbers = fields[*part].as_array().into_iter().flatten();
            axes.iter()
                .zip(numbers)
                .try_for_each(|(axis, number)| each_number(&format!("{name}.{axis}"), most, number, line))
        }),
        Json::Object(fields) => {
            fields.iter().try_for_each(|(field, value)| each_number(&format!("{name}.{field}"), most, value, line))
        }
        Json::Array(entries) if entries.len() <= LONGEST_LIST => entries
            .iter()
            .enumerate()
            .try_for_each(|(index, entry)| each_number(&format!("{name}[{index}]"), most, entry, line)),
        Json::Number(number) if number.is_f64() => line(name, &digits(number.as_f64().unwrap_or(f64::NAN))),
        Json::Number(number) => line(name, &number.to_string()),
        Json::Bool(flag) => line(name, if *flag { "1" } else { "0" }),
        Json::Array(_) | Json::String(_) | Json::Null => Ok(()),
    }
}

fn is_pose(fields: &Map<String, Json>) -> bool {
    let has = |(part, axes): &(&str, &[&str])| {
        fields.get(*part).and_then(Json::as_array).is_some_and(|numbers| numbers.len() == axes.len())
    };
    fields.len() == POSE.len() && POSE.iter().all(has)
}

/// A number that comes back bit for bit, in few letters.
fn digits(number: f64) -> String {
    let usual = number == 0.0 || (1e-5..1e16).contains(&number.abs()) || !number.is_finite();
    if usual { number.to_string() } else { format!("{number:e}") }
}

/// A field of a line: in quotes if anything in it would end it.
fn quoted(text: &str) -> String {
    match text.contains([',', '"', '\n', '\r']) {
        true => format!("\"{}\"", text.replace('"', "\"\"")),
        false => text.into(),
    }
}
