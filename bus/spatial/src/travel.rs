//! What a controller whose robot takes its time says of that.

use elk_bus::{Invalid, payload};
use nalgebra::Point3;

use crate::checks;

/// Controller whose robot takes its time to anyone, with each pose command: how long the robot has been on its way by its own
/// clock, which is computed from its limits: nobody waits for it.
#[payload]
#[derive(Debug, Clone, PartialEq)]
pub struct TravelReport {
    /// The pose command at whose end this holds.
    #[describe(count)]
    pub command: u64,
    /// Time on the way since the beginning of the run (s).
    #[describe(unit = "s", range = checks::SUMS)]
    pub secs: f64,
    /// How often it stopped since it would have left what is known to be free.
    #[describe(count)]
    pub stops: u64,
}

/// How a robot moves that takes its time: of a controller's memory, beside its pose.
#[payload]
#[derive(Debug, Clone, PartialEq)]
pub struct Drive {
    /// Where its last motion began (m, world).
    #[describe(unit = "m", any, check = elk_geometry::limits::check_point)]
    pub from: Point3<f64>,
    /// Heading (rad, anticlockwise from world x).
    #[describe(unit = "rad", range = -7.0..=7.0)]
    pub yaw: f64,
    /// Elevation of the camera (rad, up positive).
    #[describe(unit = "rad", range = -2.0..=2.0)]
    pub pitch: f64,
    /// Speeds forward, to the left, up (m/s), of yaw and of the camera's tilt (rad/s).
    #[describe(any, check = rates)]
    pub rates: [f64; 5],
    /// Time on the way since the beginning of the run (s).
    #[describe(unit = "s", range = checks::SUMS)]
    pub secs: f64,
    /// How often it stopped since it would have left what is known to be free.
    #[describe(count)]
    pub stops: u64,
}

/// Largest speed of any robot (m/s, rad/s).
const LARGEST_RATE: f64 = 1e4;

fn rates(rates: &[f64; 5]) -> Result<(), Invalid> {
    let odd = rates.iter().find(|rate| !(-LARGEST_RATE..=LARGEST_RATE).contains(*rate));
    odd.map_or(Ok(()), |odd| checks::holds("", false, odd, "speeds of -10000 to 10000"))
}
