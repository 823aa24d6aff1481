//! Any bytes as a map that is perhaps a .bt, of today or of before 2011.
#![no_main]

#[path = "common/map.rs"]
mod map;

use libfuzzer_sys::fuzz_target;

fuzz_target!(|bytes: &[u8]| map::go_on_from(bytes));
