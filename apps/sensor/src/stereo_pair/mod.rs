//! One pair of a stereo camera, without a mission: two images and a calibration into disparities, points and a picture.

mod grey;
mod outcome;
mod pair;
mod reasons;

pub use grey::{GreyError, grey};
pub use outcome::Outcome;
pub use pair::{Pair, PairError};
pub use reasons::Reasons;
