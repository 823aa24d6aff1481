//! Space as elk's apps speak of it: poses, scans, voxels, paths, and the keys they travel under.
//!
//! Metres, radians; right-handed, z up; camera frame x right, y down, z forward. Everything here is plain data with no
//! bus in sight, except [`keys`], which names the variables that apps exchange it under.

pub mod bricks;
pub mod camera;
pub mod checks;
pub mod clearance;
pub mod frontier;
pub mod keys;
pub mod map;
pub mod mask;
pub mod messages;
pub mod polyline;
pub mod pose;
pub mod ray;
pub mod replica;
#[doc(hidden)]
pub mod samples;
pub mod scan;
pub mod strategy_memory;
pub mod voxel;

pub use bricks::Bricks;
pub use camera::CameraInfo;
pub use frontier::FrontierSet;
pub use map::{OccupancyGrid, State};
pub use polyline::Polyline;
pub use pose::Pose;
pub use replica::Replica;
pub use scan::{Points, Scan};
pub use strategy_memory::StrategyMemory;
pub use voxel::{Bounds, Voxel};
