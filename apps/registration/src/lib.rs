//! Registration of point clouds and laser scans: where a sensor is, from what it sees. Without a bus.
//!
//! A [`Cloud`] is a scan put together by voxels, a [`Map`] the surfaces of the clouds that were inserted, [`Icp`] finds the pose at which a cloud
//! lies on them, and a [`Tracker`] does so scan by scan; [`carmen`] reads
//! logs of lasers. All in space ([`nalgebra::Isometry3`]) and in the plane ([`nalgebra::Isometry2`]) alike. An
//! [`Estimate`] says how well it is known, and along which directions not at all; where there is no pose to stand for, [`Lost`] says why.
//! Metres and radians. The same scans give the same poses, bit for bit. Sections are those of the thesis that this reproduces (Shade, *Choosing
//! Where To Go*, 2011), where no other source is named.
//!
//! ```
#![doc = include_str!("../examples/found_again.rs")]
//! ```

pub mod carmen;
pub mod cloud;
pub mod depth;
mod eigen;
pub mod estimate;
pub mod icp;
mod level;
pub mod map;
pub mod moments;
pub mod pose;
pub mod resolution;
mod table;
pub mod tracker;

pub use cloud::{Cloud, CloudError};
pub use depth::{DepthCamera, DepthError};
pub use estimate::{Estimate, Health, Lost};
pub use icp::{Icp, IcpConfig};
pub use map::Map;
pub use moments::Moments;
pub use pose::{Pose, PoseError};
pub use resolution::{ConfigError, Resolution};
pub use tracker::{Tracked, Tracker, TrackerConfig, TrackerError};

#[cfg(doctest)]
#[doc = include_str!("../README.md")]
struct Readme;
