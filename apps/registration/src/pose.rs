//! What registration asks of poses, the same in the plane and in space.

use nalgebra::{Isometry2, Isometry3, Matrix2, Matrix3, SMatrix, SVector, Vector2, Vector3};

/// A rigid motion of D dimensions with N degrees of freedom: [`Isometry2`] and [`Isometry3`].
///
/// A pose takes points of the sensor's frame into that of the map: p_map = R p + t. Small changes of it are N numbers: D of translation in
/// metres, then N − D of rotation in radians, both along the axes of the map, the rotation about the sensor. So a change means the same
/// however far the sensor is from the map's origin.
pub trait Pose<const D: usize, const N: usize>:
    Copy + PartialEq + std::fmt::Debug + std::ops::Mul<Output = Self>
{
    /// The pose at the origin.
    fn identity() -> Self;
    /// The motion back.
    fn inverse(&self) -> Self;
    /// R.
    fn rotation(&self) -> SMatrix<f64, D, D>;
    /// t, metres: where the sensor is.
    fn position(&self) -> SVector<f64, D>;
    /// By how much it turns, radians, 0 to π.
    fn angle(&self) -> f64;
    /// The pose changed by a step: t + v, exp(ω) R.
    fn moved(&self, step: &SVector<f64, N>) -> Self;
    /// The step from this pose to another: the inverse of [`Pose::moved`].
    fn step_to(&self, other: &Self) -> SVector<f64, N>;
    /// How a point's distance from a plane changes with the pose: (n, a × n) for a normal n and a point that lies off the sensor by the arm
    /// a, in the axes of the map.
    fn slope(normal: &SVector<f64, D>, arm: &SVector<f64, D>) -> SVector<f64, N>;

    /// That it can be a sensor's.
    ///
    /// # Errors
    /// Numbers that are not finite, and positions beyond [`MAX_POSITION`].
    fn check(&self) -> Result<(), PoseError> {
        let position = self.position();
        let is_rotation = self.rotation().iter().all(|x| x.is_finite());
        match is_rotation && position.iter().all(|x| x.abs() <= MAX_POSITION) {
            true => Ok(()),
            false => Err(PoseError { position: position.iter().copied().collect() }),
        }
    }
}

/// How far from the map's origin a sensor may be along each axis, metres.
pub const MAX_POSITION: f64 = 10_000.0;

/// A pose that no sensor has.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[error("a pose at {position:?}: finite numbers, and a position within ±{MAX_POSITION} m, would be right")]
pub struct PoseError {
    /// Where it is, metres.
    pub position: Vec<f64>,
}

impl Pose<2, 3> for Isometry2<f64> {
    fn identity() -> Self {
        Isometry2::identity()
    }

    fn inverse(&self) -> Self {
        Isometry2::inverse(self)
    }

    fn rotation(&self) -> Matrix2<f64> {
        *self.rotation.to_rotation_matrix().matrix()
    }

    fn position(&self) -> Vector2<f64> {
        self.translation.vector
    }

    fn angle(&self) -> f64 {
        self.rotation.angle().abs()
    }

    fn moved(&self, step: &SVector<f64, 3>) -> Self {
        Isometry2::new(self.position() + step.xy(), self.rotation.angle() + step.z)
    }

    fn step_to(&self, other: &Self) -> SVector<f64, 3> {
        let turn = self.rotation.rotation_to(&other.rotation).angle();
        (other.position() - self.position()).push(turn)
    }

    fn slope(normal: &Vector2<f64>, arm: &Vector2<f64>) -> Vector3<f64> {
        Vector3::new(normal.x, normal.y, arm.perp(normal))
    }
}

impl Pose<3, 6> for Isometry3<f64> {
    fn identity() -> Self {
        Isometry3::identity()
    }

    fn inverse(&self) -> Self {
        Isometry3::inverse(self)
    }

    fn rotation(&self) -> Matrix3<f64> {
        *self.rotation.to_rotation_matrix().matrix()
    }

    fn position(&self) -> Vector3<f64> {
        self.translation.vector
    }

    fn angle(&self) -> f64 {
        self.rotation.angle()
    }

    fn moved(&self, step: &SVector<f64, 6>) -> Self {
        let turn = nalgebra::UnitQuaternion::from_scaled_axis(step.fixed_rows::<3>(3).into_owned());
        // Products of unit quaternions leave the sphere by rounding, which adds up over a run.
        let rotation = nalgebra::UnitQuaternion::new_normalize((turn * self.rotation).into_inner());
        Isometry3::from_parts((self.position() + step.fixed_rows::<3>(0)).into(), rotation)
    }

    fn step_to(&self, other: &Self) -> SVector<f64, 6> {
        let turn = (other.rotation * self.rotation.inverse()).scaled_axis();
        let way = other.position() - self.position();
        SVector::from([way.x, way.y, way.z, turn.x, turn.y, turn.z])
    }

    fn slope(normal: &Vector3<f64>, arm: &Vector3<f64>) -> SVector<f64, 6> {
        let turn = arm.cross(normal);
        SVector::from([normal.x, normal.y, normal.z, turn.x, turn.y, turn.z])
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Differences of the distance of a point from a plane, as the pose takes small steps.
    fn differences<P: Pose<D, N>, const D: usize, const N: usize>(
        pose: P,
        point: SVector<f64, D>,
        normal: SVector<f64, D>,
    ) -> (SVector<f64, N>, SVector<f64, N>) {
        let at = |pose: &P| pose.rotation() * point + pose.position();
        let numeric = SVector::from_fn(|i, _| {
            let step = SVector::from_fn(|j, _| if i == j { 1e-6 } else { 0.0 });
            (normal.dot(&at(&pose.moved(&step))) - normal.dot(&at(&pose.moved(&-step)))) / 2e-6
        });
        (P::slope(&normal, &(at(&pose) - pose.position())), numeric)
    }

    #[test]
    fn a_step_leads_from_pose_to_pose() {
        let [a, b] =
            [0.3, -2.0].map(|x| Isometry3::new(Vector3::new(x, 2.0, 3.0 * x), Vector3::new(0.3, -0.2 * x, 1.1)));
        let there = a.moved(&a.step_to(&b));
        assert!((there.inverse() * b).translation.vector.norm() < 1e-12 && there.rotation.angle_to(&b.rotation) < 1e-7);
        let [a, b] = [3.0, -3.0].map(|x| Isometry2::new(Vector2::new(x, 2.0), x));
        assert!((a.step_to(&b) - Vector3::new(-6.0, 0.0, std::f64::consts::TAU - 6.0)).norm() < 1e-12);
        assert!((a.moved(&a.step_to(&b)).inverse() * b).translation.vector.norm() < 1e-12);
    }

    #[test]
    fn slopes_are_those_of_distances() {
        let pose = Isometry3::new(Vector3::new(30.0, -2.0, 1.0), Vector3::new(0.3, -0.8, 1.1));
        let (slope, numeric) = differences(pose, Vector3::new(1.0, 2.0, 3.0), Vector3::new(0.6, 0.0, 0.8));
        assert!((slope - numeric).norm() < 1e-7, "{slope} {numeric}");
        let pose = Isometry2::new(Vector2::new(30.0, -2.0), 2.0);
        let (slope, numeric) = differences(pose, Vector2::new(1.0, 2.0), Vector2::new(0.6, 0.8));
        assert!((slope - numeric).norm() < 1e-7, "{slope} {numeric}");
    }
}
