//! How much of one map another map has.

use elk_geometry::{OccupancyGrid, State, Voxel};

use crate::occupancy::OccupancyMap;

/// How the known voxels of a map are in another one.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct Comparison {
    /// Known voxels of the one.
    pub known: u64,
    /// Of these, voxels that have the same state in the other.
    pub same: u64,
    /// Of these, voxels whose state some voxel of the other has that is near enough.
    pub near: u64,
}

impl Comparison {
    /// Shares of the known voxels (0 to 1), the same and near; of none, all.
    pub fn shares(&self) -> [f64; 2] {
        let share = |count: u64| if self.known == 0 { 1.0 } else { count as f64 / self.known as f64 };
        [share(self.same), share(self.near)]
    }
}

/// How the voxels that are known in `one`, free or occupied, are in `other`, whose voxels are of the same size: as they are there, or
/// as at least one is that is up to `within` voxels away along each axis.
pub fn compare(one: &OccupancyMap, other: &OccupancyGrid, within: u32) -> Comparison {
    let reach = within.min(i32::MAX as u32) as i32;
    let mut comparison = Comparison::default();
    for (voxel, _) in one.known() {
        let state = one.grid().state(voxel);
        let same = other.state(voxel) == state;
        comparison.known += 1;
        comparison.same += u64::from(same);
        comparison.near += u64::from(same || has_near(other, voxel, state, reach));
    }
    comparison
}

fn has_near(grid: &OccupancyGrid, voxel: Voxel, state: State, reach: i32) -> bool {
    let steps = || -reach..=reach;
    steps().any(|x| steps().any(|y| steps().any(|z| grid.state(voxel + Voxel::new(x, y, z)) == state)))
}

#[cfg(test)]
mod tests {
    use nalgebra::Point3;

    use super::*;
    use crate::MapConfig;

    /// A ray of ten free voxels and an occupied one along x.
    fn ray(y: f64) -> OccupancyMap {
        let mut map = OccupancyMap::new(MapConfig { resolution: 0.1, ..MapConfig::default() }).unwrap();
        map.insert(Point3::new(0.05, y, 0.05), [Point3::new(1.05, y, 0.05)]);
        map
    }

    #[test]
    fn what_lies_beside_it_is_near() {
        let (one, beside, off) = (ray(0.05), ray(0.15), ray(0.25));
        assert_eq!(compare(&one, one.grid(), 0), Comparison { known: 11, same: 11, near: 11 });
        assert_eq!(compare(&one, beside.grid(), 0), Comparison { known: 11, same: 0, near: 0 });
        assert_eq!(compare(&one, beside.grid(), 1), Comparison { known: 11, same: 0, near: 11 });
        assert_eq!(compare(&one, off.grid(), 1).near, 0);
        let empty = OccupancyMap::new(MapConfig::default()).unwrap();
        assert_eq!(compare(&empty, one.grid(), 1).shares(), [1.0, 1.0]);
    }
}
