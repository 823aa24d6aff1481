//! How far positions lie from the true ones (absolute trajectory error: Sturm et al., IROS 2012).

use nalgebra::{Isometry3, Matrix3, Rotation3, UnitQuaternion, Vector3};

/// The rigid motion that takes positions nearest to others (Horn, JOSA A 1987).
pub fn alignment(from: &[Isometry3<f64>], to: &[Isometry3<f64>]) -> Isometry3<f64> {
    let mean = |poses: &[Isometry3<f64>]| {
        poses.iter().map(|pose| pose.translation.vector).sum::<Vector3<f64>>() / poses.len() as f64
    };
    let (a, b) = (mean(from), mean(to));
    let pairs = from.iter().zip(to);
    let spread: Matrix3<f64> =
        pairs.map(|(from, to)| (to.translation.vector - b) * (from.translation.vector - a).transpose()).sum();
    let svd = spread.svd(true, true);
    let (u, v_t) = (svd.u.unwrap(), svd.v_t.unwrap());
    let mirror = Matrix3::from_diagonal(&Vector3::new(1.0, 1.0, (u * v_t).determinant().signum()));
    let rotation = UnitQuaternion::from_rotation_matrix(&Rotation3::from_matrix_unchecked(u * mirror * v_t));
    Isometry3::from_parts((b - rotation * a).into(), rotation)
}

/// The root mean square of positions' differences, metres, after a rigid motion of all.
pub fn rms(from: &[Isometry3<f64>], to: &[Isometry3<f64>], moved: &Isometry3<f64>) -> f64 {
    let off = |(from, to): (&Isometry3<f64>, &Isometry3<f64>)| {
        ((moved * from).translation.vector - to.translation.vector).norm_squared()
    };
    (from.iter().zip(to).map(off).sum::<f64>() / from.len() as f64).sqrt()
}
