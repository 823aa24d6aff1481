//! What hangs together with a voxel over faces, kept up to date as voxels open and close.
//!
//! What opens is grown into from the voxels that it touches, a brick at a time, at the cost of what is gained. Where something
//! closes, all that lay around it is searched from at once, until the searches have met, or one has nowhere left to go and is
//! what was cut off: at the cost of the smaller part (after Even and Shiloach, *An On-Line Edge-Deletion Problem*, 1981).

use std::collections::BTreeSet;
use std::ops::Deref;

use crate::bricks::{brick_of, cell_of, voxel_at};
use crate::mask::{self, Mask};
use crate::searches::Searches;
use crate::set::VoxelSet;
use crate::voxel::{FACES, Voxel};

/// The voxels that are connected with a start over the faces of open voxels; the start always is one of them.
#[derive(Debug, Clone)]
pub struct Component {
    start: Voxel,
    inside: VoxelSet,
}

/// The voxels that are in it.
impl Deref for Component {
    type Target = VoxelSet;

    fn deref(&self) -> &VoxelSet {
        &self.inside
    }
}

impl Component {
    /// What is connected with `start` over what is open.
    pub fn of(open: &VoxelSet, start: Voxel) -> Self {
        let mut component = Self { start, inside: VoxelSet::new() };
        component.begin(open, &mut |_, _| {});
        component
    }

    /// The voxel that the others are connected with.
    pub fn start(&self) -> Voxel {
        self.start
    }

    /// Takes note that the start is in another place, and that these voxels, by brick, have opened or closed since: `open` is
    /// as it is now. The voxels that come in or go out are told to `changed`, by brick.
    pub fn update(
        &mut self,
        open: &VoxelSet,
        start: Voxel,
        turned: &[(Voxel, Mask)],
        changed: &mut impl FnMut(Voxel, &Mask),
    ) {
        let before = std::mem::replace(&mut self.start, start);
        if !self.inside.contains(start) {
            return self.begin_anew(open, changed);
        }
        let mut gone = self.close(open, before, turned, changed);
        while let Some(first) = gone.first().copied() {
            if !self.settle(first, &mut gone, changed) {
                return self.begin_anew(open, changed);
            }
        }
        for (brick, cells) in turned {
            let opened = mask::without(&mask::and(cells, open.brick(*brick)), self.inside.brick(*brick));
            if opened != mask::NONE {
                self.grow(open, vec![(*brick, mask::and(&opened, &self.beside(*brick)))], changed);
            }
        }
    }

    /// Takes out what has closed, and the start `before` if it only was in as such; answers all of it.
    fn close(
        &mut self,
        open: &VoxelSet,
        before: Voxel,
        turned: &[(Voxel, Mask)],
        changed: &mut impl FnMut(Voxel, &Mask),
    ) -> BTreeSet<Voxel> {
        let mut start = mask::NONE;
        mask::set(&mut start, cell_of(self.start));
        let mut old = mask::NONE;
        mask::set(&mut old, cell_of(before));
        let mut gone = BTreeSet::new();
        for (brick, cells) in turned.iter().chain([&(brick_of(before), old)]) {
            let own = *self.inside.brick(*brick);
            let mut closed = mask::without(&mask::and(cells, &own), open.brick(*brick));
            if *brick == brick_of(self.start) {
                closed = mask::without(&closed, &start);
            }
            if closed != mask::NONE {
                self.inside.replace(*brick, &mask::without(&own, &closed));
                changed(*brick, &closed);
                gone.extend(mask::cells(&closed).map(|cell| voxel_at(*brick, cell)));
            }
        }
        gone
    }

    /// The cells of a brick that share a face with any that is in.
    fn beside(&self, brick: Voxel) -> Mask {
        let own = self.inside.brick(brick);
        let around = |(n, face): (usize, &Voxel)| mask::beyond(self.inside.brick(brick - *face), n);
        let beside = FACES.iter().enumerate().map(around).fold(mask::NONE, |all, one| mask::or(&all, &one));
        mask::or(&beside, &mask::dilated(own))
    }

    fn remove(&mut self, voxel: Voxel, changed: &mut impl FnMut(Voxel, &Mask)) {
        if self.inside.remove(voxel) {
            let mut cell = mask::NONE;
            mask::set(&mut cell, cell_of(voxel));
            changed(brick_of(voxel), &cell);
        }
    }

    /// Takes in the start, and all that hangs together with it.
    fn begin(&mut self, open: &VoxelSet, changed: &mut impl FnMut(Voxel, &Mask)) {
        self.inside.insert(self.start);
        let seeds = self.start.face_neighbours().into_iter().map(|voxel| {
            let mut seed = mask::NONE;
            mask::set(&mut seed, cell_of(voxel));
            (brick_of(voxel), seed)
        });
        self.grow(open, seeds.collect(), changed);
    }

    fn begin_anew(&mut self, open: &VoxelSet, changed: &mut impl FnMut(Voxel, &Mask)) {
        let before = std::mem::take(&mut self.inside);
        self.begin(open, &mut |_, _| {});
        let added = self.inside.bricks().filter(|(brick, _)| *before.brick(*brick) == mask::NONE);
        for (brick, was) in before.bricks().chain(added.map(|(brick, _)| (brick, &mask::NONE))) {
            let now = self.inside.brick(brick);
            if was != now {
                changed(brick, &std::array::from_fn(|z| was[z] ^ now[z]));
            }
        }
    }

    /// Takes in what can be got to from these voxels, themselves included, of which those that are open touch what is in.
    fn grow(&mut self, open: &VoxelSet, mut front: Vec<(Voxel, Mask)>, changed: &mut impl FnMut(Voxel, &Mask)) {
        while let Some((brick, seed)) = front.pop() {
            let own = *self.inside.brick(brick);
            let new = mask::fill(&seed, &mask::without(open.brick(brick), &own));
            if new == mask::NONE {
                continue;
            }
            self.inside.replace(brick, &mask::or(&own, &new));
            changed(brick, &new);
            let beyond = FACES.iter().enumerate().map(|(n, face)| (brick + *face, mask::beyond(&new, n)));
            front.extend(beyond.filter(|(_, seed)| *seed != mask::NONE));
        }
    }

    /// Takes out what is cut off by those voxels of `gone` that hang together with `first`; all of them are out already. What
    /// was cut off is gone with them, and so is what of `gone` it touches: it held together what lies on both sides of it.
    /// Answers whether the start is still in what is left.
    fn settle(&mut self, first: Voxel, gone: &mut BTreeSet<Voxel>, changed: &mut impl FnMut(Voxel, &Mask)) -> bool {
        let mut hole = connected(first, gone);
        loop {
            let border: BTreeSet<Voxel> = beside(&hole).filter(|voxel| self.inside.contains(*voxel)).collect();
            let mut inside = self.inside.near();
            let mut near = |voxel: Voxel| voxel.face_neighbours().map(|n| Some(n).filter(|n| inside.contains(*n)));
            let Some(cut) = Searches::from(border).next_cut_off(|voxel| near(voxel).into_iter().flatten()) else {
                return true;
            };
            if cut.contains(&self.start) {
                return false;
            }
            cut.iter().for_each(|voxel| self.remove(*voxel, changed));
            for voxel in beside(&cut) {
                if gone.contains(&voxel) {
                    hole.extend(connected(voxel, gone));
                }
            }
            hole.extend(cut);
        }
    }
}

/// What shares a face with any of the voxels.
fn beside(voxels: &[Voxel]) -> impl Iterator<Item = Voxel> + '_ {
    voxels.iter().flat_map(|voxel| voxel.face_neighbours())
}

/// Takes the voxels out of `among` that hang together with `first`.
fn connected(first: Voxel, among: &mut BTreeSet<Voxel>) -> Vec<Voxel> {
    among.remove(&first);
    let mut found = vec![first];
    let mut next = 0;
    while let Some(voxel) = found.get(next).copied() {
        next += 1;
        found.extend(voxel.face_neighbours().into_iter().filter(|n| among.remove(n)));
    }
    found
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    /// Edge of the box that voxels open and close in: it spans bricks.
    const EDGE: i32 = 9;

    fn voxel() -> impl Strategy<Value = Voxel> {
        prop::array::uniform3(2..2 + EDGE).prop_map(Voxel::from)
    }

    /// All that a flood finds.
    fn flooded(open: &VoxelSet, start: Voxel) -> VoxelSet {
        let mut found = vec![start];
        let mut seen = BTreeSet::from([start]);
        while let Some(voxel) = found.pop() {
            found.extend(voxel.face_neighbours().into_iter().filter(|n| open.contains(*n) && seen.insert(*n)));
        }
        seen.into_iter().collect()
    }

    /// Turns voxels around; by brick, those that are not as they were.
    fn turn(open: &mut VoxelSet, voxels: &[Voxel]) -> Vec<(Voxel, Mask)> {
        let mut turned = Vec::new();
        for voxel in voxels {
            if !open.remove(*voxel) {
                open.insert(*voxel);
            }
            let mut cell = mask::NONE;
            mask::set(&mut cell, cell_of(*voxel));
            turned.push((brick_of(*voxel), cell));
        }
        turned
    }

    proptest! {
        #![proptest_config(ProptestConfig::with_cases(512))]
        /// Kept up to date edit by edit, it is what a flood finds, and what it says has changed is what has.
        #[test]
        fn incremental_equals_flooded(
            density in 0.2..0.9f64,
            scattered in prop::collection::vec(0.0..1.0f64, EDGE.pow(3) as usize),
            edits in prop::collection::vec((voxel(), prop::collection::vec(voxel(), 0..30), any::<bool>()), 1..12),
        ) {
            let all = (0..EDGE.pow(3)).map(|i| Voxel::new(2 + i % EDGE, 2 + i / EDGE % EDGE, 2 + i / EDGE / EDGE));
            let mut open: VoxelSet = all.zip(scattered).filter(|(_, share)| *share < density).map(|(v, _)| v).collect();
            let mut component = Component::of(&open, edits[0].0);
            for (start, voxels, move_on) in edits {
                let turned = turn(&mut open, &voxels);
                let start = if move_on { start } else { component.start() };
                let before = component.clone();
                let mut changed = VoxelSet::new();
                component.update(&open, start, &turned, &mut |brick, cells| {
                    let more = mask::or(changed.brick(brick), cells);
                    changed.replace(brick, &more);
                });
                let expected = flooded(&open, start);
                prop_assert!(*component == expected);
                let differs = |v: &Voxel| before.contains(*v) != expected.contains(*v);
                prop_assert!(before.iter().chain(expected.iter()).filter(differs).all(|v| changed.contains(v)));
            }
        }
    }

    /// A long corridor that is cut: what is visited is about the smaller part.
    #[test]
    fn what_is_cut_off_is_the_part_without_the_start() {
        let at = |x: i32| Voxel::new(x, 1, 1);
        for (start, cut, left) in [(at(3), at(990), 989), (at(3), at(9), 8)] {
            let mut open: VoxelSet = (1..=1000).map(at).collect();
            let mut component = Component::of(&open, start);
            assert_eq!(component.len(), 1000);
            let turned = turn(&mut open, &[cut]);
            component.update(&open, start, &turned, &mut |_, _| {});
            assert_eq!(component.len(), left);
        }
    }
}
