//! Any bytes as a world that is perhaps glTF, as JSON or `.glb`.
#![no_main]

#[path = "common/world.rs"]
mod world;

use libfuzzer_sys::fuzz_target;

fuzz_target!(|bytes: &[u8]| world::look_into("fuzz.glb", bytes));
