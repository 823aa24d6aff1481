//! Where to go next: frontier exploration of an occupancy grid, one module per strategy behind one trait.
//!
//! The way through the code, in the order in which a plan is made ([`explore::Explorer::plan`]):
//! [`space`] says where the robot can be, in sets of voxels ([`elk_geometry::set`]), [`goals`] from where each frontier voxel
//! can be resolved (with [`elk_geometry::visibility`]; what was found before is in [`verdicts`]), all of which is kept from plan
//! to plan and brought up to date where the map has changed; a [`strategy`] chooses one and a way to it (with
//! [`elk_geometry::astar`], or with [`elk_field`] in an [`extent`]), and [`policy`] makes of it a path with scans. A way that cannot be gone is its strategy's fault ([`route_fault`]).
//! [`app`] puts that on the bus, [`program`] makes it a program.
//!
//! # A strategy of one's own
//!
//! A crate that depends on this one and has this `main.rs` is an explorer; `elk new explorer NAME` makes such a crate.
//!
//! ```no_run
#![doc = include_str!("../examples/level.rs")]
//! ```
//!
//! [`View::goals`] are the places to choose from, [`View::cheapest`] is the shortest way to the one that costs least, and
//! [`View::ways`] gives lengths and ways one by one. What it weighs and counts goes into the [`Journal`], and from there to
//! whoever looks on (`EXPLORER_GOALS`, the report); what the next one of its kind is to know it leaves with
//! [`Strategy::memory`], as a [`payload`] of its own. Whatever it chooses, [`Policy`] says how far the way is followed and
//! where scans are taken, so that strategies can be compared. [`Room`] is a place to try one in.

/// The text of the example above, with which `elk new explorer` begins.
pub const EXAMPLE: &str = include_str!("../examples/level.rs");

pub mod app;
pub mod explore;
pub mod extent;
pub mod goals;
pub mod journal;
mod pictures;
pub mod policy;
pub mod program;
mod requests;
pub mod route_fault;
pub mod sight;
pub mod space;
pub mod strategies;
pub mod strategy;
pub mod strategy_memory;
pub mod target;
mod trial;
pub mod verdicts;
pub mod ways;
pub mod weighed;

/// What a strategy's own memory needs: `#[payload]` makes it of a struct, in a crate that depends on `elk-bus`.
pub use elk_bus::{DecodeError, payload};
pub use elk_geometry;
pub use elk_mission::{Kind, ParamSpec, Params};
pub use explore::{Explorer, Settings};
pub use goals::{Goal, Goals};
pub use journal::Journal;
pub use nalgebra;
pub use policy::Policy;
pub use program::{main, main_with};
pub use route_fault::RouteFault;
pub use sight::Sight;
pub use strategies::{
    ClosestFrontier, InformationGain, Potential, Random, RecedingHorizon, TYPES, Tour, WeightedInformationGain,
};
pub use strategy::{Route, Strategy, View};
pub use strategy_memory::{LeaveError, StrategyMemory};
pub use target::Target;
pub use trial::Room;
pub use ways::Ways;
