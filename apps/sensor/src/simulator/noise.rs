//! Noise as a stereo camera has it (thesis 6.5.3): on the position at which a pixel was matched, before triangulation.

use nalgebra::Point3;

use crate::camera::Camera;
use elk_geometry::random::Random;

/// Focal length of the thesis' stereo images (px): 512 px of a Bumblebee2 that sees 66° (thesis 3.1.2.3; 512 × 384 px, 5.8.1.1).
pub const STEREO_FOCAL_PX: f64 = 394.2;

/// A stereo camera's matching error.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct StereoNoise {
    /// Standard deviation of the matched position in the left image, along u and along v (px of the stereo camera).
    pub sigma_px: f64,
    /// Focal length of the stereo camera (px): what a pixel is.
    pub focal_px: f64,
    /// Distance between the two cameras (m). The error in depth grows with depth² · σ / (focal length · baseline).
    pub baseline_m: f64,
}

impl StereoNoise {
    /// Standard deviation of inverse depth (1/m).
    pub fn inverse_depth_sigma(&self) -> f64 {
        self.sigma_px / (self.focal_px * self.baseline_m)
    }

    /// The point (m, camera frame) that triangulation makes of what is seen at (u, v) (px) at `depth` (m).
    ///
    /// The left position moves by N(0, σ²) along both axes; the right one, `f·B/depth` to its left, stays. So the
    /// disparity carries the error of u, and the depth error is skewed: long towards the far side. A disparity that is
    /// not positive is no measurement.
    pub fn measure(&self, camera: &Camera, (u, v): (f64, f64), depth: f64, random: &mut Random) -> Option<Point3<f64>> {
        let (du, dv) = random.normal_pair();
        let (du, dv) = (self.sigma_px * du, self.sigma_px * dv);
        let scale = self.focal_px * self.baseline_m;
        let disparity = scale / depth + du;
        let pixel = camera.focal_px / self.focal_px;
        (disparity > 0.0).then(|| camera.point(u + du * pixel, v + dv * pixel, scale / disparity))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Of the camera's own pixels.
    const STEREO: StereoNoise = StereoNoise { sigma_px: 0.5, focal_px: 417.03, baseline_m: 0.12 };

    fn camera() -> Camera {
        Camera { width: 640, height: 480, focal_px: STEREO.focal_px }
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
        assert!((STEREO.inverse_depth_sigma() * scale - 0.5).abs() < 1e-12, "and it is what scans say of it");
        let standard_error = 0.5 / (n as f64).sqrt();
        assert!(mean.abs() < 5.0 * standard_error);
        assert!((variance.sqrt() - 0.5).abs() < 5.0 * standard_error);
    }

    /// The same matching error, of finer pixels, is a smaller one along the ray and beside it.
    #[test]
    fn a_pixel_is_the_stereo_cameras() {
        let camera = camera();
        let measure = |focal_px: f64| {
            let noise = StereoNoise { focal_px, ..STEREO };
            let point = noise.measure(&camera, (100.5, 50.5), 2.0, &mut Random::new(3, 1)).unwrap();
            (1.0 / point.z - 0.5, (point - camera.point(100.5, 50.5, point.z)) / point.z)
        };
        let ((coarse, aside), (fine, less)) = (measure(417.03), measure(4.0 * 417.03));
        assert!((coarse / fine - 4.0).abs() < 1e-9 && (aside.norm() / less.norm() - 4.0).abs() < 1e-9);
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
