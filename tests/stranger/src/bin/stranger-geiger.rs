//! An app with message types of its own: it says how much it counts wherever the camera is.

use elk_bus::{App, AppError, Comms, Failure, Key, Mail, RunOptions, payload, run_app};
use elk_geometry::Pose;
use elk_spatial::keys::{CAMERA_POSE, camera_pose};

/// What was counted.
#[payload]
#[describe(drawn = "pose")]
#[derive(Debug, Clone, PartialEq)]
pub struct Reading {
    /// Where.
    pub at: Pose,
    /// Counts a second.
    #[describe(unit = "1/s", range = 0.0..=1e9)]
    pub rate: f64,
    /// The tubes, each for itself.
    pub tubes: Vec<Tube>,
}

/// A tube of the counter.
#[payload]
#[derive(Debug, Clone, PartialEq)]
pub struct Tube {
    /// What it counts.
    pub kind: Kind,
    /// Counts a second.
    #[describe(unit = "1/s")]
    pub rate: f64,
}

/// What a tube counts.
#[payload]
#[derive(Debug, Clone, PartialEq)]
pub enum Kind {
    /// Photons.
    Gamma,
    /// Electrons behind a window.
    Beta {
        /// How thick it is.
        #[describe(unit = "mm")]
        window: f32,
    },
}

/// How the counter is to count.
#[payload]
#[derive(Debug, Clone, PartialEq)]
pub struct Setup {
    /// What each count stands for.
    #[describe(range = 0.1..=100.0)]
    pub gain: f64,
}

const RADIATION: Key<Reading> = Key::new("RADIATION");
const RADIATION_SETUP: Key<Setup> = Key::new("RADIATION_SETUP");

struct Geiger {
    gain: f64,
    at: Option<Pose>,
}

impl Geiger {
    /// The source is in the world's origin, and decreases with the square of the distance.
    fn say(&self, comms: &mut Comms) -> Result<(), AppError> {
        let Some(at) = self.at else { return Ok(()) };
        let rate = self.gain / (0.01 + at.position().coords.norm_squared());
        let tubes = vec![
            Tube { kind: Kind::Gamma, rate: 0.75 * rate },
            Tube { kind: Kind::Beta { window: 0.5 }, rate: 0.25 * rate },
        ];
        Ok(comms.publish(&RADIATION, &Reading { at, rate, tubes })?)
    }
}

impl App for Geiger {
    fn on_start_up(&mut self, comms: &mut Comms) -> Result<(), AppError> {
        comms.register(&camera_pose(CAMERA_POSE))?;
        Ok(comms.register(&RADIATION_SETUP)?)
    }

    fn on_new_mail(&mut self, comms: &mut Comms, mail: &Mail<'_>) -> Result<(), AppError> {
        if mail.is(&RADIATION_SETUP) {
            self.gain = mail.decode(&RADIATION_SETUP)?.gain;
        } else {
            self.at = Some(mail.decode(&camera_pose(CAMERA_POSE))?.pose);
        }
        self.say(comms)
    }
}

fn main() -> Result<(), Failure> {
    Ok(run_app(Box::new(Geiger { gain: 1.0, at: None }), &RunOptions::from_launcher()?)?)
}
