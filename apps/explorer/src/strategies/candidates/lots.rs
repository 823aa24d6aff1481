//! What is drawn by lot, voxel by voxel: the same in every plan, whatever was drawn before.

use elk_geometry::Voxel;
use elk_geometry::random::Random;
use nalgebra::Vector3;

/// The share of the voxels that have a pose (thesis 6.5.1.3: 5 % of the freespace voxels).
const SHARE: f64 = 0.05;

/// Where the camera is, in the middle of that voxel, and the direction (unit vector) in which it looks.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Pose {
    pub place: Voxel,
    pub axis: Vector3<f64>,
}

/// The lots of one seed and draw: a hash of each voxel's indices.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Lots {
    key: u64,
}

impl Lots {
    /// Two draws of one seed have nothing to do with each other.
    pub fn new(seed: u64, draw: u64) -> Self {
        Self { key: Random::new(seed, draw).next_u64() }
    }

    /// The pose in a voxel, if it has one: one voxel of twenty does, and directions are even over the sphere.
    pub fn pose(self, place: Voxel) -> Option<Pose> {
        let mut random = self.of(place);
        (random.unit() < SHARE).then(|| Pose { place, axis: direction(random.unit(), random.unit()) })
    }

    /// A number of a voxel: those of a few voxels with the smallest numbers are an even sample.
    pub fn number(self, voxel: Voxel) -> u64 {
        self.of(voxel).next_u64()
    }

    fn of(self, voxel: Voxel) -> Random {
        // More bits an axis than the indices of a map have.
        let [x, y, z] = voxel.to_array().map(|c| c as u64 & 0x1f_ffff);
        Random::new(self.key, x << 42 | y << 21 | z)
    }
}

/// A direction; evenly over the sphere if both numbers are evenly in [0, 1).
fn direction(height: f64, turn: f64) -> Vector3<f64> {
    let (z, angle) = (2.0 * height - 1.0, std::f64::consts::TAU * turn);
    let radius = (1.0 - z * z).max(0.0).sqrt();
    Vector3::new(radius * angle.cos(), radius * angle.sin(), z)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn block(edge: i32) -> impl Iterator<Item = Voxel> {
        let side = move || -edge..edge;
        side().flat_map(move |x| side().flat_map(move |y| side().map(move |z| Voxel::new(x, y, z))))
    }

    #[test]
    fn one_voxel_of_twenty_has_a_pose_and_they_look_everywhere() {
        let lots = Lots::new(7, 0);
        let poses: Vec<Pose> = block(40).filter_map(|voxel| lots.pose(voxel)).collect();
        let (count, expected) = (poses.len() as f64, 512_000.0 * SHARE);
        // Five standard deviations.
        assert!((count - expected).abs() < 5.0 * (expected * (1.0 - SHARE)).sqrt(), "{count}");
        let sum: Vector3<f64> = poses.iter().map(|pose| pose.axis).sum();
        // Five standard errors of each component's mean, whose variance is a third.
        assert!((sum / count).amax() < 5.0 * (1.0 / 3.0 / count).sqrt(), "{sum}");
        assert!(poses.iter().all(|pose| (pose.axis.norm() - 1.0).abs() < 1e-9));
    }

    #[test]
    fn draws_have_nothing_to_do_with_each_other_and_a_voxel_keeps_its_pose() {
        let drawn = |draw: u64| block(20).filter_map(|voxel| Lots::new(7, draw).pose(voxel)).collect::<Vec<_>>();
        let (one, other) = (drawn(0), drawn(1));
        assert_eq!(one, drawn(0));
        let places: std::collections::BTreeSet<Voxel> = one.iter().map(|pose| pose.place).collect();
        let both = other.iter().filter(|pose| places.contains(&pose.place)).count();
        // As many as by chance: 5 % of 5 % of 64,000 voxels.
        assert!((80..250).contains(&both), "{both}");
    }
}
