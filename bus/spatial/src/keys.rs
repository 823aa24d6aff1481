//! The variables that the apps of an exploration exchange, with their types.

use elk_bus::{Key, Payload, pattern};

use crate::map::MapUpdate;
use crate::messages::{
    AccuracyReport, CameraPose, ExplorationReport, ExplorerMemory, MapMemory, MapStatus, MotionMemory, MotionReport,
    Plan, PlanRequest, PoseCommand, Progress, SensorReport,
};
use crate::scan::Scan;

/// Controller to sensor: go there and scan.
pub const POSE_COMMAND: Key<PoseCommand> = Key::new("POSE_COMMAND");
/// Sensor to the first filter, or to the map: what was seen. Filters publish under `SCAN_1`, `SCAN_2`, …
pub const SCAN: Key<Scan<'static>> = Key::new("SCAN");
/// Map to its readers: what the last scan changed.
pub const MAP_UPDATE: Key<MapUpdate> = Key::new("MAP_UPDATE");
/// Map to its readers: the whole map, on request and at the end. Readers to a map that has lost its memory: their copy.
pub const MAP: Key<MapUpdate> = Key::new("MAP");
/// Map to its successor: all that it knows, when it stops.
pub const MAP_MEMORY: Key<MapMemory> = Key::new("MAP_MEMORY");
/// A map that was killed, to its readers: whoever has a copy of this revision (a double) or a later one says it under
/// [`MAP`].
pub const MAP_RECALL: &str = "MAP_RECALL";
/// Person to controller: `pause` before the next pose command, or `run` (again). Without it the parameter `Manual` decides.
pub const MOTION: &str = "MOTION";
/// Person to a controller that pauses: one more pose command (any double).
pub const STEP: &str = "STEP";
/// Anyone to the map: publish the whole map (any double).
pub const MAP_REQUEST: &str = "MAP_REQUEST";
/// Map to anyone: how much is known. (Not `MAP_STATUS`: every app says `<APP>_STATUS` of itself, and one may be named Map.)
pub const MAP_KNOWN: Key<MapStatus> = Key::new("MAP_KNOWN");
/// Controller to explorer: where to?
pub const PLAN_REQUEST: Key<PlanRequest> = Key::new("PLAN_REQUEST");
/// Explorer to controller: there.
pub const PLAN: Key<Plan> = Key::new("PLAN");
/// Controller to its successor: how it stands, before it says anything that follows from it.
pub const MOTION_MEMORY: Key<MotionMemory> = Key::new("MOTION_MEMORY");
/// Explorer to its successor, of whatever type: what it knows, before each plan.
pub const EXPLORER_MEMORY: Key<ExplorerMemory> = Key::new("EXPLORER_MEMORY");
/// Controller to anyone: how far the run is.
pub const PROGRESS: Key<Progress> = Key::new("PROGRESS");
/// Controller to anyone, at the end: scans and way, to 95, 99, 99.9 and 100 % of the free voxels.
pub const MOTION_REPORT: Key<MotionReport> = Key::new("MOTION_REPORT");
/// The variable of the camera's pose, unless the mission names another one (`MOOSPoseVarName`).
pub const CAMERA_POSE: &str = "SIM_SENSOR";

/// Sensor to anyone: where the camera is, under the `variable` that the mission names.
pub fn camera_pose(variable: &str) -> Key<CameraPose> {
    Key::named(variable)
}

/// Explorer to anyone, at the end: why, and what is left.
pub const EXPLORATION_REPORT: Key<ExplorationReport> = Key::new("EXPLORATION_REPORT");
/// Sensor to anyone: scans and contacts.
pub const SENSOR_REPORT: Key<SensorReport> = Key::new("SENSOR_REPORT");
/// Sensor to anyone: the last whole map against the true world.
pub const ACCURACY_REPORT: Key<AccuracyReport> = Key::new("ACCURACY_REPORT");

/// What these variables carry, by the pattern of their names.
const CARRIED: &[(&str, &str)] = &[
    ("POSE_COMMAND", PoseCommand::NAME),
    ("SCAN", <Scan<'_> as Payload>::NAME),
    ("SCAN_*", <Scan<'_> as Payload>::NAME),
    ("MAP_UPDATE", MapUpdate::NAME),
    ("MAP", MapUpdate::NAME),
    ("MAP_KNOWN", MapStatus::NAME),
    ("PLAN_REQUEST", PlanRequest::NAME),
    ("PLAN", Plan::NAME),
    ("PROGRESS", Progress::NAME),
    ("MOTION_REPORT", MotionReport::NAME),
    (CAMERA_POSE, CameraPose::NAME),
    ("EXPLORATION_REPORT", ExplorationReport::NAME),
    ("SENSOR_REPORT", SensorReport::NAME),
    ("ACCURACY_REPORT", AccuracyReport::NAME),
    ("MAP_MEMORY", MapMemory::NAME),
    ("MOTION_MEMORY", MotionMemory::NAME),
    ("EXPLORER_MEMORY", ExplorerMemory::NAME),
];

/// The name of the type that a variable of an exploration carries.
pub fn carried_by(key: &str) -> Option<&'static str> {
    CARRIED.iter().find(|(pattern, _)| pattern::matches(pattern, key)).map(|(_, type_name)| *type_name)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::samples;

    /// The type that a declaration of a key names.
    fn declared(line: &str) -> Option<(&str, &str)> {
        let (type_, name) = line.split_once("Key<")?.1.split_once("Key::new(\"")?;
        Some((type_.split(|c: char| !c.is_alphanumeric()).next()?, name.trim_end_matches("\");")))
    }

    #[test]
    fn every_key_is_known_with_its_type() {
        let keys: Vec<_> =
            include_str!("keys.rs").lines().filter(|line| line.starts_with("pub const")).filter_map(declared).collect();
        assert!(keys.len() > 10, "{keys:?}");
        for (type_, name) in keys {
            assert_eq!(carried_by(name), Some(type_), "CARRIED has to know what {name} carries");
            assert!(samples::named(type_).is_some(), "{type_} has to have a sample");
        }
        assert_eq!((carried_by("SCAN_1"), carried_by("NAV_X")), (Some("Scan"), None));
    }
}
