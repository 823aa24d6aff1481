//! What hangs together with a voxel over faces, kept up to date as voxels open and close.
//!
//! What opens is grown into from the voxels that it touches, at the cost of what is gained. Where something closes, all that
//! lay around it is searched from at once, until the searches have met, or one has nowhere left to go and is what was cut
//! off: at the cost of the smaller part (after Even and Shiloach, *An On-Line Edge-Deletion Problem*, 1981).

use std::collections::{BTreeSet, HashMap, VecDeque};
use std::hash::BuildHasherDefault;
use std::ops::Deref;

use crate::bricks::BrickHasher;
use crate::region::Region;

/// The voxels that are connected with a start over the faces of open voxels, by index of a [`Region`]; the start always is
/// one of them. No voxel on the region's own faces may be open.
#[derive(Debug, Clone)]
pub struct Component {
    start: usize,
    inside: Vec<bool>,
    len: usize,
}

/// Whether each voxel of the region is in it, by index.
impl Deref for Component {
    type Target = [bool];

    fn deref(&self) -> &[bool] {
        &self.inside
    }
}

impl Component {
    /// What is connected with `start`; `open` says whether a voxel is, by index.
    pub fn of(region: &Region, open: &impl Fn(usize) -> bool, start: usize) -> Self {
        let mut component = Self { start, inside: vec![false; region.len()], len: 0 };
        component.add(start);
        component.grow(region.faces(), open, vec![start], &mut |_| {});
        component
    }

    /// The voxel that the others are connected with.
    pub fn start(&self) -> usize {
        self.start
    }

    /// Number of voxels.
    pub fn count(&self) -> usize {
        self.len
    }

    /// Whether a voxel is one of them.
    pub fn contains(&self, index: usize) -> bool {
        self.inside[index]
    }

    /// Takes note that the start is in another place, and that these voxels have opened or closed since: `open` is as it is
    /// now. Each voxel that comes in or goes out is told to `changed`.
    pub fn update(
        &mut self,
        region: &Region,
        open: &impl Fn(usize) -> bool,
        start: usize,
        turned: &[usize],
        changed: &mut impl FnMut(usize),
    ) {
        let faces = region.faces();
        let before = std::mem::replace(&mut self.start, start);
        if !self.inside[start] {
            return self.begin_anew(faces, open, changed);
        }
        let closed = turned.iter().copied().chain([before]);
        let mut gone: BTreeSet<usize> = closed.filter(|i| self.inside[*i] && !open(*i) && *i != start).collect();
        gone.iter().for_each(|i| self.remove(*i, changed));
        while let Some(first) = gone.first().copied() {
            if !self.settle(faces, first, &mut gone, changed) {
                return self.begin_anew(faces, open, changed);
            }
        }
        let touches = |i: &usize| faces.iter().any(|d| self.inside[i.wrapping_add_signed(*d)]);
        let opened: Vec<usize> =
            turned.iter().copied().filter(|i| open(*i) && !self.inside[*i]).filter(touches).collect();
        for i in opened {
            if self.add(i) {
                changed(i);
                self.grow(faces, open, vec![i], changed);
            }
        }
    }

    fn add(&mut self, index: usize) -> bool {
        let new = !std::mem::replace(&mut self.inside[index], true);
        self.len += usize::from(new);
        new
    }

    fn remove(&mut self, index: usize, changed: &mut impl FnMut(usize)) {
        self.inside[index] = false;
        self.len -= 1;
        changed(index);
    }

    fn begin_anew(&mut self, faces: [isize; 6], open: &impl Fn(usize) -> bool, changed: &mut impl FnMut(usize)) {
        let before = std::mem::take(&mut self.inside);
        self.inside = vec![false; before.len()];
        self.len = 0;
        self.add(self.start);
        self.grow(faces, open, vec![self.start], &mut |_| {});
        let differs = |i: &usize| before[*i] != self.inside[*i];
        (0..before.len()).filter(differs).for_each(changed);
    }

    /// Takes in what can be got to from the voxels of `front`, which are in.
    fn grow(
        &mut self,
        faces: [isize; 6],
        open: &impl Fn(usize) -> bool,
        mut front: Vec<usize>,
        changed: &mut impl FnMut(usize),
    ) {
        while let Some(i) = front.pop() {
            for d in faces {
                let n = i.wrapping_add_signed(d);
                if open(n) && self.add(n) {
                    changed(n);
                    front.push(n);
                }
            }
        }
    }

    /// Takes out what is cut off by those voxels of `gone` that hang together with `first`; all of them are out already. What
    /// was cut off is gone with them, and so is what of `gone` it touches: it held together what lies on both sides of it.
    /// Answers whether the start is still in what is left.
    fn settle(
        &mut self,
        faces: [isize; 6],
        first: usize,
        gone: &mut BTreeSet<usize>,
        changed: &mut impl FnMut(usize),
    ) -> bool {
        let mut hole = connected(faces, first, gone);
        loop {
            let border: BTreeSet<usize> = beside(faces, &hole).filter(|i| self.inside[*i]).collect();
            let Some(cut) = Searches::from(border).smallest(faces, &self.inside) else { return true };
            if cut.contains(&self.start) {
                return false;
            }
            cut.iter().for_each(|i| self.remove(*i, changed));
            for i in beside(faces, &cut) {
                if gone.contains(&i) {
                    hole.extend(connected(faces, i, gone));
                }
            }
            hole.extend(cut);
        }
    }
}

/// What shares a face with any of the voxels.
fn beside(faces: [isize; 6], voxels: &[usize]) -> impl Iterator<Item = usize> + '_ {
    voxels.iter().flat_map(move |i| faces.map(|d| i.wrapping_add_signed(d)))
}

/// Takes the voxels out of `among` that hang together with `first`.
fn connected(faces: [isize; 6], first: usize, among: &mut BTreeSet<usize>) -> Vec<usize> {
    among.remove(&first);
    let mut found = vec![first];
    let mut next = 0;
    while let Some(i) = found.get(next).copied() {
        next += 1;
        found.extend(beside(faces, &[i]).filter(|n| among.remove(n)));
    }
    found
}

/// Searches from several voxels at once, which are one when they meet.
struct Searches {
    /// Which search has been to a voxel.
    been: HashMap<usize, usize, BuildHasherDefault<BrickHasher>>,
    /// What each search has still to go on from, in the order in which it came there.
    fronts: Vec<VecDeque<usize>>,
    /// Which search each has become a part of; its own number if none.
    joined: Vec<usize>,
    /// Searches that have not become a part of another one.
    left: usize,
}

impl Searches {
    fn from(starts: BTreeSet<usize>) -> Self {
        let count = starts.len();
        let been = starts.iter().copied().enumerate().map(|(search, i)| (i, search)).collect();
        let fronts = starts.into_iter().map(|i| VecDeque::from([i])).collect();
        Self { been, fronts, joined: (0..count).collect(), left: count }
    }

    /// Searches until all are one; or one of several has been everywhere that it can: all voxels where it was.
    fn smallest(mut self, faces: [isize; 6], inside: &[bool]) -> Option<Vec<usize>> {
        while self.left > 1 {
            for search in 0..self.fronts.len() {
                if self.joined[search] != search || self.left == 1 {
                    continue;
                }
                let Some(i) = self.fronts[search].pop_front() else {
                    return Some(self.voxels_of(search));
                };
                beside(faces, &[i]).filter(|n| inside[*n]).for_each(|n| self.come_to(n, search));
            }
        }
        None
    }

    fn come_to(&mut self, index: usize, search: usize) {
        let own = self.root(search);
        let Some(other) = self.been.insert(index, own) else {
            return self.fronts[own].push_back(index);
        };
        let other = self.root(other);
        if other != own {
            self.joined[other] = own;
            let mut front = std::mem::take(&mut self.fronts[other]);
            self.fronts[own].append(&mut front);
            self.left -= 1;
        }
    }

    fn root(&self, mut search: usize) -> usize {
        while self.joined[search] != search {
            search = self.joined[search];
        }
        search
    }

    /// In order of their indices.
    fn voxels_of(&self, search: usize) -> Vec<usize> {
        let mut voxels: Vec<usize> =
            self.been.iter().filter(|(_, other)| self.root(**other) == search).map(|(i, _)| *i).collect();
        voxels.sort_unstable();
        voxels
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::voxel::Voxel;
    use proptest::prelude::*;

    /// Edge of the region.
    const EDGE: usize = 9;

    fn region() -> Region {
        Region::new(Voxel::new(0, 0, 0), [EDGE; 3], 1.0)
    }

    /// A voxel that is not on the region's faces.
    fn inner() -> impl Strategy<Value = usize> {
        prop::array::uniform3(1..EDGE - 1).prop_map(|[x, y, z]| (z * EDGE + y) * EDGE + x)
    }

    /// All that a flood finds.
    fn flooded(open: &[bool], start: usize) -> Vec<bool> {
        let mut found = vec![false; open.len()];
        let mut front = vec![start];
        found[start] = true;
        while let Some(i) = front.pop() {
            let near = region().faces().map(|d| i.wrapping_add_signed(d));
            front.extend(near.into_iter().filter(|n| open[*n] && !std::mem::replace(&mut found[*n], true)));
        }
        found
    }

    proptest! {
        #![proptest_config(ProptestConfig::with_cases(512))]
        /// Kept up to date edit by edit, it is what a flood finds, and what it says has changed is what has.
        #[test]
        fn incremental_equals_flooded(
            density in 0.2..0.9f64,
            scattered in prop::collection::vec(0.0..1.0f64, EDGE.pow(3)),
            edits in prop::collection::vec((inner(), prop::collection::vec(inner(), 0..30), any::<bool>()), 1..12),
        ) {
            let region = region();
            let is_inner = |i: &usize| region.voxel(*i).to_array().iter().all(|c| (1..EDGE as i32 - 1).contains(c));
            let mut open: Vec<bool> = (0..region.len()).map(|i| is_inner(&i) && scattered[i] < density).collect();
            let mut component = Component::of(&region, &|i: usize| open[i], edits[0].0);
            for (start, turned, move_on) in edits {
                turned.iter().for_each(|i| open[*i] = !open[*i]);
                let start = if move_on { start } else { component.start() };
                let before = component.clone();
                let mut changed = BTreeSet::new();
                component.update(&region, &|i: usize| open[i], start, &turned, &mut |i| {
                    changed.insert(i);
                });
                let expected = flooded(&open, start);
                prop_assert_eq!(&*component, &*expected);
                prop_assert_eq!(component.count(), expected.iter().filter(|inside| **inside).count());
                prop_assert!((0..open.len()).filter(|i| before[*i] != expected[*i]).all(|i| changed.contains(&i)));
            }
        }
    }

    /// A long corridor that is cut: what is visited is about the smaller part.
    #[test]
    fn what_is_cut_off_is_the_part_without_the_start() {
        let region = Region::new(Voxel::new(0, 0, 0), [1002, 3, 3], 1.0);
        let at = |x: i32| region.index(Voxel::new(x, 1, 1)).unwrap();
        let mut open: Vec<bool> = (0..region.len()).map(|i| (at(1)..=at(1000)).contains(&i)).collect();
        for (start, cut, left) in [(at(3), at(990), 989), (at(3), at(9), 8)] {
            open.iter_mut().enumerate().for_each(|(i, open)| *open = (at(1)..=at(1000)).contains(&i));
            let mut component = Component::of(&region, &|i: usize| open[i], start);
            assert_eq!(component.count(), 1000);
            open[cut] = false;
            component.update(&region, &|i: usize| open[i], start, &[cut], &mut |_| {});
            assert_eq!(component.count(), left);
        }
    }
}
