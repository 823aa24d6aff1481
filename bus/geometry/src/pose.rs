//! Where a camera is and where it looks.

use elk_describe::{Describe, Invalid};
use nalgebra::{Isometry3, Matrix3, Point3, Rotation3, Translation3, UnitQuaternion, Vector3};
use serde::{Deserialize, Serialize};

use crate::limits::check_point;

/// Pose of a camera in the world (`pose_world_camera`): takes points of the camera frame (x right, y down, z forward)
/// to the world frame (z up). Metres.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize, Describe)]
#[describe(check = check)]
pub struct Pose(pub Isometry3<f64>);

impl Pose {
    /// The camera at `position` (m, world), its optical axis along `direction` (world; any length but zero), its x axis
    /// level. Looking straight up or down, the image's top points to +x or −x.
    pub fn looking(position: Point3<f64>, direction: Vector3<f64>) -> Self {
        let forward = direction.try_normalize(1e-12).unwrap_or_else(Vector3::x);
        let right = forward.cross(&Vector3::z()).try_normalize(1e-9).unwrap_or(-Vector3::y());
        let down = forward.cross(&right);
        let rotation = Rotation3::from_matrix_unchecked(Matrix3::from_columns(&[right, down, forward]));
        Self(Isometry3::from_parts(Translation3::from(position), UnitQuaternion::from_rotation_matrix(&rotation)))
    }

    /// The camera at `position`, heading `yaw` (rad, anticlockwise from world x), raised by `pitch` (rad, up positive).
    pub fn from_yaw_pitch(position: Point3<f64>, yaw: f64, pitch: f64) -> Self {
        let level = pitch.cos();
        Self::looking(position, Vector3::new(level * yaw.cos(), level * yaw.sin(), pitch.sin()))
    }

    /// Position of the camera's centre (m, world).
    pub fn position(&self) -> Point3<f64> {
        self.0.translation.vector.into()
    }

    /// Unit vector along the optical axis (world).
    pub fn forward(&self) -> Vector3<f64> {
        self.0.rotation * Vector3::z()
    }

    /// Heading (rad, anticlockwise from world x).
    pub fn yaw(&self) -> f64 {
        let forward = self.forward();
        forward.y.atan2(forward.x)
    }

    /// Elevation of the optical axis (rad, up positive).
    pub fn pitch(&self) -> f64 {
        self.forward().z.clamp(-1.0, 1.0).asin()
    }

    /// A point of the camera frame in the world.
    #[inline]
    pub fn to_world(&self, point: Point3<f64>) -> Point3<f64> {
        self.position() + self.turn(point.coords)
    }

    /// A direction of the camera frame in the world: as the product with [`Self::0`]'s rotation, to the bit, but inlined, since
    /// each ray of each scan is turned.
    #[inline]
    pub fn turn(&self, direction: Vector3<f64>) -> Vector3<f64> {
        let cross =
            |[ax, ay, az]: [f64; 3], [bx, by, bz]: [f64; 3]| [ay * bz - az * by, az * bx - ax * bz, ax * by - ay * bx];
        let [i, j, k, w]: [f64; 4] = self.0.rotation.coords.into();
        let (axis, direction) = ([i, j, k], direction.into());
        let twice = cross(axis, direction).map(|c| c * 2.0);
        let again = cross(axis, twice);
        std::array::from_fn::<f64, 3, _>(|n| twice[n] * w + again[n] + direction[n]).into()
    }
}

/// Whether it lies within the world; that its rotation is one, its type sees to.
fn check(pose: &Pose) -> Result<(), Invalid> {
    check_point(&pose.position()).map_err(|inner| inner.within("translation"))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_camera_axes_are_right_down_forward() {
        let pose = Pose::looking(Point3::new(1.0, 2.0, 3.0), Vector3::x());
        assert!((pose.to_world(Point3::new(0.0, 0.0, 2.0)) - Point3::new(3.0, 2.0, 3.0)).norm() < 1e-12);
        assert!((pose.to_world(Point3::new(1.0, 0.0, 0.0)) - Point3::new(1.0, 1.0, 3.0)).norm() < 1e-12);
        assert!((pose.to_world(Point3::new(0.0, 1.0, 0.0)) - Point3::new(1.0, 2.0, 2.0)).norm() < 1e-12);
    }

    /// Written out, the product is the library's.
    #[test]
    fn a_turned_direction_is_the_rotations_product_to_the_bit() {
        for n in 0..200 {
            let [a, b, c] = [0.7, 1.3, 2.9].map(|f| (f64::from(n) * f).sin());
            let pose = Pose::from_yaw_pitch(Point3::new(c, a, b), 3.0 * a, 1.5 * b);
            let (direction, point) = (Vector3::new(b, c, a) * 7.0, Point3::new(c, b, a));
            assert_eq!(pose.turn(direction), pose.0.rotation * direction);
            assert_eq!(pose.to_world(point), pose.0 * point);
        }
    }

    #[test]
    fn yaw_and_pitch_come_back() {
        let pose = Pose::from_yaw_pitch(Point3::origin(), 0.7, -0.3);
        assert!((pose.yaw() - 0.7).abs() < 1e-12 && (pose.pitch() + 0.3).abs() < 1e-12);
        for up in [-1.0, 1.0] {
            assert!((Pose::looking(Point3::origin(), Vector3::z() * up).forward().z - up).abs() < 1e-12);
        }
    }
}
