//! Where to go next: frontier exploration of an occupancy grid, one module per strategy behind one trait.
//!
//! The way through the code, in the order in which a plan is made ([`explore::Explorer::plan`]):
//! [`extent`] says which part of the map, [`volume`] takes a dense copy of it, [`space`] says where the robot can be, [`goals`] from where each frontier
//! voxel can be resolved (with [`visibility`]), a [`strategy`] chooses one and a way to it (with [`astar`], or with
//! [`laplace`] and [`streamline`]), and [`policy`] makes of it a path with scans. [`app`] puts that on the bus.

pub mod app;
pub mod astar;
pub mod explore;
pub mod extent;
pub mod goals;
pub mod laplace;
pub mod policy;
mod requests;
pub mod space;
pub mod strategy;
pub mod streamline;
pub mod visibility;
pub mod volume;

pub use app::TYPES;
pub use explore::{Explorer, Settings};
pub use policy::Policy;
pub use strategy::{ClosestFrontier, Potential, Strategy};
