//! Where depth comes from: a simulated depth camera over OBJ worlds.
//!
//! [`World`] is what is truly there, [`Simulator`] a robot with a depth camera in it, [`truth`] the judge of the maps that
//! are made from its scans, and [`scenery`] the workshop in which the worlds that come with elk are built. [`app`] puts the
//! simulator on the bus.

pub mod app;
pub mod bvh;
pub mod camera;
pub mod noise;
pub mod random;
pub mod ray;
pub mod scenery;
pub mod simulator;
pub mod triangle;
pub mod truth;
pub mod world;

pub use app::TYPES;
pub use camera::Camera;
pub use noise::StereoNoise;
pub use simulator::{Outcome, Refusal, Settings, Simulator, random_start};
pub use world::{BUILT_IN, CAR_INTERIOR, World, WorldError};
