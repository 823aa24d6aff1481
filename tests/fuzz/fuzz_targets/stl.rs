//! Any bytes as a world that is perhaps STL, as text or binary.
#![no_main]

#[path = "common/world.rs"]
mod world;

use libfuzzer_sys::fuzz_target;

fuzz_target!(|bytes: &[u8]| world::look_into("fuzz.stl", bytes));
