//! An occupancy map: log-odds voxels, exact scan insertion, its frontier, and OctoMap's files. Without a bus: a robot's map for
//! whoever has scans.
//!
//! [`OccupancyMap`] is the map and what can be asked of it, [`insertion`] how a scan gets into it, [`snapshot`] how all that
//! it knows is kept and had again, [`octree`] and [`bt`] how it gets into OctoMap's files and out of them. Metres; world
//! frame, z up; voxel indices as in [`elk_geometry::Voxel`].
//!
//! ```
#![doc = include_str!("../examples/scan.rs")]
//! ```

pub mod bt;
mod fan;
mod frontier;
mod growth;
pub mod insertion;
mod marks;
pub mod occupancy;
pub mod octree;
pub mod snapshot;
mod table;
mod volume;
mod walk;

pub use insertion::{Dropped, Insertion};
pub use occupancy::{ConfigError, Grazing, Integration, MapConfig, OccupancyMap};
pub use snapshot::{RestoreError, Snapshot};

#[cfg(doctest)]
#[doc = include_str!("../README.md")]
struct Readme;
