//! The depth source: one ray a pixel, and the body that goes where it is sent.

use elk_bus::AppError;
use elk_geometry::random::Random;
use elk_geometry::{OccupancyGrid, Pose};
use elk_spatial::CameraInfo;
use elk_world::truth::accuracy;
use elk_world::{START_CLEARANCE_M, World, WorldError};
use nalgebra::{Point3, Vector3};

use super::noise::StereoNoise;
use crate::camera::Camera;
use crate::source::{Accuracy, Capture, DepthSource, Obstruction, Seen, Travel, Truth};

/// Voxels of a map that are held against the true world: more would take minutes.
const MOST_EVALUATED: usize = 1 << 25;

/// Random streams of a seed: scan `k` draws from stream `k`, and the start from this one.
const START_STREAM: u64 = 0;

/// What a simulated robot is.
#[derive(Debug, Clone, PartialEq)]
pub struct Settings {
    /// Its camera.
    pub camera: Camera,
    /// Its camera's noise, if any.
    pub noise: Option<StereoNoise>,
    /// Seed of everything random.
    pub seed: u64,
    /// Radius of its body, a ball around the camera (m).
    pub body_radius: f64,
    /// How far its camera sees (m); `None`: as far as there is anything.
    pub range: Option<f64>,
}

impl Default for Settings {
    /// The thesis' camera: 100×100 px, 75° wide, without noise.
    fn default() -> Self {
        Self {
            camera: Camera::new(100, 100, 75_f64.to_radians()),
            noise: None,
            seed: 1,
            body_radius: 0.05,
            range: None,
        }
    }
}

/// The camera and its world.
#[derive(Debug, Clone)]
pub struct Simulator {
    world: World,
    settings: Settings,
    start: Pose,
    /// What whoever looks at the scans should know of the world.
    remarks: Vec<String>,
}

impl Simulator {
    /// A camera that is at `start` before the first command.
    pub fn new(world: World, settings: Settings, start: Pose) -> Self {
        Self { world, settings, start, remarks: Vec::new() }
    }

    /// The same, with what whoever looks at its scans should know of the world.
    pub fn with_remarks(self, remarks: Vec<String>) -> Self {
        Self { remarks, ..self }
    }

    /// True depth at a pixel (m along the optical axis).
    fn depth(&self, pose: &Pose, u: f64, v: f64) -> Option<f64> {
        let in_camera = self.settings.camera.direction(u, v);
        let depth = self.world.cast(pose.position(), pose.turn(in_camera))?;
        let near = self.settings.range.is_none_or(|range| depth * in_camera.norm() <= range);
        near.then_some(depth)
    }

    /// Whether the centre of the body can go all the way, and be at its end.
    fn passable(&self, way: &[Point3<f64>], end: &Pose) -> Result<(), Obstruction> {
        self.free(end)?;
        let pierced = |a: Point3<f64>, b: Point3<f64>| a != b && self.world.cast(a, b - a).is_some_and(|t| t <= 1.0);
        match way.windows(2).find(|s| pierced(s[0], s[1])) {
            Some(segment) => Err(Obstruction::Blocked(segment[0], segment[1])),
            None => Ok(()),
        }
    }

    /// Whether the body touches anything on the way.
    fn touches(&self, way: &[Point3<f64>]) -> bool {
        let radius = self.settings.body_radius;
        way.windows(2).any(|s| self.world.touches(s[0], s[1], radius))
    }
}

impl DepthSource for Simulator {
    fn camera(&self) -> CameraInfo {
        self.settings.camera.info(self.settings.range.unwrap_or(0.0))
    }

    fn start(&self) -> Pose {
        self.start
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
        Ok(Seen { points: points.into_iter().collect(), no_return: no_return.into_iter().collect() })
    }

    fn truth(&self) -> Option<&dyn Truth> {
        Some(self)
    }

    fn remarks(&self) -> Vec<String> {
        self.remarks.clone()
    }
}

impl Truth for Simulator {
    fn free(&self, pose: &Pose) -> Result<(), Obstruction> {
        match self.world.is_free(pose.position()) {
            true => Ok(()),
            false => Err(Obstruction::NotFree(pose.position())),
        }
    }

    fn travel(&self, way: &[Point3<f64>], end: &Pose) -> Travel {
        let refused = self.passable(way, end).err();
        Travel { contact: refused.is_some() || self.touches(way), refused }
    }

    fn evaluate(&self, map: &OccupancyGrid) -> Result<Option<Accuracy>, AppError> {
        let known = map.free() + map.occupied();
        if known > MOST_EVALUATED {
            return Err(format!("{known} voxels are known; at most {MOST_EVALUATED} are evaluated").into());
        }
        let accuracy = accuracy(&self.world, map);
        Ok(Some(Accuracy { share: accuracy.share(), voxels: accuracy.known }))
    }
}

/// A start drawn from `seed`: anywhere free with [`START_CLEARANCE_M`] around, looking anywhere (thesis 6.5.2).
pub fn random_start(world: &World, seed: u64) -> Result<Pose, WorldError> {
    let mut random = Random::new(seed, START_STREAM);
    let place = world.draw_place(START_CLEARANCE_M, &mut random)?;
    let (rise, heading) = (random.between(-1.0, 1.0), random.between(0.0, std::f64::consts::TAU));
    let level = (1.0 - rise * rise).sqrt();
    let direction = Vector3::new(level * heading.cos(), level * heading.sin(), rise);
    Ok(Pose::looking(place, direction))
}
