//! An occupancy map: log-odds voxels, exact scan insertion, its frontier, and OctoMap's files. Without a bus: a robot's map for
//! whoever has scans.
//!
//! [`OccupancyMap`] is the map and what can be asked of it, [`insertion`] how a scan gets into it, [`uncertain`] how one
//! does whose sensor errs along its rays ([`depth_error`]), [`edit`] what is done to it on request, [`comparison`] how much of
//! it another map has, [`snapshot`] how all that it knows is kept and had again. [`saved`] is a map in a file of any kind: its own,
//! [`elkmap`], or OctoMap's, [`octomap`], by way of an [`octree`]. Metres; world frame, z up; voxel indices as in
//! [`elk_geometry::Voxel`].
//!
//! ```
#![doc = include_str!("../examples/scan.rs")]
//! ```

mod bytes;
pub mod comparison;
pub mod depth_error;
pub mod edit;
pub mod elkmap;
mod fan;
mod frontier;
mod growth;
pub mod insertion;
mod log_odds;
mod marks;
pub mod occupancy;
pub mod octomap;
pub mod octree;
pub mod saved;
pub mod snapshot;
mod table;
mod tree_file;
pub mod uncertain;
mod volume;
mod walk;

pub use depth_error::DepthError;
pub use insertion::{Dropped, Insertion};
pub use occupancy::{ConfigError, Grazing, Integration, MapConfig, OccupancyMap};
pub use saved::{Format, Saved, SavedError};
pub use snapshot::{RestoreError, Snapshot};

#[cfg(doctest)]
#[doc = include_str!("../README.md")]
struct Readme;
