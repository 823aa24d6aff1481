//! What was recorded, frame by frame.

use elk_geometry::Pose;
use elk_spatial::CameraInfo;
use elk_spatial::pixels::PixelRun;
use nalgebra::Isometry3;

use crate::frame::{BadFrame, Frame};

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

    /// What became of all pixels of the frame that was taken last, row by row, of a camera that matches images; empty: it is none.
    fn pixel_runs(&self) -> Vec<PixelRun> {
        Vec::new()
    }

    /// Where the sensor was at the beginning (world), if that is recorded.
    fn start(&self) -> Pose {
        Pose(Isometry3::identity())
    }

    /// What whoever plays it should know before.
    fn remarks(&self) -> Vec<String> {
        Vec::new()
    }
}
