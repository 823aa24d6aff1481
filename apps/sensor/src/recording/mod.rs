//! A sensor that was recorded. Nobody sends it anywhere: each pose command takes the next frame of which there is a scan.
//!
//! A [`Recording`] has its frames one by one; [`Player`] says where each was taken, as recorded or as estimated
//! ([`PoseEstimator`](crate::pose_estimator::PoseEstimator)), passes over those that cannot be used, and counts. It is the same from the beginning every time: a sensor
//! that takes the place of another goes through the frames that the other one has had, and stands where that one stood.

mod folder;
mod frames;
mod player;
mod pose;
mod times;

pub use folder::FolderError;
pub(crate) use folder::{Line, MOST_FRAMES, Timed, entries, lines, lines_in_order, single};
pub use frames::Recording;
#[cfg(test)]
pub(crate) use player::tests::player as mostly;
pub use player::{Advance, Player};
pub(crate) use pose::{of_line, of_matrix, of_row_euroc, of_rows};
pub(crate) use times::Times;
