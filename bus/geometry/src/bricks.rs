//! A sparse voxel grid: bricks of 8×8×8 cells, found through a hash of their position.
//!
//! Dense inside a brick, nothing outside: a lookup is one hash probe (none while it stays in the brick of the previous
//! one, see [`Bricks::brick`]), and neighbours share cache lines. Bricks are kept in the order in which they were first
//! written, so that every walk over the grid is the same on every run.

use std::hash::{Hash, Hasher};

use hashbrown::HashTable;

use crate::voxel::Voxel;

/// Edge of a brick, in cells.
pub const BRICK: i32 = 8;
/// Cells of a brick.
pub const BRICK_CELLS: usize = 512;

/// A sparse grid of `T`; cells never written read as `T::default()`.
#[derive(Debug, Clone, Default)]
pub struct Bricks<T> {
    index: BrickIndex,
    positions: Vec<Voxel>,
    cells: Vec<Box<[T; BRICK_CELLS]>>,
}

/// The brick that holds a cell: the cell's indices divided by eight, rounded down.
#[inline]
pub fn brick_of(voxel: Voxel) -> Voxel {
    Voxel::new(voxel.x >> 3, voxel.y >> 3, voxel.z >> 3)
}

/// A cell's place inside its brick: x fastest, z slowest.
#[inline]
pub fn cell_of(voxel: Voxel) -> usize {
    ((voxel.z & 7) << 6 | (voxel.y & 7) << 3 | voxel.x & 7) as usize
}

/// The cell at place `cell` of brick `brick`; the inverse of [`brick_of`] and [`cell_of`].
#[inline]
pub fn voxel_at(brick: Voxel, cell: usize) -> Voxel {
    let c = cell as i32;
    Voxel::new(brick.x << 3 | c & 7, brick.y << 3 | c >> 3 & 7, brick.z << 3 | c >> 6)
}

/// Adds to a list of something a brick. Where it is full it grows by an eighth: twice as much would be the largest part of what is
/// kept.
pub fn push<T>(list: &mut Vec<T>, one: T) {
    if list.len() == list.capacity() {
        list.reserve_exact((list.len() / 8).max(4));
    }
    list.push(one);
}

/// Takes one out of such a list; the last one comes to stand in its place. Once a fifth of the list is vacant it is given back.
pub fn swap_remove<T>(list: &mut Vec<T>, place: usize) -> T {
    let one = list.swap_remove(place);
    if list.len() + list.len() / 4 + 4 < list.capacity() {
        list.shrink_to(list.len() + list.len() / 8);
    }
    one
}

/// Smallest corner, and the corner beyond the largest, of bricks and of a voxel.
pub fn corners(include: Voxel, bricks: impl Iterator<Item = Voxel>) -> (Voxel, Voxel) {
    let (mut min, mut max) = (include, include + Voxel::new(1, 1, 1));
    for brick in bricks {
        let low = voxel_at(brick, 0);
        min = Voxel::new(min.x.min(low.x), min.y.min(low.y), min.z.min(low.z));
        let high = low + Voxel::new(BRICK, BRICK, BRICK);
        max = Voxel::new(max.x.max(high.x), max.y.max(high.y), max.z.max(high.z));
    }
    (min, max)
}

impl<T: Copy + Default> Bricks<T> {
    /// An empty grid.
    pub fn new() -> Self {
        Self::default()
    }

    /// The value of a cell.
    pub fn get(&self, voxel: Voxel) -> T {
        self.brick(brick_of(voxel)).map_or_else(T::default, |cells| cells[cell_of(voxel)])
    }

    /// The cell, for writing; its brick comes into being if it was not there.
    pub fn get_mut(&mut self, voxel: Voxel) -> &mut T {
        &mut self.brick_mut(brick_of(voxel))[cell_of(voxel)]
    }

    /// The cells of the brick at `brick` (in bricks, see [`brick_of`]), if any of them was ever written.
    pub fn brick(&self, brick: Voxel) -> Option<&[T; BRICK_CELLS]> {
        self.index.find(brick, |i| self.positions[i]).map(|i| &*self.cells[i])
    }

    /// The cells of the brick at `brick`, for writing; comes into being if it was not there.
    pub fn brick_mut(&mut self, brick: Voxel) -> &mut [T; BRICK_CELLS] {
        let next = self.cells.len();
        let found = self.index.find(brick, |i| self.positions[i]);
        if found.is_none() {
            push(&mut self.positions, brick);
            push(&mut self.cells, Box::new([T::default(); BRICK_CELLS]));
            self.index.insert(next, |i| self.positions[i]);
        }
        &mut self.cells[found.unwrap_or(next)]
    }

    /// All bricks with their cells, in the order in which they were first written.
    pub fn iter(&self) -> impl Iterator<Item = (Voxel, &[T; BRICK_CELLS])> {
        self.positions.iter().zip(&self.cells).map(|(&p, c)| (p, &**c))
    }

    /// All cells of all bricks, in the order of [`Bricks::iter`].
    pub fn voxels(&self) -> impl Iterator<Item = (Voxel, T)> {
        self.iter().flat_map(|(b, cells)| cells.iter().enumerate().map(move |(i, &v)| (voxel_at(b, i), v)))
    }

    /// Number of bricks.
    pub fn len(&self) -> usize {
        self.cells.len()
    }

    /// Whether nothing was ever written.
    pub fn is_empty(&self) -> bool {
        self.cells.is_empty()
    }
}

/// The numbers of bricks by their positions, in five bytes and some each: positions are kept by who numbers them, and asked for.
#[derive(Debug, Clone, Default)]
pub struct BrickIndex(HashTable<u32>);

impl BrickIndex {
    /// The number of the brick at `brick` (in bricks), if it has one; `position` says where a number is.
    #[inline]
    pub fn find(&self, brick: Voxel, position: impl Fn(usize) -> Voxel) -> Option<usize> {
        let number = self.0.find(hash(brick), |number| position(*number as usize) == brick);
        number.map(|number| *number as usize)
    }

    /// Takes in a number whose position has none yet.
    pub fn insert(&mut self, number: usize, position: impl Fn(usize) -> Voxel) {
        self.0.insert_unique(hash(position(number)), number as u32, |number| hash(position(*number as usize)));
    }

    /// Takes out the number of a brick, which becomes that of the brick whose number was the `last`; `position` says where each was
    /// before.
    pub fn swap_remove(&mut self, number: usize, last: usize, position: impl Fn(usize) -> Voxel) {
        if let Ok(entry) = self.0.find_entry(hash(position(number)), |other| *other as usize == number) {
            entry.remove();
        }
        if let Some(moved) = self.0.find_mut(hash(position(last)), |other| *other as usize == last) {
            *moved = number as u32;
        }
        if 8 * self.0.len() < self.0.capacity() {
            let now = |other: usize| position(if other == number { last } else { other });
            self.0.shrink_to(2 * self.0.len(), |other| hash(now(*other as usize)));
        }
    }
}

#[inline]
fn hash(brick: Voxel) -> u64 {
    let mut hasher = BrickHasher::default();
    brick.hash(&mut hasher);
    hasher.finish()
}

/// Mixes the three indices of a brick; the keys are trusted, so no defence against collisions is paid for.
#[derive(Debug, Clone, Copy, Default)]
pub struct BrickHasher(u64);

impl Hasher for BrickHasher {
    #[inline]
    fn finish(&self) -> u64 {
        self.0 ^ self.0 >> 32
    }
    #[inline]
    fn write(&mut self, bytes: &[u8]) {
        for &b in bytes {
            self.write_i32(i32::from(b));
        }
    }
    #[inline]
    fn write_i32(&mut self, i: i32) {
        self.write_usize(i as u32 as usize);
    }
    #[inline]
    fn write_usize(&mut self, i: usize) {
        self.0 = (self.0.rotate_left(21) ^ i as u64).wrapping_mul(0x9e37_79b9_7f4a_7c15);
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    proptest! {
        #[test]
        fn a_cell_is_where_its_brick_says(x in -40000..40000i32, y in -40000..40000i32, z in -40000..40000i32) {
            let v = Voxel::new(x, y, z);
            prop_assert_eq!(voxel_at(brick_of(v), cell_of(v)), v);
        }

        #[test]
        fn what_was_written_is_read(cells in prop::collection::vec(((-20..20i32, -20..20i32, -20..20i32), any::<u8>()), 0..200)) {
            let mut bricks = Bricks::new();
            let mut model = std::collections::BTreeMap::new();
            for &((x, y, z), value) in &cells {
                *bricks.get_mut(Voxel::new(x, y, z)) = value;
                model.insert(Voxel::new(x, y, z), value);
            }
            for (&v, &value) in &model {
                prop_assert_eq!(bricks.get(v), value);
            }
            prop_assert_eq!(bricks.voxels().filter(|(v, _)| model.contains_key(v)).count(), model.len());
        }
    }
}
