//! The depth source: a pair of images, and what a matcher makes of them.

use elk_bus::AppError;
use elk_geometry::Pose;
use elk_spatial::CameraInfo;
use elk_stereo::{Image, ImageError, MatchError, Matcher, Rig, RigError};

use super::eyes::Eyes;
use super::texture::{Look, Texture};
use crate::source::{Capture, DepthSource, Seen, Truth};
use crate::stereo_pair::{pixel_runs, seen};
use crate::surroundings::Body;

/// What a simulated stereo camera is, beside its matcher.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Settings {
    /// Its two cameras.
    pub eyes: Eyes,
    /// How the world looks to them.
    pub look: Look,
    /// How far its points are believed (m); `None`: all are.
    pub range: Option<f64>,
}

/// The stereo camera, and the body that carries it.
pub struct SimulatedStereo {
    body: Body,
    texture: Texture,
    settings: Settings,
    rig: Rig,
    matcher: Box<dyn Matcher + Send>,
    /// The last pair, and what it was asked for: a scan is often made of the pair that was looked at before.
    last: Option<(Capture, [Image; 2])>,
}

impl SimulatedStereo {
    /// A stereo camera that a body carries, whose images `matcher` matches.
    ///
    /// # Errors
    /// Cameras with which nothing can be triangulated.
    pub fn new(body: Body, settings: Settings, matcher: Box<dyn Matcher + Send>) -> Result<Self, RigError> {
        let Eyes { camera, baseline_m, .. } = settings.eyes;
        // elk-stereo counts pixels from their centres.
        let middle = [camera.height, camera.width].map(|side| (f64::from(side) - 1.0) / 2.0);
        let rig = Rig::new(camera.focal_px, middle, baseline_m)?;
        let texture = Texture::new(body.world(), &settings.look);
        Ok(Self { body, texture, settings, rig, matcher, last: None })
    }

    /// Its cameras, whose images are rectified.
    pub fn rig(&self) -> &Rig {
        &self.rig
    }

    /// The left and the right image of a scan, whose pose is that of the left camera.
    ///
    /// # Errors
    /// Cameras of no pixel, or of more than an image may have.
    pub fn render(&self, capture: &Capture) -> Result<[Image; 2], ImageError> {
        self.settings.eyes.render(self.body.world(), &self.texture, &capture.pose, capture.scan)
    }

    /// What is seen in a pair of its images.
    ///
    /// # Errors
    /// Images that are no pair of its cameras.
    pub fn matched(&mut self, [left, right]: &[Image; 2]) -> Result<Seen, MatchError> {
        let disparity = self.matcher.disparity(left, right)?;
        let (points, no_return) = seen(&self.rig, &disparity, self.settings.range);
        let no_return = no_return.into_iter().collect();
        Ok(Seen { points: points.into_iter().collect(), no_return, pixel_runs: pixel_runs(&disparity) })
    }
}

impl DepthSource for SimulatedStereo {
    fn camera(&self) -> CameraInfo {
        self.settings.eyes.camera.info(self.settings.range.unwrap_or(0.0))
    }

    fn start(&self) -> Pose {
        self.body.start()
    }

    fn scan(&mut self, capture: &Capture) -> Result<Seen, AppError> {
        let pair = match self.last.take() {
            Some((looked, pair)) if looked == *capture => pair,
            _ => self.render(capture)?,
        };
        let seen = self.matched(&pair)?;
        self.last = Some((*capture, pair));
        Ok(seen)
    }

    fn pair(&mut self, capture: &Capture) -> Result<Option<[Image; 2]>, AppError> {
        let pair = self.render(capture)?;
        self.last = Some((*capture, pair.clone()));
        Ok(Some(pair))
    }

    fn truth(&self) -> Option<&dyn Truth> {
        Some(&self.body)
    }

    fn remarks(&self) -> Vec<String> {
        self.body.remarks().to_vec()
    }
}
