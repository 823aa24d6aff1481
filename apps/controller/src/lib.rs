//! Turns paths into pose commands, scanning on the way.
//!
//! [`follower::Follower`] is the whole of it, a state machine without I/O; [`pace::Pace`] a robot that takes its
//! time; [`app`] puts them on the bus.

mod allowance;
pub mod app;
pub mod follower;
pub mod pace;
mod record;

pub use allowance::Allowance;
pub use app::TYPES;
pub use follower::{Action, Follower};
