//! Where a robot may be on its way: the voxels that a map knows to be free with the robot's clearance, and those of the way itself.

use std::cell::RefCell;
use std::collections::BTreeMap;

use elk_geometry::ray::Traversal;
use elk_geometry::{Clearance, OccupancyGrid, Polyline, State, Voxel, VoxelSet};
use nalgebra::Point3;

/// So near the way (m) it counts as on it, as long as the map calls it free: a straight line touches voxels' edges.
pub const ON_THE_WAY_M: f64 = 0.01;

/// A corridor along a way.
///
/// A voxel is in it if it is free and so is all within the robot's clearance: what is unknown may be occupied. Where the way
/// itself leads nearer to either, as whoever planned it knows, its own voxels are in it, and no others.
#[derive(Debug)]
pub struct Corridor<'a> {
    grid: &'a OccupancyGrid,
    clearance: &'a Clearance,
    way: &'a Polyline,
    /// Voxels that are in it, whatever is near.
    admitted: VoxelSet,
    /// Whether others are clear, as far as somebody has asked.
    clear: RefCell<BTreeMap<Voxel, bool>>,
}

impl<'a> Corridor<'a> {
    /// The corridor along `way`, from `from` (m of way) on.
    pub fn along(grid: &'a OccupancyGrid, clearance: &'a Clearance, way: &'a Polyline, from: f64) -> Self {
        let rest = way.part(from, way.length());
        let passed = rest.windows(2).flat_map(|ends| Traversal::new(ends[0], ends[1], grid.resolution()));
        Self { grid, clearance, way, admitted: passed.collect(), clear: RefCell::default() }
    }

    /// The robot cannot but pass from one point to the other (m, world): that was in its corridor before.
    pub fn admit(&mut self, from: Point3<f64>, to: Point3<f64>) {
        for voxel in Traversal::new(from, to, self.grid.resolution()) {
            self.admitted.insert(voxel);
        }
    }

    /// Whether the straight line between two points (m, world) is in it.
    pub fn has(&self, from: Point3<f64>, to: Point3<f64>) -> bool {
        let resolution = self.grid.resolution();
        let voxel = Voxel::containing(to, resolution);
        if Voxel::containing(from, resolution) == voxel && (self.admitted.contains(voxel) || self.is_clear(voxel)) {
            return true;
        }
        let voxels = Traversal::new(from, to, resolution);
        let mut outside = voxels.filter(|voxel| !self.admitted.contains(*voxel) && !self.is_clear(*voxel)).peekable();
        outside.peek().is_none()
            || self.is_on_the_way(from) && self.is_on_the_way(to) && outside.all(|v| self.is_free(v))
    }

    fn is_on_the_way(&self, point: Point3<f64>) -> bool {
        (self.way.at(self.way.nearest(point)) - point).norm() <= ON_THE_WAY_M
    }

    fn is_free(&self, voxel: Voxel) -> bool {
        self.grid.state(voxel) == State::Free
    }

    fn is_clear(&self, voxel: Voxel) -> bool {
        let look = || self.is_free(voxel) && self.clearance.offsets().iter().all(|d| self.is_free(voxel + *d));
        *self.clear.borrow_mut().entry(voxel).or_insert_with(look)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_is_unknown_is_kept_clear_of_but_on_the_way() {
        let mut grid = OccupancyGrid::new(0.1);
        for x in 0..20 {
            for y in 0..20 {
                for z in 0..5 {
                    grid.set(Voxel::new(x, y, z), State::Free);
                }
            }
        }
        let clearance = Clearance::new(0.1, 0.1).unwrap();
        let at = |x: f64, y: f64| Point3::new(x, y, 0.25);
        // Along the edge of what is known, and then into the middle.
        let way = Polyline::new([at(0.05, 0.05), at(1.05, 0.05), at(1.05, 1.05)]).unwrap();
        let mut corridor = Corridor::along(&grid, &clearance, &way, 0.0);
        assert!(corridor.has(at(0.05, 0.05), at(1.05, 0.05)), "its own way");
        assert!(corridor.has(at(1.05, 1.05), at(1.75, 1.75)), "far off the way, and clear");
        assert!(!corridor.has(at(0.05, 0.05), at(0.05, 0.15)), "beside the way there is something unknown near");
        assert!(!corridor.has(at(1.05, 1.05), at(1.05, 1.95)));
        corridor.admit(at(0.05, 0.05), at(0.05, 0.15));
        assert!(corridor.has(at(0.05, 0.05), at(0.05, 0.15)));
        let late = Corridor::along(&grid, &clearance, &way, 1.0);
        assert!(!late.has(at(0.05, 0.05), at(0.25, 0.12)), "what lies behind is not kept open");
    }
}
