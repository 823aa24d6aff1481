//! What Python is told when something cannot be done.

use std::fmt::Display;

use elk_outside::text;
use pyo3::exceptions::PyException;
use pyo3::prelude::*;
use pyo3::sync::PyOnceLock;
use pyo3::types::{PyDict, PyType};

pyo3::create_exception!(elk, Error, PyException, "Something cannot be done; it says what, on what, and what to do.");
pyo3::create_exception!(
    elk,
    Rejection,
    PyException,
    "Raised by on_new_mail: the app cannot use this message. That is said under MAIL_REJECTED, and the next one is taken."
);

const DECODE_ERROR_DOC: &str = "A message does not carry what it was asked for, or its bytes are none of its type. In on_new_mail it \
                                counts as a Rejection: the next message is taken.";

static DECODE_ERROR: PyOnceLock<Py<PyType>> = PyOnceLock::new();

/// `elk.DecodeError`: an Error, and a Rejection, so that a message that does not carry what it should ends nobody who reads it.
///
/// # Errors
/// Python has no memory for it.
pub fn decode_error_type(py: Python<'_>) -> PyResult<&Bound<'_, PyType>> {
    let made = DECODE_ERROR.get_or_try_init(py, || {
        let bases = (py.get_type::<Error>(), py.get_type::<Rejection>()).into_pyobject(py)?;
        let members = PyDict::new(py);
        members.set_item("__module__", "elk")?;
        members.set_item("__doc__", DECODE_ERROR_DOC)?;
        let made = py.get_type::<PyType>().call1(("DecodeError", bases, members))?;
        Ok::<_, PyErr>(made.cast_into::<PyType>()?.unbind())
    });
    made.map(|made| made.bind(py))
}

/// Characters of an error's words at most: there may be names and values of others in them.
const LONGEST: usize = 4000;

/// An error in these words.
pub fn error(words: impl Display) -> PyErr {
    Error::new_err(text::clipped(&words.to_string(), LONGEST).into_owned())
}

/// An error in these words about what a message carries.
pub fn decode_error(py: Python<'_>, words: impl Display) -> PyErr {
    match decode_error_type(py) {
        Ok(kind) => PyErr::from_type(kind.clone(), text::clipped(&words.to_string(), LONGEST).into_owned()),
        Err(failure) => failure,
    }
}

/// An error about what lies in something, with where that is.
pub fn within(py: Python<'_>, place: impl Display, wrong: PyErr) -> PyErr {
    match wrong.is_instance_of::<Error>(py) {
        true => error(format_args!("{place}: {}", wrong.value(py))),
        false => wrong,
    }
}
