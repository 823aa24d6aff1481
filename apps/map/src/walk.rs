//! A ray's walk over the voxels, in integers (after Amanatides and Woo, *A Fast Voxel Traversal Algorithm for Ray
//! Tracing*, 1987).
//!
//! The place on the ray is a fixed-point number from 0 to `END`, and the voxel three indices packed into one word: a
//! step is then a handful of integer selections without a branch that depends on the ray. Rounding cannot lead the walk
//! astray: each axis' first crossing is moved (by less than 1e-11 of the ray) to where all its crossings fit before the
//! end and one more would not.

use elk_geometry::Voxel;
use nalgebra::Point3;

/// The end of the ray in fixed point: one part in 10¹².
const END: i64 = 1 << 40;
/// A crossing that never comes.
const NEVER: i64 = 1 << 60;
/// Bits of an index in a packed voxel.
const FIELD: u32 = 21;
/// What is added to an index so that it is never negative.
const BIAS: i32 = 1 << 16;
/// The bits of a packed voxel that tell its brick.
const BRICK_BITS: u64 = !(7 | 7 << FIELD | 7 << (2 * FIELD));

/// The voxels of a segment one after the other.
#[derive(Debug, Clone, Copy)]
pub struct Walk {
    at: u64,
    next: [i64; 3],
    delta: [i64; 3],
    step: [u64; 3],
    left: u32,
}

impl Walk {
    /// The walk from `from` to `to`, both in voxels (metres over resolution) and with indices in OctoMap's range.
    pub fn new(from: Point3<f64>, to: Point3<f64>) -> Self {
        let mut walk = Self { at: 0, next: [NEVER; 3], delta: [0; 3], step: [0; 3], left: 0 };
        for axis in 0..3 {
            walk.set_axis(axis, from[axis], to[axis]);
        }
        walk
    }

    fn set_axis(&mut self, axis: usize, from: f64, to: f64) {
        let first = from.floor() as i32;
        let cells = i64::from(to.floor() as i32) - i64::from(first);
        let unit = 1u64 << (FIELD * axis as u32);
        self.at += (first + BIAS) as u64 * unit;
        if cells == 0 {
            return;
        }
        let forward = cells > 0;
        let cells = cells.abs();
        let boundary = f64::from(first + i32::from(forward));
        let crossing = (boundary - from) / (to - from) * END as f64;
        let delta = ((END as f64 / (to - from).abs()) as i64).clamp(1, NEVER);
        self.step[axis] = if forward { unit } else { unit.wrapping_neg() };
        self.delta[axis] = delta;
        self.next[axis] =
            (crossing as i64).clamp((END + 1).saturating_sub(cells.saturating_mul(delta)), END - (cells - 1) * delta);
        self.left += cells as u32;
    }

    /// Steps that are left; none: the walk is in the voxel of its end.
    pub fn left(&self) -> u32 {
        self.left
    }

    /// What tells the present voxel's brick from others.
    pub fn brick_key(&self) -> u64 {
        self.at & BRICK_BITS
    }

    /// The present voxel's layer in its brick (z), and its bit in the layer (see [`elk_geometry::mask`]).
    #[inline]
    pub fn cell(&self) -> (usize, u64) {
        let bit = self.at & 7 | self.at >> (FIELD - 3) & 56;
        ((self.at >> (2 * FIELD)) as usize & 7, 1 << bit)
    }

    /// The present voxel.
    pub fn voxel(&self) -> Voxel {
        let index = |axis: u32| (self.at >> (FIELD * axis) & ((1 << FIELD) - 1)) as i32 - BIAS;
        Voxel::new(index(0), index(1), index(2))
    }

    /// On to the next voxel; to be called only while steps are left.
    #[inline]
    pub fn advance(&mut self) {
        let [x, y, z] = self.next;
        let along_x = x <= y && x <= z;
        let along_y = !along_x && y <= z;
        let along_z = !along_x && !along_y;
        let mask = |along: bool| i64::from(along).wrapping_neg();
        let (mx, my, mz) = (mask(along_x), mask(along_y), mask(along_z));
        self.next = [x + (self.delta[0] & mx), y + (self.delta[1] & my), z + (self.delta[2] & mz)];
        let step = self.step[0] & mx as u64 | self.step[1] & my as u64 | self.step[2] & mz as u64;
        self.at = self.at.wrapping_add(step);
        self.left -= 1;
    }

    /// The face through which the walk came into the present brick from the one of `key`, as an index into
    /// [`elk_geometry::voxel::FACES`].
    pub fn face_from(&self, key: u64) -> usize {
        let moved = self.brick_key() ^ key;
        let axis = (moved.trailing_zeros() / FIELD) as usize;
        2 * axis + usize::from(self.brick_key() > key)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use elk_geometry::bricks::{brick_of, cell_of};
    use elk_geometry::voxel::FACES;
    use proptest::prelude::*;

    fn coordinate() -> impl Strategy<Value = f64> {
        prop_oneof![
            -30.0..30.0f64,
            (-30..30i32).prop_map(f64::from),
            (-30..30i32).prop_map(|i| f64::from(i) - 1e-12),
            -32768.0..32767.0f64,
        ]
    }

    proptest! {
        #[test]
        fn it_goes_face_to_face_and_arrives(a in prop::array::uniform3(coordinate()), b in prop::array::uniform3(coordinate())) {
            let (a, b) = (Point3::from(a), Point3::from(b));
            let mut walk = Walk::new(a, b);
            prop_assert_eq!(walk.voxel(), Voxel::containing(a, 1.0));
            while walk.left() > 0 {
                let (voxel, key) = (walk.voxel(), walk.brick_key());
                walk.advance();
                let (layer, bit) = walk.cell();
                prop_assert_eq!(cell_of(walk.voxel()), layer << 6 | bit.trailing_zeros() as usize);
                let d = walk.voxel() - voxel;
                prop_assert!(FACES.contains(&d));
                let moved = brick_of(walk.voxel()) - brick_of(voxel);
                prop_assert_eq!(moved != Voxel::new(0, 0, 0), walk.brick_key() != key);
                if walk.brick_key() != key {
                    prop_assert_eq!(FACES[walk.face_from(key)], moved);
                }
                let v = walk.voxel().center(1.0);
                let t = ((v - a).dot(&(b - a)) / (b - a).norm_squared().max(1e-12)).clamp(0.0, 1.0);
                prop_assert!((v - (a + (b - a) * t)).norm() < 0.867);
            }
            prop_assert_eq!(walk.voxel(), Voxel::containing(b, 1.0));
        }
    }
}
