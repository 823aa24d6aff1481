//! Two cameras side by side in a world that only the simulator knows: rendered, matched and triangulated (thesis 3.2).
//!
//! [`Texture`] is what the world's surfaces look like, [`Eyes`] render what both cameras see of it, a matcher of
//! [`elk_stereo`] finds the disparities, and [`SimulatedStereo`] makes a scan of those. Nothing of the true depth comes into a
//! scan but by way of the two images.

mod eyes;
mod parameters;
mod source;
mod texture;

pub use eyes::Eyes;
pub use source::{Settings, SimulatedStereo};
pub use texture::{Look, Texture};

use elk_mission::{AppType, ParamSpec, joined};

use crate::app::simulated;
use crate::parameters::{LOOKING, SIMULATED};
use crate::{matching, surroundings};

const EYES: [ParamSpec; parameters::PARAMS.len() + LOOKING.len()] = joined(parameters::PARAMS, LOOKING);
const OWN: [ParamSpec; EYES.len() + matching::PARAMS.len()] = joined(&EYES, matching::PARAMS);
const PARAMS: [ParamSpec; surroundings::PARAMS.len() + OWN.len()] = joined(surroundings::PARAMS, &OWN);

/// Its row in the table of sensors.
pub const TYPE: AppType = AppType {
    element: "Sensor",
    name: "SimulatedStereo",
    summary: "Two grey cameras in a world of triangles with a texture: rendered, matched and triangulated.",
    params: &joined::<{ PARAMS.len() + SIMULATED.len() }>(&PARAMS, SIMULATED),
    build: |params| {
        let stereo = parameters::simulated_stereo(params)?;
        let estimating = parameters::estimating(params, &stereo)?;
        simulated(params, Box::new(stereo), estimating)
    },
    preflight: Some(parameters::preflight),
};
