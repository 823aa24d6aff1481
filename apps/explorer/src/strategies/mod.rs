//! The strategies that come with elk: which goal to go to, and which way.
//!
//! A new one is a type that implements [`Strategy`](crate::Strategy): in a program of its own ([`crate::main`]), or in a module
//! here, whose `TYPE` is then a row of [`TYPES`].

mod card;
mod closest_frontier;
mod potential;

pub use card::Card;
pub use closest_frontier::ClosestFrontier;
pub use potential::{Potential, Start};

use elk_mission::AppType;

/// The explorers that a mission file can name.
pub static TYPES: &[AppType] = &[closest_frontier::TYPE, potential::TYPE];
