//! What a mission file can say of every sensor, and of every recorded one.

use elk_bus::AppError;
use elk_mission::{Kind, ParamSpec, Params};

use crate::localised::{Estimating, LookSpacing};
use crate::pose_estimator::{Drift, DriftingOdometry, IcpSettings, MapMatchingSettings};

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

/// What a simulated sensor can say of where it takes itself to be, beside which estimators there are for it.
pub(crate) const SIMULATED: &[ParamSpec] = &[
    OUTPUT,
    POSE,
    param(
        "DriftWay",
        Kind::Number { unit: "", min: 0.0, max: 1.0 },
        "0.01",
        "Standard deviation of Odometry's error of the way to each commanded pose, as a share of that way.",
    ),
    param(
        "DriftTurn",
        Kind::Number { unit: "", min: 0.0, max: 1.0 },
        "0.01",
        "Standard deviation of Odometry's error of the turn to each commanded pose, as a share of that turn.",
    ),
];

/// How a robot with a simulated depth camera knows where it is.
pub(crate) const DEAD_RECKONING: &[ParamSpec] = &[
    param(
        "PoseEstimator",
        Kind::Choice(&["none", "Odometry"]),
        "none",
        "How the pose is estimated; none: it is known exactly; Odometry: from motions that are measured with an error, so that it drifts.",
    ),
    LOOK_WAY,
    LOOK_TURN,
    REFINE,
    REFINE_VOXEL,
];

const LOOK_WAY: ParamSpec = param(
    "LookWay",
    Kind::Number { unit: "m", min: 0.001, max: 100.0 },
    "0.1",
    "With VisualOdometry or Refine: how far the robot goes at most from one look to the next on its way to a pose.",
);
const LOOK_TURN: ParamSpec = param(
    "LookTurn",
    Kind::Number { unit: "deg", min: 0.1, max: 360.0 },
    "10",
    "With VisualOdometry or Refine: how far it turns at most from one look to the next.",
);

const REFINE: ParamSpec = param(
    "Refine",
    Kind::Refinement { words: &["none", "ICP"], of: "PoseEstimator" },
    "none",
    "How an estimated pose is made better; ICP: by where the scan lies on those before it, each in as far as it is the surer one.",
);
const REFINE_VOXEL: ParamSpec = param(
    "RefineVoxel",
    Kind::Number { unit: "m", min: 0.005, max: 10.0 },
    "0.05",
    "With Refine: edge of the finest voxels whose surfaces scans are laid on.",
);

/// How visual odometry remembers.
pub(crate) const MEMORY: ParamSpec = param(
    "Memory",
    Kind::Integer { min: 0, max: 1_000_000 },
    "500",
    "With VisualOdometry: so many keyframes, of about 0.1 MB, are kept, and taken up again where their views are seen again; 0: none.",
);

/// So many keyframes are kept.
pub(crate) fn memory(params: &Params) -> usize {
    // The table keeps it positive.
    params.integer("Memory") as usize
}

/// How a robot knows where it is that goes by odometry, whose errors are drawn from a seed.
///
/// # Errors
/// Settings out of range.
pub(crate) fn dead_reckoning(params: &Params, seed: u64) -> Result<Estimating, AppError> {
    let drift = drift(params, seed);
    let spacing = if is_refined(params) { look_spacing(params) } else { LookSpacing::AT_THE_END };
    refined(params, Estimating::new(DriftingOdometry::new(drift), spacing), drift)
}

/// An estimating robot's, made better as a mission says it. Its odometry errs by `drift`.
///
/// # Errors
/// Settings out of range.
pub(crate) fn refined(params: &Params, estimating: Estimating, drift: Drift) -> Result<Estimating, AppError> {
    match is_refined(params) {
        true => Ok(estimating.refined(&MapMatchingSettings { voxel: params.number("RefineVoxel"), drift })?),
        false => Ok(estimating),
    }
}

fn is_refined(params: &Params) -> bool {
    params.text("Refine") == "ICP"
}

/// How far a robot goes and turns from look to look.
pub(crate) fn look_spacing(params: &Params) -> LookSpacing {
    LookSpacing { way_m: params.number("LookWay"), turn_rad: params.number("LookTurn").to_radians() }
}

/// How a robot with two simulated cameras knows where it is.
pub(crate) const LOOKING: &[ParamSpec] = &[
    param(
        "PoseEstimator",
        Kind::Choice(&["none", "Odometry", "VisualOdometry"]),
        "none",
        "How the pose is estimated; none: it is known exactly; Odometry: from motions that are measured with an error; VisualOdometry: from the images.",
    ),
    LOOK_WAY,
    LOOK_TURN,
    MEMORY,
    REFINE,
    REFINE_VOXEL,
];

/// Odometry as a mission says it, whose errors are drawn from the sensor's seed.
pub(crate) fn drift(params: &Params, seed: u64) -> Drift {
    Drift { way: params.number("DriftWay"), turn: params.number("DriftTurn"), seed }
}

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

/// How finely a laser's scans are matched.
pub(crate) const ICP_VOXEL: ParamSpec = param(
    "IcpVoxel",
    Kind::Number { unit: "m", min: 0.005, max: 10.0 },
    "0.1",
    "Edge of the voxels by which ICP puts points together.",
);

/// How a laser's scans are matched in the plane.
pub(crate) fn level_icp(params: &Params) -> IcpSettings {
    IcpSettings { voxel: params.number("IcpVoxel"), step: 0.3, turn: 0.3, window: 30 }
}

/// Whether a recorded sensor's poses are estimated by matching its scans.
pub(crate) fn matches_scans(params: &Params) -> bool {
    params.text("PoseEstimator") == "ICP"
}

/// How far a stereo camera's points are believed.
pub(crate) const BELIEVED_RANGE: ParamSpec = param(
    "Range",
    Kind::Number { unit: "m", min: 0.0, max: 1e4 },
    "0",
    "How far points are believed, whose error grows with the square of it: what is matched farther away gives no return; 0: all are.",
);

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

/// After so many lost frames in a row visual odometry gives up.
pub(crate) fn patience(params: &Params) -> u64 {
    // The table keeps it positive.
    params.integer("Patience") as u64
}

/// How many frames are played; none: all.
pub(crate) fn frames(params: &Params) -> Option<u64> {
    // The table keeps it positive.
    Some(params.integer("Frames") as u64).filter(|frames| *frames > 0)
}

#[cfg(test)]
mod tests {
    use std::path::Path;

    use super::*;

    /// Regression: it was said, and nothing came of it.
    #[test]
    fn what_is_not_estimated_is_not_refined() {
        let said = |settings: &[(&str, &str)]| {
            let settings = settings.iter().map(|(name, text)| ((*name).to_owned(), (*text).to_owned()));
            Params::check("Sensor", DEAD_RECKONING, &settings.collect::<Vec<_>>(), Path::new(""))
        };
        assert!(!is_refined(&said(&[]).unwrap()));
        assert!(is_refined(&said(&[("PoseEstimator", "Odometry"), ("Refine", "ICP")]).unwrap()));
        let wrong = said(&[("Refine", "ICP")]).unwrap_err().to_string();
        assert!(wrong.contains("Refine is ICP, and PoseEstimator is none"), "{wrong}");
    }
}
