//! Where a pair of cameras sees a point, and how that changes with the pose and the point.

use elk_stereo::Rig;
use nalgebra::{Isometry3, Matrix3, Point3, SMatrix, Vector3};

/// How far from the border points are looked for, pixels.
pub(crate) const MARGIN: f64 = 6.0;

/// Where a point is seen in a pair of rectified images: the left image's column and row, and the right image's column, pixels. What is seen in
/// the left one alone has none of the last.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Observation {
    pub left: [f64; 2],
    pub right: Option<f64>,
}

/// A point of the world, metres, and where a pair saw it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Match {
    pub point: Point3<f64>,
    pub seen: Observation,
}

/// Left column, row and right column at which cameras at a pose see a point of the world; none of one that is behind them.
pub(crate) fn project(rig: &Rig, pose: &Isometry3<f64>, point: &Point3<f64>) -> Option<Vector3<f64>> {
    let [row, column, disparity] = rig.project(&pose.inverse_transform_point(point))?;
    Some(Vector3::new(column, row, column - disparity))
}

impl Match {
    /// By how far a pose puts the point beside where it was seen: left column, row, right column, pixels.
    pub fn residual(&self, rig: &Rig, pose: &Isometry3<f64>) -> Option<Vector3<f64>> {
        Some(self.off(project(rig, pose, &self.point)?))
    }

    /// Whether the right camera of a pair at a pose has the point in its image, as far to the left as that goes.
    pub fn is_in_right(&self, rig: &Rig, pose: &Isometry3<f64>) -> bool {
        project(rig, pose, &self.point).is_some_and(|seen| seen.z >= MARGIN)
    }

    fn off(&self, predicted: Vector3<f64>) -> Vector3<f64> {
        let [column, row] = self.seen.left;
        let right = self.seen.right.map_or(0.0, |right| predicted.z - right);
        Vector3::new(predicted.x - column, predicted.y - row, right)
    }

    /// The residual and its slopes; none where the cameras would have the point behind them.
    pub fn linear(&self, rig: &Rig, pose: &Isometry3<f64>) -> Option<Linear> {
        let arm = self.point - pose.translation.vector;
        let camera = pose.inverse_transform_point(&self.point);
        let [row, column, disparity] = rig.project(&camera)?;
        let residual = self.off(Vector3::new(column, row, column - disparity));
        let per_metre = rig.focal() / camera.z;
        let ahead = |x: f64| -per_metre * x / camera.z;
        let right = if self.seen.right.is_some() { 1.0 } else { 0.0 };
        #[rustfmt::skip]
        let by_camera = Matrix3::new(
            per_metre, 0.0, ahead(camera.x),
            0.0, per_metre, ahead(camera.y),
            right * per_metre, 0.0, right * ahead(camera.x - rig.baseline()),
        );
        let by_point = by_camera * pose.rotation.inverse().to_rotation_matrix().matrix();
        let by_turn = by_point * arm.coords.cross_matrix();
        let mut by_pose = SMatrix::<f64, 3, 6>::zeros();
        by_pose.fixed_columns_mut::<3>(0).copy_from(&-by_point);
        by_pose.fixed_columns_mut::<3>(3).copy_from(&by_turn);
        Some(Linear { residual, by_pose, by_point })
    }
}

/// A residual (pixels), and how it changes with the pose, by steps as [`elk_registration::Pose::moved`] takes them (metres, then radians), and
/// with the point (metres).
#[derive(Clone, Copy, Debug)]
pub(crate) struct Linear {
    pub residual: Vector3<f64>,
    pub by_pose: SMatrix<f64, 3, 6>,
    pub by_point: Matrix3<f64>,
}

impl Linear {
    /// What it counts for, by Cauchy's kernel of a scale in pixels: ρ'(r) / r of ρ(r) = c²/2 ln(1 + r²/c²).
    pub fn weight(&self, scale: f64) -> f64 {
        weight(&self.residual, scale)
    }
}

fn weight(residual: &Vector3<f64>, scale: f64) -> f64 {
    1.0 / (1.0 + residual.norm_squared() / scale.powi(2))
}

/// Cauchy's ρ of a residual, pixels².
pub(crate) fn cost(residual: &Vector3<f64>, scale: f64) -> f64 {
    scale.powi(2) / 2.0 * (residual.norm_squared() / scale.powi(2)).ln_1p()
}

#[cfg(test)]
mod tests {
    use super::*;
    use elk_registration::Pose as _;
    use nalgebra::SVector;
    use proptest::prelude::*;

    fn rig() -> Rig {
        Rig::new(450.0, [240.0, 375.0], 0.11).unwrap()
    }

    proptest! {
        #[test]
        fn slopes_are_those_of_residuals(
            at in prop::array::uniform3(-0.8..0.8f64), turn in prop::array::uniform3(-1.0..1.0f64), depth in 0.8..6.0f64, is_right in any::<bool>(),
        ) {
            let pose = Isometry3::new(Vector3::from(at) * 20.0, turn.into());
            let point = pose * Point3::new(at[1] * depth, at[2] * depth, depth);
            let seen = Observation { left: [200.0, 100.0], right: is_right.then_some(150.0) };
            let one = Match { point, seen };
            let linear = one.linear(&rig(), &pose).unwrap();
            prop_assert!((linear.residual - one.residual(&rig(), &pose).unwrap()).norm() < 1e-9);
            let step = 1e-6;
            for i in 0..6 {
                let [ahead, back] = [step, -step].map(|step| {
                    let by = SVector::<f64, 6>::from_fn(|j, _| if i == j { step } else { 0.0 });
                    one.residual(&rig(), &pose.moved(&by)).unwrap()
                });
                let numeric = (ahead - back) / (2.0 * step);
                prop_assert!((linear.by_pose.column(i) - numeric).norm() < 1e-3 * (1.0 + numeric.norm()), "{i}: {numeric}");
            }
            for i in 0..3 {
                let [ahead, back] = [step, -step].map(|step| {
                    let mut moved = one;
                    moved.point[i] += step;
                    moved.residual(&rig(), &pose).unwrap()
                });
                let numeric = (ahead - back) / (2.0 * step);
                prop_assert!((linear.by_point.column(i) - numeric).norm() < 1e-3 * (1.0 + numeric.norm()), "{i}: {numeric}");
            }
        }

        #[test]
        fn the_weight_is_the_slope_of_the_cost(residual in prop::array::uniform3(-5.0..5.0f64), scale in 0.5..3.0f64) {
            let residual = Vector3::from(residual);
            let step = 1e-6;
            let numeric = (cost(&(residual * (1.0 + step)), scale) - cost(&(residual * (1.0 - step)), scale)) / (2.0 * step);
            prop_assert!((numeric - weight(&residual, scale) * residual.norm_squared()).abs() < 1e-6);
        }
    }

    #[test]
    fn a_point_behind_the_cameras_is_seen_nowhere() {
        let one = Match { point: Point3::new(0.0, 0.0, -1.0), seen: Observation { left: [1.0, 1.0], right: None } };
        assert!(one.linear(&rig(), &Isometry3::identity()).is_none());
        assert_eq!(project(&rig(), &Isometry3::identity(), &one.point), None);
    }
}
