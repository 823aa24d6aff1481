//! Odometry that drifts: where motions lead that are measured with an error.

use elk_geometry::Pose;
use elk_geometry::random::Random;
use nalgebra::{Isometry3, Translation3, UnitQuaternion, Vector3};

use super::estimate::{AGREED, Located, PoseEstimator};
use crate::frame::Frame;

/// By how much the odometry errs, as standard deviations.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Drift {
    /// Of the length of a motion, as a share of it.
    pub way: f64,
    /// Of its turn, as a share of it.
    pub turn: f64,
    /// Seed of both.
    pub seed: u64,
}

/// Streams of random numbers of a seed: scans and the start draw from those from 0 on, motions from those from here on.
const STREAM: u64 = 1 << 62;

/// Adds up the true motions, each measured with errors of its length and its turn about the vertical that are normal and independent
/// (Thrun, Burgard and Fox, *Probabilistic Robotics*, 5.4, with their α₁ and α₃ only). It is never lost, and knows nothing of its error.
pub struct DriftingOdometry {
    drift: Drift,
    motions: u64,
    /// Where the last frame was taken, truly and as said.
    last: Option<(Isometry3<f64>, Isometry3<f64>)>,
}

impl DriftingOdometry {
    /// One that has not moved.
    pub fn new(drift: Drift) -> Self {
        Self { drift, motions: 0, last: None }
    }
}

impl PoseEstimator for DriftingOdometry {
    fn locate(&mut self, frame: &Frame) -> Located {
        let now = match &frame.pose {
            Ok(pose) => pose.0,
            Err(why) => return Located::Bad(why.clone()),
        };
        let said = self.last.map_or(now, |(truly, said)| {
            let motion = truly.inverse() * now;
            self.motions += 1;
            let (way, turn) = Random::new(self.drift.seed, STREAM + self.motions).normal_pair();
            let turned = motion.rotation.angle() * self.drift.turn * turn;
            let went = motion.translation.vector * (1.0 + self.drift.way * way);
            let measured = said * Isometry3::from_parts(Translation3::from(went), motion.rotation);
            let mut rotation = UnitQuaternion::from_axis_angle(&Vector3::z_axis(), turned) * measured.rotation;
            rotation.renormalize();
            Isometry3::from_parts(measured.translation, rotation)
        });
        self.last = Some((now, said));
        Located::At(Pose(said), Vec::new(), AGREED)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use nalgebra::Point3;

    fn frame(pose: Pose) -> Frame {
        Frame {
            name: String::new(),
            secs: 0.0,
            pose: Ok(pose),
            odometry: None,
            pair: None,
            points: Vec::new(),
            no_return: Vec::new(),
        }
    }

    /// Where it is said to be after going 100 times 0.1 m ahead, and turning 100 times 0.1 rad.
    fn after(drift: Drift) -> (f64, f64) {
        let (mut ahead, mut turning) = (DriftingOdometry::new(drift), DriftingOdometry::new(drift));
        let (mut far, mut turned) = (0.0, 0.0);
        for i in 0..=100 {
            let step = f64::from(i) * 0.1;
            let at = |odometry: &mut DriftingOdometry, pose| match odometry.locate(&frame(pose)) {
                Located::At(pose, ..) => pose,
                other => panic!("{other:?}"),
            };
            far = at(&mut ahead, Pose::from_yaw_pitch(Point3::new(step, 0.0, 1.0), 0.0, 0.0)).position().x;
            let truly = Pose::from_yaw_pitch(Point3::origin(), step, 0.0);
            let said = at(&mut turning, truly);
            turned = (truly.0.rotation.inverse() * said.0.rotation).angle();
        }
        (far, turned)
    }

    #[test]
    fn what_it_says_is_off_by_what_was_asked_for_and_the_same_every_time() {
        let exact = after(Drift { way: 0.0, turn: 0.0, seed: 1 });
        assert!((exact.0 - 10.0).abs() < 1e-9 && exact.1 < 1e-9, "{exact:?}");
        // A tenth of each of 100 motions of 0.1 m, or rad: 0.1 × 0.1 × √100 in the end.
        let off: Vec<(f64, f64)> = (1..=200)
            .map(|seed| after(Drift { way: 0.1, turn: 0.1, seed }))
            .map(|(far, turned)| (far - 10.0, turned))
            .collect();
        let deviation =
            |of: fn(&(f64, f64)) -> f64| (off.iter().map(|one| of(one).powi(2)).sum::<f64>() / 200.0).sqrt();
        assert!((deviation(|one| one.0) - 0.1).abs() < 0.02, "{}", deviation(|one| one.0));
        assert!((deviation(|one| one.1) - 0.1).abs() < 0.02, "{}", deviation(|one| one.1));
        assert_eq!(after(Drift { way: 0.1, turn: 0.1, seed: 7 }), after(Drift { way: 0.1, turn: 0.1, seed: 7 }));
    }
}
