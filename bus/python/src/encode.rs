//! Dicts with numpy arrays in them as a type's bytes: the arrays are put where they belong as they lie in memory.

use elk_bus::Description;
use elk_bus::describe::{Field, Kind, Struct};
use pyo3::prelude::*;
use pyo3::types::{PyBytes, PyDict};

use crate::decode::numbers;
use crate::error::error;
use crate::json::to_json;

/// Whether a numpy array is a field of a dict, or of one in it.
pub fn has_arrays(value: &Bound<'_, PyAny>) -> PyResult<bool> {
    let Ok(dict) = value.cast::<PyDict>() else { return Ok(false) };
    for (_, field) in dict {
        if is_array(&field)? || has_arrays(&field)? {
            return Ok(true);
        }
    }
    Ok(false)
}

fn is_array(value: &Bound<'_, PyAny>) -> PyResult<bool> {
    Ok(value.hasattr("__array_interface__")? && value.getattr("ndim")?.extract::<usize>()? > 0)
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
        let name: String = name.extract()?;
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
            if let Some((number, shape)) = numbers(of) {
                return put_array(matches!(field.kind.plain(), Kind::Packed(_)), (&number, &shape), &value, way, bytes);
            }
        }
        _ => {}
    }
    field.put(Some(&to_json(&value)?), way, bytes).map_err(error)
}

/// An array of numbers of this kind and shape, behind their count, or, packed, their length in bytes.
fn put_array(
    is_packed: bool,
    (number, inner): (&str, &[usize]),
    value: &Bound<'_, PyAny>,
    way: &str,
    bytes: &mut Vec<u8>,
) -> PyResult<()> {
    let py = value.py();
    let how = PyDict::new(py);
    // A float may lose digits, an integer may not become another.
    how.set_item("casting", if number.contains('f') { "same_kind" } else { "safe" })?;
    how.set_item("copy", false)?;
    let found = value.getattr("dtype")?;
    let array = value.call_method("astype", (number,), Some(&how)).map_err(|_| {
        error(format_args!("{way} is an array of {found}; right is {number}: astype(\"{number}\") makes it one"))
    })?;
    let shape: Vec<usize> = array.getattr("shape")?.extract()?;
    let [count, own @ ..] = &shape[..] else { return Err(error(format_args!("{way} is no list"))) };
    if own != inner {
        return Err(error(format_args!("{way} is an array of shape {shape:?}; right is one of shape (n, {inner:?})")));
    }
    let raw = array.call_method0("tobytes")?;
    let raw = raw.cast::<PyBytes>()?.as_bytes();
    let length = if is_packed { raw.len() } else { *count };
    bytes.reserve(8 + raw.len());
    bytes.extend_from_slice(&(length as u64).to_le_bytes());
    bytes.extend_from_slice(raw);
    Ok(())
}
