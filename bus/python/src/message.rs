//! A message as Python has it.

use std::sync::Arc;

use elk_bus::{Mail, Type, ValueRef};
use elk_log::RecordRef;
use pyo3::IntoPyObjectExt;
use pyo3::prelude::*;

use crate::bytes::{Bytes, Shelf, Shelved, View};
use crate::decode::decode;
use crate::error::error;

/// A message: pymoos' names, and `value()` for whatever it carries.
#[pyclass(frozen, module = "elk")]
pub struct Message {
    key: String,
    source: String,
    source_aux: String,
    community: String,
    time: f64,
    sequence: u64,
    is_latest: bool,
    value: Value,
}

enum Value {
    Double(f64),
    Text(String),
    Binary(Type, Arc<Bytes>),
}

impl Value {
    /// Of bytes, what becomes of them.
    fn of(value: ValueRef<'_>, bytes_of: impl FnOnce(&[u8]) -> Bytes) -> Self {
        match value {
            ValueRef::Double(number) => Self::Double(number),
            ValueRef::Text(text) => Self::Text(text.to_owned()),
            ValueRef::Binary { type_, bytes } => Self::Binary(type_.to_type(), Arc::new(bytes_of(bytes))),
        }
    }
}

impl Message {
    /// A message of the bus: a bulk value stays in its publisher's shared memory.
    pub fn of_mail(mail: &Mail<'_>, shelf: &Arc<Shelf>) -> Self {
        let hold = |bytes: &[u8]| match mail.hold() {
            Some(held) => Bytes::InPlace(Shelved::new(held, shelf)),
            None => Bytes::Own(bytes.to_vec()),
        };
        Self {
            key: mail.key().to_owned(),
            source: mail.source().to_owned(),
            source_aux: mail.source_aux().to_owned(),
            community: mail.community().to_owned(),
            time: mail.time(),
            sequence: mail.sequence(),
            is_latest: mail.is_latest(),
            value: Value::of(mail.value(), hold),
        }
    }

    /// A message of a log.
    pub fn of_record(record: &RecordRef<'_>) -> Self {
        Self {
            key: record.key.to_owned(),
            source: record.source.to_owned(),
            source_aux: record.source_aux.to_owned(),
            community: record.community.to_owned(),
            time: record.time,
            sequence: record.sequence,
            is_latest: false,
            value: Value::of(record.value, |bytes| Bytes::Own(bytes.to_vec())),
        }
    }

    fn is_no(&self, wanted: &str, right: &str) -> PyErr {
        error(format_args!("{} carries {}, and no {wanted}; right is {right}", self.key, self.type_name()))
    }
}

#[pymethods]
impl Message {
    /// The variable.
    fn key(&self) -> &str {
        &self.key
    }

    /// The variable, as `key()`.
    fn name(&self) -> &str {
        &self.key
    }

    /// Whether it is of this variable.
    fn is_name(&self, name: &str) -> bool {
        self.key == name
    }

    /// The app that published it.
    fn source(&self) -> &str {
        &self.source
    }

    /// What the publisher says about the source; mostly empty.
    fn source_aux(&self) -> &str {
        &self.source_aux
    }

    /// The community that it was first published in.
    fn community(&self) -> &str {
        &self.community
    }

    /// When it was published (s, the community's clock).
    fn time(&self) -> f64 {
        self.time
    }

    /// The publisher's count of its messages, from 1.
    fn sequence(&self) -> u64 {
        self.sequence
    }

    /// Whether it was published before this client registered, and given to it as the variable's latest value.
    fn is_latest(&self) -> bool {
        self.is_latest
    }

    /// Whether it is a number.
    fn is_double(&self) -> bool {
        matches!(self.value, Value::Double(_))
    }

    /// Whether it is a text.
    fn is_string(&self) -> bool {
        matches!(self.value, Value::Text(_))
    }

    /// Whether it is neither: bytes of a type.
    fn is_binary(&self) -> bool {
        matches!(self.value, Value::Binary(..))
    }

    /// The number.
    fn double(&self) -> PyResult<f64> {
        match self.value {
            Value::Double(number) => Ok(number),
            _ => Err(self.is_no("number", "value(), or to ask is_double() first")),
        }
    }

    /// The text.
    fn string(&self) -> PyResult<&str> {
        match &self.value {
            Value::Text(text) => Ok(text),
            _ => Err(self.is_no("text", "value(), or to ask is_string() first")),
        }
    }

    /// The bytes, as a memoryview that cannot be written: of a bulk value where its publisher wrote it.
    fn binary_data<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyAny>> {
        let Value::Binary(_, bytes) = &self.value else {
            return Err(self.is_no("bytes", "value(), or to ask is_binary() first"));
        };
        let array = View::whole(bytes).into_array(py)?;
        py.import("builtins")?.call_method1("memoryview", (array,))
    }

    /// How many bytes `binary_data()` has.
    fn binary_data_size(&self) -> usize {
        if let Value::Binary(_, bytes) = &self.value { bytes.len() } else { 0 }
    }

    /// What it carries: `number`, `text`, or the name of a type.
    fn type_name(&self) -> &str {
        match &self.value {
            Value::Double(_) => "number",
            Value::Text(_) => "text",
            Value::Binary(type_, _) => type_.as_ref().name(),
        }
    }

    /// What the type says of its bytes, as JSON: fields, units, docs; None if nobody has described it.
    fn description(&self) -> Option<String> {
        let Value::Binary(type_, _) = &self.value else { return None };
        Some(type_.as_ref().text()).filter(|text| !text.is_empty())
    }

    /// The value: a float, a str, or, of a type, what its description says: dicts, lists, numpy arrays (read-only, over the
    /// bytes where they lie). Bytes that nobody has described are a memoryview.
    fn value<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyAny>> {
        match &self.value {
            Value::Double(number) => number.into_bound_py_any(py),
            Value::Text(text) => text.as_str().into_bound_py_any(py),
            Value::Binary(type_, bytes) => match type_.as_ref().description() {
                Some(description) => decode(py, bytes, &description),
                None => self.binary_data(py),
            },
        }
    }

    fn __repr__(&self) -> String {
        let value = match &self.value {
            Value::Double(number) => number.to_string(),
            Value::Text(text) => format!("{text:?}"),
            Value::Binary(type_, bytes) => format!("{} ({} bytes)", type_.as_ref().name(), bytes.len()),
        };
        format!("<elk.Message {}={value} from {} at {:.3} s>", self.key, self.source, self.time)
    }
}
