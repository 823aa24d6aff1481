//! What a depth camera can see, as its scans say it.

use std::f64::consts::TAU;

use elk_bus::payload;
use elk_geometry::limits::FARTHEST_M;

/// A depth camera: how wide, how fine and how far it sees. It travels with every scan, so that nobody who plans or maps has
/// numbers of a camera of his own. All zero: nothing is known of it.
#[payload]
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct CameraInfo {
    /// Pixels in a row; beams of a laser.
    #[describe(unit = "px")]
    pub columns: u32,
    /// Rows; 1: a fan of beams.
    #[describe(unit = "px")]
    pub rows: u32,
    /// Angle from the left edge of the image to the right one (rad).
    #[describe(unit = "rad", range = 0.0..=TAU)]
    pub fov_x: f64,
    /// Angle from its top to its bottom (rad).
    #[describe(unit = "rad", range = 0.0..=TAU)]
    pub fov_y: f64,
    /// How far it sees (m); 0: as far as there is anything.
    #[describe(unit = "m", range = 0.0..=FARTHEST_M)]
    pub range_m: f64,
    /// Standard deviation of inverse depth (1/m): of stereo, that of the matched position (px) over focal length (px) and
    /// baseline (m), so that depth z errs by z² times this. 0: depth is exact, as far as anybody knows.
    #[describe(unit = "1/m", range = 0.0..=MOST_UNCERTAIN, default)]
    pub inverse_depth_sigma: f64,
}

/// An error of inverse depth (1/m) of which nothing is left to know.
const MOST_UNCERTAIN: f64 = 1e3;

impl CameraInfo {
    /// How far away depth errs by no more than a voxel of `resolution` (m), by one standard deviation (m); infinite if it is
    /// exact.
    pub fn resolves_m(&self, resolution: f64) -> f64 {
        if self.inverse_depth_sigma > 0.0 { (resolution / self.inverse_depth_sigma).sqrt() } else { f64::INFINITY }
    }

    /// The farthest that it sees (m), infinite if there is no limit.
    pub fn reach_m(&self) -> f64 {
        if self.range_m > 0.0 { self.range_m } else { f64::INFINITY }
    }

    /// Whether it sees a plane alone: it is a laser whose beams are a fan.
    pub fn is_fan(&self) -> bool {
        self.rows == 1 && self.fov_x > 0.0 && self.fov_y == 0.0
    }

    /// Half the angle (rad) of the widest cone around the optical axis that is all in the image.
    pub fn cone_half_angle(&self) -> f64 {
        self.fov_x.min(self.fov_y) / 2.0
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_cone_that_is_all_in_the_image_is_as_wide_as_its_shorter_side() {
        let camera = CameraInfo { columns: 640, rows: 480, fov_x: 1.2, fov_y: 0.8, ..CameraInfo::default() };
        assert_eq!((camera.cone_half_angle(), camera.reach_m()), (0.4, f64::INFINITY));
        assert_eq!(CameraInfo { range_m: 5.0, ..camera }.reach_m(), 5.0);
        assert_eq!(CameraInfo::default().cone_half_angle(), 0.0, "what is not known is not in view");
        let fan = CameraInfo { columns: 540, rows: 1, fov_x: 4.7, ..CameraInfo::default() };
        assert_eq!([fan, camera, CameraInfo::default()].map(|camera| camera.is_fan()), [true, false, false]);
    }

    #[test]
    fn where_a_voxel_is_resolved_depth_errs_by_a_voxel() {
        let camera = CameraInfo { inverse_depth_sigma: 0.02, ..CameraInfo::default() };
        let z = camera.resolves_m(0.1);
        assert!((z * z * 0.02 - 0.1).abs() < 1e-12);
        assert_eq!(CameraInfo::default().resolves_m(0.1), f64::INFINITY);
    }
}
