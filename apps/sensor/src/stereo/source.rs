//! The recording: one pair after the other.

use std::path::Path;

use elk_geometry::Pose;
use elk_spatial::CameraInfo;
use elk_spatial::checks::MAX_POINTS;
use elk_spatial::pixels::PixelRun;
use elk_stereo::{Matcher, Rectification, Rig};
use nalgebra::Isometry3;

use super::images;
use super::layout::{Folder, Listed, RIGHT, folder};
use crate::camera::Camera;
use crate::frame::{BadFrame, Frame};
use crate::pose_estimator::level;
use crate::recording::{FolderError, Recording};
use crate::stereo_pair::{Pair, Rectified, pixel_runs, seen};

/// What is known of a recorded stereo camera, beside its calibration.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Settings {
    /// How far its points are believed (m); `None`: all are.
    pub range: Option<f64>,
    /// Standard deviation of a disparity (px).
    pub disparity_sigma: f64,
    /// Frames a second, where no times are recorded.
    pub frame_rate: f64,
}

/// A recorded stereo camera. Its frame is that of the rectified left camera.
pub struct Stereo {
    settings: Settings,
    matcher: Box<dyn Matcher + Send>,
    rectified: Rectified,
    /// Columns and rows of its images.
    size: [usize; 2],
    /// The rectified left camera's frame in that of which poses are recorded.
    posed_from_camera: Isometry3<f64>,
    pairs: Vec<Listed>,
    next: usize,
    start: Pose,
    /// What became of the last frame's pixels.
    pixel_runs: Vec<PixelRun>,
    remarks: Vec<String>,
}

impl Stereo {
    /// The recording in a folder, whose pairs `matcher` matches.
    ///
    /// # Errors
    /// There is none, or its cameras are no stereo camera.
    pub fn open(path: &Path, settings: Settings, matcher: Box<dyn Matcher + Send>) -> Result<Self, FolderError> {
        let Folder { calibration, calibration_name, posed_from_left, pairs, remarks } = folder(path)?;
        let size = calibration.left.size;
        let unfit = |why: String| FolderError::File { file: calibration_name.clone().into(), why };
        let rectification = Rectification::new(&calibration).map_err(|error| unfit(error.to_string()))?;
        if size[0] * size[1] > MAX_POINTS {
            return Err(unfit(format!(
                "cameras of {} × {} pixels: a scan has at most {MAX_POINTS} points",
                size[0], size[1]
            )));
        }
        if pairs.iter().all(|pair| pair.images.is_err()) {
            let first = pairs.iter().find_map(|pair| pair.images.clone().err()).unwrap_or_else(|| RIGHT.to_owned());
            return Err(FolderError::Unusable { folder: path.to_owned(), images: "pairs", frames: pairs.len(), first });
        }
        let posed_from_camera = posed_from_left * rectification.left_from_rectified();
        let first = pairs.iter().find_map(|pair| pair.pose.as_ref().ok());
        let start = first.map_or(level(), |pose| Pose(pose.0 * posed_from_camera));
        let rectified = Rectified { rectification, calibration_name };
        Ok(Self {
            settings,
            matcher,
            rectified,
            size,
            posed_from_camera,
            pairs,
            next: 0,
            start,
            pixel_runs: Vec::new(),
            remarks,
        })
    }

    /// The rectified cameras.
    pub fn rig(&self) -> &Rig {
        self.rectified.rectification.rig()
    }

    /// Columns and rows of their images.
    pub fn size(&self) -> [usize; 2] {
        self.size
    }

    fn frame(&mut self, index: usize, secs: f64) -> Result<Frame, BadFrame> {
        let Listed { name, images, pose, .. } = &self.pairs[index];
        let bad = |why: String| BadFrame { frame: name.clone(), why };
        let paths = images.as_ref().map_err(|why| bad(why.clone()))?;
        let images = [images::read(&paths[0]).map_err(bad)?, images::read(&paths[1]).map_err(bad)?];
        let names = paths.each_ref().map(|path| path.display().to_string());
        let pair = Pair { images, names, rectified: &self.rectified };
        let outcome = pair.matched(&mut *self.matcher).map_err(|error| bad(error.to_string()))?;
        let (points, no_return) = seen(self.rig(), outcome.disparity(), self.settings.range);
        self.pixel_runs = pixel_runs(outcome.disparity());
        Ok(Frame {
            name: name.clone(),
            secs,
            pose: pose.clone().map(|pose| Pose(pose.0 * self.posed_from_camera)),
            odometry: None,
            pair: Some(outcome.into_images()),
            points,
            no_return,
        })
    }

    fn secs(&self, i: usize) -> Option<f64> {
        let pair = self.pairs.get(i)?;
        let first = self.pairs.iter().find_map(|pair| pair.secs);
        let since = |secs: f64| (secs - first.unwrap_or(secs)).max(0.0);
        Some(pair.secs.map_or(i as f64 / self.settings.frame_rate, since))
    }
}

impl Recording for Stereo {
    fn camera(&self) -> CameraInfo {
        let (rig, [width, height]) = (self.rig(), self.size);
        let camera = Camera { width: width as u32, height: height as u32, focal_px: rig.focal() };
        let inverse_depth_sigma = self.settings.disparity_sigma / (rig.focal() * rig.baseline());
        CameraInfo { inverse_depth_sigma, ..camera.info(self.settings.range.unwrap_or(0.0)) }
    }

    fn next_secs(&self) -> Option<f64> {
        self.secs(self.next)
    }

    fn next(&mut self) -> Option<Result<Frame, BadFrame>> {
        let secs = self.secs(self.next)?;
        self.next += 1;
        Some(self.frame(self.next - 1, secs))
    }

    fn pixel_runs(&self) -> Vec<PixelRun> {
        self.pixel_runs.clone()
    }

    fn start(&self) -> Pose {
        self.start
    }

    fn remarks(&self) -> Vec<String> {
        self.remarks.clone()
    }
}
