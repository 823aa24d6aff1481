//! The strategies that come with elk: which goal to go to, and which way.
//!
//! A new one is a type that implements [`Strategy`](crate::Strategy): in a program of its own ([`crate::main`]), or in a module
//! here, whose `TYPE` is then a row of [`TYPES`].

mod candidates;
mod card;
mod closest_frontier;
mod groups;
mod information_gain;
mod potential;
mod random;
mod receding_horizon;
#[cfg(test)]
mod rooms;
mod tour;
mod weighted_information_gain;

pub use closest_frontier::ClosestFrontier;
pub use information_gain::InformationGain;
pub use potential::{Potential, Start};
pub use random::Random;
pub use receding_horizon::{RecedingHorizon, Settings as RecedingHorizonSettings};
pub use tour::Tour;
pub use weighted_information_gain::WeightedInformationGain;

use elk_mission::AppType;

/// The explorers that a mission file can name.
pub static TYPES: &[AppType] = &[
    closest_frontier::TYPE,
    potential::TYPE,
    random::TYPE,
    information_gain::TYPE,
    weighted_information_gain::TYPE,
    tour::TYPE,
    receding_horizon::TYPE,
];
