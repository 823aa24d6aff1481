//! What is to be resolved: a frontier voxel, and what is known around it.

use elk_geometry::frontier::Faces;
use elk_geometry::{FrontierSet, OccupancyGrid, Voxel};
use nalgebra::{Point3, Vector3};

use crate::sight::Sight;
use crate::space::Space;

/// A map, and the frontier that is kept up to date with it.
#[derive(Debug, Clone, Copy)]
pub struct Known<'a> {
    /// The map.
    pub grid: &'a OccupancyGrid,
    /// Its frontier.
    pub frontier: &'a FrontierSet,
    /// What the camera sees that looks there.
    pub sight: Sight,
}

impl<'a> Known<'a> {
    /// What makes `voxel` frontier ([`FrontierSet::unknown_beside`]).
    pub fn unknown_beside(self, voxel: Voxel) -> impl Iterator<Item = Voxel> {
        self.frontier.unknown_beside(voxel).beside(voxel)
    }

    /// The frontier voxels at most `range_m` from `place` (m, world).
    pub fn frontier_near(self, place: Point3<f64>, range_m: f64) -> impl Iterator<Item = Voxel> + 'a {
        let resolution = self.grid.resolution();
        let corner = |d: f64| Voxel::containing(place + Vector3::repeat(d), resolution);
        let voxels = self.frontier.within(corner(-range_m), corner(range_m));
        voxels.filter(move |voxel| (voxel.center(resolution) - place).norm() <= range_m)
    }
}

/// A frontier voxel to be resolved.
#[derive(Debug, Clone, PartialEq)]
pub struct Target {
    /// The frontier voxel.
    pub voxel: Voxel,
    /// On which of its faces lies what is unknown, and makes it frontier.
    pub faces: Faces,
    /// Voxels from which it was looked at in vain.
    pub tried: Vec<Voxel>,
}

impl Target {
    /// The target of frontier voxel `voxel`, which was looked at in vain from the voxels `tried`.
    pub fn new(known: Known, voxel: Voxel, tried: Vec<Voxel>) -> Self {
        Self { voxel, faces: known.frontier.unknown_beside(voxel), tried }
    }

    /// Its unknown face neighbours that make it frontier.
    pub fn unknown(&self) -> impl Iterator<Item = Voxel> + Clone + use<> {
        self.faces.beside(self.voxel)
    }

    /// Whether a camera at `from` (m, world) sees any of the unknown, from a place not tried yet.
    pub fn seen_from(&self, space: &Space, from: Point3<f64>) -> bool {
        self.untried(Voxel::containing(from, space.resolution()))
            && self.unknown().any(|unknown| space.sees(from, unknown))
    }

    /// Whether looking from `voxel` would be something new.
    pub fn untried(&self, voxel: Voxel) -> bool {
        is_untried(&self.tried, voxel)
    }
}

/// Whether looking from `voxel` would be something new to who has looked from the voxels `tried`.
pub(crate) fn is_untried(tried: &[Voxel], voxel: Voxel) -> bool {
    tried.iter().all(|t| t.distance(voxel) > 1.5)
}
