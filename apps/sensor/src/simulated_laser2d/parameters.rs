//! The laser as a mission file says it.

use elk_bus::AppError;
use elk_mission::{AppSpec, Kind, Mission, ParamSpec, Params, PreflightReport, Program, element};

use super::matched::LaserMatching;
use super::source::{Settings, SimulatedLaser2d};
use crate::localised::{Estimating, LookSpacing};
use crate::parameters::{ICP_VOXEL, drift, level_icp, look_spacing, param};
use crate::pose_estimator::{DriftingOdometry, LevelMatching};
use crate::source::DepthSource;
use crate::surroundings::{self, body, seed};

/// So near to the border of two layers of voxels (a part of their edge) rounding decides in which one beams lie.
const BORDER: f64 = 0.01;

/// What a mission file can say of it, beside its surroundings.
pub(super) const PARAMS: &[ParamSpec] = &[
    param("Beams", Kind::Integer { min: 1, max: 100_000 }, "540", "Beams of a scan, evenly over Fov."),
    param(
        "Fov",
        Kind::Number { unit: "deg", min: 1.0, max: 360.0 },
        "270",
        "Field of view, half of it to either side of the heading.",
    ),
    param(
        "Range",
        Kind::Number { unit: "m", min: 0.1, max: 1000.0 },
        "10",
        "How far the laser sees: what is farther gives no return.",
    ),
    param(
        "RangeNoise",
        Kind::Number { unit: "m", min: 0.0, max: 10.0 },
        "0.01",
        "Standard deviation of a measured range; 0: it is exact.",
    ),
    param(
        "PoseEstimator",
        Kind::Choice(&["none", "Odometry", "ICP"]),
        "none",
        "How the pose is estimated; none: it is known exactly; Odometry: from motions that are measured with an error; ICP: from the scans, matched in the plane.",
    ),
    ICP_VOXEL,
    param(
        "LookWay",
        Kind::Number { unit: "m", min: 0.001, max: 100.0 },
        "0.1",
        "With ICP: how far the robot goes at most from one look to the next on its way to a pose.",
    ),
    param(
        "LookTurn",
        Kind::Number { unit: "deg", min: 0.1, max: 360.0 },
        "10",
        "With ICP: how far it turns at most from one look to the next.",
    ),
];

/// The laser that the parameters say.
pub(super) fn laser(params: &Params) -> Result<SimulatedLaser2d, AppError> {
    let settings = Settings {
        // The table keeps it within 32 bits.
        beams: params.integer("Beams") as u32,
        fov: params.number("Fov").to_radians(),
        range: params.number("Range"),
        noise: params.number("RangeNoise"),
        seed: seed(params),
    };
    let body = body(params)?;
    // A place and a heading are drawn; a laser that is mounted on a robot is level.
    let body = if params.flag("RandomStart") { body.level() } else { body };
    Ok(SimulatedLaser2d::new(body, settings))
}

/// How its robot knows where it is, if it is not told.
pub(super) fn estimating(params: &Params, laser: &SimulatedLaser2d) -> Result<Option<Estimating>, AppError> {
    Ok(match params.text("PoseEstimator") {
        "Odometry" => {
            Some(Estimating::new(DriftingOdometry::new(drift(params, seed(params))), LookSpacing::AT_THE_END))
        }
        "ICP" => {
            let matching = LevelMatching::new(&level_icp(params), laser.start().position().z)?;
            let spacing = look_spacing(params);
            Some(Estimating::new(LaserMatching::new(laser.clone(), matching), spacing))
        }
        _ => None,
    })
}

/// Whether a mission can be run with it, looked at before anything starts: in the plane where its scans are matched there, and what is
/// to be said of the plane.
pub(super) fn preflight(params: &Params, mission: &Mission) -> PreflightReport {
    let mut report = surroundings::preflight(params, mission);
    if let Some(explorer) = mission.of_element(element::EXPLORER).find(leaves_plane) {
        let sees = format!("the laser sees its own plane alone, and {} sends the robot up and down", explorer.name);
        let right = format!("right is {}.Planar true", explorer.name);
        match params.text("PoseEstimator") == "ICP" {
            true => report.faults.push(format!("{sees}, which no scan shows (PoseEstimator ICP); {right}")),
            false => report.warnings.push(format!("{sees}; {right}")),
        }
    }
    let is_tilted = params.number("StartPitch") != 0.0 && !params.flag("RandomStart");
    if params.text("PoseEstimator") == "ICP" && is_tilted {
        report.faults.push(
            "StartPitch tilts the laser, whose scans are matched in the plane (PoseEstimator ICP); right is 0".into(),
        );
    }
    report.warnings.extend(on_border(params, mission));
    report
}

/// What a program of somebody else's does nobody knows.
fn leaves_plane(explorer: &&AppSpec) -> bool {
    match &explorer.program {
        Program::Builtin(app_type, params) => app_type.param("Planar").is_some() && !params.flag("Planar"),
        Program::Foreign { .. } => false,
    }
}

/// That it is at no height at which anybody knows which voxels its beams are in.
fn on_border(params: &Params, mission: &Mission) -> Option<String> {
    let edge: f64 = mission.of_element(element::MAP).next()?.setting("Res")?.parse().ok()?;
    let height = params.point("Start")[2];
    let layers = height / edge;
    let is_on_it = !params.flag("RandomStart") && (layers - layers.round()).abs() < BORDER;
    let right = (layers.floor() + 0.5) * edge;
    is_on_it.then(|| {
        format!(
            "Start: at a height of {height} m the beams lie on the border of two layers of voxels of {edge} m; right is the middle of \
             one, as {right:.3} m"
        )
    })
}
