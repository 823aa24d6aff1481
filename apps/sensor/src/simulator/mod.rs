//! A robot with a depth camera in a world that only the simulator knows (thesis 3.3).

use elk_spatial::messages::{CameraPose, PoseCommand};
use elk_spatial::{Pose, Scan};
use nalgebra::{Point3, Vector3};

use crate::camera::Camera;
use crate::noise::StereoNoise;
use elk_world::random::Random;
use elk_world::{World, WorldError};

/// A randomly drawn start is at least this far from every surface (m).
pub const START_CLEARANCE_M: f64 = 0.3;

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

/// Why a pose cannot be taken.
#[derive(Debug, Clone, Copy, PartialEq, thiserror::Error)]
pub enum Refusal {
    /// The pose is in a solid, or not in the world at all.
    #[error("{} is inside an obstacle or outside the world", shown(.0))]
    NotFree(Point3<f64>),
    /// A surface lies between here and there.
    #[error("a surface lies on the straight way from {} to {}", shown(.0), shown(.1))]
    Blocked(Point3<f64>, Point3<f64>),
}

fn shown(p: &Point3<f64>) -> String {
    format!("({:.3}; {:.3}; {:.3})", p.x, p.y, p.z)
}

/// What came of a command.
#[derive(Debug, Clone)]
pub struct Outcome {
    /// The scan from where the robot is now.
    pub scan: Scan<'static>,
    /// Whether the body touched the world on the way, or would have on the way to a place that it cannot be in.
    pub contact: bool,
    /// Why the robot stayed where it was, if it did.
    pub refused: Option<Refusal>,
}

/// The robot and its world.
#[derive(Debug, Clone)]
pub struct Simulator {
    world: World,
    settings: Settings,
    pose: Pose,
    command: u64,
    scans: u64,
    contacts: u64,
}

impl Simulator {
    /// A robot at `start`, which has to be free.
    pub fn new(world: World, settings: Settings, start: Pose) -> Result<Self, Refusal> {
        let simulator = Self { world, settings, pose: start, command: 0, scans: 0, contacts: 0 };
        simulator.free(&start)?;
        Ok(simulator)
    }

    /// The robot's pose (world).
    pub fn pose(&self) -> Pose {
        self.pose
    }

    /// The last command carried out or refused; 0: none yet.
    pub fn command(&self) -> u64 {
        self.command
    }

    /// Scans taken.
    pub fn scans(&self) -> u64 {
        self.scans
    }

    /// Motions on which the body touched the world.
    pub fn contacts(&self) -> u64 {
        self.contacts
    }

    /// The world.
    pub fn world(&self) -> &World {
        &self.world
    }

    /// Goes on where another robot in the same world stopped: at `pose`, after so many scans and contacts.
    ///
    /// # Errors
    /// It cannot be there: the world is another one.
    pub fn succeed(&mut self, at: &CameraPose, scans: u64, contacts: u64) -> Result<(), Refusal> {
        self.free(&at.pose)?;
        (self.pose, self.command, self.scans, self.contacts) = (at.pose, at.command, scans, contacts);
        Ok(())
    }

    /// The last scan, as it was taken.
    pub fn last_scan(&self) -> Scan<'static> {
        self.scan()
    }

    /// Goes to the commanded pose, by way of the positions before it, and takes a scan; stays where it is, and scans
    /// there, if that cannot be done. The command is one that passes its check ([`elk_bus::Describe::check`]): all of it finite.
    pub fn execute(&mut self, command: &PoseCommand) -> Outcome {
        let way = self.way(command);
        let refused = self.passable(&way, &command.pose).err();
        let contact = refused.is_some() || self.touches(&way);
        if refused.is_none() {
            self.pose = command.pose;
        }
        self.command = command.id;
        self.contacts += u64::from(contact);
        self.scans += 1;
        Outcome { scan: self.scan(), contact, refused }
    }

    /// The positions to pass, the robot's own first.
    fn way(&self, command: &PoseCommand) -> Vec<Point3<f64>> {
        let ends = [self.pose.position(), command.pose.position()];
        std::iter::once(ends[0]).chain(command.via.iter().copied()).chain(std::iter::once(ends[1])).collect()
    }

    fn free(&self, pose: &Pose) -> Result<(), Refusal> {
        match self.world.is_free(pose.position()) {
            true => Ok(()),
            false => Err(Refusal::NotFree(pose.position())),
        }
    }

    /// Whether the centre of the body can go all the way, and be at its end.
    fn passable(&self, way: &[Point3<f64>], end: &Pose) -> Result<(), Refusal> {
        self.free(end)?;
        let pierced = |a: Point3<f64>, b: Point3<f64>| a != b && self.world.cast(a, b - a).is_some_and(|t| t <= 1.0);
        match way.windows(2).find(|s| pierced(s[0], s[1])) {
            Some(segment) => Err(Refusal::Blocked(segment[0], segment[1])),
            None => Ok(()),
        }
    }

    /// Whether the body touches anything on the way.
    fn touches(&self, way: &[Point3<f64>]) -> bool {
        let radius = self.settings.body_radius;
        way.windows(2).any(|s| self.world.touches(s[0], s[1], radius))
    }

    /// One ray through the centre of each pixel; one that hits nothing within the camera's range gives no point, but a
    /// direction without a return. Noise depends on the seed and on the scan's number alone, not on what was seen before.
    fn scan(&self) -> Scan<'static> {
        let Settings { camera, noise, seed, range, .. } = &self.settings;
        let mut random = Random::new(*seed, self.scans);
        let (mut points, mut no_return) = (Vec::new(), Vec::new());
        for (u, v) in camera.pixels() {
            let measured = self.depth(u, v).map(|depth| match noise {
                Some(noise) => noise.measure(camera, (u, v), depth, &mut random),
                None => Some(camera.point(u, v, depth)),
            });
            match measured {
                Some(point) => points.extend(point.map(|p| p.cast())),
                None => no_return.push(Point3::from(camera.direction(u, v).normalize()).cast()),
            }
        }
        let scan = Scan::new(self.scans, self.command, self.pose, points.into_iter().collect());
        Scan { camera: camera.info(range.unwrap_or(0.0)), no_return: no_return.into_iter().collect(), ..scan }
    }

    /// True depth at a pixel (m along the optical axis).
    fn depth(&self, u: f64, v: f64) -> Option<f64> {
        let in_camera = self.settings.camera.direction(u, v);
        let depth = self.world.cast(self.pose.position(), self.pose.0.rotation * in_camera)?;
        let near = self.settings.range.is_none_or(|range| depth * in_camera.norm() <= range);
        near.then_some(depth)
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
