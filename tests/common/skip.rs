//! Tests that need what not every machine has, and say so where they skip.

use std::io::Write;

/// What may not be missing here: a list of words as in [`skip`], of which `1` means all.
const SWITCH: &str = "ELK_NO_SKIPS";

/// Says that `test` is skipped because `need` is missing (`strace`, `mcap`, …), and why. Where the environment variable
/// `ELK_NO_SKIPS` names it, the test fails instead: whoever has installed a tool wants to know that it was used.
pub fn skip(test: &str, need: &str, why: &str) {
    let required = std::env::var(SWITCH).unwrap_or_default();
    let is_required = required.split([' ', ',']).any(|one| one == need || one == "1");
    assert!(!is_required, "{test} cannot skip: {SWITCH} says {required:?}, and {why}");
    // Not by `println!`, which nobody sees of a test that passes.
    let _ = writeln!(std::io::stderr(), "skipped: {test}, for want of {need}: {why}");
}
