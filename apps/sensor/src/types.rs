//! The sensors that come with elk.

use elk_mission::AppType;

use crate::{laser2d, rgbd, simulated_laser2d, simulated_stereo, simulator, stereo};

/// The sensors that a mission file can name.
pub static TYPES: &[AppType] =
    &[simulator::TYPE, simulated_stereo::TYPE, simulated_laser2d::TYPE, stereo::TYPE, rgbd::TYPE, laser2d::TYPE];
