//! The workshop in which the worlds that come with elk are built: solids, furniture made of them, and the six worlds.
//!
//! To change a world, change its function in [`worlds`] and run `cargo run -p elk-world --example worlds`.

mod furniture;
mod solid;
pub mod worlds;

pub use solid::{Scenery, Solid};
pub use worlds::{SITES, Site};
