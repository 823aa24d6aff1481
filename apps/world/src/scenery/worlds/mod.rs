//! The six worlds, of the sizes of the thesis' scenarios (6.5.2).

mod apartment;
mod car;
mod garage;
mod hall;
mod hall_long;
mod kitchen;

use nalgebra::{Point3, Vector3};

use super::Scenery;
use elk_geometry::{Bounds, Pose};

/// A world that comes with elk: how it is built, and what a mission in it says.
pub struct Site {
    /// Name of its OBJ file, without the ending.
    pub name: &'static str,
    /// Builds it.
    pub build: fn() -> Scenery,
    /// Centre of the volume to explore (m).
    pub mid: [f64; 3],
    /// Size of the volume to explore (m).
    pub dim: [f64; 3],
    /// Where a robot starts (m).
    pub start: [f64; 3],
    /// Where it looks: yaw and pitch (degrees).
    pub view_deg: [f64; 2],
}

impl Site {
    /// The volume to explore.
    pub fn bounds(&self) -> Bounds {
        Bounds::from_mid_dim(Point3::from(self.mid), Vector3::from(self.dim))
    }

    /// Where a robot starts and where it looks.
    pub fn start(&self) -> Pose {
        let [yaw, pitch] = self.view_deg.map(f64::to_radians);
        Pose::from_yaw_pitch(Point3::from(self.start), yaw, pitch)
    }
}

/// All of them, in the thesis' order.
pub const SITES: [Site; 6] = [
    Site {
        name: "car",
        build: car::build,
        mid: [0.0, 0.0, 0.0],
        dim: [5.7, 4.3, 4.5],
        start: [0.0, 0.0, 0.8],
        view_deg: [0.0, -15.0],
    },
    Site {
        name: "hall",
        build: hall::build,
        mid: [5.0, 5.0, 2.5],
        dim: [10.5, 10.5, 5.5],
        start: [6.5, 4.6, 1.2],
        view_deg: [180.0, 0.0],
    },
    Site {
        name: "kitchen",
        build: kitchen::build,
        mid: [4.0, 4.0, 1.5],
        dim: [8.5, 8.5, 3.5],
        start: [1.6, 2.0, 1.4],
        view_deg: [45.0, 0.0],
    },
    Site {
        name: "hall-long",
        build: hall_long::build,
        mid: [4.0, 9.0, 2.5],
        dim: [8.5, 18.5, 5.5],
        start: [4.0, 4.8, 1.5],
        view_deg: [-90.0, 0.0],
    },
    Site {
        name: "apartment",
        build: apartment::build,
        mid: [3.0, 4.0, 1.0],
        dim: [6.5, 8.5, 2.5],
        start: [2.2, 3.2, 1.2],
        view_deg: [-120.0, -10.0],
    },
    Site {
        name: "garage",
        build: garage::build,
        mid: [3.5, 4.5, 1.0],
        dim: [7.5, 9.5, 2.5],
        start: [3.4, 3.0, 1.2],
        view_deg: [90.0, 0.0],
    },
];
