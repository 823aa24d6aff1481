//! A dense copy of the known part of a map, for passes that touch every voxel.

use std::ops::Deref;

use crate::bricks::{BRICK, BRICK_CELLS, voxel_at};
use crate::grid::OccupancyGrid;
use crate::region::Region;
use crate::state::State;
use crate::states::Cells;
use crate::voxel::Voxel;

/// A [`Region`] with the state of each of its voxels. Around what is known lies a margin of unknown voxels, so that the
/// index of a known voxel's neighbour always is in the box.
#[derive(Debug, Clone)]
pub struct Volume {
    region: Region,
    /// Smallest corner of what may be known, and the corner beyond the largest.
    within: (Voxel, Voxel),
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
        let corners = corners(include, grid.bricks().iter().map(|(brick, _)| brick));
        Self::between(grid, corners, margin)
    }

    /// The part of `grid` from a smallest corner up to the one beyond the largest, with `margin` (at least one voxel) around
    /// of which nothing is known.
    pub fn between(grid: &OccupancyGrid, within: (Voxel, Voxel), margin: i32) -> Self {
        let mut volume = Self::unknown(within, margin, grid.resolution());
        grid.bricks().iter().for_each(|(brick, _)| volume.follow(grid, brick, |_| {}));
        volume
    }

    /// The same of a grid of voxels of `resolution` (m) of which nothing is known yet.
    fn unknown(within: (Voxel, Voxel), margin: i32, resolution: f64) -> Self {
        let (min, max) = within;
        let margin = margin.max(1);
        let origin = min - Voxel::new(margin, margin, margin);
        let size = max - origin + Voxel::new(margin, margin, margin);
        let dim = size.to_array().map(|n| n as usize);
        let region = Region::new(origin, dim, resolution);
        Self { states: vec![State::Unknown; region.len()], region, within }
    }

    /// Takes over what is known of a brick now, row by row; the index of each voxel that is other than it was is told to
    /// `changed`.
    pub fn follow(&mut self, grid: &OccupancyGrid, brick: Voxel, mut changed: impl FnMut(usize)) {
        let ((min, max), first) = (self.within, voxel_at(brick, 0));
        let cells = grid.bricks().brick(brick).map_or([State::Unknown; BRICK_CELLS], Cells::unpack);
        let (from, to) = (first.x.max(min.x), (first.x + BRICK).min(max.x));
        for (n, line) in cells.chunks_exact(BRICK as usize).enumerate() {
            let (y, z) = (first.y + n as i32 % BRICK, first.z + n as i32 / BRICK);
            if from >= to || !(min.y..max.y).contains(&y) || !(min.z..max.z).contains(&z) {
                continue;
            }
            let line = &line[(from - first.x) as usize..(to - first.x) as usize];
            let Some(i) = self.region.index(Voxel::new(from, y, z)) else { continue };
            let own = &mut self.states[i..i + line.len()];
            if own != line {
                own.iter().zip(line).enumerate().filter(|(_, (own, new))| own != new).for_each(|(n, _)| changed(i + n));
                own.copy_from_slice(line);
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
