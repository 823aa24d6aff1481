//! A message as Python has it.

use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};

use elk_bus::{Mail, Type, ValueRef};
use elk_log::RecordRef;
use elk_outside::text::{clipped, printable};
use pyo3::IntoPyObjectExt;
use pyo3::exceptions::PyAttributeError;
use pyo3::prelude::*;
use pyo3::types::PyBytes;

use crate::bytes::{Bytes, Shelf, Shelved, View};
use crate::decode::decode;
use crate::error::{Error, decode_error};
use crate::outgoing::Said;

/// Characters of a text that are shown at most.
const LONGEST_SHOWN: usize = 1000;

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
    /// Whoever has it calls its text bytes.
    is_marked: AtomicBool,
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
            is_marked: AtomicBool::new(false),
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
            is_marked: AtomicBool::new(false),
        }
    }

    /// What is said of it if it is of no use.
    pub fn rejected(&self, why: String) -> Said {
        Said::Reject { variable: self.key.clone(), source: self.source.clone(), sequence: self.sequence, why }
    }

    /// The value in a few words.
    fn shown(&self) -> String {
        match &self.value {
            Value::Double(number) => number.to_string(),
            Value::Text(text) => format!("{:?}", clipped(text, LONGEST_SHOWN)),
            Value::Binary(type_, bytes) => format!("{} ({} bytes)", printable(type_.as_ref().name()), bytes.len()),
        }
    }

    fn is_no(&self, py: Python<'_>, wanted: &str, right: &str) -> PyErr {
        let (key, carried) = (printable(&self.key), self.type_name());
        decode_error(py, format_args!("{key} carries {carried}, and no {wanted}; right is {right}"))
    }

    /// What is wrong with its bytes.
    fn wrong(&self, py: Python<'_>, wrong: PyErr) -> PyErr {
        let key = printable(&self.key);
        match wrong.is_instance_of::<Error>(py) {
            true => decode_error(py, format_args!("{key}: {}", wrong.value(py))),
            false => wrong,
        }
    }

    /// Who said what of which variable, as it is seen on a terminal.
    fn line(&self) -> String {
        let beside =
            if self.source_aux.is_empty() { String::new() } else { format!(" ({})", printable(&self.source_aux)) };
        let (key, source, value) = (printable(&self.key), printable(&self.source), self.shown());
        format!("{key}={value} from {source}{beside}")
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

    /// Whether it is neither, but bytes of a type; or a text that was marked as bytes.
    fn is_binary(&self) -> bool {
        matches!(self.value, Value::Binary(..)) || self.is_marked.load(Ordering::Relaxed)
    }

    /// Has a text count as bytes, too, as in pymoos: it is still the text that it is.
    fn mark_as_binary(&self, py: Python<'_>) -> PyResult<()> {
        match self.value {
            Value::Double(_) => Err(self.is_no(py, "text", "value()")),
            Value::Text(_) => {
                self.is_marked.store(true, Ordering::Relaxed);
                Ok(())
            }
            Value::Binary(..) => Ok(()),
        }
    }

    /// The number.
    fn double(&self, py: Python<'_>) -> PyResult<f64> {
        match self.value {
            Value::Double(number) => Ok(number),
            _ => Err(self.is_no(py, "number", "value(), or to ask is_double() first")),
        }
    }

    /// The text.
    fn string(&self, py: Python<'_>) -> PyResult<&str> {
        match &self.value {
            Value::Text(text) => Ok(text),
            _ => Err(self.is_no(py, "text", "value(), or to ask is_string() first")),
        }
    }

    /// The bytes, as a memoryview that cannot be written: of a bulk value where its publisher wrote it, of a text its UTF-8.
    fn binary_data<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyAny>> {
        let bytes = match &self.value {
            Value::Double(_) => return Err(self.is_no(py, "bytes", "value(), or to ask is_double() first")),
            Value::Text(text) => PyBytes::new(py, text.as_bytes()).into_any(),
            Value::Binary(_, bytes) => View::whole(bytes).into_array(py)?,
        };
        py.import("builtins")?.call_method1("memoryview", (bytes,))
    }

    /// How many bytes a binary message has; 0 of all others.
    fn binary_data_size(&self) -> usize {
        match &self.value {
            Value::Binary(_, bytes) => bytes.len(),
            Value::Text(text) if self.is_binary() => text.len(),
            _ => 0,
        }
    }

    /// Prints it in a line.
    fn trace(&self, py: Python<'_>) -> PyResult<()> {
        let words = format!("{} of {} at {:.3} s", self.line(), printable(&self.community), self.time);
        py.import("builtins")?.call_method1("print", (words,)).map(drop)
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
                Some(description) => decode(py, bytes, &description).map_err(|wrong| self.wrong(py, wrong)),
                None => self.binary_data(py),
            },
        }
    }

    /// What pymoos' messages have and these have not: why.
    fn __getattr__(&self, name: &str) -> PyResult<()> {
        let why = match name {
            "double_aux" => {
                ": a value has no second number here, and pymoos cannot say one; right is a variable of its own"
            }
            _ => "",
        };
        Err(PyAttributeError::new_err(format!("'Message' object has no attribute '{name}'{why}")))
    }

    fn __repr__(&self) -> String {
        format!("<elk.Message {} at {:.3} s>", self.line(), self.time)
    }

    /// Bytes that it takes, its value's too, wherever that lies.
    fn __sizeof__(&self) -> usize {
        let value = match &self.value {
            Value::Double(_) => 0,
            Value::Text(text) => text.len(),
            Value::Binary(_, bytes) => bytes.len(),
        };
        let names = [&self.key, &self.source, &self.source_aux, &self.community];
        size_of::<Self>() + value + names.into_iter().map(String::len).sum::<usize>()
    }
}
