//! The frontier of the map (free voxels with an unknown face neighbour, thesis 6.3.1.1), brick by brick: whole layers
//! are looked at at once, and only in bricks that changed and the ones beside them.

use elk_geometry::Voxel;
use elk_geometry::bricks::voxel_at;
use elk_geometry::mask::{self, Mask};
use elk_geometry::voxel::FACES;

use crate::growth::{at_faces, face_neighbours};
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

    /// The bricks to look at again where these changed: their numbers, and the cells that have become known or unknown. They
    /// themselves, and those beside them where there are such cells.
    pub(crate) fn beside(&self, changed: &[(usize, Mask)]) -> Vec<usize> {
        let mut revise: Vec<usize> = Vec::with_capacity(2 * changed.len());
        for (i, extent) in changed {
            revise.push(*i);
            let faces = at_faces(extent).into_iter().enumerate().filter(|(_, is_there)| *is_there);
            revise.extend(faces.filter_map(|(face, _)| self.table.beyond(*i, face)));
        }
        revise.sort_unstable();
        revise.dedup();
        revise
    }

    /// Looks again at bricks of these numbers.
    pub(crate) fn update_frontier(&mut self, revise: &[usize]) {
        revise.iter().for_each(|i| self.look_at(*i));
    }

    /// Looks again at all bricks.
    pub(crate) fn update_all_of_the_frontier(&mut self) {
        self.full = self.is_full();
        (0..self.bricks.len()).for_each(|i| self.look_at(i));
    }

    fn look_at(&mut self, i: usize) {
        let frontier = self.frontier_of(i);
        let before = std::mem::replace(&mut self.bricks[i].frontier, frontier);
        self.frontier_len += mask::count(&frontier);
        self.frontier_len -= mask::count(&before);
    }

    fn frontier_of(&self, i: usize) -> Mask {
        let (brick, position) = (&self.bricks[i], self.table.position(i));
        let free: Mask = std::array::from_fn(|z| brick.known[z] & !brick.occupied[z]);
        if free == mask::NONE {
            return mask::NONE;
        }
        let inside = self.volume.mask(position);
        let own = std::array::from_fn(|z| inside[z] & !brick.known[z]);
        let beside = std::array::from_fn(|face| self.unknown_beyond(i, face));
        let near_unknown = face_neighbours(&own, &beside);
        std::array::from_fn(|z| free[z] & inside[z] & near_unknown[z])
    }

    /// The unknown cells of the brick beyond a face that lie in the volume.
    fn unknown_beyond(&self, i: usize, face: usize) -> Mask {
        let inside = || self.volume.mask(self.table.position(i) + FACES[face]);
        match self.table.beyond(i, face) {
            Some(other) if self.bricks[other].known == mask::ALL => mask::NONE,
            Some(other) => {
                let (inside, known) = (inside(), &self.bricks[other].known);
                std::array::from_fn(|z| inside[z] & !known[z])
            }
            // What there is no room for it cannot come to know.
            None if self.full => mask::NONE,
            None => inside(),
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
            let mut map = OccupancyMap::new(MapConfig { bounds, ..MapConfig::default() }).unwrap();
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
