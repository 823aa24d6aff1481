//! What is known of a voxel, and of the voxels of a brick, packed: free, occupied, or unknown.

use elk_describe::{Describe, Invalid, Shape};
use serde::{Deserialize, Serialize};

use crate::bricks::{BRICK, BRICK_CELLS};
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

    fn from_bits(bits: u8) -> Self {
        match bits & 3 {
            1 => State::Free,
            2 => State::Occupied,
            _ => State::Unknown,
        }
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
    pub fn pack(brick: Voxel, cells: &[State; BRICK_CELLS]) -> Self {
        let packed = cells.chunks_exact(4).map(|c| c.iter().rev().fold(0, |byte, &s| byte << 2 | s as u8)).collect();
        Self { brick: brick.to_array().map(|c| c as i16), cells: packed }
    }

    /// The brick's position.
    pub fn position(&self) -> Voxel {
        self.brick.map(i32::from).into()
    }

    /// The states of all cells.
    pub fn unpack(&self) -> [State; BRICK_CELLS] {
        std::array::from_fn(|cell| self.state(cell))
    }

    /// The state of cell `cell`; unknown where the bytes are too few.
    pub fn state(&self, cell: usize) -> State {
        State::from_bits(self.cells.get(cell / 4).map_or(0, |b| b >> (2 * (cell % 4))))
    }
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
    use crate::bricks::cell_of;

    #[test]
    fn a_brick_is_unpacked_as_it_was_packed() {
        let mut states = [State::Unknown; BRICK_CELLS];
        states[cell_of(Voxel::new(1, 2, 3))] = State::Occupied;
        states[cell_of(Voxel::new(7, 7, 7))] = State::Free;
        assert_eq!(BrickStates::pack(Voxel::new(-1, 0, 1), &states).unpack(), states);
    }
}
