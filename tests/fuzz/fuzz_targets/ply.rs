//! Any bytes as a world that is perhaps PLY, in its three encodings.
#![no_main]

#[path = "common/world.rs"]
mod world;

use libfuzzer_sys::fuzz_target;

fuzz_target!(|bytes: &[u8]| world::look_into("fuzz.ply", bytes));
