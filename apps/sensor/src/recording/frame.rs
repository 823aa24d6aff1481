//! What was recorded, frame by frame.

use elk_geometry::Pose;
use elk_spatial::CameraInfo;
use nalgebra::{Isometry2, Isometry3, Point3};

/// What was recorded, frame by frame.
pub trait Recording: Send {
    /// What its sensor can see.
    fn camera(&self) -> CameraInfo;

    /// Recorded time since the recording's beginning of the frame that comes next (s); none: there is no more.
    fn next_secs(&self) -> Option<f64>;

    /// Takes the next frame, if there is one.
    ///
    /// # Errors
    /// It cannot be used; the one after it perhaps can.
    fn next(&mut self) -> Option<Result<Frame, BadFrame>>;

    /// Where the sensor was at the beginning (world), if that is recorded.
    fn start(&self) -> Pose {
        Pose(Isometry3::identity())
    }
}

/// One frame.
#[derive(Debug, Clone, PartialEq)]
pub struct Frame {
    /// What people call it: its file, or its line.
    pub name: String,
    /// Recorded time since the recording's beginning (s).
    pub secs: f64,
    /// Where it was taken (world), as recorded, or why that is not known.
    pub pose: Result<Pose, String>,
    /// Where wheels say that it was taken, in a frame of theirs; none: there are no wheels.
    pub odometry: Option<Isometry2<f64>>,
    /// Points in the camera frame (x right, y down, z forward; m).
    pub points: Vec<Point3<f32>>,
    /// Directions in the camera frame (unit vectors) in which there is nothing up to the sensor's range.
    pub no_return: Vec<Point3<f32>>,
}

/// A frame that cannot be used.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
#[error("{frame}: {why}")]
pub struct BadFrame {
    /// What people call it.
    pub frame: String,
    /// What was found, and what would be right.
    pub why: String,
}
