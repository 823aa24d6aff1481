//! What is registered against: surfaces around the sensor.

use nalgebra::SVector;

use crate::cloud::Cloud;
use crate::level::{Level, Surface};
use crate::pose::{Pose, PoseError};
use crate::resolution::Resolution;

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
        Ok(())
    }

    /// The surface near a place, of the finest level from `level` on that has one there.
    pub(crate) fn near(&self, place: &SVector<f64, D>, level: usize) -> Option<&Surface<D>> {
        self.levels[level..].iter().find_map(|level| level.near(place))
    }
}
