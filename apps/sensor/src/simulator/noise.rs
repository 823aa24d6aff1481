//! Noise as a stereo camera has it (thesis 6.5.3): on the position at which a pixel was matched, before triangulation.

use nalgebra::Point3;

use crate::camera::Camera;
use elk_geometry::random::Random;

/// A stereo camera's matching error.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct StereoNoise {
    /// Standard deviation of the matched position in the left image, along u and along v (px).
    pub sigma_px: f64,
    /// Distance between the two cameras (m). The error in depth grows with depth² · σ / (focal length · baseline).
    pub baseline_m: f64,
}

impl StereoNoise {
    /// The point (m, camera frame) that triangulation makes of what is seen at (u, v) (px) at `depth` (m).
    ///
    /// The left position moves by N(0, σ²) along both axes; the right one, `f·B/depth` to its left, stays. So the
    /// disparity carries the error of u, and the depth error is skewed: long towards the far side. A disparity that is
    /// not positive is no measurement.
    pub fn measure(&self, camera: &Camera, (u, v): (f64, f64), depth: f64, random: &mut Random) -> Option<Point3<f64>> {
        let (du, dv) = random.normal_pair();
        let (du, dv) = (self.sigma_px * du, self.sigma_px * dv);
        let scale = camera.focal_px * self.baseline_m;
        let disparity = scale / depth + du;
        (disparity > 0.0).then(|| camera.point(u + du, v + dv, scale / disparity))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const STEREO: StereoNoise = StereoNoise { sigma_px: 0.5, baseline_m: 0.12 };

    fn camera() -> Camera {
        Camera::new(640, 480, 75_f64.to_radians())
    }

    fn depths(depth: f64, count: usize) -> Vec<f64> {
        let (camera, mut random) = (camera(), Random::new(3, 1));
        (0..count).filter_map(|_| STEREO.measure(&camera, (100.5, 50.5), depth, &mut random)).map(|p| p.z).collect()
    }

    #[test]
    fn without_error_triangulation_gives_the_point_back() {
        let exact = StereoNoise { sigma_px: 0.0, ..STEREO };
        let point = exact.measure(&camera(), (100.5, 50.5), 3.0, &mut Random::new(1, 1)).unwrap();
        assert!((point - camera().point(100.5, 50.5, 3.0)).norm() < 1e-12);
    }

    #[test]
    fn inverse_depth_is_gaussian_with_the_sigma_of_the_disparity() {
        let scale = camera().focal_px * STEREO.baseline_m;
        let n = 100_000;
        let errors: Vec<f64> = depths(2.0, n).iter().map(|z| scale / z - scale / 2.0).collect();
        assert_eq!(errors.len(), n, "25 px of disparity never vanish at half a pixel of noise");
        let mean = errors.iter().sum::<f64>() / n as f64;
        let variance = errors.iter().map(|e| (e - mean).powi(2)).sum::<f64>() / n as f64;
        let standard_error = 0.5 / (n as f64).sqrt();
        assert!(mean.abs() < 5.0 * standard_error);
        assert!((variance.sqrt() - 0.5).abs() < 5.0 * standard_error);
    }

    #[test]
    fn range_errors_grow_with_the_square_of_depth_and_lean_to_the_far_side() {
        let spread = |depth: f64| {
            let mut z = depths(depth, 20_001);
            z.sort_by(f64::total_cmp);
            let at = |q: f64| z[(q * z.len() as f64) as usize];
            (at(0.84) - at(0.5), at(0.5) - at(0.16))
        };
        let (far_2, near_2) = spread(2.0);
        let (far_6, near_6) = spread(6.0);
        assert!((near_6 / near_2 - 9.0).abs() < 2.0, "{}", near_6 / near_2);
        assert!(far_6 > near_6 * 1.05 && far_2 > near_2);
    }

    #[test]
    fn what_is_too_far_away_to_have_a_disparity_is_not_measured() {
        let seen = depths(1e9, 10_000).len();
        assert!((4_700..5_300).contains(&seen), "half of the errors are negative: {seen}");
    }
}
