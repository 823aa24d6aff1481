//! Sets of cells of a brick, a bit a cell.
//!
//! A brick's 512 cells are eight layers of 64: cell `z·64 + y·8 + x` (see [`cell_of`](crate::bricks::cell_of)) is bit
//! `y·8 + x` of word `z`.

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
pub fn set(mask: &mut Mask, cell: usize) {
    mask[cell >> 6] |= 1 << (cell & 63);
}

/// Whether a cell is in a set.
pub fn has(mask: &Mask, cell: usize) -> bool {
    mask[cell >> 6] >> (cell & 63) & 1 == 1
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_is_put_into_a_set_is_in_it() {
        let put = [0, 63, 64, 200, 511];
        let mut mask = NONE;
        put.iter().for_each(|cell| set(&mut mask, *cell));
        assert!(cells(&mask).eq(put) && count(&mask) == put.len());
        assert!((0..512).all(|cell| has(&mask, cell) == put.contains(&cell)));
        assert_eq!(count(&ALL), 512);
    }
}
