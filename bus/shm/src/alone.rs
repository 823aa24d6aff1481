//! Tests that end their process, each in one of its own.

use std::process::{Command, Output};

/// Runs a test of this crate by itself, in a process that may end with it.
pub fn run_test(name: &str, variable: &str, value: &str) -> Output {
    let mut command = Command::new(std::env::current_exe().unwrap());
    command.args(["--exact", name, "--nocapture"]).env(variable, value).output().unwrap()
}
