//! Dense stereo: the images of two calibrated cameras side by side into disparities, and disparities into points with their error.
//! Without a bus.
//!
//! [`calibration`] reads what two cameras are, [`rectification`] makes their images ones of a [`Rig`], a [`Matcher`] says of each pixel its
//! [`Disparity`], or why it has none, and [`triangulation`] makes points of them. There are two matchers: [`Sad5`], sums of absolute
//! differences over windows, which is fast, and [`SemiGlobal`], which is right more often. Sections and equations are those of the
//! thesis that this reproduces (Shade, *Choosing Where To Go*, 2011), where no other source is named.
//!
//! ```
#![doc = include_str!("../examples/wall.rs")]
//! ```
//!
//! From images as cameras take them:
//!
//! ```
#![doc = include_str!("../examples/rectified.rs")]
//! ```

pub mod calibration;
pub mod camera;
mod components;
pub mod disparity;
pub mod image;
mod lanes;
pub mod matcher;
mod median;
pub mod preprocessing;
pub mod rectification;
pub mod sad5;
pub mod semi_global;
mod texture;
pub mod triangulation;
mod winner;

pub use calibration::CalibrationError;
pub use camera::{Camera, Distortion, StereoCalibration};
pub use disparity::{Disparity, Unmatched};
pub use image::{Image, ImageError};
pub use matcher::{Checks, ConfigError, MatchError, Matcher};
pub use preprocessing::Preprocessing;
pub use rectification::{Rectification, RectificationError};
pub use sad5::{Sad5, Sad5Config};
pub use semi_global::{Penalties, SemiGlobal, SemiGlobalConfig};
pub use triangulation::{Noise, Rig, RigError};

#[cfg(doctest)]
#[doc = include_str!("../README.md")]
struct Readme;
