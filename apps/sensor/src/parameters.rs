//! What a mission file can say of every sensor, and of every recorded one.

use elk_mission::{Kind, ParamSpec, Params};

/// A parameter with a default.
pub(crate) const fn param(name: &'static str, kind: Kind, default: &'static str, doc: &'static str) -> ParamSpec {
    ParamSpec { name, kind, default: Some(default), doc }
}

const OUTPUT: ParamSpec = param("Output", Kind::Variable, "SCAN", "Variable under which scans are published.");
const POSE: ParamSpec =
    param("MOOSPoseVarName", Kind::Variable, "SIM_SENSOR", "Variable under which the camera's pose is published.");

/// The parameters that all sensors have.
pub const COMMON: &[ParamSpec] = &[
    OUTPUT,
    POSE,
    param("PoseEstimator", Kind::Choice(&["none"]), "none", "How the pose is estimated; none: it is known exactly."),
];

/// The parameters that all recorded sensors have.
pub const RECORDED: &[ParamSpec] = &[
    OUTPUT,
    POSE,
    param(
        "PoseEstimator",
        Kind::Choice(&["none", "ICP"]),
        "none",
        "How poses are estimated; none: they are the recorded ones; ICP: from the scans alone, which are matched; the first is the recorded one.",
    ),
    param(
        "Frames",
        Kind::Integer { min: 0, max: i64::MAX },
        "0",
        "How many frames are played, from the first on; 0: all.",
    ),
    param(
        "FrameRate",
        Kind::Number { unit: "Hz", min: 0.001, max: 100_000.0 },
        "30",
        "Frames a second, of a recording that does not say its times.",
    ),
];

/// Whether a recorded sensor's poses are estimated by matching its scans.
pub(crate) fn matches_scans(params: &Params) -> bool {
    params.text("PoseEstimator") == "ICP"
}

/// How many frames are played; none: all.
pub(crate) fn frames(params: &Params) -> Option<u64> {
    // The table keeps it positive.
    Some(params.integer("Frames") as u64).filter(|frames| *frames > 0)
}
