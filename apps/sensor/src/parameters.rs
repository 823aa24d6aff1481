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

/// The parameters that all recorded sensors have, beside how their poses are estimated.
pub const RECORDED: &[ParamSpec] = &[
    OUTPUT,
    POSE,
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

/// How the poses of recorded scans are estimated.
pub(crate) const SCAN_MATCHING: ParamSpec = param(
    "PoseEstimator",
    Kind::Choice(&["none", "ICP"]),
    "none",
    "How poses are estimated; none: they are the recorded ones; ICP: from the scans alone, which are matched; the first is the recorded one.",
);

/// Whether a recorded sensor's poses are estimated by matching its scans.
pub(crate) fn matches_scans(params: &Params) -> bool {
    params.text("PoseEstimator") == "ICP"
}

/// How the poses of recorded pairs are estimated.
pub(crate) const PAIR_TRACKING: ParamSpec = param(
    "PoseEstimator",
    Kind::Choice(&["none", "VisualOdometry"]),
    "none",
    "How poses are estimated; none: they are the recorded ones; VisualOdometry: from the images alone; the first is the recorded one.",
);

/// When visual odometry gives up.
pub(crate) const PATIENCE: ParamSpec = param(
    "Patience",
    Kind::Integer { min: 1, max: 1_000_000_000 },
    "20",
    "After so many lost frames in a row VisualOdometry gives up what was seen before them, and the run ends.",
);

/// How many frames are played; none: all.
pub(crate) fn frames(params: &Params) -> Option<u64> {
    // The table keeps it positive.
    Some(params.integer("Frames") as u64).filter(|frames| *frames > 0)
}
