//! Where depth comes from: one trait, a simulated camera behind it, and the app around it, which is written once.
//!
//! [`source`] is the seam: whatever answers "a scan from this pose" is a sensor. [`robot`] carries it where it is sent, and
//! counts, or, where it is not told where it is, goes by an estimate ([`localised`]); [`app`] puts that on the bus, and [`program`] makes a program of it. Three are elk's own: [`simulator`] is a depth
//! camera in a [`World`](elk_world::World), which is what is truly there, [`simulated_stereo`] two cameras in one, whose
//! pictures are matched, and [`simulated_laser2d`] a laser; [`surroundings`] is what they have in common. A [`recording`] decides itself where its sensor was:
//! [`rgbd`] is one of a depth camera, [`laser2d`] one of a laser, [`stereo`] one of two cameras. Where its frames ([`frame`]) were
//! taken a [`pose_estimator`] says. [`stereo_pair`] is one pair of a real stereo camera, [`matching`] how pairs are matched.
//!
//! # A sensor of one's own
//!
//! A crate that depends on this one and has this `main.rs` is a sensor; `elk new sensor NAME` makes such a crate.
//!
//! ```no_run
#![doc = include_str!("../examples/hall.rs")]
//! ```
//!
//! A sensor of elk's own is a module here with a `TYPE`, and its row in [`TYPES`].

/// The text of the example above, with which `elk new sensor` begins.
pub const EXAMPLE: &str = include_str!("../examples/hall.rs");

pub mod app;
pub mod camera;
pub mod frame;
pub mod laser2d;
pub mod localised;
pub mod matching;
mod parameters;
pub mod pose_estimator;
pub mod program;
pub mod recording;
pub mod rgbd;
pub mod robot;
pub mod simulated_laser2d;
pub mod simulated_stereo;
pub mod simulator;
pub mod source;
pub mod stereo;
pub mod stereo_pair;
pub mod surroundings;
#[cfg(test)]
mod test_png;
mod types;

pub use camera::Camera;
pub use elk_bus::AppError;
pub use elk_geometry::{OccupancyGrid, Pose};
pub use elk_mission::{Kind, ParamSpec, Params};
pub use elk_spatial::{CameraInfo, Points};
pub use nalgebra;
pub use parameters::{COMMON, RECORDED};
pub use program::main;
pub use robot::{Robot, ScanError};
pub use source::{Accuracy, Capture, DepthSource, Obstruction, Seen, Travel, Truth};
pub use types::TYPES;
