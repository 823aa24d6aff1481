//! Stereo visual odometry: where two cameras side by side are, from their images alone. Without a bus.
//!
//! An [`Odometry`] takes pairs of rectified images, one after the other, and says of each where it was taken ([`Estimate`]: pose, covariance,
//! how much of what was looked for was found), or why nobody knows ([`Lost`]). Corners are spread evenly over the image, matched along rows, and
//! stay in a map as points with what they look like. Each pair looks for the points of the map; a consensus of few (RANSAC) tells which were
//! found, and least squares on the reprojection error in both images give the pose. Some pairs become keyframes, of which the last few are
//! adjusted together with the points that they see. With a memory ([`OdometryConfig::memory`]) those before are kept as well, and taken up again where
//! their views are seen again. The pipeline is that of the thesis that this reproduces (Shade, *Choosing Where To Go*,
//! 2011, 2.2.3, where the system is Sibley, Mei, Reid and Newman's); sections without another source are of that.
//!
//! Poses are those of the rectified left camera in the world (x right, y down, z forward; metres). Pixels are columns and rows, the centre of a
//! pixel has whole coordinates. The same pairs give the same poses, bit for bit.
//!
//! ```
#![doc = include_str!("../examples/sideways.rs")]
//! ```

mod bundle;
mod config;
mod consensus;
mod corners;
pub mod estimate;
mod keyframes;
mod landmarks;
mod least_squares;
pub mod odometry;
mod patch;
mod pyramid;
mod reprojection;
mod row;
mod turn;

pub use config::OdometryConfig;
pub use estimate::{Estimate, Health, Lost};
pub use odometry::{Odometry, PairError, SetupError, Tracked};

#[cfg(doctest)]
#[doc = include_str!("../README.md")]
struct Readme;
