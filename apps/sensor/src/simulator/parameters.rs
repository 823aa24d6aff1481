//! The simulator as a mission file says it.

use elk_bus::AppError;
use elk_mission::{Kind, Mission, ParamSpec, Params, PreflightReport};

use super::noise::{STEREO_FOCAL_PX, StereoNoise};
use super::source::{Settings, Simulator};
use crate::parameters::param;
use crate::surroundings::{self, FOV, body, camera, check_pixels, range, seed};

const PIXELS: Kind = Kind::Integer { min: 1, max: 10_000 };

/// What a mission file can say of it, beside its surroundings.
pub(super) const PARAMS: &[ParamSpec] = &[
    param("Width", PIXELS, "100", "Pixels in a row of the depth image."),
    param("Height", PIXELS, "100", "Rows of the depth image."),
    FOV,
    param(
        "Range",
        Kind::Number { unit: "m", min: 0.0, max: 1e4 },
        "0",
        "How far the camera sees: what is farther gives no return; 0: as far as there is anything.",
    ),
    param(
        "NoiseSigma",
        Kind::Number { unit: "px", min: 0.0, max: 100.0 },
        "0",
        "Standard deviation of the matched pixel position before triangulation; 0: exact depth.",
    ),
    param(
        "NoisePixel",
        Kind::Choice(&["sensor", "stereo"]),
        "sensor",
        "Whose pixels NoiseSigma counts: those of this depth image, or those of the thesis' stereo images (512 px over 66 deg).",
    ),
    param(
        "NoiseBaseline",
        Kind::Number { unit: "m", min: 0.001, max: 10.0 },
        "0.12",
        "Distance of the two cameras whose triangulation NoiseSigma disturbs (the thesis' stereo camera: 0.12).",
    ),
];

/// The simulator that the parameters say.
pub(super) fn simulator(params: &Params) -> Result<Simulator, AppError> {
    check_pixels(params)?;
    Ok(Simulator::new(body(params)?, settings(params)))
}

/// Whether a mission can be run with it, looked at before anything starts.
pub(super) fn preflight(params: &Params, mission: &Mission) -> PreflightReport {
    match check_pixels(params) {
        Ok(()) => surroundings::preflight(params, mission),
        Err(error) => PreflightReport::fault(error),
    }
}

fn settings(params: &Params) -> Settings {
    let camera = camera(params);
    let noise = StereoNoise {
        sigma_px: params.number("NoiseSigma"),
        focal_px: if params.text("NoisePixel") == "stereo" { STEREO_FOCAL_PX } else { camera.focal_px },
        baseline_m: params.number("NoiseBaseline"),
    };
    Settings { camera, noise: (noise.sigma_px > 0.0).then_some(noise), seed: seed(params), range: range(params) }
}
