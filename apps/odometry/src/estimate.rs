//! What an odometry answers: a pose with how well it is known, or why there is none.

use elk_geometry::Pose;
use nalgebra::Matrix6;

/// A pose that was found, and how well.
#[derive(Clone, Debug, PartialEq)]
pub struct Estimate {
    /// Where the rectified left camera is: its frame (x right, y down, z forward) → the world's, metres.
    pub pose: Pose,
    /// The covariance of a small change of the pose, as [`elk_registration::Pose::moved`] takes it (metres, then radians, along the axes of the
    /// world): (JᵀJ)⁻¹ σ², σ from the residuals. m², m rad and rad². It says what the noise of this pair makes of the pose in the map. What the
    /// map itself has drifted is not in it, so it is the least uncertainty that there is.
    pub covariance: Matrix6<f64>,
    /// How well the pose is known.
    pub health: Health,
}

/// How well a pose is known.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Health {
    /// Points of the map that should be in view.
    pub of: usize,
    /// Points that were found somewhere.
    pub matched: usize,
    /// Points that agree on the pose.
    pub inliers: usize,
    /// The distances at which the inliers lie beside where the pose puts them in the left image, root mean square, pixels.
    pub rms: f64,
    /// Whether the pair became a keyframe.
    pub is_keyframe: bool,
}

/// Why there is no pose.
#[derive(Clone, Copy, Debug, PartialEq, thiserror::Error)]
pub enum Lost {
    /// The pair shows too little of what a map could begin with.
    #[error(
        "{points} corners are seen by both cameras, less than {least}: too little texture, or it is too dark, too near or too far"
    )]
    Featureless {
        /// Corners that were matched along their rows.
        points: usize,
        /// How many are asked for.
        least: usize,
    },
    /// Too few points of the map were found.
    #[error(
        "{matched} of {of} points of the map were found, less than {least}: the pair shows another place, or nothing"
    )]
    Unseen {
        /// Points that were found.
        matched: usize,
        /// Points that should be in view.
        of: usize,
        /// How many are asked for.
        least: usize,
    },
    /// Points were found, but there is no pose at which enough of them are where they were found.
    #[error(
        "{inliers} of {matched} points that were found agree on a pose, less than {least}: what is seen moves, or is taken for something else"
    )]
    Disagreeing {
        /// Points that agree.
        inliers: usize,
        /// Points that were found.
        matched: usize,
        /// How many are asked for.
        least: usize,
    },
    /// Too few of the points that agree on a pose of the left camera, and that the right one should have in its image, were found there.
    #[error(
        "{both} of {of} points that the right image should show are in it, less than {least}: is the right camera covered, or are the cameras swapped?"
    )]
    OneSided {
        /// Points that both images show.
        both: usize,
        /// Points that both should show.
        of: usize,
        /// How many are asked for.
        least: usize,
    },
    /// The points agree on too many poses.
    #[error(
        "the position is known to ± {deviation:.3} m, {limit} m are asked for: all points are far away, or in one part of the image"
    )]
    Vague {
        /// The standard deviation in the worst direction, metres.
        deviation: f64,
        /// How large it may be.
        limit: f64,
    },
}
