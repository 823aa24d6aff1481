//! How far space goes: the limits that hold for every map, and the check of a point against them.

use std::ops::RangeInclusive;

use elk_describe::Invalid;
use nalgebra::Point3;

use crate::voxel::reach_m;

/// Edges of voxels (m).
pub const RESOLUTIONS_M: RangeInclusive<f64> = 0.001..=10.0;
/// Largest distance of anything from the world's origin along an axis (m): 32,768 of the coarsest voxels.
pub const FARTHEST_M: f64 = reach_m(*RESOLUTIONS_M.end());

/// Whether a point (m, world) is finite and no farther away than [`FARTHEST_M`].
///
/// # Errors
/// The first coordinate that is not.
pub fn check_point(point: &Point3<f64>) -> Result<(), Invalid> {
    let outside = |(_, c): &(&str, &f64)| c.is_nan() || c.abs() > FARTHEST_M;
    match ["x", "y", "z"].into_iter().zip(point.iter()).find(outside) {
        None => Ok(()),
        Some((axis, c)) => Err(Invalid::new(axis, c, format!("{} to {FARTHEST_M} m", -FARTHEST_M))),
    }
}
