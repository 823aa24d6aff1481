//! Turns paths into pose commands, scanning on the way.
//!
//! [`follower::Follower`] is the whole of it, a state machine without I/O, whose robot is where it is sent at once, or [`drive`]s
//! there; [`pace::Pace`] holds it back for who watches; [`app`] puts them on the bus. [`player::Player`] has the frames of a recording come, and [`playback`] is it on the bus.

mod allowance;
pub mod app;
pub mod drive;
pub mod follower;
pub mod pace;
pub mod playback;
pub mod player;
mod types;
mod velocity;

pub use allowance::Allowance;
pub use follower::{Action, Follower};
pub use types::TYPES;
