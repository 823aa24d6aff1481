//! Any bytes as a log of elk: records, index, jumps, check, recover.
#![no_main]

use libfuzzer_sys::fuzz_target;

fuzz_target!(|bytes: &[u8]| {
    let path = std::env::temp_dir().join(format!("elk-fuzz-{}.mcap", std::process::id()));
    std::fs::write(&path, bytes).expect("a temporary file can be written");
    elk_log::fuzzing::read_log(&path);
});
