//! The worlds that a simulated sensor sees: read from OBJ, STL, PLY and glTF, checked, and asked where their surfaces
//! are.
//!
//! | module | one idea |
//! |---|---|
//! | [`mod@read`] | one reader a format, each error with its place |
//! | [`polygon`] | polygons of any shape become triangles |
//! | [`placement`] | a file's units and axes become metres, z up |
//! | `topology`, `partition`, [`winding`] | what hangs together; walls that bound nothing; faces that look the wrong way are turned over |
//! | `regions` | what surfaces enclose together that enclose nothing by themselves |
//! | [`world`], [`bvh`], [`ray`], [`triangle`], `distance` | where surfaces are, and what is free between them |
//! | `exits`, [`openness`], [`inspection`], [`units`] | what a person wants to know of a world before it is used |
//! | [`suitability`] | whether a mission can be run in it |
//! | [`mesh`] | surfaces as few triangles, to be shown |
//! | [`truth`] | how right a map of it is |
//! | [`surface`] | how much of its surfaces a map has, and how much of the map's is there |
//! | [`scenery`] | the workshop in which the worlds that come with elk are built |

pub mod bvh;
mod distance;
mod exits;
pub mod inspection;
pub mod mesh;
pub mod openness;
mod partition;
pub mod placement;
pub mod polygon;
pub mod ray;
pub mod read;
mod regions;
pub mod scenery;
pub mod suitability;
pub mod surface;
mod topology;
pub mod triangle;
pub mod truth;
pub mod units;
pub mod winding;
pub mod world;

pub use mesh::Mesh;
pub use placement::Placement;
pub use read::Format;
pub use world::{BUILT_IN, CAR_INTERIOR, START_CLEARANCE_M, World, WorldError};
