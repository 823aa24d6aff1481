//! How much of a map that was made with noise is as in one without (thesis 6.5.3.1).

use std::collections::BTreeSet;

use elk_geometry::bricks::voxel_at;
use elk_geometry::mask;
use elk_geometry::state::Cells;
use elk_geometry::{Bounds, OccupancyGrid, Voxel};

use crate::truth::Truth;

/// Shares (0 to 1) of voxels that have the same state, free, occupied or unknown, in two maps.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Agreement {
    /// Of all voxels of the world's box, in the volume to explore: the thesis' accuracy.
    pub of_world: f64,
    /// Of those that are known in either map, in the volume to explore: what neither knows does not count.
    pub of_known: f64,
}

/// Two maps of a world of such extents, held against each other; `None`: neither knows anything of it.
pub fn agreement(truth: &Truth, extents: Bounds, maps: [&OccupancyGrid; 2]) -> Option<Agreement> {
    let [low, high] = corners(truth, extents);
    let is_in_box = |voxel: Voxel| voxel == voxel.sup(low).inf(high);
    let nothing = Cells::new(&mask::NONE, &mask::NONE);
    let [mut known, mut different, mut different_in_box] = [0_u64; 3];
    let bricks = maps.iter().flat_map(|map| map.bricks().iter().map(|(brick, _)| brick));
    let bricks: BTreeSet<Voxel> = bricks.collect();
    for brick in bricks {
        let [a, b] = maps.map(|map| map.bricks().brick(brick).unwrap_or(&nothing));
        let (either, differing) = (mask::or(a.known(), b.known()), a.differing(b));
        let voxels = mask::cells(&either).map(|cell| (cell, voxel_at(brick, cell)));
        for (cell, voxel) in voxels.filter(|(_, voxel)| truth.holds(*voxel)) {
            let differs = mask::has(&differing, cell);
            known += 1;
            different += u64::from(differs);
            different_in_box += u64::from(differs && is_in_box(voxel));
        }
    }
    let edges = [high.x - low.x, high.y - low.y, high.z - low.z].map(|edge| f64::from(edge.max(-1)) + 1.0);
    let voxels: f64 = edges.iter().product();
    let same = |different: u64, all: f64| 1.0 - different as f64 / all;
    (known > 0 && voxels > 0.0)
        .then(|| Agreement { of_world: same(different_in_box, voxels), of_known: same(different, known as f64) })
}

/// The first and the last voxel whose centres lie in the world's box and in the volume to explore.
fn corners(truth: &Truth, extents: Bounds) -> [Voxel; 2] {
    let bounds = truth.bounds().unwrap_or(extents);
    let index = |metres: f64| metres / truth.resolution() - 0.5;
    let low = |axis: usize| index(extents.min[axis].max(bounds.min[axis])).ceil() as i32;
    let high = |axis: usize| index(extents.max[axis].min(bounds.max[axis])).floor() as i32;
    [std::array::from_fn::<i32, 3, _>(low).into(), std::array::from_fn::<i32, 3, _>(high).into()]
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::truth::Terms;
    use elk_geometry::State;
    use elk_world::World;
    use elk_world::scenery::{Scenery, Solid};
    use nalgebra::{Point3, Vector3};

    /// A room of 10 × 10 × 10 voxels, of which the lower half is to be explored.
    fn room() -> (World, Truth) {
        let scenery = Scenery::within(Solid::block("room", [0.0; 3], [1.0; 3]));
        let world = World::from_triangles("room", scenery.triangles_at(Vector3::zeros())).unwrap();
        let bounds = Some(Bounds { min: Point3::new(-1.0, -1.0, -1.0), max: Point3::new(2.0, 2.0, 0.5) });
        let truth = Truth::of(&world, Terms { resolution: 0.1, radius_m: 0.1, bounds }).unwrap();
        (world, truth)
    }

    #[test]
    fn what_differs_counts_in_the_volume_to_explore() {
        let (world, truth) = room();
        let [mut noisy, mut exact] = [OccupancyGrid::new(0.1), OccupancyGrid::new(0.1)];
        let shares = |noisy: &OccupancyGrid, exact: &OccupancyGrid| {
            agreement(&truth, world.extents(), [noisy, exact]).map(|one| [one.of_world, one.of_known])
        };
        assert_eq!(shares(&noisy, &exact), None);
        for x in 0..8 {
            exact.set([x, 0, 0].into(), State::Free);
            noisy.set([x, 0, 0].into(), State::Free);
        }
        assert_eq!(shares(&noisy, &exact), Some([1.0, 1.0]));
        noisy.set([0, 0, 0].into(), State::Occupied);
        // Behind the wall, outside the world's box; and above what is to be explored.
        noisy.set([-1, 0, 0].into(), State::Occupied);
        noisy.set([0, 0, 8].into(), State::Occupied);
        let expected = Some([1.0 - 1.0 / 500.0, 1.0 - 2.0 / 9.0]);
        assert_eq!((shares(&noisy, &exact), shares(&exact, &noisy)), (expected, expected));
    }
}
