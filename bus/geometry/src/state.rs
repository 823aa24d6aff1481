//! What is known of a voxel, and of the voxels of a brick, packed: free, occupied, or unknown.

use elk_describe::{Describe, Invalid, Shape};
use serde::{Deserialize, Serialize};

use crate::bricks::{BRICK, BRICK_CELLS};
use crate::mask::{self, Mask};
use crate::voxel::{INDEX_RANGE, Voxel};

/// What is known of a voxel (thesis 6.3.1).
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
#[repr(u8)]
pub enum State {
    /// Never observed.
    #[default]
    Unknown = 0,
    /// Observed and empty.
    Free = 1,
    /// Observed and blocked.
    Occupied = 2,
}

impl State {
    /// States in two bits each, and the letters that people read for them; there is no fourth state.
    const PACKED: Shape = Shape::Symbols(2, "?.#?", BRICK_CELLS);
}

/// The states of a brick's cells.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct Cells {
    known: Mask,
    occupied: Mask,
}

impl Cells {
    /// Of a brick of which nothing is known.
    pub const UNKNOWN: Self = Self { known: mask::NONE, occupied: mask::NONE };

    /// Occupied where `occupied` has them, else free where `known` has them, else unknown.
    pub fn new(known: &Mask, occupied: &Mask) -> Self {
        Self { known: std::array::from_fn(|z| known[z] | occupied[z]), occupied: *occupied }
    }

    /// The state of a cell.
    pub fn state(&self, cell: usize) -> State {
        match (mask::has(&self.occupied, cell), mask::has(&self.known, cell)) {
            (true, _) => State::Occupied,
            (false, true) => State::Free,
            (false, false) => State::Unknown,
        }
    }

    /// Sets the state of a cell.
    pub fn set(&mut self, cell: usize, state: State) {
        let (layer, bit) = (cell >> 6, 1 << (cell & 63));
        let put = |word: u64, is_in: bool| word & !bit | if is_in { bit } else { 0 };
        self.known[layer] = put(self.known[layer], state != State::Unknown);
        self.occupied[layer] = put(self.occupied[layer], state == State::Occupied);
    }

    /// The cells of which anything is known.
    pub fn known(&self) -> &Mask {
        &self.known
    }

    /// The occupied cells.
    pub fn occupied(&self) -> &Mask {
        &self.occupied
    }

    /// The free cells.
    pub fn free(&self) -> Mask {
        std::array::from_fn(|z| self.known[z] & !self.occupied[z])
    }

    /// The cells that are other than those of another brick.
    pub fn differing(&self, other: &Self) -> Mask {
        std::array::from_fn(|z| (self.known[z] ^ other.known[z]) | (self.occupied[z] ^ other.occupied[z]))
    }

    /// The states of all cells, one after the other.
    pub fn unpack(&self) -> [State; BRICK_CELLS] {
        std::array::from_fn(|cell| self.state(cell))
    }
}

/// The states of a brick's 512 cells, two bits each: cell `i` stands in bits `2(i mod 4)` of byte `i / 4`.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize, Describe)]
pub struct BrickStates {
    /// The brick's position, in bricks.
    #[describe(check = check_brick)]
    pub brick: [i16; 3],
    /// `?` for unknown, `.` for free, `#` for occupied, x fastest; 128 bytes.
    #[describe(shape = State::PACKED, any, check = check_cells)]
    pub cells: Vec<u8>,
}

impl BrickStates {
    /// Bytes of a brick's states.
    pub const BYTES: usize = BRICK_CELLS / 4;

    /// Packs a brick.
    pub fn pack(brick: Voxel, cells: &Cells) -> Self {
        let mut packed = Vec::with_capacity(Self::BYTES);
        for (free, occupied) in cells.free().iter().zip(cells.occupied()) {
            for half in [0, 32] {
                let pairs = spread(free >> half) | spread(occupied >> half) << 1;
                packed.extend(pairs.to_le_bytes());
            }
        }
        Self { brick: brick.to_array().map(|c| c as i16), cells: packed }
    }

    /// The brick's position.
    pub fn position(&self) -> Voxel {
        self.brick.map(i32::from).into()
    }

    /// Whether nothing is known of any cell.
    pub fn is_unknown(&self) -> bool {
        self.unpack() == Cells::UNKNOWN
    }

    /// The states of all cells; unknown where the bytes are too few, or say free and occupied at once.
    pub fn unpack(&self) -> Cells {
        let (mut free, mut occupied) = (mask::NONE, mask::NONE);
        for (half, bytes) in self.cells.as_chunks().0.iter().take(2 * free.len()).enumerate() {
            let pairs = u64::from_le_bytes(*bytes);
            let (is_free, is_occupied) = (gather(pairs), gather(pairs >> 1));
            let (layer, shift) = (half / 2, half % 2 * 32);
            free[layer] |= (is_free & !is_occupied) << shift;
            occupied[layer] |= (is_occupied & !is_free) << shift;
        }
        Cells::new(&free, &occupied)
    }
}

/// The lower 32 bits, each moved to the place of twice its own number; with 0 between them.
fn spread(bits: u64) -> u64 {
    let spread = |bits: u64, by: u32, kept: u64| (bits | bits << by) & kept;
    let bits = spread(bits & 0xffff_ffff, 16, 0x0000_ffff_0000_ffff);
    let bits = spread(spread(bits, 8, 0x00ff_00ff_00ff_00ff), 4, 0x0f0f_0f0f_0f0f_0f0f);
    spread(spread(bits, 2, 0x3333_3333_3333_3333), 1, 0x5555_5555_5555_5555)
}

/// The bits at even places, moved together: the inverse of [`spread`].
fn gather(bits: u64) -> u64 {
    let gather = |bits: u64, by: u32, kept: u64| (bits | bits >> by) & kept;
    let bits = gather(bits & 0x5555_5555_5555_5555, 1, 0x3333_3333_3333_3333);
    let bits = gather(gather(bits, 2, 0x0f0f_0f0f_0f0f_0f0f), 4, 0x00ff_00ff_00ff_00ff);
    gather(gather(bits, 8, 0x0000_ffff_0000_ffff), 16, 0xffff_ffff)
}

/// Whether a map has a place for a brick at this position (in bricks).
///
/// # Errors
/// The first index that lies outside.
pub fn check_brick(brick: &[i16; 3]) -> Result<(), Invalid> {
    let range = INDEX_RANGE.start() / BRICK..=INDEX_RANGE.end() / BRICK;
    let outside = brick.iter().find(|c| !range.contains(&i32::from(**c)));
    outside.map_or(Ok(()), |c| Err(Invalid::new("", c, "-4096 to 4095")))
}

/// Whether these are the cells of a brick.
fn check_cells(packed: &[u8]) -> Result<(), Invalid> {
    match packed.len() {
        BrickStates::BYTES => Ok(()),
        other => Err(Invalid::new("", format!("{other} bytes long"), "128 bytes")),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    proptest! {
        /// Cell by cell the bytes say what the brick is, and say it again.
        #[test]
        fn a_brick_is_unpacked_as_it_was_packed(states in prop::collection::vec(0..3u8, BRICK_CELLS)) {
            let mut cells = Cells::UNKNOWN;
            for (cell, state) in states.iter().enumerate() {
                cells.set(cell, [State::Unknown, State::Free, State::Occupied][usize::from(*state)]);
            }
            let packed = BrickStates::pack(Voxel::new(-1, 0, 1), &cells);
            let bytes = states.chunks(4).map(|four| four.iter().rev().fold(0, |byte, state| byte << 2 | state));
            prop_assert_eq!(&packed.cells, &bytes.collect::<Vec<u8>>());
            prop_assert_eq!(packed.unpack(), cells);
        }
    }

    #[test]
    fn bytes_that_are_no_states_are_unknown() {
        let of = |cells: Vec<u8>| BrickStates { brick: [0; 3], cells }.unpack();
        assert_eq!([of(vec![0xff; 128]), of(vec![0x55; 7]), of(vec![])], [Cells::UNKNOWN; 3]);
        assert_eq!(of(vec![0x55; 300]), Cells::new(&mask::ALL, &mask::NONE));
    }
}
