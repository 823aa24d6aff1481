//! The seam between a sensor and the app around it: whatever sees depth is a [`DepthSource`].
//!
//! A source answers "a scan from this pose" and says what its camera is. Numbers, commands, reports, what a successor goes
//! on from: all of that is written once, in [`crate::robot`] and [`crate::app`]. So a source is one type in one file, here
//! (with a row in [`crate::TYPES`]) or in a crate of its own ([`crate::main`]).

use std::fmt;

use elk_bus::AppError;
use elk_geometry::{OccupancyGrid, Pose};
use elk_spatial::pixels::PixelRun;
use elk_spatial::{CameraInfo, Points};
use elk_stereo::Image;
use nalgebra::Point3;

/// Where depth comes from.
pub trait DepthSource: Send {
    /// What its camera can see; the same from the first scan to the last. It goes along with every scan.
    fn camera(&self) -> CameraInfo;

    /// Takes a scan. It is called once a scan, in their order, but for the last scan of a sensor that died before it was
    /// published: whoever goes on takes that one again. A source that is slow may take its time; nobody hears of the sensor
    /// meanwhile, so one that waits for half a minute or longer needs `health="off"` or a longer one in its mission.
    ///
    /// # Errors
    /// There is no scan: what was tried, on what, and what to do about it. The app ends with that, and what its element says
    /// of `restart` decides whether another one tries again.
    fn scan(&mut self, capture: &Capture) -> Result<Seen, AppError>;

    /// What two cameras see from there, rectified, if the source has two: what a scan there is made of. From it a robot that is not
    /// told where it is may know.
    ///
    /// # Errors
    /// There are no images, as there is no scan.
    fn pair(&mut self, _capture: &Capture) -> Result<Option<[Image; 2]>, AppError> {
        Ok(None)
    }

    /// Where the camera is before the first command (world).
    fn start(&self) -> Pose {
        Pose::from_yaw_pitch(Point3::origin(), 0.0, 0.0)
    }

    /// What it knows of the true world, as only a simulator does. Without it the robot is taken to be where it was sent, and
    /// nobody counts contacts or evaluates maps.
    fn truth(&self) -> Option<&dyn Truth> {
        None
    }

    /// What whoever looks at its scans should know, said once at the start.
    fn remarks(&self) -> Vec<String> {
        Vec::new()
    }
}

/// What a scan is asked for.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Capture {
    /// Its number, from 1, unbroken (but of a robot that also looks between scans, whose looks are counted), whichever process of the mission takes it: what is random may depend on it, and is the
    /// same then in every run and after every restart.
    pub scan: u64,
    /// The community's time (s).
    pub time_secs: f64,
    /// Where the camera is (world).
    pub pose: Pose,
}

/// What a camera saw.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Seen {
    /// Points in the camera frame (x right, y down, z forward; m).
    pub points: Points<'static>,
    /// Directions in the camera frame (unit vectors) in which there is nothing up to the camera's range. A pixel that measured
    /// nothing for any other reason is in neither list: of its ray nothing is known.
    pub no_return: Points<'static>,
    /// What became of all pixels of a camera that matches images, row by row; empty: the source is none, or does not say.
    pub pixel_runs: Vec<PixelRun>,
}

/// The true world, as a simulator knows it.
pub trait Truth {
    /// Whether a robot can be there.
    ///
    /// # Errors
    /// Why not.
    fn free(&self, pose: &Pose) -> Result<(), Obstruction>;

    /// What comes of going `way` (m, world), the robot's own position first and that of `end` last, in straight lines.
    fn travel(&self, way: &[Point3<f64>], end: &Pose) -> Travel;

    /// How much of a map is as the world is; `None`: it cannot tell.
    ///
    /// # Errors
    /// Why this map cannot be evaluated.
    fn evaluate(&self, _map: &OccupancyGrid) -> Result<Option<Accuracy>, AppError> {
        Ok(None)
    }
}

/// What came of a motion.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct Travel {
    /// Whether the body touched the world on the way, or would have on the way to a place that it cannot be in.
    pub contact: bool,
    /// Why the robot stayed where it was, if it did.
    pub refused: Option<Obstruction>,
}

/// How much of a map is true.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Accuracy {
    /// Known voxels whose state is that of the true world, of all known voxels (0 to 1).
    pub share: f64,
    /// Known voxels evaluated.
    pub voxels: u64,
}

/// Why a pose cannot be taken.
#[derive(Debug, Clone, Copy, PartialEq, thiserror::Error)]
pub enum Obstruction {
    /// The pose is in a solid, or not in the world at all.
    #[error("{} is inside an obstacle or outside the world", Shown(.0))]
    NotFree(Point3<f64>),
    /// A surface lies between here and there.
    #[error("a surface lies on the straight way from {} to {}", Shown(.0), Shown(.1))]
    Blocked(Point3<f64>, Point3<f64>),
}

struct Shown<'a>(&'a Point3<f64>);

impl fmt::Display for Shown<'_> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Self(Point3 { coords }) = self;
        write!(f, "({:.3}; {:.3}; {:.3})", coords.x, coords.y, coords.z)
    }
}
