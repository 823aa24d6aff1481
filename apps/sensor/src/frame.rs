//! What a sensor saw at once.

use elk_geometry::Pose;
use elk_stereo::Image;
use nalgebra::{Isometry2, Point3};

/// What a sensor saw at once, with what else is known of that moment.
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
    /// The left and the right image of two cameras, rectified; none: it is no frame of such.
    pub pair: Option<[Image; 2]>,
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
