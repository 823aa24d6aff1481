//! Where a frame was taken: the seam behind which ways to know it lie, and those that are elk's.

mod drift;
mod estimate;
mod map_matching;
mod scan_matching;
mod visual_odometry;

pub use drift::{Drift, DriftingOdometry};
pub(crate) use estimate::level;
pub use estimate::{Located, PoseEstimator, Recorded};
pub use map_matching::{MapMatching, MapMatchingSettings};
pub(crate) use scan_matching::in_space;
pub use scan_matching::{IcpSettings, LevelMatching, ScanMatching};
pub use visual_odometry::{VisualOdometry, VisualOdometrySettings};
