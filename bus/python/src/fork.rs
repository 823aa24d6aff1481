//! Which process something was made in. A fork has a client's memory and its descriptors, but not its thread: what it said
//! would be written over what the client says, and what it let go of the client still reads. So nothing of a client is
//! touched there.

use std::process::{exit, id};

use pyo3::exceptions::PySystemExit;
use pyo3::prelude::*;

use crate::error::error;

/// The process that something was made in.
#[derive(Clone, Copy, PartialEq, Eq)]
pub struct Home(u32);

impl Home {
    /// This process.
    pub fn here() -> Self {
        Self(id())
    }

    /// Whether this is another process: a fork.
    pub fn is_elsewhere(self) -> bool {
        self != Self::here()
    }

    /// Sees that what `name` says is said in the process that it was made in.
    ///
    /// # Errors
    /// This is a fork of it.
    pub fn check(self, name: &str) -> PyResult<()> {
        match self.is_elsewhere() {
            false => Ok(()),
            true => Err(error(format_args!(
                "{name} is a client of process {}, and this is a fork of it, process {}; right is a client that is made after \
                 the fork, or multiprocessing's start method \"spawn\"",
                self.0,
                id()
            ))),
        }
    }

    /// Ends a fork that comes back from a callback, which has nowhere to go: with the code that it asks for, else with 1.
    pub fn end_fork(self, py: Python<'_>, callback: &str, done: PyResult<()>) -> ! {
        let failure = done.err().unwrap_or_else(|| {
            error(format_args!(
                "a fork, process {}, has come back from {callback} of process {}; right is to end it there, with os._exit(0)",
                id(),
                self.0
            ))
        });
        // Of a SystemExit this is the end; so it is of the second one.
        failure.print(py);
        PySystemExit::new_err(1).print(py);
        exit(1)
    }
}
