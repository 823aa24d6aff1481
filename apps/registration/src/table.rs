//! From a voxel's index to its place in a list.

/// Where a voxel is: its index along each axis.
pub(crate) type Index<const D: usize> = [i32; D];

/// Indices of voxels are from −LIMIT to LIMIT.
pub(crate) const LIMIT: i32 = (1 << 22) - 8;

/// A brick has 1 << SHIFT voxels along each axis.
const SHIFT: usize = 2;

/// No brick, and no place of a voxel.
const NONE: u32 = u32::MAX;

/// Places of voxels by their indices: bricks of 4 voxels along each axis, found by hashing (open addressing, linear probing, at most half full).
/// Neighbours are mostly of one brick. It is looked into only, never walked through.
#[derive(Clone, Debug)]
pub(crate) struct Table<const D: usize> {
    slots: Vec<(u64, u32)>,
    /// Places of the voxels of all bricks, brick by brick.
    places: Vec<u32>,
}

impl<const D: usize> Table<D> {
    const BRICK: usize = 1 << (SHIFT * D);

    pub fn new() -> Self {
        Self { slots: vec![(0, NONE); 1 << 6], places: Vec::new() }
    }

    /// A brick's indices, packed: 21 bits an axis, of up to three.
    fn key(index: &Index<D>) -> u64 {
        index.iter().fold(0, |key, &i| key << 21 | ((i >> SHIFT) + (1 << 20)) as u64)
    }

    fn cell(index: &Index<D>) -> usize {
        index.iter().fold(0, |cell, &i| cell << SHIFT | (i & ((1 << SHIFT) - 1)) as usize)
    }

    /// The slot in which a key is, or would be.
    fn slot(&self, key: u64) -> usize {
        // The upper bits of the product depend on all of the key (Fibonacci hashing, Knuth, TAOCP 6.4).
        let hash = key.wrapping_mul(0x9e37_79b9_7f4a_7c15) >> 32;
        let mask = self.slots.len() - 1;
        let mut slot = hash as usize & mask;
        while self.slots[slot].1 != NONE && self.slots[slot].0 != key {
            slot = (slot + 1) & mask;
        }
        slot
    }

    pub fn get(&self, index: &Index<D>) -> Option<usize> {
        let (_, brick) = self.slots[self.slot(Self::key(index))];
        let place = *self.places.get(brick as usize * Self::BRICK + Self::cell(index))?;
        (place != NONE).then_some(place as usize)
    }

    /// The indices and places of the voxels of a cube, `edge` along each axis from its `first` on.
    pub fn cube(&self, first: Index<D>, edge: usize) -> impl Iterator<Item = (Index<D>, usize)> {
        let mut index = first;
        let mut left = edge.pow(D as u32);
        // A key that no brick has.
        let mut last = (u64::MAX, NONE);
        std::iter::from_fn(move || {
            while left > 0 {
                let here = index;
                left -= 1;
                for axis in (0..D).rev() {
                    index[axis] += 1;
                    if index[axis] < first[axis] + edge as i32 {
                        break;
                    }
                    index[axis] = first[axis];
                }
                let key = Self::key(&here);
                if key != last.0 {
                    last = (key, self.slots[self.slot(key)].1);
                }
                if last.1 == NONE {
                    continue;
                }
                let place = self.places[last.1 as usize * Self::BRICK + Self::cell(&here)];
                if place != NONE {
                    return Some((here, place as usize));
                }
            }
            None
        })
    }

    /// The indices and places of the voxels of half the edge of which a voxel consists, `first` first (bit i: the upper half along axis i),
    /// its opposite last. They are of one brick.
    pub fn halves<'a>(
        &'a self,
        coarser: &Index<D>,
        first: usize,
    ) -> impl Iterator<Item = (Index<D>, usize)> + use<'a, D> {
        let lowest = coarser.map(|i| i << 1);
        let (_, brick) = self.slots[self.slot(Self::key(&lowest))];
        let cells = self.places.get(brick as usize * Self::BRICK..).unwrap_or_default();
        (0..if brick == NONE { 0 } else { 1usize << D }).filter_map(move |i| {
            let index = std::array::from_fn(|axis| lowest[axis] + ((i ^ first) >> axis & 1) as i32);
            let place = cells[Self::cell(&index)];
            (place != NONE).then_some((index, place as usize))
        })
    }

    /// The place of a voxel; `next`, if it has had none, which is then its own.
    pub fn get_or_insert(&mut self, index: &Index<D>, next: usize) -> usize {
        let key = Self::key(index);
        let mut slot = self.slot(key);
        if self.slots[slot].1 == NONE {
            let bricks = self.places.len() / Self::BRICK;
            if 2 * bricks >= self.slots.len() {
                self.grow();
                slot = self.slot(key);
            }
            self.slots[slot] = (key, bricks as u32);
            self.places.resize(self.places.len() + Self::BRICK, NONE);
        }
        let place = &mut self.places[self.slots[slot].1 as usize * Self::BRICK + Self::cell(index)];
        if *place == NONE {
            *place = next as u32;
        }
        *place as usize
    }

    fn grow(&mut self) {
        let larger = vec![(0, NONE); 2 * self.slots.len()];
        for (key, brick) in std::mem::replace(&mut self.slots, larger) {
            if brick != NONE {
                let slot = self.slot(key);
                self.slots[slot] = (key, brick);
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;
    use std::collections::BTreeMap;

    proptest! {
        #[test]
        fn what_was_put_in_is_found(indices in prop::collection::vec(prop::array::uniform3(-9..9i32), 0..600), shift in 0..2) {
            let base = shift * (LIMIT - 9);
            let mut table = Table::new();
            let mut known: BTreeMap<[i32; 3], usize> = BTreeMap::new();
            for index in indices {
                let index = index.map(|i| i + base);
                let next = known.len();
                let place = *known.entry(index).or_insert(next);
                prop_assert_eq!(table.get_or_insert(&index, next), place);
            }
            let first = [base - 9; 3];
            prop_assert!(table.cube(first, 18).eq(known.iter().map(|(&index, &place)| (index, place))));
            for index in (-9..9).flat_map(|x| (-9..9).flat_map(move |y| (-9..9).map(move |z| [x, y, z].map(|i| i + base)))) {
                prop_assert_eq!(table.get(&index), known.get(&index).copied());
                let place_first = index[0].unsigned_abs() as usize % 8;
                let halves: BTreeMap<_, _> = table.halves(&index, place_first).collect();
                let twice = index.map(|i| 2 * i..2 * i + 2);
                let within = known.iter().filter(|(index, _)| (0..3).all(|axis| twice[axis].contains(&index[axis])));
                prop_assert_eq!(halves, within.map(|(&index, &place)| (index, place)).collect());
            }
        }
    }
}
