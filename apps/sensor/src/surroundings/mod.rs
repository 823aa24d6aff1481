//! What all simulated sensors have in common: the true world, the body in it, and how a mission file says both.

mod body;
mod parameters;
mod preflight;

pub use body::{Body, random_start};
pub(crate) use parameters::{FOV, PARAMS, body, camera, check_pixels, range, seed};
pub(crate) use preflight::preflight;
