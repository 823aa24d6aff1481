//! Python's texts and numbers as the bus has them: what is none is said in words.

use pyo3::exceptions::PyOverflowError;
use pyo3::prelude::*;
use pyo3::types::PyString;

use crate::error::error;

/// A text that UTF-8 can say.
pub struct Text(pub String);

impl<'a, 'py> FromPyObject<'a, 'py> for Text {
    type Error = PyErr;

    fn extract(value: Borrowed<'a, 'py, PyAny>) -> PyResult<Self> {
        let text = value.cast::<PyString>()?;
        text.extract::<String>().map(Self).map_err(|_| {
            error(
                "a text has half a character in it (a surrogate), which UTF-8 cannot say; right is \
                 text.encode(errors=\"replace\").decode()",
            )
        })
    }
}

/// A number of 64 bits.
pub struct Number(pub f64);

impl<'a, 'py> FromPyObject<'a, 'py> for Number {
    type Error = PyErr;

    fn extract(value: Borrowed<'a, 'py, PyAny>) -> PyResult<Self> {
        value.extract::<f64>().map(Self).map_err(|wrong| match wrong.is_instance_of::<PyOverflowError>(value.py()) {
            true => {
                error("an integer is too large for a number of the bus, which has 64 bits; right is one up to 1.8e308")
            }
            false => wrong,
        })
    }
}
