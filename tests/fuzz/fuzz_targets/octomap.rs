//! Any bytes as a map that is perhaps OctoMap's: a .bt, of today or of before 2011, or an .ot of any kind of tree.
#![no_main]

#[path = "common/map.rs"]
mod map;

use libfuzzer_sys::fuzz_target;

fuzz_target!(|bytes: &[u8]| map::go_on_from(bytes));
