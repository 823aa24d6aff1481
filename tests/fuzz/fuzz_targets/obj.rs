//! Any bytes as a world: what loads can be looked into.
#![no_main]

#[path = "common/world.rs"]
mod world;

use libfuzzer_sys::fuzz_target;

fuzz_target!(|bytes: &[u8]| world::look_into("fuzz.obj", bytes));
