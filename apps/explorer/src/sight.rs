//! How wide and how far the robot's camera is sure to see: as its scans say.

use elk_spatial::CameraInfo;
use nalgebra::Vector3;

/// So near the edge of the image (rad) nothing counts as in view: a voxel is not a point, and its centre alone is looked at.
const EDGE_MARGIN: f64 = 2.5 * std::f64::consts::PI / 180.0;

/// What a camera has in view, as a cone around its optical axis: which way up it is held does not matter then.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Sight {
    /// Half the angle of the cone (rad).
    pub half_angle: f64,
    /// How far it sees what is there (m), by its range and by its error; infinite: as far as there is anything.
    pub range_m: f64,
    /// It sees a plane alone, and is held level, so that this is the robot's own layer of voxels.
    pub is_level: bool,
    /// Of [`Sight::half_angle`]: each voxel near a look is held against it.
    cos_half_angle: f64,
    sin_half_angle: f64,
}

impl Sight {
    /// What a camera is sure to see of voxels of `resolution` (m). Of one that is not known that is what it is aimed at.
    pub fn of(camera: &CameraInfo, resolution: f64) -> Self {
        Self::within(camera.cone_half_angle(), camera, resolution)
    }

    /// The same of a robot that stays in its layer of voxels: of a fan that is held level, as wide as that opens.
    pub fn in_layer(camera: &CameraInfo, resolution: f64) -> Self {
        match camera.is_fan() {
            true => Self { is_level: true, ..Self::within(camera.fov_x / 2.0, camera, resolution) },
            false => Self::of(camera, resolution),
        }
    }

    fn within(half_angle: f64, camera: &CameraInfo, resolution: f64) -> Self {
        let half_angle = (half_angle - EDGE_MARGIN).max(0.0);
        let range_m = camera.reach_m().min(camera.resolves_m(resolution));
        let (sin_half_angle, cos_half_angle) = (half_angle.sin(), half_angle.cos());
        Self { half_angle, range_m, is_level: false, cos_half_angle, sin_half_angle }
    }

    /// The direction (unit vector) in which it looks that is to look in this one: the same, or level.
    pub fn held(&self, direction: Vector3<f64>) -> Vector3<f64> {
        let level = || Vector3::new(direction.x, direction.y, 0.0).try_normalize(1e-6).unwrap_or_else(Vector3::x);
        if self.is_level { level() } else { direction }
    }

    /// Whether a camera that looks along `axis` has in view what lies in direction `toward` (unit vectors).
    pub fn covers(&self, axis: &Vector3<f64>, toward: &Vector3<f64>) -> bool {
        toward.dot(axis) >= self.cos_half_angle
    }

    /// Whether a camera that looks along `axis` (unit vector) has in view and in range what is `toward` (m) from it; what is
    /// where the camera is has no direction, and is in view.
    #[inline]
    pub fn has_in_view(&self, axis: &Vector3<f64>, toward: &Vector3<f64>) -> bool {
        let (along, squared) = (toward.dot(axis), toward.norm_squared());
        let edge = self.cos_half_angle * self.cos_half_angle * squared;
        let is_covered = match self.cos_half_angle >= 0.0 {
            true => along >= 0.0 && along * along >= edge,
            false => along >= 0.0 || along * along <= edge,
        };
        is_covered && squared <= self.range_m * self.range_m
    }

    /// Whether a camera that looks along `axis` (unit vector) may have in view and in range anything of a ball of `radius` (m)
    /// whose middle is `toward` (m) from it: it has if not.
    pub fn may_cover(&self, axis: &Vector3<f64>, toward: &Vector3<f64>, radius: f64) -> bool {
        let (squared, farthest) = (toward.norm_squared(), self.range_m + radius);
        let tangent = squared - radius * radius;
        if tangent <= 0.0 {
            return true;
        }
        // Seen from the camera the ball is a cone of half angle β: sin β = radius / distance, cos β = tangent / distance.
        let tangent = tangent.sqrt();
        let [sum_sin, sum_cos] = [
            self.sin_half_angle * tangent + self.cos_half_angle * radius,
            self.cos_half_angle * tangent - self.sin_half_angle * radius,
        ];
        let covers_all = sum_sin <= 0.0;
        squared <= farthest * farthest && (covers_all || toward.dot(axis) >= sum_cos)
    }
}

impl Default for Sight {
    fn default() -> Self {
        Self::of(&CameraInfo::default(), 0.0)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_wide_camera_covers_what_a_narrow_one_does_not() {
        let camera = |degrees: f64| {
            let fov = degrees.to_radians();
            Sight::of(&CameraInfo { fov_x: fov, fov_y: fov, range_m: 4.0, ..CameraInfo::default() }, 0.1)
        };
        let (axis, aside) = (Vector3::x(), Vector3::new(1.0, 0.5, 0.0).normalize());
        assert!(camera(75.0).covers(&axis, &aside) && !camera(40.0).covers(&axis, &aside));
        assert!(camera(40.0).covers(&axis, &axis) && Sight::default().covers(&axis, &axis));
        assert!((camera(75.0).half_angle.to_degrees() - 35.0).abs() < 1e-9);
        assert_eq!((camera(75.0).range_m, Sight::default().range_m), (4.0, f64::INFINITY));
    }

    #[test]
    fn a_fan_that_is_held_level_covers_as_much_as_it_opens() {
        let fan =
            CameraInfo { columns: 540, rows: 1, fov_x: 270_f64.to_radians(), range_m: 10.0, ..CameraInfo::default() };
        let (level, any) = (Sight::in_layer(&fan, 0.1), Sight::of(&fan, 0.1));
        let at = |degrees: f64| Vector3::new(degrees.to_radians().cos(), degrees.to_radians().sin(), 0.0);
        let covers = |sight: &Sight| [0.0, 100.0, 130.0, 140.0].map(|degrees| sight.covers(&at(0.0), &at(degrees)));
        assert_eq!((covers(&level), covers(&any)), ([true, true, true, false], [true, false, false, false]));
        let down = Vector3::new(0.6, 0.0, -0.8);
        assert_eq!((level.held(down), any.held(down)), (Vector3::x(), down));
        let camera = CameraInfo { rows: 400, fov_y: 1.0, ..fan };
        assert_eq!(Sight::in_layer(&camera, 0.1), Sight::of(&camera, 0.1));
    }

    #[test]
    fn what_errs_by_more_than_a_voxel_is_out_of_sight() {
        let camera = CameraInfo { range_m: 4.0, inverse_depth_sigma: 0.1, ..CameraInfo::default() };
        assert_eq!([0.1, 0.4, 10.0].map(|resolution| Sight::of(&camera, resolution).range_m), [1.0, 2.0, 4.0]);
    }
}
