//! One pair of a stereo camera: two images and a calibration into disparities, points and a picture.

mod grey;
mod outcome;
mod pair;
mod seen;

pub use grey::{GreyError, grey};
pub use outcome::Outcome;
pub use pair::{Pair, PairError, Rectified};
pub use seen::{pixel_runs, seen};
