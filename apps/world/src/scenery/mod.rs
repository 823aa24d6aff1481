//! The workshop in which worlds are built: solids, furniture made of them, the six worlds that come with elk, buildings
//! of any number of rooms, and the worlds that only suites explore.
//!
//! To change a world, change its function in [`worlds`], or here, and run `cargo run -p elk-world --example worlds`.

pub mod building;
pub mod cube;
mod furniture;
mod solid;
pub mod worlds;

pub use building::Building;
pub use solid::{Scenery, Solid};
pub use worlds::{SITES, Site};

/// A world's file, without its ending, and what builds it.
pub type Model = (&'static str, fn() -> Scenery);

/// The worlds of `mission-files/suites/worlds`, which no mission is in.
pub const OF_SUITES: [Model; 2] = [("cube", cube::build), ("office", office)];

/// A storey of eight rooms along a corridor, 16.2 × 9 × 2.4 m: about as large as the apartment of NBVP's experiments (20 × 10 × 3 m;
/// Bircher et al., ICRA 2016).
fn office() -> Scenery {
    Building::new(8, 1).scenery()
}
