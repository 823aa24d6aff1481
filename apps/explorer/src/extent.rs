//! Which part of the map is planned over: all that is known as long as that is not too much, else what the robot can get to.
//!
//! A dense volume costs by its extent, and one stray point far away makes that of the whole map as large as anybody likes.

use elk_geometry::bricks::Bricks;
use elk_geometry::volume::corners;
use elk_geometry::{OccupancyGrid, State, Voxel};

/// What of the map is in an [`Extent`].
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum Scope {
    /// All that is known.
    #[default]
    Whole,
    /// The free voxels that the robot's own is connected with, and what is around them.
    Component,
    /// Of these, what is near the robot.
    Near,
}

/// A box of voxels around the robot's own.
#[derive(Debug, Clone)]
pub struct Extent {
    /// Smallest corner.
    pub min: Voxel,
    /// The corner beyond the largest.
    pub max: Voxel,
    /// What of the map is in it.
    pub scope: Scope,
    /// The robot's component, where not all of it is in the box.
    component: Option<Bricks<bool>>,
}

impl Extent {
    /// The extent to plan over for a robot in voxel `robot`, so that with `margin` voxels around it is of at most `budget`
    /// voxels.
    pub fn of(grid: &OccupancyGrid, robot: Voxel, margin: i32, budget: usize) -> Self {
        let fits = |(min, max): (Voxel, Voxel)| voxels(min, max, margin) <= budget as u64;
        let known = corners(robot, grid.bricks().iter().map(|(brick, _)| brick));
        if fits(known) {
            return Self { min: known.0, max: known.1, scope: Scope::Whole, component: None };
        }
        let component = component(grid, robot);
        let around = Voxel::new(margin, margin, margin);
        let (min, max) = corners(robot, component.iter().map(|(brick, _)| brick));
        let (min, max) = (min - around, max + around);
        if fits((min, max)) {
            return Self { min, max, scope: Scope::Component, component: None };
        }
        let (min, max) = near(robot, (min, max), fits);
        Self { min, max, scope: Scope::Near, component: Some(component) }
    }

    /// Whether it is the same box as another one, with the same of the map in it.
    pub fn is_box_of(&self, other: &Self) -> bool {
        (self.min, self.max, self.scope) == (other.min, other.max, other.scope)
    }

    /// Whether a voxel is of the robot's component, and not in the box.
    pub fn leaves_out(&self, voxel: Voxel) -> bool {
        self.component.as_ref().is_some_and(|component| component.get(voxel)) && !self.contains(voxel)
    }

    fn contains(&self, voxel: Voxel) -> bool {
        let (min, max, voxel) = (self.min.to_array(), self.max.to_array(), voxel.to_array());
        (0..3).all(|axis| (min[axis]..max[axis]).contains(&voxel[axis]))
    }
}

/// Number of voxels of a box with `margin` voxels around.
fn voxels(min: Voxel, max: Voxel, margin: i32) -> u64 {
    let edges = (max - min).to_array().map(|n| u64::from((n + 2 * margin).unsigned_abs()));
    edges.iter().fold(1, |product, edge| product.saturating_mul(*edge))
}

/// The free voxels connected with `start` over faces; `start` itself always is.
fn component(grid: &OccupancyGrid, start: Voxel) -> Bricks<bool> {
    let mut found = Bricks::new();
    *found.get_mut(start) = true;
    let mut open = vec![start];
    while let Some(voxel) = open.pop() {
        for next in voxel.face_neighbours() {
            if grid.state(next) == State::Free && !std::mem::replace(found.get_mut(next), true) {
                open.push(next);
            }
        }
    }
    found
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
    use super::*;

    /// A corridor of `length` free voxels along x, and a stray voxel of this state 30,000 voxels away.
    fn corridor(length: i32, stray: State) -> OccupancyGrid {
        let mut grid = OccupancyGrid::new(0.1);
        (0..length).for_each(|x| assert!(grid.set(Voxel::new(x, 0, 0), State::Free)));
        grid.set(Voxel::new(30_000, -30_000, 30_000), stray);
        grid
    }

    #[test]
    fn all_that_is_known_is_planned_over_if_it_is_not_too_much() {
        let grid = corridor(40, State::Unknown);
        let extent = Extent::of(&grid, Voxel::new(3, 0, 0), 2, 10_000);
        assert_eq!((extent.min, extent.max), (Voxel::new(0, 0, 0), Voxel::new(40, 8, 8)));
        assert_eq!(extent.scope, Scope::Whole);
    }

    /// Regression: one stray point at 3 km made the explorer ask for 24 TB.
    #[test]
    fn what_is_far_away_and_apart_is_left_out() {
        for stray in [State::Free, State::Occupied] {
            let extent = Extent::of(&corridor(40, stray), Voxel::new(3, 0, 0), 2, 20_000);
            assert_eq!((extent.min, extent.max), (Voxel::new(-2, -2, -2), Voxel::new(42, 10, 10)));
            assert_eq!(extent.scope, Scope::Component);
            assert!(!extent.leaves_out(Voxel::new(30_000, -30_000, 30_000)), "the robot cannot get there");
        }
    }

    #[test]
    fn of_a_component_that_is_too_large_the_robots_surroundings_are_planned_over() {
        let robot = Voxel::new(1000, 0, 0);
        let extent = Extent::of(&corridor(30_000, State::Free), robot, 2, 20_000);
        assert_eq!(extent.scope, Scope::Near);
        assert!(voxels(extent.min, extent.max, 2) <= 20_000 && extent.contains(robot));
        assert!(extent.contains(Voxel::new(1020, 0, 0)) && !extent.leaves_out(Voxel::new(1020, 0, 0)));
        assert!(extent.leaves_out(Voxel::new(20_000, 0, 0)) && !extent.leaves_out(Voxel::new(20_000, 1, 0)));
        let ahead = Extent::of(&corridor(30_000, State::Free), robot + Voxel::new(1, 0, 0), 2, 20_000);
        assert!(extent.is_box_of(&ahead), "it goes in steps: {extent:?} {ahead:?}");
    }
}
