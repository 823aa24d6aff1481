//! Visual odometry: where two cameras are, from their images (thesis 2.2.3).

use elk_geometry::Pose;
use elk_odometry::{Odometry, OdometryConfig, SetupError, Tracked};
use elk_stereo::Rig;
use nalgebra::Isometry3;

use super::estimate::{AGREED, Located, PoseEstimator, level};
use crate::frame::Frame;

/// What pairs are followed.
#[derive(Debug, Clone, PartialEq)]
pub struct VisualOdometrySettings {
    /// The rectified cameras.
    pub rig: Rig,
    /// Columns and rows of their images.
    pub size: [usize; 2],
    /// After so many lost pairs in a row what was seen before is given up; `None`: never.
    pub patience: Option<u64>,
    /// So many keyframes of before are kept, and taken up again where their views are seen again.
    pub memory: usize,
    /// Of the random numbers by which a consensus is looked for.
    pub seed: u64,
}

/// An [`Odometry`] that begins with the first pair that shows enough, where the recording says, or at the origin.
pub struct VisualOdometry {
    settings: VisualOdometrySettings,
    odometry: Option<Odometry>,
    /// How many frames were lost since one was found.
    lost: u64,
}

impl VisualOdometry {
    /// One that has seen nothing.
    ///
    /// # Errors
    /// Settings out of range, and images too small to follow anything.
    pub fn new(settings: VisualOdometrySettings) -> Result<Self, SetupError> {
        // What is wrong with settings is said before there is a frame.
        begun(&settings, Pose(Isometry3::identity()))?;
        Ok(Self { settings, odometry: None, lost: 0 })
    }
}

fn begun(settings: &VisualOdometrySettings, start: Pose) -> Result<Odometry, SetupError> {
    let VisualOdometrySettings { rig, size, patience, memory, seed } = *settings;
    Odometry::new(rig, size, OdometryConfig { patience, memory, seed, ..OdometryConfig::for_images(size) }, start)
}

impl PoseEstimator for VisualOdometry {
    fn locate(&mut self, frame: &Frame) -> Located {
        let Some([left, right]) = &frame.pair else {
            return Located::Bad("there is no pair of images, from which visual odometry goes".to_owned());
        };
        let begins = self.odometry.is_none();
        let start = frame.pose.as_ref().map_or(level(), |pose| *pose);
        let mut odometry = match self.odometry.take().map_or_else(|| begun(&self.settings, start), Ok) {
            Ok(odometry) => odometry,
            Err(error) => return Located::Bad(error.to_string()),
        };
        let tracked = odometry.track(left, right);
        let supposed = odometry.supposed();
        let lost = std::mem::take(&mut self.lost);
        // One that could not begin with this pair begins with a later one, where that was taken.
        self.odometry = Some(odometry).filter(|_| !begins || tracked == Ok(Tracked::Started));
        match tracked {
            Ok(Tracked::Started) if begins => Located::At(supposed, Vec::new(), AGREED),
            Ok(Tracked::Started) => Located::Apart(format!(
                "{lost} frames before it were lost, and it shows nothing of what was seen before them: nobody knows where it is to those"
            )),
            Ok(Tracked::Found(estimate)) => {
                let covariance = estimate.covariance.transpose().iter().copied().collect();
                let health = estimate.health;
                Located::At(estimate.pose, covariance, health.inliers as f64 / health.of.max(1) as f64)
            }
            Ok(Tracked::Lost(why)) => {
                self.lost = lost + 1;
                Located::Lost(why.to_string())
            }
            Err(error) => {
                self.lost = lost;
                Located::Bad(error.to_string())
            }
        }
    }
}
