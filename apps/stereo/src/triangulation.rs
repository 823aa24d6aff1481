//! From disparities to points, with their error (thesis 3.2.2 and 5.3.2).

use nalgebra::{Matrix3, Point3, Vector3};

use crate::disparity::Disparity;

/// A rectified pair of cameras: alike, side by side, looking the same way. Points lie in the frame of the left one: x right, y
/// down, z forward, in metres.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Rig {
    focal: f64,
    center: [f64; 2],
    baseline: f64,
}

/// Why two cameras are no rig.
#[derive(Clone, Copy, Debug, PartialEq, thiserror::Error)]
pub enum RigError {
    /// No focal length, or none that is one.
    #[error("a focal length of {found} pixels: a positive number would be right")]
    Focal {
        /// What there is in its place, in pixels.
        found: f64,
    },
    /// No baseline: both cameras see from one place, so that all disparities are 0. Or one that no stereo camera has.
    #[error(
        "a baseline of {found} m: the right camera has to be on the right of the left one, by a positive number of metres, at most {}; are these \
         millimetres?",
        Rig::MOST_BASELINE
    )]
    Baseline {
        /// What there is in its place, in metres.
        found: f64,
    },
    /// A principal point that is no point.
    #[error("a principal point of row {row}, column {column}: finite numbers of pixels would be right")]
    Center {
        /// Its row, in pixels.
        row: f64,
        /// Its column, in pixels.
        column: f64,
    },
}

/// By how much a match is wrong, as standard deviations in pixels.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Noise {
    /// Of where the point is seen in the left image, along rows and along columns each.
    pub position: f64,
    /// Of the disparity.
    pub disparity: f64,
}

/// Where in a pixel a point is seen is known to half of it at best (σ of an even distribution over a pixel: 1/√12); disparities are
/// interpolated, and of good matches a quarter of a pixel is what is seen of their error.
impl Default for Noise {
    fn default() -> Self {
        Self { position: 1.0 / 12f64.sqrt(), disparity: 0.25 }
    }
}

impl Rig {
    /// The longest baseline, metres: calibrations whose unit is the millimetre are beyond it.
    pub const MOST_BASELINE: f64 = 10.0;

    /// Two cameras with a common focal length in pixels, the principal point's row and column in pixels, and the distance of the
    /// right one from the left one in metres.
    ///
    /// # Errors
    /// Numbers with which nothing can be triangulated.
    pub fn new(focal: f64, [row, column]: [f64; 2], baseline: f64) -> Result<Self, RigError> {
        let is_length = |length: f64| length.is_finite() && length > 0.0;
        match (
            is_length(focal),
            is_length(baseline) && baseline <= Self::MOST_BASELINE,
            row.is_finite() && column.is_finite(),
        ) {
            (false, _, _) => Err(RigError::Focal { found: focal }),
            (true, false, _) => Err(RigError::Baseline { found: baseline }),
            (true, true, false) => Err(RigError::Center { row, column }),
            (true, true, true) => Ok(Self { focal, center: [row, column], baseline }),
        }
    }

    /// The focal length, in pixels.
    pub fn focal(&self) -> f64 {
        self.focal
    }

    /// The principal point, row and column, in pixels.
    pub fn center(&self) -> [f64; 2] {
        self.center
    }

    /// The baseline, in metres.
    pub fn baseline(&self) -> f64 {
        self.baseline
    }

    /// The point (thesis 5.7) that is seen in the left image at a row and a column, and in the right one `disparity` pixels farther
    /// left; none of disparity 0, which is infinitely far.
    pub fn point(&self, row: f64, column: f64, disparity: f64) -> Option<Point3<f64>> {
        let scale = self.baseline / disparity;
        let point = Point3::new(column - self.center[1], row - self.center[0], self.focal) * scale;
        (disparity > 0.0 && point.iter().all(|x| x.is_finite())).then_some(point)
    }

    /// The row, column and disparity of a point in front of the cameras (thesis 3.1 to 3.9); none of one behind them.
    pub fn project(&self, point: &Point3<f64>) -> Option<[f64; 3]> {
        let per_metre = self.focal / point.z;
        let pixel = [self.center[0] + point.y * per_metre, self.center[1] + point.x * per_metre];
        (point.z > 0.0).then_some([pixel[0], pixel[1], self.baseline * per_metre])
    }

    /// The covariance of such a point in m², to first order: J Σ Jᵀ, where J is the Jacobian of (5.7) by column, row and disparity,
    /// and Σ has the variances of those on its diagonal. Its largest part is that of z, which grows with the square of the distance:
    /// σ_z = z² / (f b) σ_d (Matthies and Shafer 1987, thesis 6.5.3).
    pub fn covariance(&self, row: f64, column: f64, disparity: f64, noise: Noise) -> Option<Matrix3<f64>> {
        let point = self.point(row, column, disparity)?;
        let per_pixel = self.baseline / disparity;
        #[rustfmt::skip]
        let jacobian = Matrix3::new(
            per_pixel, 0.0, -point.x / disparity,
            0.0, per_pixel, -point.y / disparity,
            0.0, 0.0, -point.z / disparity,
        );
        let deviations = Vector3::new(noise.position, noise.position, noise.disparity);
        Some(jacobian * Matrix3::from_diagonal(&deviations.component_mul(&deviations)) * jacobian.transpose())
    }

    /// The points of all pixels that have a disparity (thesis 5.8), each with its row and column.
    pub fn cloud<'a>(&'a self, disparity: &'a Disparity) -> impl Iterator<Item = (usize, usize, Point3<f64>)> + 'a {
        let width = disparity.width();
        disparity.iter().enumerate().filter_map(move |(i, said)| {
            let (row, column) = (i / width, i % width);
            let point = self.point(row as f64, column as f64, f64::from(said.ok()?))?;
            Some((row, column, point))
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::disparity::Unmatched;
    use proptest::prelude::*;

    fn rig() -> Rig {
        Rig::new(500.0, [240.0, 320.0], 0.1).unwrap()
    }

    #[test]
    fn a_point_is_where_the_equations_say() {
        assert_eq!(rig().point(240.0, 320.0, 25.0), Some(Point3::new(0.0, 0.0, 2.0)));
        assert_eq!(rig().point(290.0, 420.0, 25.0), Some(Point3::new(0.4, 0.2, 2.0)));
        assert_eq!(rig().point(240.0, 320.0, 0.0), None);
        assert_eq!(rig().project(&Point3::new(0.0, 0.0, -1.0)), None);
    }

    #[test]
    fn a_cloud_has_what_was_matched() {
        let said = [Ok(25.0), Err(Unmatched::Textureless), Ok(0.0), Ok(50.0)];
        let disparity = Disparity::from_fn(2, 2, |row, column| said[2 * row + column]);
        let cloud: Vec<_> = rig().cloud(&disparity).map(|(row, column, point)| (row, column, point.z)).collect();
        assert_eq!(cloud, [(0, 0, 2.0), (1, 1, 1.0)]);
    }

    #[test]
    fn what_is_no_rig_is_said() {
        let said = |focal, center, baseline| Rig::new(focal, center, baseline).unwrap_err().to_string();
        assert_eq!(said(0.0, [0.0; 2], 0.1), "a focal length of 0 pixels: a positive number would be right");
        assert!(said(500.0, [0.0; 2], 0.0).starts_with("a baseline of 0 m: the right camera has to be on the right"));
        assert!(said(500.0, [0.0; 2], -0.1).starts_with("a baseline of -0.1 m"));
        assert!(said(500.0, [f64::NAN, 0.0], 0.1).starts_with("a principal point of row NaN"));
    }

    proptest! {
        #[test]
        fn what_is_projected_is_triangulated(x in -3.0..3.0f64, y in -3.0..3.0f64, z in 0.1..50.0f64) {
            let point = Point3::new(x, y, z);
            let [row, column, disparity] = rig().project(&point).unwrap();
            prop_assert!((rig().point(row, column, disparity).unwrap() - point).norm() < 1e-9);
        }

        #[test]
        fn the_covariance_is_that_of_small_errors(row in 0.0..480.0f64, column in 0.0..640.0f64, disparity in 2.0..80.0f64) {
            let noise = Noise { position: 0.3, disparity: 0.2 };
            let covariance = rig().covariance(row, column, disparity, noise).unwrap();
            let step = 1e-5;
            let by = |dr: f64, dc: f64, dd: f64| {
                let [ahead, back] = [step, -step].map(|s| rig().point(row + s * dr, column + s * dc, disparity + s * dd).unwrap());
                (ahead - back) / (2.0 * step)
            };
            let columns = [by(1.0, 0.0, 0.0) * 0.3, by(0.0, 1.0, 0.0) * 0.3, by(0.0, 0.0, 1.0) * 0.2];
            let numeric: Matrix3<f64> = columns.iter().map(|column| column * column.transpose()).sum();
            prop_assert!((numeric - covariance).norm() <= 1e-4 * covariance.norm());
            let z = rig().point(row, column, disparity).unwrap().z;
            prop_assert!((covariance[(2, 2)].sqrt() - z * z / (500.0 * 0.1) * 0.2).abs() < 1e-9);
        }
    }
}
