//! Any text as a mission file, held against the tables of all apps; a mission that is right can be set and exchanged.
#![no_main]

use std::path::Path;

use elk_mission::{Exchange, Mission};
use libfuzzer_sys::fuzz_target;

#[path = "../../../apps/elk/registry.rs"]
mod registry;

fuzz_target!(|text: &str| {
    let registry = registry::registry();
    // The last line may say parameters as a command line does.
    let (text, sets) = text.rsplit_once("\n--set").unwrap_or((text, ""));
    let overrides: Vec<_> = sets.split("--set").filter_map(|set| set.trim().parse().ok()).collect();
    match Mission::parse(text, Path::new("/nowhere/m.xml"), &registry, &overrides) {
        Err(problems) => assert!(!problems.to_string().is_empty()),
        Ok(mission) => {
            for app in &mission.apps {
                let same = app.exchange_among(&mission.apps, &Exchange::default(), &registry);
                let same = same.expect("what was right is right");
                assert_eq!(same.app.name, app.name);
            }
        }
    }
});
