//! Sets of cells of a brick, a bit a cell.
//!
//! A brick's 512 cells are eight layers of 64: cell `z·64 + y·8 + x` (see [`cell_of`](crate::bricks::cell_of)) is bit
//! `y·8 + x` of word `z`.

use crate::bricks::{BRICK_CELLS, voxel_at};
use crate::voxel::Voxel;

/// A set of cells of one brick: eight layers along z, each with 8 rows along y of 8 bits along x.
pub type Mask = [u64; 8];

/// No cell.
pub const NONE: Mask = [0; 8];
/// Every cell.
pub const ALL: Mask = [!0; 8];

/// The places of the bits of `word`, ascending.
pub fn bits(mut word: u64) -> impl Iterator<Item = usize> {
    std::iter::from_fn(move || {
        let bit = (word != 0).then(|| word.trailing_zeros() as usize)?;
        word &= word - 1;
        Some(bit)
    })
}

/// The cells of a set, as places in the brick, ascending.
pub fn cells(mask: &Mask) -> impl Iterator<Item = usize> {
    mask.iter().enumerate().flat_map(|(z, &word)| bits(word).map(move |bit| z << 6 | bit))
}

/// Number of cells in a set.
pub fn count(mask: &Mask) -> usize {
    mask.iter().map(|word| word.count_ones() as usize).sum()
}

/// Puts a cell into a set.
#[inline]
pub fn set(mask: &mut Mask, cell: usize) {
    mask[cell >> 6] |= 1 << (cell & 63);
}

/// Takes a cell out of a set.
#[inline]
pub fn clear(mask: &mut Mask, cell: usize) {
    mask[cell >> 6] &= !(1 << (cell & 63));
}

/// Those of two sets that are in both.
#[inline]
pub fn and(a: &Mask, b: &Mask) -> Mask {
    std::array::from_fn(|z| a[z] & b[z])
}

/// Those that are in one of two sets, or in both.
#[inline]
pub fn or(a: &Mask, b: &Mask) -> Mask {
    std::array::from_fn(|z| a[z] | b[z])
}

/// Those of a set that are not in another one.
#[inline]
pub fn without(a: &Mask, b: &Mask) -> Mask {
    std::array::from_fn(|z| a[z] & !b[z])
}

/// The cells with x = 0 of a layer.
const LEFT: u64 = 0x0101_0101_0101_0101;
/// Those with x = 7.
const RIGHT: u64 = LEFT << 7;

/// The cells of a brick (in bricks) that lie in the box between two voxels, both in it.
pub fn within(brick: Voxel, [min, max]: [Voxel; 2]) -> Mask {
    let (low, high) = (voxel_at(brick, 0), voxel_at(brick, BRICK_CELLS - 1));
    let (min, max) = (min.sup(low), max.inf(high));
    if min.x > max.x || min.y > max.y || min.z > max.z {
        return NONE;
    }
    let (min, max) = (min - low, max - low);
    let run = |from: i32, to: i32| 0xff_u64 >> (7 - to) & 0xff << from;
    let rows = (min.y..=max.y).fold(0, |rows, y| rows | run(min.x, max.x) << (8 * y));
    std::array::from_fn(|z| if (min.z..=max.z).contains(&(z as i32)) { rows } else { 0 })
}

/// Corners of the box around the cells of a brick (in bricks), both in it; `None`: there is none.
pub fn corners(brick: Voxel, cells: &Mask) -> Option<[Voxel; 2]> {
    let all = cells.iter().fold(0, |all, layer| all | layer);
    if all == 0 {
        return None;
    }
    let row = (0..8).fold(0, |row, y| row | all >> (8 * y) & 0xff);
    let layers = (0..8).filter(|z| cells[*z] != 0);
    let z = layers.fold([7, 0], |[low, high]: [usize; 2], z| [low.min(z), high.max(z)]);
    let corner = |bits: u32, y: u32, z: usize| voxel_at(brick, z << 6 | (y as usize) << 3 | bits as usize);
    let low = corner(row.trailing_zeros(), all.trailing_zeros() / 8, z[0]);
    Some([low, corner(63 - row.leading_zeros(), (63 - all.leading_zeros()) / 8, z[1])])
}

/// The cells of a brick that share a face with any of a set.
pub fn dilated(mask: &Mask) -> Mask {
    let beside = |word: u64| (word << 1 & !LEFT) | (word >> 1 & !RIGHT) | word << 8 | word >> 8;
    std::array::from_fn(|z| {
        let (below, above) = (if z > 0 { mask[z - 1] } else { 0 }, if z < 7 { mask[z + 1] } else { 0 });
        beside(mask[z]) | below | above
    })
}

/// The cells of a brick that share the face opposite to this one, in the order of [`FACES`](crate::voxel::FACES), with any of a
/// set: the set, one cell on.
pub fn stepped(mask: &Mask, face: usize) -> Mask {
    let layer = |z: usize| mask.get(z).copied().unwrap_or_default();
    match face {
        0 => mask.map(|word| word >> 1 & !RIGHT),
        1 => mask.map(|word| word << 1 & !LEFT),
        2 => mask.map(|word| word >> 8),
        3 => mask.map(|word| word << 8),
        4 => std::array::from_fn(|z| layer(z + 1)),
        _ => std::array::from_fn(|z| layer(z.wrapping_sub(1))),
    }
}

/// All cells of `open` that hang together with any of `seed` over faces, within the brick; of `seed` those that are open.
pub fn fill(seed: &Mask, open: &Mask) -> Mask {
    let mut filled = and(seed, open);
    loop {
        let before = filled;
        // Up and down, each with what was gained below: along z one pass goes all the way.
        for z in (0..8).chain((0..7).rev()) {
            let word = filled[z];
            let beside = (word << 1 & !LEFT) | (word >> 1 & !RIGHT) | word << 8 | word >> 8;
            let (below, above) = (if z > 0 { filled[z - 1] } else { 0 }, if z < 7 { filled[z + 1] } else { 0 });
            filled[z] |= (beside | below | above) & open[z];
        }
        if filled == before {
            return filled;
        }
    }
}

/// What lies beyond a face of the brick, in the order of [`FACES`](crate::voxel::FACES), beside cells of a set: as cells of
/// the neighbour there.
pub fn beyond(mask: &Mask, face: usize) -> Mask {
    let layer = |to: usize, word: u64| std::array::from_fn(|z| if z == to { word } else { 0 });
    match face {
        0 => mask.map(|word| (word & LEFT) << 7),
        1 => mask.map(|word| (word & RIGHT) >> 7),
        2 => mask.map(|word| word << 56),
        3 => mask.map(|word| word >> 56),
        4 => layer(7, mask[0]),
        _ => layer(0, mask[7]),
    }
}

/// Whether a cell is in a set.
#[inline]
pub fn has(mask: &Mask, cell: usize) -> bool {
    mask[cell >> 6] >> (cell & 63) & 1 == 1
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::bricks::{brick_of, cell_of};
    use crate::voxel::FACES;
    use proptest::prelude::*;

    #[test]
    fn what_is_put_into_a_set_is_in_it() {
        let put = [0, 63, 64, 200, 511];
        let mut mask = NONE;
        put.iter().for_each(|cell| set(&mut mask, *cell));
        assert!(cells(&mask).eq(put) && count(&mask) == put.len());
        assert!((0..512).all(|cell| has(&mask, cell) == put.contains(&cell)));
        assert_eq!(count(&ALL), 512);
        clear(&mut mask, 64);
        assert!(!has(&mask, 64) && count(&mask) == put.len() - 1);
    }

    proptest! {
        /// Cell by cell it is what lies between the corners; and the box around cells is the smallest that has them all.
        #[test]
        fn a_box_has_what_lies_between_its_corners(
            brick in prop::array::uniform3(-3..3i32),
            corners in prop::array::uniform2(prop::array::uniform3(-30..30i32)),
            sparse in prop::collection::vec(0..512usize, 0..6),
        ) {
            let (brick, [a, b]) = (Voxel::from(brick), corners.map(Voxel::from));
            let (min, max) = (a.inf(b), a.sup(b));
            let is_in = |cell: &usize| {
                let voxel = voxel_at(brick, *cell);
                voxel == voxel.sup(min).inf(max)
            };
            let expected: Vec<usize> = (0..BRICK_CELLS).filter(is_in).collect();
            prop_assert!(cells(&within(brick, [min, max])).eq(expected));
            let mut some = NONE;
            sparse.iter().for_each(|cell| set(&mut some, *cell));
            let voxels = || sparse.iter().map(|cell| voxel_at(brick, *cell));
            let around = voxels().reduce(Voxel::inf).zip(voxels().reduce(Voxel::sup)).map(|(low, high)| [low, high]);
            prop_assert_eq!(super::corners(brick, &some), around);
        }

        /// Word by word it is what a flood from voxel to voxel finds, and beyond a face lies what is beside it.
        #[test]
        fn what_is_filled_hangs_together(seed in 0..512usize, open in prop::array::uniform8(any::<u64>()), more in any::<bool>()) {
            let open = if more { or(&open, &[!0x1042_0800_2104_0081; 8]) } else { open };
            let mut seeds = NONE;
            set(&mut seeds, seed);
            let filled = fill(&seeds, &open);
            let voxel = |cell: usize| voxel_at(Voxel::new(0, 0, 0), cell);
            let beside = |cell: usize| voxel(cell).face_neighbours().into_iter();
            let inside = |v: &Voxel| brick_of(*v) == Voxel::new(0, 0, 0);
            prop_assert_eq!(and(&filled, &open), filled);
            prop_assert_eq!(has(&filled, seed), has(&open, seed));
            let closed = |cell: usize| beside(cell).filter(inside).all(|n| has(&filled, cell_of(n)) || !has(&open, cell_of(n)));
            prop_assert!(cells(&filled).all(closed));
            let mut flood = if has(&open, seed) { vec![seed] } else { vec![] };
            let mut next = 0;
            while let Some(cell) = flood.get(next).copied() {
                next += 1;
                for n in beside(cell).filter(inside).map(cell_of) {
                    if has(&open, n) && !flood.contains(&n) {
                        flood.push(n);
                    }
                }
            }
            prop_assert_eq!(flood.len(), count(&filled));
            for (n, face) in FACES.iter().enumerate() {
                let expected = cells(&open).flat_map(beside).filter(|v| brick_of(*v) == *face).map(cell_of);
                let mut mask = NONE;
                expected.for_each(|cell| set(&mut mask, cell));
                prop_assert_eq!(beyond(&open, n), mask);
                let moved = cells(&open).map(|cell| voxel(cell) + *face).filter(inside).map(cell_of);
                let mut mask = NONE;
                moved.for_each(|cell| set(&mut mask, cell));
                prop_assert_eq!(stepped(&open, n), mask);
            }
        }
    }
}
