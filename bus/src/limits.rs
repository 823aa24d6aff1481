//! The limits of the process that the operating system keeps low by habit.

use rustix::process::{Resource, getrlimit, setrlimit};

/// Raises the number of file descriptors to the hard limit: every lane costs some.
pub fn raise_descriptors() {
    let mut limit = getrlimit(Resource::Nofile);
    limit.current = limit.maximum;
    // A refusal leaves the limit as it was; what then fails says so itself.
    let _ = setrlimit(Resource::Nofile, limit);
}
