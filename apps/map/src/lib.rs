//! The occupancy map: log-odds voxels, scan insertion, and OctoMap's files.
//!
//! [`occupancy::OccupancyMap`] is the map and what can be asked of it, [`insertion`] how a scan gets into it, [`memory`] how
//! it gets into its successor, [`octree`] and [`bt`] how into OctoMap's files and out of them, [`app`] the process around
//! it. Metres; world frame, z up; voxel indices as in [`elk_spatial::Voxel`].

pub mod app;
pub mod bt;
pub mod frontier;
pub mod growth;
pub mod insertion;
pub mod memory;
pub mod occupancy;
pub mod octree;
mod recovery;
mod table;
pub mod walk;

pub use app::TYPES;
pub use insertion::{Dropped, Insertion};
pub use occupancy::{Grazing, MapConfig, OccupancyMap};
