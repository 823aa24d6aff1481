//! Any bytes as a map that is perhaps an .elkmap, and any as one whose checksum is right.
#![no_main]

#[path = "common/map.rs"]
mod map;

use elk_map::elkmap::checksum;
use libfuzzer_sys::fuzz_target;

fuzz_target!(|bytes: &[u8]| {
    map::go_on_from(bytes);
    map::go_on_from(&[bytes, &checksum(bytes).to_le_bytes()].concat());
});
