//! The body of a simulated robot in the true world, which only a simulated sensor knows.

use elk_bus::AppError;
use elk_geometry::random::Random;
use elk_geometry::{OccupancyGrid, Pose};
use elk_world::truth::accuracy;
use elk_world::{START_CLEARANCE_M, World, WorldError};
use nalgebra::{Point3, Vector3};

use crate::source::{Accuracy, Obstruction, Travel, Truth};

/// Voxels of a map that are held against the true world: more would take minutes.
const MOST_EVALUATED: usize = 1 << 25;

/// Random streams of a seed: scan `k` draws from streams from `k` on, and the start from this one.
const START_STREAM: u64 = 0;

/// The world, and a body in it: a ball around the camera.
#[derive(Debug, Clone)]
pub struct Body {
    world: World,
    start: Pose,
    radius: f64,
    remarks: Vec<String>,
}

impl Body {
    /// A body of a radius (m) that is at `start` (world) before the first command.
    pub fn new(world: World, start: Pose, radius: f64) -> Self {
        Self { world, start, radius, remarks: Vec::new() }
    }

    /// The same, with what whoever looks at its scans should know of the world.
    pub fn with_remarks(self, remarks: Vec<String>) -> Self {
        Self { remarks, ..self }
    }

    /// The same, looking level at the start.
    pub fn level(self) -> Self {
        let start = Pose::from_yaw_pitch(self.start.position(), self.start.yaw(), 0.0);
        Self { start, ..self }
    }

    /// The world.
    pub fn world(&self) -> &World {
        &self.world
    }

    /// Where it is before the first command (world).
    pub fn start(&self) -> Pose {
        self.start
    }

    /// What whoever looks at the scans should know of the world.
    pub fn remarks(&self) -> &[String] {
        &self.remarks
    }

    /// Whether its centre can go all the way, and be at its end.
    fn passable(&self, way: &[Point3<f64>], end: &Pose) -> Result<(), Obstruction> {
        self.free(end)?;
        let pierced = |a: Point3<f64>, b: Point3<f64>| a != b && self.world.cast(a, b - a).is_some_and(|t| t <= 1.0);
        match way.windows(2).find(|s| pierced(s[0], s[1])) {
            Some(segment) => Err(Obstruction::Blocked(segment[0], segment[1])),
            None => Ok(()),
        }
    }

    /// Whether it touches anything on the way.
    fn touches(&self, way: &[Point3<f64>]) -> bool {
        way.windows(2).any(|s| self.world.touches(s[0], s[1], self.radius))
    }
}

impl Truth for Body {
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
