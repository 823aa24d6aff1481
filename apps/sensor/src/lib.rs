//! Where depth comes from: a simulated depth camera in a world of `elk-world`.
//!
//! [`Simulator`] is a robot with a depth camera in a [`World`](elk_world::World), which is what is truly there and
//! which only it knows. [`app`] puts it on the bus.

pub mod app;
pub mod camera;
pub mod noise;
mod preflight;
pub mod simulator;

pub use app::TYPES;
pub use camera::Camera;
pub use noise::StereoNoise;
pub use simulator::{Outcome, Refusal, Settings, Simulator, random_start};
