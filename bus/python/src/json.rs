//! Python's values as JSON, from which a description makes bytes.

use elk_bus::Description;
use elk_bus::codec::MAX_VALUE_BYTES;
use pyo3::prelude::*;
use pyo3::types::{PyBool, PyDict, PyFloat, PyInt, PyList, PyString, PyTuple};
use serde_json::{Map, Value};

use crate::error::{error, within};
use crate::text::Text;

/// How deep values lie in each other at most: a list may lie in itself.
pub const DEEPEST: usize = 64;

/// A value of Python's as JSON: None, bool, int, float, str, lists and tuples, dicts, and whatever has a `tolist` (numpy).
/// Infinities and NaN are the texts that descriptions know them by.
///
/// # Errors
/// There is something else in it, or more than a message takes: where.
pub fn to_json(value: &Bound<'_, PyAny>) -> PyResult<Value> {
    Converter { values: Description::MOST_VALUES, bytes: MAX_VALUE_BYTES }.convert(value, 0)
}

/// That values lie too deep.
pub fn too_deep() -> PyErr {
    error(format_args!("values lie more than {DEEPEST} deep in each other"))
}

/// That there are too many values.
pub fn too_many() -> PyErr {
    error(format_args!(
        "there are more than {} values in it; right is to publish it in parts",
        Description::MOST_VALUES
    ))
}

/// What is left to be converted: one list may lie in another many times, and so on, so that little memory says very much.
struct Converter {
    values: usize,
    /// Of texts.
    bytes: usize,
}

impl Converter {
    fn convert(&mut self, value: &Bound<'_, PyAny>, depth: usize) -> PyResult<Value> {
        if depth > DEEPEST {
            return Err(too_deep());
        }
        self.take_values(1)?;
        if value.is_none() {
            Ok(Value::Null)
        } else if let Ok(flag) = value.cast::<PyBool>() {
            Ok(flag.is_true().into())
        } else if value.is_instance_of::<PyInt>() {
            let negative = || value.extract::<i64>().map(Value::from);
            let whole = value.extract::<u64>().map(Value::from).or_else(|_| negative());
            whole.map_err(|_| error("an integer is none of 64 bits; right is one from -2**63 to 2**64 - 1"))
        } else if value.is_instance_of::<PyFloat>() {
            Ok(elk_pipe::words::number(value.extract()?))
        } else if value.is_instance_of::<PyString>() {
            self.text(value).map(Value::from)
        } else if let Ok(list) = value.cast::<PyList>() {
            list.iter().enumerate().map(|(place, inner)| self.entry(place, &inner, depth)).collect()
        } else if let Ok(tuple) = value.cast::<PyTuple>() {
            tuple.iter().enumerate().map(|(place, inner)| self.entry(place, &inner, depth)).collect()
        } else if let Ok(dict) = value.cast::<PyDict>() {
            self.dict(dict, depth).map(Value::from)
        } else if value.hasattr("tolist")? {
            // An array says how many values a list of it would have before it is made.
            let size = value.getattr("size").ok().and_then(|size| size.extract::<usize>().ok());
            if size.is_some_and(|size| size > self.values) {
                return Err(too_many());
            }
            self.convert(&value.call_method0("tolist")?, depth + 1)
        } else {
            let kind = value.get_type().name()?;
            Err(error(format_args!(
                "a {kind} is no value for the bus; right are numbers, texts, lists, dicts, None and numpy arrays"
            )))
        }
    }

    fn take_values(&mut self, count: usize) -> PyResult<()> {
        self.values = self.values.checked_sub(count).ok_or_else(too_many)?;
        Ok(())
    }

    fn text(&mut self, value: &Bound<'_, PyAny>) -> PyResult<String> {
        let most =
            || error(format_args!("its texts have more than {MAX_VALUE_BYTES} bytes; right is to publish it in parts"));
        // A character is at least a byte: what is too long is not copied first.
        if value.len()? > self.bytes {
            return Err(most());
        }
        let Text(text) = value.extract()?;
        self.bytes = self.bytes.checked_sub(text.len()).ok_or_else(most)?;
        Ok(text)
    }

    fn entry(&mut self, place: usize, value: &Bound<'_, PyAny>, depth: usize) -> PyResult<Value> {
        self.convert(value, depth + 1).map_err(|wrong| match depth {
            0 => within(value.py(), format_args!("[{place}]"), wrong),
            // One place says enough of what may lie very deep.
            _ => wrong,
        })
    }

    fn dict(&mut self, dict: &Bound<'_, PyDict>, depth: usize) -> PyResult<Map<String, Value>> {
        let mut object = Map::new();
        for (name, value) in dict {
            let Ok(text) = name.cast::<PyString>() else {
                let kind = name.get_type().name()?;
                return Err(error(format_args!("a {kind} names no field; right is a text")));
            };
            let field = self.text(text)?;
            let inner = self.convert(&value, depth + 1).map_err(|wrong| match depth {
                0..4 => within(value.py(), &field, wrong),
                _ => wrong,
            })?;
            object.insert(field, inner);
        }
        Ok(object)
    }
}
