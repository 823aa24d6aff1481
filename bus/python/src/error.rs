//! What Python is told when something cannot be done.

use std::fmt::Display;

use pyo3::PyErr;
use pyo3::exceptions::PyException;

pyo3::create_exception!(elk, Error, PyException, "Something cannot be done; it says what, on what, and what to do.");
pyo3::create_exception!(
    elk,
    Rejection,
    PyException,
    "Raised by on_new_mail: the app cannot use this message. That is said under MAIL_REJECTED, and the next one is taken."
);

/// An error in these words.
pub fn error(words: impl Display) -> PyErr {
    Error::new_err(words.to_string())
}
