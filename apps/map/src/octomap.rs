//! OctoMap's files (Hornung et al., *OctoMap*, 2013; the library of version 1.9): [`bt`] (occupied, free or unknown, two bits a
//! child) and [`ot`] (log-odds) both ways, and [`graph`] (scans and the poses that they were taken from) for reading.
//!
//! The first two are a text header, its last line `data`, then the nodes of an [octree](crate::octree), depth first.

pub mod bt;
pub mod graph;
mod header;
pub mod ot;

pub use crate::tree_file::{Cubes, TreeFile, TreeFileError};
