//! Voxels, and what is worked out on them: grids of what is free and what is occupied, frontiers, rays, sight, clearance,
//! shortest ways. No bus, no clock, no file: a robot's map for whoever has one.
//!
//! Metres, radians; right-handed, z up; camera frame x right, y down, z forward.
//!
//! | what | where |
//! |---|---|
//! | cells of the lattice over the world, boxes | [`voxel`]; how far they go: [`limits`] |
//! | values by voxel, sparse: bricks of 8×8×8 | [`bricks`]; sets of a brick's cells: [`mask`], of voxels: [`set`] |
//! | what is free, occupied, unknown | [`state`], [`states`], [`grid`]; what changed, for whoever keeps a copy: [`delta`] |
//! | where what is known ends, and what of it hangs together | [`frontier`], [`clusters`] |
//! | a dense box of voxels with numbers | [`region`] |
//! | which voxels a segment passes, and what is seen from where | [`ray`], [`visibility`] |
//! | where a body of some size can be, what hangs together, and the shortest way there | [`clearance`], [`component`], [`astar`] |
//! | ways in straight lines, and where a camera is; short tours past many places | [`polyline`], [`pose`]; [`tour`] |
//! | numbers drawn by lot, the same on every machine | [`random`] |
//!
//! ```
#![doc = include_str!("../examples/rooms.rs")]
//! ```
//!
//! What a robot would send to another one ([`Voxel`], [`Pose`], [`state::BrickStates`]) has serde's traits and describes
//! itself ([`elk_describe::Describe`]): field names, units, and what a value has to keep to.

pub mod astar;
pub mod bricks;
pub mod clearance;
pub mod clusters;
pub mod component;
pub mod delta;
pub mod frontier;
pub mod grid;
pub mod limits;
pub mod mask;
pub mod polyline;
pub mod pose;
pub mod random;
pub mod ray;
pub mod region;
mod searches;
pub mod set;
pub mod state;
pub mod states;
pub mod tour;
pub mod visibility;
pub mod voxel;

pub use bricks::Bricks;
pub use clearance::Clearance;
pub use clusters::Clusters;
pub use component::Component;
pub use delta::Delta;
pub use frontier::FrontierSet;
pub use grid::OccupancyGrid;
pub use polyline::Polyline;
pub use pose::Pose;
pub use region::Region;
pub use set::VoxelSet;
pub use state::State;
pub use voxel::{Bounds, Voxel};

#[cfg(doctest)]
#[doc = include_str!("../README.md")]
struct Readme;
