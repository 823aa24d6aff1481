//! How open a world is, in figures and in words.

use nalgebra::{Point3, Vector3};
use serde::Serialize;

use crate::units::shown;

/// A hole in a surface: rims that hang together.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Hole {
    /// Its middle (m, world).
    pub middle: Point3<f64>,
    /// The edges of the box around it (m).
    pub size: Vector3<f64>,
    /// Edges of its rim.
    pub edges: usize,
    /// A ray from a free place gets out through it.
    pub leads_out: bool,
    /// Points in it that are looked through: its middle, and towards the corners of its rim.
    #[serde(skip)]
    pub(crate) aims: Vec<Point3<f64>>,
}

/// How open a world is.
#[derive(Debug, Clone, PartialEq, Default, Serialize)]
pub struct Openness {
    /// Free places that were looked from.
    pub places: usize,
    /// Share of the rays from there that met nothing (0 to 1).
    pub escaping: f64,
    /// Where surfaces end and no other goes on, those that lead out first, then the larger ones.
    pub holes: Vec<Hole>,
    /// Where some of the rays that met nothing left the box around the world (m, world).
    pub exits: Vec<Point3<f64>>,
    /// Digits behind the point with which lengths are shown.
    #[serde(skip)]
    pub(crate) digits: usize,
}

impl Openness {
    /// Whether a ray from a free place can get out.
    pub fn is_open(&self) -> bool {
        self.escaping > 0.0 || self.holes.iter().any(|hole| hole.leads_out)
    }

    /// Where it is open, in words; `None`: it is closed.
    pub fn words(&self) -> Option<String> {
        const SHOWN: usize = 3;
        if !self.is_open() {
            return None;
        }
        let leading_out = self.holes.iter().filter(|hole| hole.leads_out).take(SHOWN);
        let holes: Vec<String> = leading_out.map(|hole| hole.words(self.digits)).collect();
        let exits = || self.exits.iter().map(|exit| shown(exit, self.digits)).collect::<Vec<_>>().join(", ");
        let whereabouts = match holes.as_slice() {
            [] => format!("some leave it at {}", exits()),
            holes => format!("there is {}", holes.join(", and ")),
        };
        let share = self.escaping * 100.0;
        Some(format!("{share:.1} % of the rays from {} free places meet nothing; {whereabouts}", self.places))
    }

    /// Keeps a few exits that lie so far (m) apart.
    pub(crate) fn remember(&mut self, exit: Point3<f64>, apart: f64) {
        const KEPT: usize = 3;
        if self.exits.len() < KEPT && self.exits.iter().all(|other| (other - exit).norm() > apart) {
            self.exits.push(exit);
        }
    }
}

impl Hole {
    fn words(&self, digits: usize) -> String {
        let Self { middle, size, .. } = self;
        let around = shown(middle, digits);
        format!("a hole of {:.digits$} × {:.digits$} × {:.digits$} m around {around}", size.x, size.y, size.z)
    }
}
