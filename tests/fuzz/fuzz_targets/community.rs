//! Any text as a community's name: what is taken for one is one component of a path, and no pattern.
#![no_main]

use std::path::{Component, Path};

use elk_bus::Community;
use libfuzzer_sys::fuzz_target;

fuzz_target!(|name: &str| {
    if let Ok(community) = Community::new(name) {
        let mut components = Path::new(community.as_str()).components();
        assert!(matches!(components.next(), Some(Component::Normal(_))) && components.next().is_none(), "{name:?}");
        assert!(!name.contains(|c: char| c.is_control() || "/*?[".contains(c)), "{name:?}");
    }
});
