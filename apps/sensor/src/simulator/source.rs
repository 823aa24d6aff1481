//! The depth source: one ray a pixel.

use elk_bus::AppError;
use elk_geometry::Pose;
use elk_geometry::random::Random;
use elk_spatial::CameraInfo;
use nalgebra::Point3;

use super::noise::StereoNoise;
use crate::camera::Camera;
use crate::source::{Capture, DepthSource, Seen, Truth};
use crate::surroundings::Body;

/// What a simulated depth camera is.
#[derive(Debug, Clone, PartialEq)]
pub struct Settings {
    /// Its pinhole.
    pub camera: Camera,
    /// Its noise, if any.
    pub noise: Option<StereoNoise>,
    /// Seed of its noise.
    pub seed: u64,
    /// How far it sees (m); `None`: as far as there is anything.
    pub range: Option<f64>,
}

impl Default for Settings {
    /// The thesis' camera: 100×100 px, 75° wide, without noise.
    fn default() -> Self {
        Self { camera: Camera::new(100, 100, 75_f64.to_radians()), noise: None, seed: 1, range: None }
    }
}

/// The camera, and the body that carries it.
#[derive(Debug, Clone)]
pub struct Simulator {
    body: Body,
    settings: Settings,
}

impl Simulator {
    /// A camera that a body carries.
    pub fn new(body: Body, settings: Settings) -> Self {
        Self { body, settings }
    }

    /// True depth at a pixel (m along the optical axis).
    fn depth(&self, pose: &Pose, u: f64, v: f64) -> Option<f64> {
        let in_camera = self.settings.camera.direction(u, v);
        let depth = self.body.world().cast(pose.position(), pose.turn(in_camera))?;
        let near = self.settings.range.is_none_or(|range| depth * in_camera.norm() <= range);
        near.then_some(depth)
    }
}

impl DepthSource for Simulator {
    fn camera(&self) -> CameraInfo {
        let Settings { camera, noise, range, .. } = &self.settings;
        let inverse_depth_sigma = noise.map_or(0.0, |noise| noise.inverse_depth_sigma());
        CameraInfo { inverse_depth_sigma, ..camera.info(range.unwrap_or(0.0)) }
    }

    fn start(&self) -> Pose {
        self.body.start()
    }

    /// One ray through the centre of each pixel; one that hits nothing within the camera's range gives no point, but a
    /// direction without a return. Noise depends on the seed and on the scan's number alone, not on what was seen before.
    fn scan(&mut self, capture: &Capture) -> Result<Seen, AppError> {
        let Settings { camera, noise, seed, .. } = &self.settings;
        let mut random = Random::new(*seed, capture.scan);
        let (mut points, mut no_return) = (Vec::new(), Vec::new());
        for (u, v) in camera.pixels() {
            let measured = self.depth(&capture.pose, u, v).map(|depth| match noise {
                Some(noise) => noise.measure(camera, (u, v), depth, &mut random),
                None => Some(camera.point(u, v, depth)),
            });
            match measured {
                Some(point) => points.extend(point.map(|p| p.cast())),
                None => no_return.push(Point3::from(camera.direction(u, v).normalize()).cast()),
            }
        }
        let no_return = no_return.into_iter().collect();
        Ok(Seen { points: points.into_iter().collect(), no_return, ..Seen::default() })
    }

    fn truth(&self) -> Option<&dyn Truth> {
        Some(&self.body)
    }

    fn remarks(&self) -> Vec<String> {
        self.body.remarks().to_vec()
    }
}
