//! A 2-D laser in a world that only the simulator knows: a fan of beams in its own plane.
//!
//! [`SimulatedLaser2d`] measures ranges, with an error, and sees nothing above its plane or below. A robot that carries it level sees a
//! slice of the world, which the explorer's `Planar` explores. Where it is not told where it is, its scans are matched in the plane.

mod matched;
mod parameters;
mod source;

pub use matched::LaserMatching;
pub use source::{Settings, SimulatedLaser2d};

use elk_mission::{AppType, ParamSpec, joined};

use crate::app::simulated;
use crate::parameters::SIMULATED;
use crate::surroundings;

const OWN: [ParamSpec; surroundings::PARAMS.len() + parameters::PARAMS.len()] =
    joined(surroundings::PARAMS, parameters::PARAMS);

/// Its row in the table of sensors.
pub const TYPE: AppType = AppType {
    element: "Sensor",
    name: "SimulatedLaser2D",
    summary: "A 2-D laser in a world of triangles: a fan of beams that measure ranges with noise, for a robot that explores a slice of it.",
    params: &joined::<{ OWN.len() + SIMULATED.len() }>(&OWN, SIMULATED),
    build: |params| {
        let laser = parameters::laser(params)?;
        let estimating = parameters::estimating(params, &laser)?;
        simulated(params, Box::new(laser), estimating)
    },
    preflight: Some(parameters::preflight),
};
