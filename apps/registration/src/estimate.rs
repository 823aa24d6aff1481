//! What registration answers: a pose with how well it is known, or why there is none.

use nalgebra::{SMatrix, SVector};

use crate::eigen;
use crate::pose::PoseError;

/// A pose that was found, and how well.
#[derive(Clone, Debug, PartialEq)]
pub struct Estimate<P, const N: usize> {
    /// Where the sensor is: its frame → the map's.
    pub pose: P,
    /// The inverse of the covariance of a small change of the pose (as [`crate::Pose::moved`] takes it: metres, then radians): JᵀWJ / σ², σ from the
    /// residuals. It says what the noise of independent points makes of the pose. What all points have in common, such as a map that is bent, is not in
    /// it, so it is the least uncertainty that there is (Censi, ICRA 2007). About 0 along directions that the points say nothing of.
    pub information: SMatrix<f64, N, N>,
    /// How well the pose is known.
    pub health: Health<N>,
}

impl<P, const N: usize> Estimate<P, N> {
    /// The inverse of the information, m², m rad and rad², where all directions are known.
    pub fn covariance(&self) -> Option<SMatrix<f64, N, N>> {
        if !self.health.unknown.is_empty() {
            return None;
        }
        let (values, vectors) = eigen::symmetric(&self.information);
        Some(vectors * SMatrix::from_diagonal(&values.map(|value| 1.0 / value)) * vectors.transpose())
    }
}

/// How well a pose is known.
#[derive(Clone, Debug, PartialEq)]
pub struct Health<const N: usize> {
    /// Voxels of the cloud.
    pub of: usize,
    /// Voxels of the cloud near a surface of the map.
    pub matched: usize,
    /// Voxels of the cloud on a surface: not farther from it than half a finest voxel, nor than the robust kernel's scale.
    pub inliers: usize,
    /// The distances of the inliers from their surfaces, root mean square, metres.
    pub rms: f64,
    /// How much the points say of each principal direction, ascending: the weighted mean of squared slopes, rotations in units in which their slopes
    /// are as large as normals are. About 1 / D each where normals point everywhere.
    pub observability: SVector<f64, N>,
    /// The directions of which they say too little, where the pose is as it was guessed: unit steps as [`crate::Pose::moved`] takes them, rotations in the
    /// same units. In a corridor, one: along it.
    pub unknown: Vec<SVector<f64, N>>,
    /// Steps that it took, over all levels.
    pub iterations: usize,
}

impl<const N: usize> Health<N> {
    /// The share of the cloud that is on surfaces of the map, 0 to 1.
    pub fn overlap(&self) -> f64 {
        self.inliers as f64 / self.of as f64
    }
}

/// Why there is no pose.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum Lost {
    /// Not enough of the cloud is on surfaces of the map.
    #[error(
        "{inliers} of {of} voxels are on surfaces of the map, less than the share of {overlap} that is asked for: the cloud shows another place, or the guess is too far off"
    )]
    Overlap {
        /// Voxels on surfaces.
        inliers: usize,
        /// Voxels of the cloud.
        of: usize,
        /// The share that is asked for.
        overlap: f64,
    },
    /// Steps do not become smaller.
    #[error("the last of {iterations} steps still was one of {step:.4} m: the cloud fits nowhere, or in many places")]
    Unsettled {
        /// Steps over all levels.
        iterations: usize,
        /// How far it moved points, metres.
        step: f64,
    },
    /// The guess is no pose.
    #[error(transparent)]
    Guess(#[from] PoseError),
}
