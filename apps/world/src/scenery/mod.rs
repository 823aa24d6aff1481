//! The workshop in which worlds are built: solids, furniture made of them, the six worlds that come with elk, and buildings
//! of any number of rooms.
//!
//! To change a world, change its function in [`worlds`] and run `cargo run -p elk-world --example worlds`.

pub mod building;
mod furniture;
mod solid;
pub mod worlds;

pub use building::Building;
pub use solid::{Scenery, Solid};
pub use worlds::{SITES, Site};
