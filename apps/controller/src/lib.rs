//! Turns paths into pose commands, scanning on the way.
//!
//! [`follower::Follower`] is the whole of it, a state machine without I/O; [`app`] puts it on the bus.

pub mod app;
pub mod follower;
mod record;

pub use app::TYPES;
pub use follower::{Follower, Output};
