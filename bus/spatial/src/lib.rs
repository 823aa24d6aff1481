//! What the apps of an exploration say to each other about space: scans, maps, plans, reports, and the keys they travel under.
//!
//! What space itself is, voxels, poses, rays, grids, is [`elk_geometry`]'s, and knows of no message. Here are [`keys`] and
//! [`messages`], the [`scan`] and the [`map`] as they travel, whole in parts ([`keyframe`]), what is believed of them ([`checks`]),
//! and a reader's own copy of the map ([`replica`]).

pub mod camera;
pub mod candidates;
pub mod checks;
pub mod keyframe;
pub mod keys;
pub mod map;
pub mod messages;
pub mod pixels;
pub mod playback;
pub mod rays;
pub mod record;
pub mod replica;
#[cfg(any(test, feature = "samples"))]
pub mod samples;
pub mod scan;
pub mod travel;

pub use camera::CameraInfo;
pub use replica::Replica;
pub use scan::{Points, Scan};
