//! Numbers for spreadsheets: one line a number, `time,key,source,value`.
//!
//! Besides the doubles of the bus these are the numbers in the fields of small typed values (`PROGRESS.path_length_m`).
//! Times count from the log's first message (s).

use std::io::Write;

use elk_bus::ValueRef;
use elk_spatial::catalogue;
use serde_json::Value as Json;

use crate::record::RecordRef;

/// A list with more entries than this is no number of a plot.
const LONGEST_LIST: usize = 0;

/// The first line.
pub const HEADER: &str = "time,key,source,value\n";

/// Writes the numbers of a record that was published `secs` after the log's first message.
pub fn put_csv(out: &mut impl Write, secs: f64, record: &RecordRef<'_>) -> std::io::Result<()> {
    match record.value {
        ValueRef::Double(number) => line(out, secs, record.key, record, number),
        ValueRef::Text(_) => Ok(()),
        ValueRef::Binary { type_name, layout, bytes } => {
            match catalogue::to_json(type_name, layout, bytes, LONGEST_LIST) {
                Ok(fields) => put_fields(out, secs, record.key, record, &fields),
                Err(_) => Ok(()), // a type of somebody else: no field of it is known
            }
        }
    }
}

fn put_fields(
    out: &mut impl Write,
    secs: f64,
    name: &str,
    record: &RecordRef<'_>,
    value: &Json,
) -> std::io::Result<()> {
    match value {
        Json::Object(fields) => fields
            .iter()
            .try_for_each(|(field, value)| put_fields(out, secs, &format!("{name}.{field}"), record, value)),
        Json::Number(number) => line(out, secs, name, record, number.as_f64().unwrap_or(f64::NAN)),
        _ => Ok(()),
    }
}

fn line(out: &mut impl Write, secs: f64, name: &str, record: &RecordRef<'_>, number: f64) -> std::io::Result<()> {
    writeln!(out, "{secs:.6},{},{},{number}", quoted(name), quoted(record.source))
}

/// A field of a line: in quotes if anything in it would end it.
fn quoted(text: &str) -> String {
    match text.contains([',', '"', '\n', '\r']) {
        true => format!("\"{}\"", text.replace('"', "\"\"")),
        false => text.into(),
    }
}
