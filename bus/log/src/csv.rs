//! Numbers for spreadsheets: one line a number, `time,key,source,value`.
//!
//! Besides the doubles of the bus these are the numbers in the fields of typed values and of texts that are JSON: a
//! pose as `SIM_SENSOR.pose.x`, `.y`, `.z` (m) and `.qx`, `.qy`, `.qz`, `.qw`, the entries of a list by their index
//! (`POINT[2]`) as long as there are at most [`LONGEST_LIST`], what is true or false as 1 or 0, which variant an enum is as
//! its number, from 0. Times count from the
//! log's earliest message (s). A text of more than [`LONGEST_JSON`] bytes, or deeper than 127 levels, is a text; a
//! field to which a name of more than [`LONGEST_NAME`] bytes leads has no line, so that a small text does not make a
//! large table.

use std::io::Write;

use elk_bus::describe::{Content, Field, Kind};
use elk_bus::{TypeRef, ValueRef};
use serde_json::Value as Json;

use crate::plain::without_nan;
use crate::record::RecordRef;
use crate::spatial::is_pose;

/// A list with more entries than this is nothing that is plotted.
pub const LONGEST_LIST: usize = 16;

/// A longer text (bytes) is not looked into for numbers.
pub const LONGEST_JSON: usize = 1 << 20;
/// Names of fields take at most so many bytes beside their variable's.
pub const LONGEST_NAME: usize = 256;

/// The first line.
pub const HEADER: &str = "time,key,source,value\n";

/// Writes the numbers of a record that was published `secs` after the log's earliest message.
pub fn put_csv(out: &mut impl Write, secs: f64, record: &RecordRef<'_>) -> std::io::Result<()> {
    let mut line =
        |name: &str, number: &str| writeln!(out, "{secs:.6},{},{},{number}", quoted(name), quoted(record.source));
    put_numbers(record, &mut line)
}

/// Hands the numbers of a record to `line`: under the name of each, in digits that come back bit for bit.
///
/// # Errors
/// What `line` fails with.
pub fn put_numbers(
    record: &RecordRef<'_>,
    line: &mut impl FnMut(&str, &str) -> std::io::Result<()>,
) -> std::io::Result<()> {
    let most = record.key.len() + LONGEST_NAME;
    let fields = match record.value {
        ValueRef::Double(number) => return line(record.key, &digits(number)),
        ValueRef::Text(text) if text.starts_with(['{', '[']) && text.len() <= LONGEST_JSON => {
            // A number that is none has no line.
            let meant = || serde_json::from_str(&without_nan(text)?).ok();
            serde_json::from_str(text).ok().or_else(meant)
        }
        ValueRef::Text(_) => None,
        ValueRef::Binary { type_, bytes } => return put_typed(record.key, most, type_, bytes, line),
    };
    fields.map_or(Ok(()), |fields| each_number(record.key, most, &fields, line))
}

/// Hands the numbers in a value of a type to `line`; of one that nobody has described there are none.
fn put_typed(key: &str, most: usize, type_: TypeRef<'_>, bytes: &[u8], line: &mut impl Line) -> std::io::Result<()> {
    let Some(description) = type_.description() else { return Ok(()) };
    match description.to_json(bytes, LONGEST_LIST) {
        Ok(value) => each_of(key, most, description.kind(), &value, line),
        Err(_) => Ok(()),
    }
}

/// What takes a name and a number.
trait Line: FnMut(&str, &str) -> std::io::Result<()> {}

impl<F: FnMut(&str, &str) -> std::io::Result<()>> Line for F {}

/// As [`each_number`], of a value of this kind: poses have names of their own, and enums a number.
fn each_of(name: &str, most: usize, kind: &Kind, value: &Json, line: &mut impl Line) -> std::io::Result<()> {
    // Names below it are longer still.
    if name.len() > most {
        return Ok(());
    }
    match (kind.plain(), value) {
        (Kind::Struct(one), Json::Object(_)) if is_pose(kind.plain()) => {
            let axes = [&["qx", "qy", "qz", "qw"][..], &["x", "y", "z"]];
            one.fields.iter().zip(axes).rev().try_for_each(|(part, axes)| {
                let numbers = value[&part.name].as_array().into_iter().flatten();
                let mut each = axes.iter().zip(numbers);
                each.try_for_each(|(axis, number)| each_number(&format!("{name}.{axis}"), most, number, line))
            })
        }
        (Kind::Struct(one), _) => each_field(name, most, &one.fields, value, line),
        (Kind::Enum(one), _) => {
            let held = value.as_object().and_then(|object| object.iter().next());
            let said = held.map(|(variant, _)| variant.as_str()).or(value.as_str());
            let Some(number) = one.variants.iter().position(|variant| Some(variant.name.as_str()) == said) else {
                return Ok(());
            };
            line(name, &number.to_string())?;
            let variant = &one.variants[number];
            let (name, content) =
                (format!("{name}.{}", variant.name), held.map_or(&Json::Null, |(_, content)| content));
            match &variant.content {
                Content::Unit => Ok(()),
                Content::One(kind) => each_of(&name, most, kind, content, line),
                Content::Tuple(kinds) => each_entry(&name, most, kinds.iter(), content, line),
                Content::Fields(fields) => each_field(&name, most, fields, content, line),
            }
        }
        // An option in an option is a list of one where it is there.
        (Kind::Option(inner), Json::Array(one)) if matches!(inner.plain(), Kind::Option(_) | Kind::Unit) => {
            one.iter().try_for_each(|value| each_of(name, most, inner, value, line))
        }
        (Kind::Option(inner), _) => each_of(name, most, inner, value, line),
        (Kind::List(of) | Kind::Packed(of) | Kind::Array { of, .. }, _) => {
            each_entry(name, most, std::iter::repeat(&**of), value, line)
        }
        (Kind::Tuple(kinds), _) => each_entry(name, most, kinds.iter(), value, line),
        _ => each_number(name, most, value, line),
    }
}

fn each_field(name: &str, most: usize, fields: &[Field], value: &Json, line: &mut impl Line) -> std::io::Result<()> {
    let mut there = fields.iter().filter_map(|field| Some((field, value.get(&field.name)?)));
    there.try_for_each(|(field, value)| each_of(&format!("{name}.{}", field.name), most, &field.kind, value, line))
}

fn each_entry<'a>(
    name: &str,
    most: usize,
    kinds: impl Iterator<Item = &'a Kind>,
    value: &Json,
    line: &mut impl Line,
) -> std::io::Result<()> {
    let entries = value.as_array().map_or(&[][..], Vec::as_slice);
    let mut each = kinds.zip(entries).enumerate();
    each.try_for_each(|(i, (kind, entry))| each_of(&format!("{name}[{i}]"), most, kind, entry, line))
}

/// Hands every number in `value` to `line`, under the name that leads to it, if that has at most so many bytes.
fn each_number(name: &str, most: usize, value: &Json, line: &mut impl Line) -> std::io::Result<()> {
    // Names below it are longer still.
    if name.len() > most {
        return Ok(());
    }
    match value {
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
