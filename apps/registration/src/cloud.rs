//! A scan's points, checked and put together by voxels.

use nalgebra::{Point, SVector};

use crate::level::Level;
use crate::moments::Moments;
use crate::resolution::Resolution;

/// Points that are no scan.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum CloudError {
    /// No point at all.
    #[error("a scan of 0 points: there is nothing to register")]
    Empty,
    /// A coordinate that is no number.
    #[error("point {index} is {found:?}: what the sensor did not see has to be left out")]
    NotFinite {
        /// Which point, from 0.
        index: usize,
        /// Its coordinates.
        found: Vec<f32>,
    },
    /// A point farther than any sensor sees.
    #[error("point {index} is {found:?}, and no coordinate may be beyond ±{most}: are these metres?")]
    Far {
        /// Which point, from 0.
        index: usize,
        /// Its coordinates, metres.
        found: Vec<f32>,
        /// The largest coordinate, metres.
        most: f32,
    },
}

/// A scan, ready to be registered: the moments of its points by voxels, on each level of a [`Resolution`]. In the sensor's frame, metres.
#[derive(Clone, Debug)]
pub struct Cloud<const D: usize> {
    resolution: Resolution,
    levels: Vec<Vec<Moments<D>>>,
}

impl<const D: usize> Cloud<D> {
    /// The largest coordinate of a point, metres.
    pub const MAX_COORDINATE: f32 = 1000.0;

    /// Of points in the sensor's frame, metres.
    ///
    /// # Errors
    /// No point, and one that is not finite or too far, with its index.
    pub fn new(points: &[Point<f32, D>], resolution: Resolution) -> Result<Self, CloudError> {
        if points.is_empty() {
            return Err(CloudError::Empty);
        }
        let mut finest = Level::new(resolution.voxel(0));
        for (index, point) in points.iter().enumerate() {
            finest.add(&Moments::of(checked(index, point)?), 0);
        }
        let mut levels = vec![finest.moments()];
        for level in 1..resolution.levels() {
            let mut coarser = Level::new(resolution.voxel(level));
            levels[level - 1].iter().for_each(|moments| coarser.add(moments, 0));
            levels.push(coarser.moments());
        }
        Ok(Self { resolution, levels })
    }

    /// What its voxels are.
    pub fn resolution(&self) -> Resolution {
        self.resolution
    }

    /// The moments of a level's voxels, in the order in which the points reach them.
    pub fn level(&self, level: usize) -> &[Moments<D>] {
        &self.levels[level]
    }
}

fn checked<const D: usize>(index: usize, point: &Point<f32, D>) -> Result<SVector<f64, D>, CloudError> {
    let found = || point.iter().copied().collect();
    let most = Cloud::<D>::MAX_COORDINATE;
    if point.iter().any(|x| !x.is_finite()) {
        return Err(CloudError::NotFinite { index, found: found() });
    }
    match point.iter().all(|x| x.abs() <= most) {
        true => Ok(point.coords.map(f64::from)),
        false => Err(CloudError::Far { index, found: found(), most }),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use nalgebra::{Point2, Point3};

    #[test]
    fn points_that_are_none_are_said_by_their_index() {
        let resolution = Resolution::new(0.1, 2).unwrap();
        let said = |points: &[Point3<f32>]| Cloud::new(points, resolution).unwrap_err().to_string();
        let good = Point3::new(1.0, 2.0, 3.0);
        assert_eq!(said(&[]), "a scan of 0 points: there is nothing to register");
        let nan = said(&[good, Point3::new(f32::NAN, 0.0, 0.5)]);
        assert_eq!(nan, "point 1 is [NaN, 0.0, 0.5]: what the sensor did not see has to be left out");
        let far = said(&[good, good, Point3::new(0.0, 2000.0, 0.5)]);
        assert_eq!(far, "point 2 is [0.0, 2000.0, 0.5], and no coordinate may be beyond ±1000: are these metres?");
    }

    #[test]
    fn each_level_has_all_points() {
        let points: Vec<Point2<f32>> = (0..500).map(|i| Point2::new((i as f32).sin(), i as f32 * 0.01)).collect();
        let cloud = Cloud::new(&points, Resolution::new(0.05, 4).unwrap()).unwrap();
        let voxels: Vec<usize> = (0..4).map(|level| cloud.level(level).len()).collect();
        assert!(voxels.is_sorted_by(|fine, coarse| fine > coarse), "{voxels:?}");
        for level in 0..4 {
            assert_eq!(cloud.level(level).iter().map(|moments| moments.count).sum::<f64>(), 500.0);
        }
    }
}
