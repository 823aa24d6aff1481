//! Sets of voxels, a bit each: sized by what is in them, wherever that is.

use crate::bricks::{BrickIndex, brick_of, cell_of, push, voxel_at};
use crate::mask::{self, Mask};
use crate::voxel::Voxel;

/// A set of voxels, kept by brick. A voxel far away from all others costs one brick.
#[derive(Debug, Clone, Default)]
pub struct VoxelSet {
    index: BrickIndex,
    bricks: Vec<(Voxel, Mask)>,
    len: usize,
}

impl VoxelSet {
    /// The empty set.
    pub fn new() -> Self {
        Self::default()
    }

    /// The voxels of a brick (in bricks) that are in it.
    #[inline]
    pub fn brick(&self, brick: Voxel) -> &Mask {
        self.place(brick).map_or(&mask::NONE, |i| &self.bricks[i].1)
    }

    #[inline]
    fn place(&self, brick: Voxel) -> Option<usize> {
        self.index.find(brick, |i| self.bricks[i].0)
    }

    /// Whether a voxel is in it.
    #[inline]
    pub fn contains(&self, voxel: Voxel) -> bool {
        mask::has(self.brick(brick_of(voxel)), cell_of(voxel))
    }

    /// For many questions about voxels that lie near each other.
    pub fn near(&self) -> Near<'_> {
        Near { set: self, bricks: [NOWHERE; 8], masks: [&mask::NONE; 8] }
    }

    /// Puts these of a brick's voxels in, and all others of that brick out; answers those that were not as they are now.
    pub fn replace(&mut self, brick: Voxel, now: &Mask) -> Mask {
        let place = match self.place(brick) {
            Some(place) => place,
            None if *now == mask::NONE => return mask::NONE,
            None => {
                let last = self.bricks.len();
                push(&mut self.bricks, (brick, mask::NONE));
                self.index.insert(last, |i| self.bricks[i].0);
                last
            }
        };
        let own = &mut self.bricks[place].1;
        let turned = std::array::from_fn(|z| own[z] ^ now[z]);
        self.len = self.len + mask::count(now) - mask::count(own);
        *own = *now;
        turned
    }

    /// Puts these of a brick's voxels in.
    pub fn unite(&mut self, brick: Voxel, more: &Mask) {
        let all = mask::or(self.brick(brick), more);
        self.replace(brick, &all);
    }

    /// Puts a voxel in; answers whether it was not.
    pub fn insert(&mut self, voxel: Voxel) -> bool {
        let (brick, mut now) = (brick_of(voxel), *self.brick(brick_of(voxel)));
        mask::set(&mut now, cell_of(voxel));
        self.replace(brick, &now) != mask::NONE
    }

    /// Takes a voxel out; answers whether it was in.
    pub fn remove(&mut self, voxel: Voxel) -> bool {
        let (brick, mut now) = (brick_of(voxel), *self.brick(brick_of(voxel)));
        mask::clear(&mut now, cell_of(voxel));
        self.replace(brick, &now) != mask::NONE
    }

    /// Number of voxels.
    pub fn len(&self) -> usize {
        self.len
    }

    /// Whether there is none.
    pub fn is_empty(&self) -> bool {
        self.len == 0
    }

    /// The bricks that have, or had, voxels in it, in the order in which they first had, with those that they have now.
    pub fn bricks(&self) -> impl Iterator<Item = (Voxel, &Mask)> {
        self.bricks.iter().map(|(brick, mask)| (*brick, mask))
    }

    /// The voxels, brick by brick in the order of [`VoxelSet::bricks`].
    pub fn iter(&self) -> impl Iterator<Item = Voxel> + '_ {
        self.bricks().flat_map(|(brick, cells)| mask::cells(cells).map(move |cell| voxel_at(brick, cell)))
    }

    /// Smallest and largest corner of the box around all of them, both in it; `None`: there is none.
    pub fn corners(&self) -> Option<[Voxel; 2]> {
        let corners = self.bricks().filter_map(|(brick, cells)| mask::corners(brick, cells));
        corners.reduce(|[a, b], [c, d]| [a.inf(c), b.sup(d)])
    }
}

/// By what is in them, not by the order in which it came.
impl PartialEq for VoxelSet {
    fn eq(&self, other: &Self) -> bool {
        self.len == other.len && self.bricks().all(|(brick, cells)| other.brick(brick) == cells)
    }
}

/// A run of voxels of one brick costs little more than one.
impl Extend<Voxel> for VoxelSet {
    fn extend<I: IntoIterator<Item = Voxel>>(&mut self, voxels: I) {
        let mut run: Option<(Voxel, Mask)> = None;
        for voxel in voxels {
            let brick = brick_of(voxel);
            if let Some((last, cells)) = run.as_mut().filter(|(last, _)| *last != brick) {
                self.unite(*last, cells);
                (*last, *cells) = (brick, mask::NONE);
            }
            mask::set(&mut run.get_or_insert((brick, mask::NONE)).1, cell_of(voxel));
        }
        run.iter().for_each(|(last, cells)| self.unite(*last, cells));
    }
}

impl FromIterator<Voxel> for VoxelSet {
    fn from_iter<I: IntoIterator<Item = Voxel>>(voxels: I) -> Self {
        let mut set = Self::new();
        set.extend(voxels);
        set
    }
}

/// A set that is asked about voxels near each other: while they stay in eight bricks that meet in a corner, each is looked up
/// once.
#[derive(Debug, Clone)]
pub struct Near<'a> {
    set: &'a VoxelSet,
    /// The last brick that was asked for of those that are even and odd alike.
    bricks: [Voxel; 8],
    masks: [&'a Mask; 8],
}

/// No voxel lies in this brick.
const NOWHERE: Voxel = Voxel::new(i32::MAX, i32::MAX, i32::MAX);

impl Near<'_> {
    /// Whether a voxel is in the set.
    #[inline]
    pub fn contains(&mut self, voxel: Voxel) -> bool {
        mask::has(self.brick(brick_of(voxel)), cell_of(voxel))
    }

    /// Whether all voxels of a brick are in the set.
    #[inline]
    pub fn has_brick(&mut self, brick: Voxel) -> bool {
        *self.brick(brick) == mask::ALL
    }

    /// Whether any voxel of the box between two, both in it, is in the set.
    pub fn meets(&mut self, [min, max]: [Voxel; 2]) -> bool {
        let (low, high) = (brick_of(min), brick_of(max));
        let rows = (low.z..=high.z).flat_map(|z| (low.y..=high.y).map(move |y| (y, z)));
        let mut bricks = rows.flat_map(|(y, z)| (low.x..=high.x).map(move |x| Voxel::new(x, y, z)));
        bricks.any(|brick| mask::and(self.brick(brick), &mask::within(brick, [min, max])) != mask::NONE)
    }

    #[inline]
    fn brick(&mut self, brick: Voxel) -> &Mask {
        let place = (brick.x & 1 | (brick.y & 1) << 1 | (brick.z & 1) << 2) as usize;
        if brick != self.bricks[place] {
            (self.bricks[place], self.masks[place]) = (brick, self.set.brick(brick));
        }
        self.masks[place]
    }
}

#[cfg(test)]
mod tests {
    use std::collections::BTreeSet;

    use proptest::prelude::*;

    use super::*;

    fn voxel() -> impl Strategy<Value = Voxel> {
        prop::array::uniform3(-12..12i32).prop_map(Voxel::from)
    }

    proptest! {
        /// It is what a set of voxels is that is kept one by one.
        #[test]
        fn what_is_put_in_and_not_taken_out_is_in(edits in prop::collection::vec((voxel(), any::<bool>()), 0..200)) {
            let (mut set, mut model) = (VoxelSet::new(), BTreeSet::new());
            for (voxel, into) in edits {
                let (changed, expected) = match into {
                    true => (set.insert(voxel), model.insert(voxel)),
                    false => (set.remove(voxel), model.remove(&voxel)),
                };
                prop_assert_eq!(changed, expected);
            }
            prop_assert_eq!(set.iter().collect::<BTreeSet<_>>(), model.clone());
            prop_assert_eq!((set.len(), set.is_empty()), (model.len(), model.is_empty()));
            let corner = |pick: fn(Voxel, Voxel) -> Voxel| model.iter().copied().reduce(pick);
            prop_assert_eq!(set.corners(), corner(Voxel::inf).zip(corner(Voxel::sup)).map(|(a, b)| [a, b]));
            let mut near = set.near();
            prop_assert!(set.iter().all(|voxel| set.contains(voxel) && near.contains(voxel)));
            let (min, max) = (Voxel::new(-9, -2, 3), Voxel::new(1, 7, 5));
            prop_assert_eq!(near.meets([min, max]), model.iter().any(|v| *v == v.sup(min).inf(max)));
            prop_assert!(set == model.iter().copied().collect());
        }
    }
}
