//! Any bytes as the page that a client shares with its broker.
#![no_main]

use libfuzzer_sys::fuzz_target;

fuzz_target!(|bytes: &[u8]| {
    elk_bus::shm::fuzzing::read_page(bytes);
});
