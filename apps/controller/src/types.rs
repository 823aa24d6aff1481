//! The controllers that come with elk.

use elk_mission::AppType;

use crate::{app, playback, velocity};

/// The controllers that a mission file can name.
pub static TYPES: &[AppType] = &[app::TYPE, playback::TYPE, velocity::TYPE];
