//! The variables that the apps of an exploration exchange, with their types.

use elk_bus::{Key, Payload, pattern};

use crate::candidates::Candidates;
use crate::keyframe::MapPart;
use crate::map::MapUpdate;
use crate::messages::{
    AccuracyReport, CameraPose, ExplorationReport, ExplorerMemory, ExplorerPast, MapMemory, MapStatus, MotionMemory,
    MotionReport, Plan, PlanRequest, PoseCommand, Progress, SensorReport,
};
use crate::playback::{Playback, PoseEstimate};
use crate::scan::Scan;
use crate::travel::TravelReport;

/// Makes a key of each row, of the variable of the same name, and a table of what they carry.
macro_rules! typed {
    ($($(#[$doc:meta])* $name:ident: $carries:ty;)*) => {
        $($(#[$doc])* pub const $name: Key<$carries> = Key::new(stringify!($name));)*

        /// What these variables carry.
        const TYPED: &[(&str, &str)] = &[$((stringify!($name), <$carries as Payload>::NAME)),*];
    };
}

/// Makes a name of each row, which carries a text or a number, and a list of them.
macro_rules! plain {
    ($($(#[$doc:meta])* $name:ident;)*) => {
        $($(#[$doc])* pub const $name: &str = stringify!($name);)*

        /// The variables of an exploration that carry texts and numbers.
        pub const PLAIN: &[&str] = &[$($name),*];
    };
}

typed! {
    /// Controller to sensor: go there and scan.
    POSE_COMMAND: PoseCommand;
    /// Sensor to the first filter, or to the map: what was seen. Filters publish under `SCAN_1`, `SCAN_2`, …
    SCAN: Scan<'static>;
    /// Map to its readers: what the last scan changed.
    MAP_UPDATE: MapUpdate;
    /// Map to its readers, on request: a part of the whole map, part by part between the updates.
    MAP_PART: MapPart;
    /// Map to anyone: the whole map, at the end. Readers to a map that has lost its memory: their copy.
    MAP: MapUpdate;
    /// Map to an explorer that asks for it ([`MAP_CONFIDENCE`]), before each update: the voxels that are occupied with less confidence, all
    /// of them, as a whole map of these alone.
    MAP_UNSURE: MapUpdate;
    /// Map to its successor: all that it knows, when it stops.
    MAP_MEMORY: MapMemory;
    /// Map to anyone: how much is known. (Not `MAP_STATUS`: every app says `<APP>_STATUS` of itself, and one may be named Map.)
    MAP_KNOWN: MapStatus;
    /// Controller to explorer: where to?
    PLAN_REQUEST: PlanRequest;
    /// Explorer to controller: there.
    PLAN: Plan;
    /// Controller to its successor: how it stands, before it says anything that follows from it.
    MOTION_MEMORY: MotionMemory;
    /// Explorer to its successor, of whatever type: what it knows, before each plan.
    EXPLORER_MEMORY: ExplorerMemory;
    /// Explorer to its successor: what memories go on from, after the one that it is of.
    EXPLORER_PAST: ExplorerPast;
    /// Controller to anyone: how far the run is.
    PROGRESS: Progress;
    /// Controller to anyone, at the end: scans and way, to 95, 99, 99.9 and 100 % of the free voxels.
    MOTION_REPORT: MotionReport;
    /// Controller whose robot takes its time to anyone, with each pose command: how long it has been on its way.
    TRAVEL_REPORT: TravelReport;
    /// Explorer to anyone, before the plan that comes of them. A strategy that weighs none publishes none.
    EXPLORER_GOALS: Candidates;
    /// Explorer to anyone, at the end: why, and what is left.
    EXPLORATION_REPORT: ExplorationReport;
    /// Sensor to anyone: scans and contacts.
    SENSOR_REPORT: SensorReport;
    /// Sensor of a recording to anyone: how far it is.
    PLAYBACK: Playback;
    /// Sensor that estimates its poses to anyone: where it is, how well that is known, or why nobody knows.
    POSE_ESTIMATE: PoseEstimate;
    /// Sensor to anyone, at the end: the whole map against the true world.
    ACCURACY_REPORT: AccuracyReport;
}

plain! {
    /// A map that was killed, to its readers: whoever has a copy of this revision (a double) or a later one says it under
    /// [`MAP`].
    MAP_RECALL;
    /// Explorer to the map: say with each update which voxels are occupied with a probability of less than this (a double; 0: none
    /// any more), under [`MAP_UNSURE`].
    MAP_CONFIDENCE;
    /// Person to controller: `pause` before the next pose command, or `run` (again). Without it the parameter `Manual` decides.
    MOTION;
    /// Person to a controller that pauses: one more pose command (any double).
    STEP;
    /// Anyone to the map: publish the whole map, in parts (any double).
    MAP_REQUEST;
}

/// The variable of the camera's pose, unless the mission names another one (`MOOSPoseVarName`).
pub const CAMERA_POSE: &str = "SIM_SENSOR";

/// Sensor to anyone: where the camera is, under the `variable` that the mission names.
pub fn camera_pose(variable: &str) -> Key<CameraPose> {
    Key::named(variable)
}

/// The variable of what the strategy of this name remembers, a value of a type of its own.
pub fn strategy_memory(strategy: &str) -> String {
    format!("{}_{strategy}", EXPLORER_MEMORY.name())
}

/// Whether a variable is some strategy's memory ([`strategy_memory`]).
pub fn is_strategy_memory(key: &str) -> bool {
    key.strip_prefix(EXPLORER_MEMORY.name()).is_some_and(|rest| rest.starts_with('_'))
}

/// What variables carry whose names are made as a mission is: scans behind filters, and the camera's pose.
const NAMED_OTHERWISE: &[(&str, &str)] = &[("SCAN_*", <Scan<'_> as Payload>::NAME), (CAMERA_POSE, CameraPose::NAME)];

/// The names of all of these variables.
pub fn names() -> impl Iterator<Item = &'static str> {
    TYPED.iter().map(|(name, _)| *name).chain(PLAIN.iter().copied()).chain([CAMERA_POSE])
}

/// The name of the type that a variable of an exploration carries.
pub fn carried_by(key: &str) -> Option<&'static str> {
    let carried = TYPED.iter().chain(NAMED_OTHERWISE).find(|(pattern, _)| pattern::matches(pattern, key));
    carried.map(|(_, type_name)| *type_name)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::samples;

    #[test]
    fn what_is_carried_is_known_and_has_a_sample() {
        for (name, type_) in TYPED {
            assert!(samples::named(type_).is_some(), "{type_}, which {name} carries, has to have a sample");
        }
        let carried = ["SCAN_1", "NAV_X", "EXPLORER_GOALS", "MOTION"].map(carried_by);
        assert_eq!(carried, [Some("Scan"), None, Some("Candidates"), None]);
        let memories = [&strategy_memory("Magpie"), EXPLORER_MEMORY.name(), "EXPLORER_MEMORYS"].map(is_strategy_memory);
        assert_eq!(memories, [true, false, false]);
    }
}
