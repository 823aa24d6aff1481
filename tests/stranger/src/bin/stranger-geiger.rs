//! An app with message types of its own: it says how much it counts wherever the camera is, draws where that was, and takes a
//! key.

use elk_bus::drawing::drawing::rgb;
use elk_bus::drawing::{Drawing, KeyTable, variables};
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

/// Places that are drawn at most: of more the last ones.
const MOST_PLACES: usize = 1000;

struct Geiger {
    gain: f64,
    at: Option<Pose>,
    /// Where it has counted, the redder the more.
    places: Vec<([f32; 3], [u8; 4])>,
}

impl Geiger {
    /// The source is in the world's origin, and decreases with the square of the distance.
    fn say(&mut self, comms: &mut Comms) -> Result<(), AppError> {
        let Some(at) = self.at else { return Ok(()) };
        let rate = self.gain / (0.01 + at.position().coords.norm_squared());
        let tubes = vec![
            Tube { kind: Kind::Gamma, rate: 0.75 * rate },
            Tube { kind: Kind::Beta { window: 0.5 }, rate: 0.25 * rate },
        ];
        comms.publish(&RADIATION, &Reading { at, rate, tubes })?;
        let place = at.position().coords.map(|c| c as f32).into();
        let redness = (255.0 * rate / (1.0 + rate)) as u8;
        self.places.push((place, rgb(redness, 255 - redness, 0)));
        let first = self.places.len().saturating_sub(MOST_PLACES);
        self.places.drain(..first);
        let (places, colours): (Vec<_>, Vec<_>) = self.places.iter().copied().unzip();
        let drawing = Drawing::new("readings").points(places, colours);
        Ok(comms.draw(&drawing.text(place, format!("{rate:.2} /s"), rgb(255, 255, 255)))?)
    }
}

impl App for Geiger {
    fn on_start_up(&mut self, comms: &mut Comms) -> Result<(), AppError> {
        comms.take_keys(&KeyTable::new([("g", "ten times as much a count")]))?;
        comms.register(&camera_pose(CAMERA_POSE))?;
        Ok(comms.register(&RADIATION_SETUP)?)
    }

    fn on_new_mail(&mut self, comms: &mut Comms, mail: &Mail<'_>) -> Result<(), AppError> {
        if mail.is(&variables::key_press(comms.name())) {
            self.gain *= 10.0;
        } else if mail.is(&RADIATION_SETUP) {
            self.gain = mail.decode(&RADIATION_SETUP)?.gain;
        } else {
            self.at = Some(mail.decode(&camera_pose(CAMERA_POSE))?.pose);
        }
        self.say(comms)
    }
}

fn main() -> Result<(), Failure> {
    Ok(run_app(Box::new(Geiger { gain: 1.0, at: None, places: Vec::new() }), &RunOptions::from_launcher()?)?)
}
