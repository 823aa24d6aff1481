//! How far a way is from the true one.

use nalgebra::Isometry3;

/// The length of a way up to each of its poses, metres.
pub fn way(poses: &[Isometry3<f64>]) -> Vec<f64> {
    let mut length = 0.0;
    let step = |pair: &[Isometry3<f64>]| {
        length += (pair[1].translation.vector - pair[0].translation.vector).norm();
        length
    };
    [0.0].into_iter().chain(poses.windows(2).map(step).collect::<Vec<_>>()).collect()
}

/// By how much motions over stretches of so many metres of the true way are off, from each pose on: the mean error of their position in parts of
/// the stretch, and of their rotation, radians a metre (Geiger, Lenz and Urtasun, CVPR 2012).
pub fn relative(poses: &[Isometry3<f64>], truth: &[Isometry3<f64>], stretch: f64) -> [f64; 2] {
    let length = way(truth);
    let mut sums = [0.0; 2];
    let mut count = 0;
    for i in 0..truth.len() {
        let Some(j) = (i..truth.len()).find(|&j| length[j] - length[i] >= stretch) else { break };
        let motion = |poses: &[Isometry3<f64>]| poses[i].inverse() * poses[j];
        let off = motion(truth).inverse() * motion(poses);
        let over = length[j] - length[i];
        sums = [sums[0] + off.translation.vector.norm() / over, sums[1] + off.rotation.angle() / over];
        count += 1;
    }
    sums.map(|sum| sum / f64::from(count.max(1)))
}
