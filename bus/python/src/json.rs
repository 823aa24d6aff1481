//! Python's values as JSON, from which a description makes bytes.

use pyo3::prelude::*;
use pyo3::types::{PyBool, PyDict, PyFloat, PyInt, PyList, PyString, PyTuple};
use serde_json::{Map, Value};

use crate::error::error;

/// How deep values lie in each other at most: a list may lie in itself.
const DEEPEST: usize = 64;

/// A value of Python's as JSON: None, bool, int, float, str, lists and tuples, dicts, and whatever has a `tolist` (numpy).
/// Infinities and NaN are the texts that descriptions know them by.
///
/// # Errors
/// There is something else in it: where.
pub fn to_json(value: &Bound<'_, PyAny>) -> PyResult<Value> {
    convert(value, 0)
}

fn convert(value: &Bound<'_, PyAny>, depth: usize) -> PyResult<Value> {
    if depth > DEEPEST {
        return Err(error(format_args!("values lie more than {DEEPEST} deep in each other")));
    }
    let inner = |value: Bound<'_, PyAny>| convert(&value, depth + 1);
    if value.is_none() {
        Ok(Value::Null)
    } else if let Ok(flag) = value.cast::<PyBool>() {
        Ok(flag.is_true().into())
    } else if value.is_instance_of::<PyInt>() {
        let negative = || value.extract::<i64>().map(Value::from);
        value.extract::<u64>().map(Value::from).or_else(|_| negative())
    } else if value.is_instance_of::<PyFloat>() {
        Ok(elk_pipe::words::number(value.extract()?))
    } else if value.is_instance_of::<PyString>() {
        Ok(value.extract::<String>()?.into())
    } else if let Ok(list) = value.cast::<PyList>() {
        list.iter().map(inner).collect()
    } else if let Ok(tuple) = value.cast::<PyTuple>() {
        tuple.iter().map(inner).collect()
    } else if let Ok(dict) = value.cast::<PyDict>() {
        let mut object = Map::new();
        for (name, value) in dict {
            let field =
                name.cast::<PyString>().map_err(|_| error(format_args!("{name} names no field: it is no text")))?;
            object.insert(field.extract()?, inner(value)?);
        }
        Ok(object.into())
    } else if value.hasattr("tolist")? {
        inner(value.call_method0("tolist")?)
    } else {
        let kind = value.get_type().name()?;
        Err(error(format_args!(
            "a {kind} is no value for the bus; right are numbers, texts, lists, dicts, None and numpy arrays"
        )))
    }
}
