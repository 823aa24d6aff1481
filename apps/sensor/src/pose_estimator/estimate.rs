//! What an estimator of poses is asked, and what it answers.

use elk_geometry::Pose;
use nalgebra::Point3;

use crate::frame::Frame;

/// The first pose is where it is said to be, and sees nothing that was seen before.
pub(crate) const AGREED: f64 = 1.0;

/// Says where frames were taken. It is given all frames of a run that can be used, in their order, and says the same of the same frames.
pub trait PoseEstimator: Send {
    /// Where the next frame was taken.
    fn locate(&mut self, frame: &Frame) -> Located;

    /// Whether what it says is its own, and not the recording's word.
    fn estimates(&self) -> bool {
        true
    }

    /// Whether it looks at the points of frames.
    fn goes_by_points(&self) -> bool {
        false
    }
}

/// What is known of where a frame was taken.
#[derive(Debug, Clone, PartialEq)]
pub enum Located {
    /// There (world), with the covariance, row by row, where it is known, and the share of what it could see again that it did see (0 to 1).
    At(Pose, Vec<f64>, f64),
    /// Nobody knows. The frames to come are looked for in what was seen before.
    Lost(String),
    /// What was seen before is given up, since frames were lost for too long: nobody knows where those from here on are to those before.
    Apart(String),
    /// The frame cannot be used for that.
    Bad(String),
}

/// A camera at the origin that looks along x, level, so that z is up as in every world: where one is taken to be of which nothing is known.
pub(crate) fn level() -> Pose {
    Pose::from_yaw_pitch(Point3::origin(), 0.0, 0.0)
}

/// Where the recording says.
pub struct Recorded;

impl PoseEstimator for Recorded {
    fn locate(&mut self, frame: &Frame) -> Located {
        match &frame.pose {
            Ok(pose) => Located::At(*pose, Vec::new(), AGREED),
            Err(why) => Located::Bad(why.clone()),
        }
    }

    fn estimates(&self) -> bool {
        false
    }
}
