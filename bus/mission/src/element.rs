//! The elements of a Scenario: what an app can be.

/// Where depth comes from.
pub const SENSOR: &str = "Sensor";
/// What to leave out of a scan.
pub const FILTER: &str = "Filter";
/// What is known of the world.
pub const MAP: &str = "Map";
/// Where to go next.
pub const EXPLORER: &str = "Explorer";
/// How to get there.
pub const CONTROLLER: &str = "Controller";
/// What was said.
pub const LOGGER: &str = "Logger";
/// Anything else, which may end of its own accord.
pub const APP: &str = "App";
