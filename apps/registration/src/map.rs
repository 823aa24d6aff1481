//! What is registered against: surfaces around the sensor.

use nalgebra::SVector;

use crate::cloud::Cloud;
use crate::level::{Level, Surface};
use crate::pose::{Pose, PoseError};
use crate::resolution::Resolution;
use crate::table::Index;

/// A local map: the moments of all points that were inserted, by voxels, and the surfaces that go through them. It keeps no point, so its size
/// depends on the space alone that was seen.
#[derive(Clone, Debug)]
pub struct Map<const D: usize> {
    resolution: Resolution,
    levels: Vec<Level<D>>,
    insertions: u64,
}

impl<const D: usize> Map<D> {
    /// A map of nothing.
    pub fn new(resolution: Resolution) -> Self {
        let levels = (0..resolution.levels()).map(|level| Level::new(resolution.voxel(level))).collect();
        Self { resolution, levels, insertions: 0 }
    }

    /// What its voxels are.
    pub fn resolution(&self) -> Resolution {
        self.resolution
    }

    /// How many of its finest voxels have points.
    pub fn len(&self) -> usize {
        self.levels[0].len()
    }

    /// Whether it has no point.
    pub fn is_empty(&self) -> bool {
        self.len() == 0
    }

    /// Adds a cloud that was seen from a pose, and then forgets all voxels to which the last `window` clouds, this one among them, have added
    /// nothing.
    ///
    /// # Errors
    /// A pose that is not finite, or too far from the origin; the map stays as it was.
    pub fn insert<P: Pose<D, N>, const N: usize>(
        &mut self,
        cloud: &Cloud<D>,
        pose: &P,
        window: u64,
    ) -> Result<(), PoseError> {
        pose.check()?;
        let (rotation, position) = (pose.rotation(), pose.position());
        self.insertions += 1;
        for moments in cloud.level(0) {
            let seen = moments.seen(&rotation, &position);
            self.levels.iter_mut().for_each(|level| level.add(&seen, self.insertions));
        }
        for level in &mut self.levels {
            level.forget((self.insertions + 1).saturating_sub(window));
            level.update_surfaces();
        }
        for level in 1..self.levels.len() {
            let (finer, coarser) = self.levels.split_at_mut(level);
            coarser[0].refine(&finer[level - 1]);
        }
        Ok(())
    }

    /// The surface of the voxel next to a place, of those that have one and none finer in them; less than an edge of a level's
    /// voxels off. On the coarsest level one farther than half an edge may be missed.
    pub(crate) fn near(&self, place: &SVector<f64, D>, level: usize) -> Option<&Surface<D>> {
        // Most places are in such a voxel, and nothing is nearer.
        if let Some(surface) = self.levels[0].at(place) {
            return Some(surface);
        }
        let reach = self.levels[level].size();
        let mut nearest = Nearest { distance_squared: reach * reach, surface: None };
        let top = self.levels.len() - 1;
        for (index, cell) in self.levels[top].beside(place) {
            self.search(place, &index, cell, top, &mut nearest);
        }
        nearest.surface
    }

    /// The voxels that [`Map::near`] looks for: their levels and indices.
    #[cfg(test)]
    fn leaves(&self) -> impl Iterator<Item = (usize, Index<D>)> {
        let levels = self.levels.iter().enumerate();
        levels.flat_map(|(at, level)| level.unrefined_surfaces().map(move |index| (at, index)))
    }

    fn search<'a>(
        &'a self,
        place: &SVector<f64, D>,
        index: &Index<D>,
        cell: usize,
        level: usize,
        nearest: &mut Nearest<'a, D>,
    ) {
        let distance_squared = self.levels[level].distance_squared(index, place);
        if distance_squared >= nearest.distance_squared {
            return;
        }
        let cell = self.levels[level].cell(cell);
        if cell.is_refined {
            for (index, cell) in self.levels[level - 1].within(index, place) {
                self.search(place, &index, cell, level - 1, nearest);
            }
        } else if let Some(surface) = &cell.surface {
            *nearest = Nearest { distance_squared, surface: Some(surface) };
        }
    }
}

/// The nearest surface so far.
struct Nearest<'a, const D: usize> {
    /// How far its voxel is, m².
    distance_squared: f64,
    surface: Option<&'a Surface<D>>,
}

#[cfg(test)]
mod tests {
    use super::*;
    use nalgebra::{Isometry3, Point3, Vector3};
    use proptest::prelude::*;

    proptest! {
        #![proptest_config(ProptestConfig::with_cases(40))]
        /// Sheets and single points, inserted one after the other, and forgotten again.
        #[test]
        fn the_nearest_is_that_of_all(
            points in prop::collection::vec(prop::array::uniform3(-1.0..1.0f32), 20..200),
            places in prop::collection::vec(prop::array::uniform3(-1.2..1.2f64), 10),
            shifts in prop::collection::vec(-0.5..0.5f64, 1..5),
        ) {
            let resolution = Resolution::new(0.1, 4).unwrap();
            let mut map = Map::new(resolution);
            let sheet = |[x, y, z]: [f32; 3]| if z > 0.8 { Point3::new(x, y, z) } else { Point3::new(x, y, 0.3 * x) };
            let cloud = Cloud::new(&points.into_iter().map(sheet).collect::<Vec<_>>(), resolution).unwrap();
            for shift in shifts {
                let pose = Isometry3::new(Vector3::new(shift, 0.0, shift * shift), Vector3::zeros());
                map.insert(&cloud, &pose, 2).unwrap();
            }
            for (place, level) in places.into_iter().flat_map(|place| (0..4).map(move |level| (place, level))) {
                let place = SVector::from(place);
                let distances = map.leaves().map(|(at, index)| map.levels[at].distance_squared(&index, &place));
                let least = distances.fold(f64::INFINITY, f64::min);
                let near = map.near(&place, level);
                if level == 3 && least > (map.levels[3].size() / 2.0).powi(2) {
                    continue;
                }
                prop_assert_eq!(near.is_some(), least < map.levels[level].size().powi(2), "{} m", least.sqrt());
                if let Some(near) = near {
                    let mut at_least = map.leaves().filter(|(at, index)| map.levels[*at].distance_squared(index, &place) <= least);
                    prop_assert!(at_least.any(|(at, index)| map.levels[at].surface_at(&index) == Some(*near)));
                }
            }
        }
    }
}
