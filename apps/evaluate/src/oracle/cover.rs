//! A part of what is to be seen, a bit a voxel.

use elk_geometry::mask::{self, Mask};
use elk_geometry::{OccupancyGrid, VoxelSet};

/// Voxels of a set, by brick in the order in which that has them.
#[derive(Debug, Clone, PartialEq)]
pub struct Cover {
    bricks: Vec<Mask>,
}

impl Cover {
    /// Nothing of what is wanted.
    pub fn none(wanted: &VoxelSet) -> Self {
        Self { bricks: vec![mask::NONE; wanted.bricks().count()] }
    }

    /// What of it a map knows.
    pub fn of(wanted: &VoxelSet, map: &OccupancyGrid) -> Self {
        let known = |brick| map.bricks().brick(brick).map_or(mask::NONE, |cells| *cells.known());
        Self { bricks: wanted.bricks().map(|(brick, wanted)| mask::and(&known(brick), wanted)).collect() }
    }

    /// Puts in what is in another one.
    pub fn add(&mut self, other: &Self) {
        self.bricks.iter_mut().zip(&other.bricks).for_each(|(own, others)| *own = mask::or(own, others));
    }

    /// How many more there would be with another one.
    pub fn gain(&self, other: &Self) -> usize {
        self.bricks.iter().zip(&other.bricks).map(|(own, others)| mask::count(&mask::without(others, own))).sum()
    }

    /// Whether it has a cell of the brick of this place in the order.
    pub fn has(&self, brick: usize, cell: usize) -> bool {
        mask::has(&self.bricks[brick], cell)
    }

    /// What share of a part of what is wanted it has (0 to 1).
    pub fn share_of(&self, wanted: &VoxelSet, part: &VoxelSet) -> f64 {
        let own = wanted.bricks().zip(&self.bricks);
        let count: usize = own.map(|((brick, _), own)| mask::count(&mask::and(own, part.brick(brick)))).sum();
        count as f64 / part.len().max(1) as f64
    }
}
