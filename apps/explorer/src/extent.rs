//! Which part of the map a field is solved over: all that is known as long as that is not too much, else what the robot can
//! get to, or what of it is near.
//!
//! A dense box costs by its extent, and one stray point far away makes that of the whole map as large as anybody likes. Bricks cost
//! by their number, so that only where there are too many a box says which.

use elk_geometry::bricks::{BRICK_CELLS, corners};
use elk_geometry::mask::{self, Mask};
use elk_geometry::{Region, Voxel};

use crate::space::Space;

/// A box of voxels around the robot's own: its smallest corner, and the corner beyond the largest.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Extent {
    /// Smallest corner.
    pub min: Voxel,
    /// The corner beyond the largest.
    pub max: Voxel,
    /// Voxels around it of which nothing is said.
    margin: i32,
    /// Whether the robot can get to voxels that are not in it.
    is_cut: bool,
}

impl Extent {
    /// What a robot's space has in it, or of it what the robot can get to, or what is near, so that with a margin around it is of
    /// at most `budget` voxels.
    pub fn of(space: &Space, budget: usize) -> Self {
        let (robot, margin) = (space.component.start(), space.margin());
        let fits = |(min, max): (Voxel, Voxel)| voxels(min, max, margin) <= budget as u64;
        let known = corners(robot, space.known().into_iter().flatten());
        if fits(known) {
            return Self { min: known.0, max: known.1, margin, is_cut: false };
        }
        let reached = space.reach.bricks().filter(|(_, cells)| **cells != mask::NONE).map(|(brick, _)| brick);
        let around = Voxel::new(margin, margin, margin);
        let (min, max) = corners(robot, reached);
        let (min, max) = (min - around, max + around);
        let is_cut = !fits((min, max));
        let (min, max) = if is_cut { near(robot, (min, max), fits) } else { (min, max) };
        Self { min, max, margin, is_cut }
    }

    /// For a solver that keeps only the bricks that the robot can get to: all of these as long as they are of at most `budget`
    /// voxels, wherever they are, else a box.
    pub fn of_bricks(space: &Space, budget: usize) -> Self {
        let bricks = space.reach.bricks().filter(|(_, cells)| **cells != mask::NONE).count();
        if bricks * BRICK_CELLS > budget {
            return Self::of(space, budget);
        }
        let [min, max] = [i32::MIN, i32::MAX].map(|end| Voxel::new(end, end, end));
        Self { min, max, margin: space.margin(), is_cut: false }
    }

    /// The cells of a brick that are in the box.
    pub fn cells(&self, brick: Voxel) -> Mask {
        mask::within(brick, [self.min, self.max - Voxel::new(1, 1, 1)])
    }

    /// Its voxels with the margin, numbered.
    pub fn region(&self, resolution: f64) -> Region {
        let around = Voxel::new(self.margin, self.margin, self.margin);
        let dim = (self.max - self.min + around + around).to_array().map(|n| n as usize);
        Region::new(self.min - around, dim, resolution)
    }

    /// Whether of what the robot can get to the same is in both.
    pub fn has_the_same_reached(&self, other: &Self) -> bool {
        self == other || !self.is_cut && !other.is_cut
    }

    /// Whether a voxel is in the box.
    pub fn contains(&self, voxel: Voxel) -> bool {
        let (min, max, voxel) = (self.min.to_array(), self.max.to_array(), voxel.to_array());
        (0..3).all(|axis| (min[axis]..max[axis]).contains(&voxel[axis]))
    }
}

/// Number of voxels of a box with `margin` voxels around.
fn voxels(min: Voxel, max: Voxel, margin: i32) -> u64 {
    let edges = (max - min).to_array().map(|n| u64::from((n + 2 * margin).unsigned_abs()));
    edges.iter().fold(1, |product, edge| product.saturating_mul(*edge))
}

/// The largest part of a box that reaches equally far along each axis from a place near the robot, as far as the box goes, and
/// fits. The place is the robot's own but for an eighth of that: it changes in steps, and the part with it.
fn near(robot: Voxel, within: (Voxel, Voxel), fits: impl Fn((Voxel, Voxel)) -> bool) -> (Voxel, Voxel) {
    let step = 1 << (reach(robot, within, &fits) / 4).max(1).ilog2();
    let middle = robot.to_array().map(|c| c.div_euclid(step) * step + step / 2).into();
    part(middle, within, reach(middle, within, &fits))
}

/// How far the largest part of a box reaches from `middle` that fits.
fn reach(middle: Voxel, within: (Voxel, Voxel), fits: &impl Fn((Voxel, Voxel)) -> bool) -> i32 {
    let (mut reach, mut too_far) = (0, 1 << 18);
    while too_far - reach > 1 {
        let between = (reach + too_far) / 2;
        if fits(part(middle, within, between)) { reach = between } else { too_far = between }
    }
    reach
}

/// The part of a box that reaches so far from `middle` along each axis.
fn part(middle: Voxel, (min, max): (Voxel, Voxel), reach: i32) -> (Voxel, Voxel) {
    let around = Voxel::new(reach, reach, reach);
    (min.sup(middle - around), max.inf(middle + around + Voxel::new(1, 1, 1)))
}

#[cfg(test)]
mod tests {
    use elk_geometry::bricks::voxel_at;
    use elk_geometry::{Clearance, OccupancyGrid, State};

    use super::*;

    /// A robot at `x` in a corridor of `length` free voxels along x, and a stray voxel of this state 30,000 voxels away.
    fn corridor(length: i32, stray: State, x: i32) -> Space {
        let mut grid = OccupancyGrid::new(0.1);
        let free: Vec<Voxel> = (0..length).map(|x| Voxel::new(x, 0, 0)).collect();
        free.iter().for_each(|voxel| assert!(grid.set(*voxel, State::Free)));
        grid.set(Voxel::new(30_000, -30_000, 30_000), stray);
        Space::around(&grid, Voxel::new(x, 0, 0), &Clearance::default(), (&free, &[]))
    }

    #[test]
    fn all_that_is_known_is_in_it_if_it_is_not_too_much() {
        let extent = Extent::of(&corridor(40, State::Unknown, 3), 10_000);
        assert_eq!((extent.min, extent.max), (Voxel::new(0, 0, 0), Voxel::new(40, 8, 8)));
        assert_eq!(extent.region(0.1).dim(), [44, 12, 12]);
    }

    /// Regression: one stray point at 3 km made the explorer ask for 24 TB.
    #[test]
    fn what_is_far_away_and_apart_is_left_out() {
        for stray in [State::Free, State::Occupied] {
            let extent = Extent::of(&corridor(40, stray, 3), 20_000);
            assert_eq!((extent.min, extent.max), (Voxel::new(-2, -2, -2), Voxel::new(42, 10, 10)));
        }
    }

    #[test]
    fn bricks_are_all_in_it_wherever_they_are_as_long_as_there_are_not_too_many() {
        // 5 bricks, in a box that is larger than all that may be.
        let space = corridor(40, State::Free, 3);
        let extent = Extent::of_bricks(&space, 5 * BRICK_CELLS);
        assert!(space.reach.iter().all(|voxel| extent.contains(voxel)) && !extent.is_cut);
        assert_eq!(extent.cells(Voxel::new(4, 0, 0)), mask::ALL);
        let few = 10_000;
        let too_many = corridor(30_000, State::Free, 1000);
        let extent = Extent::of_bricks(&too_many, few);
        assert_eq!(extent, Extent::of(&too_many, few));
        assert!(extent.is_cut && !extent.has_the_same_reached(&Extent::of_bricks(&space, few)));
        for (brick, _) in too_many.reach.bricks() {
            let is_in = |cell: &usize| extent.contains(voxel_at(brick, *cell));
            let cells: Vec<usize> = (0..BRICK_CELLS).filter(is_in).collect();
            assert_eq!(mask::cells(&extent.cells(brick)).collect::<Vec<_>>(), cells);
        }
    }

    #[test]
    fn of_what_is_too_large_the_robots_surroundings_are_in_it() {
        let extent = Extent::of(&corridor(30_000, State::Free, 1000), 20_000);
        assert!(extent.region(0.1).len() <= 20_000 && extent.contains(Voxel::new(1020, 0, 0)));
        assert!(!extent.contains(Voxel::new(20_000, 0, 0)));
        let ahead = Extent::of(&corridor(30_000, State::Free, 1001), 20_000);
        assert_eq!(extent, ahead, "it goes in steps");
    }
}
