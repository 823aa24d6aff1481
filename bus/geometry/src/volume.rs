//! A dense copy of the known part of a map, for passes that touch every voxel.

use std::ops::Deref;

use crate::bricks::{BRICK, voxel_at};
use crate::grid::OccupancyGrid;
use crate::region::Region;
use crate::state::{Cells, State};
use crate::voxel::Voxel;

/// A [`Region`] with the state of each of its voxels. Around what is known lies a margin of unknown voxels, so that the
/// index of a known voxel's neighbour always is in the box.
#[derive(Debug, Clone)]
pub struct Volume {
    region: Region,
    states: Vec<State>,
}

/// All that a region answers, it answers.
impl Deref for Volume {
    type Target = Region;

    fn deref(&self) -> &Region {
        &self.region
    }
}

impl Volume {
    /// The known part of `grid` and `include`, with `margin` (at least one voxel) around.
    pub fn of(grid: &OccupancyGrid, include: Voxel, margin: i32) -> Self {
        let (min, max) = corners(include, grid.bricks().iter().map(|(brick, _)| brick));
        let around = Voxel::new(margin.max(1), margin.max(1), margin.max(1));
        let dim = (max - min + around + around).to_array().map(|n| n as usize);
        let region = Region::new(min - around, dim, grid.resolution());
        let mut volume = Self { states: vec![State::Unknown; region.len()], region };
        grid.bricks().iter().for_each(|(brick, cells)| volume.take(brick, cells));
        volume
    }

    /// Takes over what is known of a brick.
    fn take(&mut self, brick: Voxel, cells: &Cells) {
        for (cell, state) in cells.unpack().into_iter().enumerate() {
            if let Some(i) = self.region.index(voxel_at(brick, cell)) {
                self.states[i] = state;
            }
        }
    }

    /// The voxels.
    pub fn region(&self) -> &Region {
        &self.region
    }

    /// The state of a voxel; unknown outside the box.
    pub fn state(&self, voxel: Voxel) -> State {
        self.index(voxel).map_or(State::Unknown, |i| self.states[i])
    }

    /// All states, by index.
    pub fn states(&self) -> &[State] {
        &self.states
    }
}

/// Smallest corner, and the corner beyond the largest, of bricks and of a voxel.
pub fn corners(include: Voxel, bricks: impl Iterator<Item = Voxel>) -> (Voxel, Voxel) {
    let (mut min, mut max) = (include, include + Voxel::new(1, 1, 1));
    for brick in bricks {
        let low = voxel_at(brick, 0);
        min = Voxel::new(min.x.min(low.x), min.y.min(low.y), min.z.min(low.z));
        let high = low + Voxel::new(BRICK, BRICK, BRICK);
        max = Voxel::new(max.x.max(high.x), max.y.max(high.y), max.z.max(high.z));
    }
    (min, max)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_copy_is_the_map() {
        let mut grid = OccupancyGrid::new(0.1);
        let cells = [(Voxel::new(-9, 3, 0), State::Free), (Voxel::new(17, 3, 5), State::Occupied)];
        for (v, s) in cells {
            grid.set(v, s);
        }
        let volume = Volume::of(&grid, Voxel::new(40, 0, 0), 2);
        let known = (0..volume.len()).filter(|&i| volume.states()[i] != State::Unknown);
        assert_eq!(known.map(|i| (volume.voxel(i), volume.states()[i])).collect::<Vec<_>>(), cells);
        assert!(volume.index(Voxel::new(42, 0, 0)).is_some(), "the margin");
        assert_eq!(volume.index(Voxel::new(43, 0, 0)), None);
        for i in 0..volume.len() {
            assert_eq!(volume.index(volume.voxel(i)), Some(i));
        }
    }
}
