//! The depth source: one ray a beam.

use std::f64::consts::TAU;
use std::sync::Arc;

use elk_bus::AppError;
use elk_geometry::Pose;
use elk_geometry::random::Random;
use elk_spatial::CameraInfo;
use nalgebra::{Point3, Vector3};

use crate::source::{Capture, DepthSource, Seen, Truth};
use crate::surroundings::Body;

/// What a simulated laser is.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Settings {
    /// Beams of a scan.
    pub beams: u32,
    /// The angle that they share (rad), half of it to either side.
    pub fov: f64,
    /// How far it sees (m).
    pub range: f64,
    /// Standard deviation of a range (m).
    pub noise: f64,
    /// Seed of the noise.
    pub seed: u64,
}

impl Settings {
    /// The bearing of a beam (rad, anticlockwise from ahead as seen from above): each is in the middle of its share of the field of view,
    /// from right to left.
    pub fn bearing(&self, beam: u32) -> f64 {
        self.fov * ((f64::from(beam) + 0.5) / f64::from(self.beams) - 0.5)
    }
}

/// The laser, and the body that carries it.
#[derive(Debug, Clone)]
pub struct SimulatedLaser2d {
    body: Arc<Body>,
    settings: Settings,
}

impl SimulatedLaser2d {
    /// A laser that a body carries.
    pub fn new(body: Body, settings: Settings) -> Self {
        Self { body: Arc::new(body), settings }
    }

    /// What it sees from a pose, as scan number `scan`: its noise depends on that and the seed alone. A beam that hits nothing within the
    /// range, or reads more, is a direction without a return.
    pub fn look(&self, pose: &Pose, scan: u64) -> Seen {
        let Settings { range, noise, seed, .. } = self.settings;
        let mut random = Random::new(seed, scan);
        let (mut points, mut no_return) = (Vec::new(), Vec::new());
        for beam in 0..self.settings.beams {
            let (sin, cos) = self.settings.bearing(beam).sin_cos();
            // The camera's z is ahead, its x to the right.
            let direction = Vector3::new(-sin, 0.0, cos);
            let surface = self.body.world().cast(pose.position(), pose.turn(direction)).filter(|away| *away <= range);
            let measured = surface.map(|away| away + noise * random.normal_pair().0);
            match measured.filter(|measured| *measured <= range) {
                // What would lie behind it is no measurement.
                Some(measured) if measured <= 0.0 => {}
                Some(measured) => points.push(Point3::from(direction * measured).cast()),
                None => no_return.push(Point3::from(direction).cast()),
            }
        }
        let no_return = no_return.into_iter().collect();
        Seen { points: points.into_iter().collect(), no_return, ..Seen::default() }
    }
}

impl DepthSource for SimulatedLaser2d {
    fn camera(&self) -> CameraInfo {
        let Settings { beams, fov, range, .. } = self.settings;
        // A whole turn in degrees is one in radians but for rounding.
        let fov_x = fov.min(TAU);
        CameraInfo { columns: beams, rows: 1, fov_x, fov_y: 0.0, range_m: range, inverse_depth_sigma: 0.0 }
    }

    fn start(&self) -> Pose {
        self.body.start()
    }

    fn scan(&mut self, capture: &Capture) -> Result<Seen, AppError> {
        Ok(self.look(&capture.pose, capture.scan))
    }

    fn truth(&self) -> Option<&dyn Truth> {
        Some(&*self.body)
    }

    fn remarks(&self) -> Vec<String> {
        self.body.remarks().to_vec()
    }
}
