//! The growth of sets of cells across the borders of bricks. In a [`Mask`] a row along x is a byte, so whole layers are
//! worked on at once.

use elk_geometry::mask::Mask;
use elk_geometry::voxel::Voxel;

/// The cells with x = 0, in every row of a layer.
const FIRST_COLUMN: u64 = 0x0101_0101_0101_0101;
/// The cells with x = 7.
const LAST_COLUMN: u64 = FIRST_COLUMN << 7;

/// The cells of a brick whose x, y and z (0 to 7) lie in these half-open ranges.
pub fn block(x: [i32; 2], y: [i32; 2], z: [i32; 2]) -> Mask {
    // The bits of a range among the first eight.
    let below = |end: i32| (1u64 << end.clamp(0, 8)) - 1;
    let bits = |[from, to]: [i32; 2]| below(to) & !below(from);
    let first_column = |rows: u64| (0..8).fold(0, |column, i| column | (rows >> i & 1) << (8 * i));
    let layer = bits(x) * first_column(bits(y));
    let layers = bits(z);
    std::array::from_fn(|i| (layers >> i & 1).wrapping_neg() & layer)
}

/// Whether a set has cells at each of the faces of its brick.
pub fn at_faces(set: &Mask) -> [bool; 6] {
    let any = set.iter().fold(0, |any, layer| any | layer);
    let rows = [any & FIRST_COLUMN, any & LAST_COLUMN, any & 255, any >> 56, set[0], set[7]];
    rows.map(|cells| cells != 0)
}

/// The cells of a brick that share a face with a cell of a set; `own` is the set in the brick, `beside` in those beyond its
/// faces.
pub fn face_neighbours(own: &Mask, beside: &[Mask; 6]) -> Mask {
    let [left, right, front, back, below, above] = beside;
    std::array::from_fn(|z| {
        along_x(own[z], left[z], right[z])
            | along_y(own[z], front[z], back[z])
            | if z == 0 { below[7] } else { own[z - 1] }
            | if z == 7 { above[0] } else { own[z + 1] }
    })
}

/// The cells of a brick that are in a set or share a face, an edge or a corner with a cell of it; `set` gives the set in
/// the brick and the 26 around it, by offset.
pub fn grown(set: impl Fn(Voxel) -> Mask) -> Mask {
    let columns: [[[Mask; 3]; 3]; 3] = std::array::from_fn(|z| {
        std::array::from_fn(|y| std::array::from_fn(|x| set(Voxel::new(x as i32 - 1, y as i32 - 1, z as i32 - 1))))
    });
    // Layers −1 to 8 grown along x and y, then each joined with the two beside it.
    let layers: [u64; 10] = std::array::from_fn(|i| {
        let layer = i + 7; // of the 24 of the three bricks one above the other
        let (brick, z) = (layer >> 3, layer & 7);
        let [front, own, back] = std::array::from_fn(|y| grown_along_x(columns[brick][y].map(|mask| mask[z])));
        own | along_y(own, front, back)
    });
    std::array::from_fn(|z| layers[z] | layers[z + 1] | layers[z + 2])
}

fn grown_along_x([left, own, right]: [u64; 3]) -> u64 {
    own | along_x(own, left, right)
}

/// The cells beside those of a layer along x; `left` and `right` are the same layer of the bricks there.
fn along_x(own: u64, left: u64, right: u64) -> u64 {
    (own & !LAST_COLUMN) << 1 | (own & !FIRST_COLUMN) >> 1 | (left & LAST_COLUMN) >> 7 | (right & FIRST_COLUMN) << 7
}

/// The cells beside those of a layer along y.
fn along_y(own: u64, front: u64, back: u64) -> u64 {
    own << 8 | own >> 8 | front >> 56 | back << 56
}

#[cfg(test)]
mod tests {
    use super::*;
    use elk_geometry::bricks::{BRICK_CELLS, brick_of, cell_of, voxel_at};
    use elk_geometry::mask::{self, cells, count};
    use elk_geometry::voxel::FACES;
    use proptest::prelude::*;
    use std::collections::BTreeSet;

    fn mask_of(set: &BTreeSet<Voxel>, brick: Voxel) -> Mask {
        let mut mask = mask::NONE;
        set.iter().filter(|v| brick_of(**v) == brick).for_each(|v| mask::set(&mut mask, cell_of(*v)));
        mask
    }

    proptest! {
        #[test]
        fn growth_is_what_the_neighbours_say(cells in prop::collection::btree_set((-2..10i32, -2..10i32, -2..10i32), 0..60)) {
            let set: BTreeSet<Voxel> = cells.into_iter().map(|(x, y, z)| Voxel::new(x, y, z)).collect();
            let grown = grown(|brick| mask_of(&set, brick));
            let own = mask_of(&set, Voxel::new(0, 0, 0));
            let beside = face_neighbours(&own, &FACES.map(|face| mask_of(&set, face)));
            for cell in 0..BRICK_CELLS {
                let v = voxel_at(Voxel::new(0, 0, 0), cell);
                let near = set.contains(&v) || v.neighbours().any(|n| set.contains(&n));
                prop_assert_eq!(mask::has(&grown, cell), near);
                let face = v.face_neighbours().iter().any(|n| set.contains(n));
                prop_assert_eq!(mask::has(&beside, cell), face);
            }
            let at_face = |face: &Voxel| (0..BRICK_CELLS).any(|c| mask::has(&own, c) && brick_of(voxel_at(Voxel::new(0, 0, 0), c) + *face) == *face);
            prop_assert_eq!(at_faces(&own), FACES.map(|face| at_face(&face)));
        }
    }

    #[test]
    fn a_block_is_its_ranges() {
        let mask = block([1, 3], [-5, 1], [7, 20]);
        assert_eq!(cells(&mask).collect::<Vec<_>>(), vec![7 << 6 | 1, 7 << 6 | 2]);
        assert_eq!((count(&mask), count(&block([0, 8], [0, 8], [0, 8]))), (2, 512));
    }
}
