//! The stereo camera as a mission file says it.

use elk_bus::AppError;
use elk_mission::{Kind, Mission, ParamSpec, Params, PreflightReport};
use elk_stereo::Matcher;

use super::eyes::Eyes;
use super::source::{Settings, SimulatedStereo};
use super::texture::Look;
use crate::camera::Camera;
use crate::localised::Estimating;
use crate::matching::matcher;
use crate::parameters::{BELIEVED_RANGE, dead_reckoning, look_spacing, memory, param, refined};
use crate::pose_estimator::{Drift, VisualOdometry, VisualOdometrySettings};
use crate::surroundings::{self, FOV, body, camera, check_pixels, range, seed};

/// By how much visual odometry errs in these worlds, of way and turn, beside scans that are to make it better.
const IMAGES_DRIFT: f64 = 0.005;
const PIXELS: Kind = Kind::Integer { min: 16, max: 10_000 };

/// What a mission file can say of it, beside its surroundings and how it matches.
pub(super) const PARAMS: &[ParamSpec] = &[
    param("Width", PIXELS, "320", "Pixels in a row of each image; more than Disparities."),
    param("Height", PIXELS, "240", "Rows of each image."),
    FOV,
    param(
        "Baseline",
        Kind::Number { unit: "m", min: 0.001, max: 10.0 },
        "0.12",
        "How far the right camera is to the right of the left one, whose pose is the sensor's.",
    ),
    BELIEVED_RANGE,
    param(
        "Texture",
        Kind::Number { unit: "", min: 0.0, max: 100.0 },
        "20",
        "How far each octave of the surfaces' texture takes grey levels up and down; 0: blank walls, of which nothing is seen.",
    ),
    param(
        "BlankShare",
        Kind::Number { unit: "", min: 0.0, max: 1.0 },
        "0",
        "Share of the world's planes that have no texture, drawn from Seed.",
    ),
];

/// The stereo camera that the parameters say.
pub(super) fn simulated_stereo(params: &Params) -> Result<SimulatedStereo, AppError> {
    let matcher = checked_matcher(params)?;
    Ok(SimulatedStereo::new(body(params)?, settings(params), matcher)?)
}

/// How its robot knows where it is, if it is not told.
pub(super) fn estimating(params: &Params, stereo: &SimulatedStereo) -> Result<Option<Estimating>, AppError> {
    let seed = seed(params);
    Ok(match params.text("PoseEstimator") {
        "Odometry" => Some(dead_reckoning(params, seed)?),
        "VisualOdometry" => {
            let Camera { width, height, .. } = camera(params);
            let (rig, size) = (*stereo.rig(), [width as usize, height as usize]);
            // A robot that is lost goes back to where it knew where it was: what it saw there is never given up.
            let settings = VisualOdometrySettings { rig, size, patience: None, memory: memory(params), seed };
            let estimating = Estimating::new(VisualOdometry::new(settings)?, look_spacing(params));
            Some(refined(params, estimating, Drift { way: IMAGES_DRIFT, turn: IMAGES_DRIFT, seed })?)
        }
        _ => None,
    })
}

/// Whether a mission can be run with it, looked at before anything starts.
pub(super) fn preflight(params: &Params, mission: &Mission) -> PreflightReport {
    match checked_matcher(params) {
        Ok(_) => surroundings::preflight(params, mission),
        Err(error) => PreflightReport::fault(error),
    }
}

/// What matches its images, if they can be matched.
fn checked_matcher(params: &Params) -> Result<Box<dyn Matcher + Send>, AppError> {
    check_pixels(params)?;
    let matcher = matcher(params)?;
    let (width, levels) = (params.integer("Width"), params.integer("Disparities"));
    match width > levels {
        true => Ok(matcher),
        false => Err(format!(
            "Width is {width} and Disparities {levels}: no column has that many on its left; right is a Width of more than Disparities"
        )
        .into()),
    }
}

fn settings(params: &Params) -> Settings {
    let eyes = Eyes {
        camera: camera(params),
        baseline_m: params.number("Baseline"),
        noise: params.number("ImageNoise"),
        seed: seed(params),
    };
    let look =
        Look { contrast: params.number("Texture") as f32, blank: params.number("BlankShare"), seed: seed(params) };
    Settings { eyes, look, range: range(params) }
}
