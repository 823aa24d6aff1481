//! Where a laser is, from its own scans.

use super::source::SimulatedLaser2d;
use crate::frame::Frame;
use crate::pose_estimator::{LevelMatching, Located, PoseEstimator};

/// Matches what a laser sees at each look of its robot. A look has the images of cameras, if a robot has any, and no scan; so this one
/// takes it, of the look's number, with which the laser then takes the same one again where the robot scans.
pub struct LaserMatching {
    laser: SimulatedLaser2d,
    matching: LevelMatching,
    looks: u64,
}

impl LaserMatching {
    /// Of no look yet.
    pub fn new(laser: SimulatedLaser2d, matching: LevelMatching) -> Self {
        Self { laser, matching, looks: 0 }
    }
}

impl PoseEstimator for LaserMatching {
    fn locate(&mut self, frame: &Frame) -> Located {
        self.looks += 1;
        let seen = match &frame.pose {
            Ok(pose) => self.laser.look(pose, self.looks),
            Err(why) => return Located::Bad(why.clone()),
        };
        let points = seen.points.iter().collect();
        self.matching.locate(&Frame { points, no_return: seen.no_return.iter().collect(), ..frame.clone() })
    }
}
