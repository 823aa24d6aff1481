//! A depth camera in a world that only the simulator knows (thesis 3.3).

mod noise;
mod parameters;
mod source;

pub use noise::StereoNoise;
pub use source::{Settings, Simulator};

use elk_mission::{AppType, joined};

use crate::app::app;
use crate::parameters::COMMON;
use crate::surroundings;

const PARAMS: [elk_mission::ParamSpec; parameters::PARAMS.len() + surroundings::PARAMS.len()] =
    joined(surroundings::PARAMS, parameters::PARAMS);

/// Its row in the table of sensors.
pub const TYPE: AppType = AppType {
    element: "Sensor",
    name: "Simulator",
    summary: "A depth camera in a world of triangles, by ray casting; moves on pose commands and counts contacts.",
    params: &joined::<{ PARAMS.len() + COMMON.len() }>(&PARAMS, COMMON),
    build: |params| app(params, Box::new(parameters::simulator(params)?)),
    preflight: Some(surroundings::preflight),
};
