//! What tests of evaluations have in common: the types of all apps that elk comes with, and missions from their files.

use std::path::Path;

use elk_mission::{AppType, Mission, Override, Registry};

/// The types that elk comes with, and these.
pub fn registry(more: &'static [AppType]) -> Registry {
    let own = [elk_sensor::TYPES, elk_filter::TYPES, elk_map_app::TYPES, elk_explorer::TYPES, elk_controller::TYPES];
    Registry::new(&[&own[..], &[more]].concat())
}

/// A mission from its file.
#[allow(dead_code, reason = "not every test has missions in files")]
pub fn read(file: &Path, sets: &[Override]) -> Result<Mission, String> {
    let text = std::fs::read_to_string(file).map_err(|error| format!("{}: {error}", file.display()))?;
    Mission::parse(&text, file, &registry(&[]), sets).map_err(|error| error.to_string())
}
