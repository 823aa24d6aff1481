//! The frontier of the map (free voxels with an unknown face neighbour, thesis 6.3.1.1), brick by brick: whole layers
//! are looked at at once, and only in bricks that changed and the ones beside them.

use elk_geometry::Voxel;
use elk_geometry::bricks::voxel_at;
use elk_geometry::mask::{self, Mask};
use elk_geometry::voxel::FACES;

use crate::growth::face_neighbours;
use crate::occupancy::OccupancyMap;

impl OccupancyMap {
    /// Number of frontier voxels in the volume that counts.
    pub fn frontier_len(&self) -> usize {
        self.frontier_len
    }

    /// The frontier voxels, brick by brick.
    pub fn frontier(&self) -> impl Iterator<Item = Voxel> + '_ {
        self.bricks.iter().enumerate().flat_map(|(i, brick)| {
            let position = self.table.position(i);
            mask::cells(&brick.frontier).map(move |cell| voxel_at(position, cell))
        })
    }

    /// Looks again at the bricks of these numbers and the ones beside them.
    pub(crate) fn update_frontier(&mut self, changed: &[usize]) {
        let table = &self.table;
        let beside =
            changed.iter().flat_map(|&i| FACES.iter().filter_map(move |&face| table.find(table.position(i) + face)));
        let mut revise: Vec<usize> = changed.iter().copied().chain(beside).collect();
        revise.sort_unstable();
        revise.dedup();
        for i in revise {
            let frontier = self.frontier_of(i);
            let before = std::mem::replace(&mut self.bricks[i].frontier, frontier);
            self.frontier_len += mask::count(&frontier);
            self.frontier_len -= mask::count(&before);
        }
    }

    fn frontier_of(&self, i: usize) -> Mask {
        let position = self.table.position(i);
        let near_unknown = face_neighbours(|offset| self.unknown(position + offset));
        let (brick, inside) = (&self.bricks[i], self.volume.mask(position));
        std::array::from_fn(|z| brick.known[z] & !brick.occupied[z] & inside[z] & near_unknown[z])
    }

    /// The unknown cells of a brick that lie in the volume.
    fn unknown(&self, position: Voxel) -> Mask {
        let inside = self.volume.mask(position);
        match self.table.find(position) {
            Some(i) => std::array::from_fn(|z| inside[z] & !self.bricks[i].known[z]),
            // What there is no room for it cannot come to know.
            None if self.table.is_full() => mask::NONE,
            None => inside,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::occupancy::MapConfig;
    use elk_geometry::{Bounds, FrontierSet, State};
    use nalgebra::{Point3, Vector3};
    use proptest::prelude::*;
    use std::collections::BTreeSet;

    fn point() -> impl Strategy<Value = Point3<f64>> {
        prop::array::uniform3(-1.5..1.5f64).prop_map(Point3::from)
    }

    proptest! {
        #![proptest_config(ProptestConfig::with_cases(64))]
        /// Kept up to date scan by scan, the frontier is what a look at every voxel finds.
        #[test]
        fn incremental_equals_exhaustive(
            scans in prop::collection::vec((point(), prop::collection::vec(point(), 1..30)), 1..6),
            bounded in any::<bool>(),
            dim in 0.3..2.5f64,
        ) {
            let bounds = bounded.then(|| Bounds::from_mid_dim(Point3::new(0.2, 0.1, -0.3), Vector3::new(dim, 1.0, 1.7)));
            let mut map = OccupancyMap::new(MapConfig { bounds, ..MapConfig::default() });
            for (origin, points) in scans {
                map.insert(origin, points);
            }
            let free: Vec<Voxel> = map.grid().bricks().voxels().filter(|(_, s)| *s == State::Free).map(|(v, _)| v).collect();
            let mut all = FrontierSet::new(bounds);
            all.update(map.grid(), &free);
            prop_assert_eq!(map.frontier_len(), all.len());
            prop_assert_eq!(map.frontier().collect::<BTreeSet<_>>(), all.iter().collect::<BTreeSet<_>>());
        }
    }
}
