//! A sensor that was recorded. Nobody sends it anywhere: each pose command takes the next frame of which there is a scan.
//!
//! A [`Recording`] has its frames one by one; [`Player`] says where each was taken, as recorded or as estimated
//! ([`PoseEstimator`]), passes over those that cannot be used, and counts. It is the same from the beginning every time: a sensor
//! that takes the place of another goes through the frames that the other one has had, and stands where that one stood.

mod estimator;
mod frame;
mod player;

pub(crate) use estimator::in_space;
pub use estimator::{IcpSettings, PoseEstimator};
pub use frame::{BadFrame, Frame, Recording};
#[cfg(test)]
pub(crate) use player::tests::player as mostly;
pub use player::{Advance, Player};
