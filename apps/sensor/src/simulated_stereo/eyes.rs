//! What the two cameras see: an image each, by one ray a pixel.

use elk_geometry::Pose;
use elk_geometry::random::Random;
use elk_stereo::{Image, ImageError};
use elk_world::World;
use elk_world::ray::Ray;
use nalgebra::{Point3, Vector3};

use super::texture::Texture;
use crate::camera::Camera;

/// Two cameras that are alike, side by side, and look the same way: their images are rectified.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Eyes {
    /// Both cameras' pinhole.
    pub camera: Camera,
    /// How far the right one is to the right of the left one (m).
    pub baseline_m: f64,
    /// Standard deviation of their images' noise (grey levels).
    pub noise: f64,
    /// Seed of the noise.
    pub seed: u64,
}

impl Eyes {
    /// What the left and the right camera see of a world, the left one at `pose`, as images of scan number `scan`: their noise
    /// depends on it and the seed alone.
    ///
    /// # Errors
    /// Cameras of no pixel, or of more than an image may have.
    pub fn render(&self, world: &World, texture: &Texture, pose: &Pose, scan: u64) -> Result<[Image; 2], ImageError> {
        let across = pose.turn(Vector3::x() * self.baseline_m);
        // Streams of a scan's own; 0 is that of the start.
        let random = |eye| Random::new(self.seed, 2 * scan + eye);
        let left = self.view(world, texture, pose.position(), pose, random(0))?;
        Ok([left, self.view(world, texture, pose.position() + across, pose, random(1))?])
    }

    fn view(
        &self,
        world: &World,
        texture: &Texture,
        from: Point3<f64>,
        pose: &Pose,
        random: Random,
    ) -> Result<Image, ImageError> {
        let Camera { width, height, .. } = self.camera;
        let mut noise = Noise { random, sigma: self.noise, kept: None };
        let grey = |row: usize, column: usize| {
            let in_camera = self.camera.direction(column as f64 + 0.5, row as f64 + 0.5);
            (self.grey(world, texture, from, pose.turn(in_camera)) + noise.next()).round().clamp(0.0, 255.0) as u8
        };
        Image::from_fn(width as usize, height as usize, grey)
    }

    /// The grey level that is seen from a place along `direction`, whose length is that of depth 1.
    fn grey(&self, world: &World, texture: &Texture, from: Point3<f64>, direction: Vector3<f64>) -> f32 {
        let Some((depth, triangle)) = world.surfaces().nearest(&Ray::new(from, direction)) else {
            return texture.sky();
        };
        // A pixel covers depth / focal length of a surface that faces the camera, and more along one that is seen at a slant.
        let slant = texture.normal(triangle).dot(&direction).abs() / direction.norm();
        texture.grey(triangle, from + direction * depth, depth / (self.camera.focal_px * slant))
    }
}

/// Gaussian noise, two at a time as they come.
struct Noise {
    random: Random,
    sigma: f64,
    kept: Option<f64>,
}

impl Noise {
    fn next(&mut self) -> f32 {
        if self.sigma == 0.0 {
            return 0.0;
        }
        let one = self.kept.take().unwrap_or_else(|| {
            let (one, other) = self.random.normal_pair();
            self.kept = Some(other);
            one
        });
        (self.sigma * one) as f32
    }
}
