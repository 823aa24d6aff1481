//! A depth camera in a world that only the simulator knows (thesis 3.3), and the body that carries it.

mod noise;
mod parameters;
mod preflight;
mod source;

pub use noise::StereoNoise;
pub use source::{Settings, Simulator, random_start};

use elk_mission::{AppType, joined};

use crate::app::{COMMON, app};

/// Its row in the table of sensors.
pub const TYPE: AppType = AppType {
    element: "Sensor",
    name: "Simulator",
    summary: "A depth camera in a world of triangles, by ray casting; moves on pose commands and counts contacts.",
    params: &joined::<{ parameters::PARAMS.len() + COMMON.len() }>(parameters::PARAMS, COMMON),
    build: |params| app(params, Box::new(parameters::simulator(params)?)),
    preflight: Some(preflight::preflight),
};
