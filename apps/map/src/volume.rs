//! The volume in which frontiers count, brick by brick.

use elk_geometry::bricks::voxel_at;
use elk_geometry::mask::{self, Mask};
use elk_geometry::{Bounds, Voxel};

use crate::growth::block;

/// The voxels whose centres lie in a box, as half-open ranges of their indices.
#[derive(Debug, Clone, Copy)]
pub struct Volume(Option<[[i32; 2]; 3]>);

impl Volume {
    /// The voxels of `resolution` (m) in `bounds`; `None`: all.
    pub fn new(bounds: Option<Bounds>, resolution: f64) -> Self {
        let range = |b: Bounds, axis: usize| {
            let inside = |k: i32| b.contains(center_on(b, axis, k, resolution));
            // The ends by division, then each put right by at most one voxel where rounding misplaced it.
            let from = (b.min[axis] / resolution - 0.5).ceil() as i32;
            let to = (b.max[axis] / resolution - 0.5).floor() as i32;
            let from = (from - 1..=from + 1).find(|&k| inside(k)).unwrap_or(to + 1);
            let to = (to - 1..=to + 1).rev().find(|&k| inside(k)).unwrap_or(from - 1);
            [from, to + 1]
        };
        Self(bounds.map(|b| std::array::from_fn(|axis| range(b, axis))))
    }

    /// The bricks that it has voxels of, as half-open ranges of their positions; `None`: all.
    pub fn bricks(&self) -> Option<[[i32; 2]; 3]> {
        self.0.map(|ranges| ranges.map(|[from, to]| [from >> 3, (to + 7) >> 3]))
    }

    /// The cells of the brick at `position` (in bricks) that lie in the volume, and where a map can have voxels at all.
    pub fn mask(&self, position: Voxel) -> Mask {
        if !voxel_at(position, 0).is_mappable() {
            return mask::NONE;
        }
        let Some(ranges) = self.0 else {
            return mask::ALL;
        };
        let origin = voxel_at(position, 0).to_array();
        let [x, y, z] = std::array::from_fn(|axis| ranges[axis].map(|k| k - origin[axis]));
        block(x, y, z)
    }
}

/// The middle of the box, moved along one axis to the centre of voxel `k`.
fn center_on(bounds: Bounds, axis: usize, k: i32, resolution: f64) -> nalgebra::Point3<f64> {
    let mut point = bounds.mid();
    point[axis] = Voxel::new(k, k, k).center(resolution)[axis];
    point
}
