//! The variables that the apps of an exploration exchange, with their types.

use elk_bus::Key;

use crate::map::MapUpdate;
use crate::messages::{
    AccuracyReport, CameraPose, ExplorationReport, MapStatus, MotionReport, Plan, PlanRequest, PoseCommand, Progress,
    SensorReport,
};
use crate::scan::Scan;

/// Controller to sensor: go there and scan.
pub const POSE_COMMAND: Key<PoseCommand> = Key::new("POSE_COMMAND");
/// Sensor to the first filter, or to the map: what was seen. Filters publish under `SCAN_1`, `SCAN_2`, …
pub const SCAN: Key<Scan<'static>> = Key::new("SCAN");
/// Map to its readers: what the last scan changed.
pub const MAP_UPDATE: Key<MapUpdate> = Key::new("MAP_UPDATE");
/// Map to its readers: the whole map, on request and at the end.
pub const MAP: Key<MapUpdate> = Key::new("MAP");
/// Person to controller: take the next step (any double). Only a controller whose parameter `Manual` is true waits for it,
/// before each pose command.
pub const STEP: &str = "STEP";
/// Anyone to the map: publish the whole map (any double).
pub const MAP_REQUEST: &str = "MAP_REQUEST";
/// Map to anyone: how much is known. (Not `MAP_STATUS`: every app says `<APP>_STATUS` of itself, and one may be named Map.)
pub const MAP_KNOWN: Key<MapStatus> = Key::new("MAP_KNOWN");
/// Controller to explorer: where to?
pub const PLAN_REQUEST: Key<PlanRequest> = Key::new("PLAN_REQUEST");
/// Explorer to controller: there.
pub const PLAN: Key<Plan> = Key::new("PLAN");
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
