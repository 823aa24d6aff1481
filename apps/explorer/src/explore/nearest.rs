//! The nearest of many.

use elk_geometry::Voxel;

/// The `most` voxels that are nearest to the robot, in order, and the number of the others.
pub fn nearest(mut voxels: Vec<Voxel>, robot: Voxel, most: usize) -> (Vec<Voxel>, usize) {
    let far = voxels.len().saturating_sub(most);
    if far > 0 {
        voxels.sort_by(|a, b| a.distance(robot).total_cmp(&b.distance(robot)));
        voxels.truncate(most);
        voxels.sort_unstable();
    }
    (voxels, far)
}
