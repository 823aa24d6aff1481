//! The recording: one image of depths after the other.

use std::path::Path;

use elk_geometry::Pose;
use elk_outside::file;
use elk_registration::DepthCamera;
use elk_spatial::CameraInfo;
use nalgebra::Isometry3;

use super::depth_image::{DepthImage, depth_image};
use super::layout::{Folder, Listed, folder};
use crate::frame::{BadFrame, Frame};
use crate::recording::{FolderError, Recording};

/// The longest file of depths that is read (bytes).
const LONGEST_IMAGE: u64 = 1 << 26;

/// What is known of a recorded depth camera.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Settings {
    /// Its pinhole, and what its counts mean.
    pub camera: DepthCamera,
    /// Of so many columns and rows one is taken.
    pub stride: usize,
    /// Frames a second, where no times are recorded.
    pub frame_rate: f64,
}

/// A recorded depth camera.
#[derive(Debug, Clone)]
pub struct Rgbd {
    settings: Settings,
    frames: Vec<Listed>,
    next: usize,
    /// Columns and rows of its images: those of the first that is one.
    size: [usize; 2],
    start: Pose,
    remarks: Vec<String>,
}

impl Rgbd {
    /// The recording in a folder.
    ///
    /// # Errors
    /// There is none, or none of its images is one.
    pub fn open(path: &Path, settings: Settings) -> Result<Self, FolderError> {
        let Folder { frames, remarks } = folder(path)?;
        let mut first = None;
        for frame in &frames {
            match image(frame) {
                Ok(image) => {
                    let size = [image.width, image.height];
                    let start = frames.iter().find_map(|frame| frame.pose().ok());
                    let start = start.unwrap_or(Pose(Isometry3::identity()));
                    return Ok(Self { settings, frames, next: 0, size, start, remarks });
                }
                Err(why) => first = first.or(Some(format!("{}: {why}", frame.name))),
            }
        }
        let (frames, first) = (frames.len(), first.unwrap_or_default());
        Err(FolderError::Unusable { folder: path.to_owned(), images: "depth images", frames, first })
    }

    fn frame(&self, frame: &Listed, secs: f64) -> Result<Frame, String> {
        let image = image(frame)?;
        let ([columns, rows], [width, height]) = (self.size, [image.width, image.height]);
        if self.size != [width, height] {
            return Err(format!(
                "it is of {width} × {height} pixels: {columns} × {rows}, as the others, would be right"
            ));
        }
        if image.depths.iter().all(|depth| *depth == 0) {
            return Err(
                "none of its pixels has a depth, all are 0: right is an image that something was measured in".into()
            );
        }
        let Settings { camera, stride, .. } = self.settings;
        let points = camera.points(&image.depths, width, stride).map_err(|error| error.to_string())?;
        Ok(Frame {
            name: frame.name.clone(),
            secs,
            pose: frame.pose(),
            odometry: None,
            pair: None,
            points,
            no_return: Vec::new(),
        })
    }

    fn secs(&self, i: usize) -> Option<f64> {
        let frame = self.frames.get(i)?;
        let since = |secs: f64| (secs - self.frames[0].secs.unwrap_or(secs)).max(0.0);
        Some(frame.secs.map_or(i as f64 / self.settings.frame_rate, since))
    }
}

fn image(frame: &Listed) -> Result<DepthImage, String> {
    let unread = |error| format!("{error}; right is a PNG of 16 bits grey of this name in the recording's folder");
    let bytes = file::read(frame.depths.as_ref()?, LONGEST_IMAGE).map_err(unread)?;
    depth_image(&bytes).map_err(|error| error.to_string())
}

impl Recording for Rgbd {
    fn camera(&self) -> CameraInfo {
        let DepthCamera { focal, centre, range, .. } = self.settings.camera;
        let angle = |axis: usize| {
            let (before, behind) = (centre[axis], self.size[axis] as f32 - centre[axis]);
            f64::from((before / focal[axis]).atan() + (behind / focal[axis]).atan()).max(0.0)
        };
        // An image has at most as many pixels as a scan has points.
        let pixels = |axis: usize| self.size[axis].div_ceil(self.settings.stride) as u32;
        let [fov_x, fov_y] = [0, 1].map(angle);
        let range_m = f64::from(range[1]);
        CameraInfo { columns: pixels(0), rows: pixels(1), fov_x, fov_y, range_m, inverse_depth_sigma: 0.0 }
    }

    fn next_secs(&self) -> Option<f64> {
        self.secs(self.next)
    }

    fn next(&mut self) -> Option<Result<Frame, BadFrame>> {
        let (listed, secs) = (self.frames.get(self.next)?, self.secs(self.next)?);
        let frame = self.frame(listed, secs).map_err(|why| BadFrame { frame: listed.name.clone(), why });
        self.next += 1;
        Some(frame)
    }

    fn start(&self) -> Pose {
        self.start
    }

    fn remarks(&self) -> Vec<String> {
        self.remarks.clone()
    }
}

#[cfg(test)]
mod tests {
    use super::super::layout::folder;
    use super::*;

    #[test]
    fn an_image_is_read_up_to_its_longest() {
        let recording = tempfile::tempdir().unwrap();
        std::fs::write(recording.path().join("depth.txt"), "1 a.png\n").unwrap();
        std::fs::write(recording.path().join("groundtruth.txt"), "1 0 0 0 0 0 0 1\n").unwrap();
        std::fs::File::create(recording.path().join("a.png")).unwrap().set_len((64 << 20) + 1).unwrap();
        let frames = folder(recording.path()).unwrap().frames;
        let said = image(&frames[0]).map(drop).unwrap_err();
        assert!(said.starts_with("it is longer than 67 MB"), "{said}");
    }
}
