//! One pair of a stereo camera: two images and a calibration into disparities, points and a picture.

mod grey;
mod outcome;
mod pair;
mod reasons;
mod seen;

pub use grey::{GreyError, grey};
pub use outcome::Outcome;
pub use pair::{Pair, PairError, Rectified};
pub use reasons::Reasons;
pub use seen::seen;
