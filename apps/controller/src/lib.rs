//! Turns paths into pose commands, scanning on the way.
//!
//! [`follower::Follower`] is the whole of it, a state machine without I/O; [`pace::Pace`] a robot that takes its
//! time; [`app`] puts them on the bus. [`player::Player`] has the frames of a recording come, and [`playback`] is it on the bus.

mod allowance;
pub mod app;
pub mod follower;
pub mod pace;
pub mod playback;
pub mod player;
mod record;
mod types;

pub use allowance::Allowance;
pub use follower::{Action, Follower};
pub use types::TYPES;
