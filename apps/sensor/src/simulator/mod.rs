//! A depth camera in a world that only the simulator knows (thesis 3.3).

mod noise;
mod parameters;
mod source;

pub use noise::StereoNoise;
pub use source::{Settings, Simulator};

use elk_bus::AppError;
use elk_mission::{AppType, ParamSpec, Params, joined};

use crate::app::simulated;
use crate::localised::Estimating;
use crate::parameters::{DEAD_RECKONING, SIMULATED, dead_reckoning};
use crate::surroundings::{self, seed};

const OWN: [ParamSpec; parameters::PARAMS.len() + DEAD_RECKONING.len()] = joined(parameters::PARAMS, DEAD_RECKONING);
const PARAMS: [ParamSpec; OWN.len() + surroundings::PARAMS.len()] = joined(surroundings::PARAMS, &OWN);

/// Its row in the table of sensors.
pub const TYPE: AppType = AppType {
    element: "Sensor",
    name: "Simulator",
    summary: "A depth camera in a world of triangles, by ray casting; moves on pose commands and counts contacts.",
    params: &joined::<{ PARAMS.len() + SIMULATED.len() }>(&PARAMS, SIMULATED),
    build: |params| simulated(params, Box::new(parameters::simulator(params)?), estimating(params)?),
    preflight: Some(parameters::preflight),
};

fn estimating(params: &Params) -> Result<Option<Estimating>, AppError> {
    match params.text("PoseEstimator") {
        "Odometry" => dead_reckoning(params, seed(params)).map(Some),
        _ => Ok(None),
    }
}
