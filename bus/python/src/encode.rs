//! Dicts with numpy arrays in them as a type's bytes: the arrays are put where they belong as they lie in memory.

use elk_bus::Description;
use elk_bus::codec::MAX_VALUE_BYTES;
use elk_bus::describe::{Field, Kind, Struct};
use pyo3::prelude::*;
use pyo3::types::{PyBytes, PyDict};

use crate::bytes::{product, width};
use crate::decode::{Numbers, numbers};
use crate::error::{error, within};
use crate::json::{DEEPEST, to_json, too_deep, too_many};
use crate::text::Text;

/// Whether a numpy array is a field of a dict, or of one in it.
///
/// # Errors
/// Dicts lie too deep in each other, as one does that lies in itself, or there are too many.
pub fn has_arrays(value: &Bound<'_, PyAny>) -> PyResult<bool> {
    let mut left = Description::MOST_VALUES;
    look_for_arrays(value, 0, &mut left)
}

fn look_for_arrays(value: &Bound<'_, PyAny>, depth: usize, left: &mut usize) -> PyResult<bool> {
    let Ok(dict) = value.cast::<PyDict>() else { return Ok(false) };
    if depth > DEEPEST {
        return Err(too_deep());
    }
    for (_, field) in dict {
        *left = left.checked_sub(1).ok_or_else(too_many)?;
        if is_array(&field)? || look_for_arrays(&field, depth + 1, left)? {
            return Ok(true);
        }
    }
    Ok(false)
}

fn is_array(value: &Bound<'_, PyAny>) -> PyResult<bool> {
    // Of a class, these are descriptors.
    let dimensions = || value.getattr("ndim").and_then(|dimensions| dimensions.extract::<usize>());
    Ok(value.hasattr("__array_interface__")? && dimensions().is_ok_and(|dimensions| dimensions > 0))
}

/// The bytes of a value: what is no array goes the way of JSON ([`Description::to_bytes`]). What a type asks of the single
/// numbers of its lists (ranges) its readers see to.
///
/// # Errors
/// It is no value of the type: which field, and what would be right.
pub fn encode(description: &Description, value: &Bound<'_, PyAny>) -> PyResult<Vec<u8>> {
    let mut bytes = Vec::new();
    let put = match (description.kind().plain(), value.cast::<PyDict>()) {
        (Kind::Struct(one), Ok(dict)) => put_fields(one, dict, "", &mut bytes),
        _ => Err(error("arrays lie in the fields of structs")),
    };
    put.map_err(|wrong| error(format_args!("this is no {}: {}", description.name(), wrong.value(value.py()))))?;
    Ok(bytes)
}

fn put_fields(one: &Struct, dict: &Bound<'_, PyDict>, way: &str, bytes: &mut Vec<u8>) -> PyResult<()> {
    let joined = |name: &str| if way.is_empty() { name.to_owned() } else { format!("{way}.{name}") };
    for name in dict.keys() {
        let Ok(Text(name)) = name.extract() else {
            return Err(error(format_args!("a {} names no field; right is a text", name.get_type().name()?)));
        };
        if !one.fields.iter().any(|field| field.name == name) {
            let right: Vec<&str> = one.fields.iter().map(|field| field.name.as_str()).collect();
            return Err(error(format_args!("there is no field {}; right are {}", joined(&name), right.join(", "))));
        }
    }
    one.fields.iter().try_for_each(|field| put_field(field, dict.get_item(&field.name)?, &joined(&field.name), bytes))
}

fn put_field(field: &Field, value: Option<Bound<'_, PyAny>>, way: &str, bytes: &mut Vec<u8>) -> PyResult<()> {
    let Some(value) = value else { return field.put(None, way, bytes).map_err(error) };
    match (field.kind.plain(), value.cast::<PyDict>()) {
        (Kind::Struct(one), Ok(dict)) => return put_fields(one, dict, way, bytes),
        (Kind::List(of) | Kind::Packed(of), _) if is_array(&value)? => {
            if let Some(right) = numbers(of) {
                return put_array(matches!(field.kind.plain(), Kind::Packed(_)), &right, &value, way, bytes);
            }
        }
        _ => {}
    }
    let value = to_json(&value).map_err(|wrong| within(value.py(), way, wrong))?;
    field.put(Some(&value), way, bytes).map_err(error)
}

/// An array of numbers of this kind and shape, behind their count, or, packed, their length in bytes.
fn put_array(
    is_packed: bool,
    Numbers { number, shape: inner }: &Numbers,
    value: &Bound<'_, PyAny>,
    way: &str,
    bytes: &mut Vec<u8>,
) -> PyResult<()> {
    let py = value.py();
    // Whatever says that it is an array: what is put is numpy's own.
    let array = py.import("numpy")?.call_method1("asarray", (value,))?;
    let found = array.getattr("dtype")?;
    let shape: Vec<usize> = array.getattr("shape")?.extract()?;
    let [count, own @ ..] = &shape[..] else { return Err(error(format_args!("{way} is no list"))) };
    if own != inner {
        return Err(error(format_args!("{way} is an array of shape {shape:?}; right is one of shape (n, {inner:?})")));
    }
    // A view of one number may have any shape: before it is written out, it takes no room.
    let room = MAX_VALUE_BYTES.saturating_sub(bytes.len());
    let Some(length) = product(width(number), &shape).filter(|length| *length <= room) else {
        return Err(error(format_args!(
            "{way} is an array of shape {shape:?}, and at most {MAX_VALUE_BYTES} bytes are allowed; right is to publish it in parts"
        )));
    };
    let how = PyDict::new(py);
    // A float may lose digits, an integer may not become another.
    how.set_item("casting", if number.contains('f') { "same_kind" } else { "safe" })?;
    how.set_item("copy", false)?;
    let array = array.call_method("astype", (number,), Some(&how)).map_err(|_| {
        error(format_args!("{way} is an array of {found}; right is {number}: astype(\"{number}\") makes it one"))
    })?;
    let raw = array.call_method0("tobytes")?;
    let raw = raw.cast::<PyBytes>()?.as_bytes();
    debug_assert_eq!(raw.len(), length, "numpy writes an array out");
    bytes.reserve(8 + raw.len());
    bytes.extend_from_slice(&(if is_packed { raw.len() } else { *count } as u64).to_le_bytes());
    bytes.extend_from_slice(raw);
    Ok(())
}
