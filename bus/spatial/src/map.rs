//! The three-valued map as it travels and as readers keep it: free, occupied, or unknown.

use serde::{Deserialize, Serialize};

use crate::bricks::{BRICK_CELLS, Bricks, brick_of, voxel_at};
use crate::voxel::Voxel;

/// What is known of a voxel (thesis 6.3.1).
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize)]
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
    fn from_bits(bits: u8) -> Self {
        match bits & 3 {
            1 => State::Free,
            2 => State::Occupied,
            _ => State::Unknown,
        }
    }
}

/// The states of a brick's 512 cells, two bits each: cell `i` stands in bits `2(i mod 4)` of byte `i / 4`.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
pub struct BrickStates {
    /// The brick's position, in bricks.
    pub brick: [i16; 3],
    /// 128 bytes.
    pub states: Vec<u8>,
}

impl BrickStates {
    /// Packs a brick.
    pub fn pack(brick: Voxel, cells: &[State; BRICK_CELLS]) -> Self {
        let states = cells.chunks_exact(4).map(|c| c.iter().rev().fold(0, |byte, &s| byte << 2 | s as u8)).collect();
        Self { brick: brick.to_array().map(|c| c as i16), states }
    }

    /// The brick's position.
    pub fn position(&self) -> Voxel {
        self.brick.map(i32::from).into()
    }

    /// The state of cell `cell`; unknown where the bytes are too few.
    pub fn state(&self, cell: usize) -> State {
        State::from_bits(self.states.get(cell / 4).map_or(0, |b| b >> (2 * (cell % 4))))
    }
}

elk_bus::payload! {
    /// What changed in a map from one revision to another: the bricks in which anything changed, whole.
    /// `since == 0` makes it the whole map.
    #[derive(Debug, Clone, PartialEq)]
    pub struct MapUpdate {
        /// The revision that the bricks belong to; grows by one a scan.
        pub revision: u64,
        /// The revision that a reader must have for this update to apply to; 0: any, the update is the whole map.
        pub since: u64,
        /// The scan that caused it (see [`crate::Scan::id`]).
        pub scan: u64,
        /// Edge of a voxel (m).
        pub resolution: f64,
        /// The bricks in which something changed.
        pub bricks: Vec<BrickStates>,
    }
}

/// Why an update could not be applied.
#[derive(Debug, Clone, Copy, PartialEq, thiserror::Error)]
pub enum UpdateError {
    /// A revision is missing: ask for the whole map.
    #[error("the map is at revision {have}, the update continues from {since}: ask for the whole map (MAP_REQUEST)")]
    Gap {
        /// The reader's revision.
        have: u64,
        /// The revision that the update continues from.
        since: u64,
    },
    /// The update is of a map with other voxels.
    #[error("the map has voxels of {have} m, the update of {update} m: do the Map's and the reader's Res differ?")]
    Resolution {
        /// The reader's resolution (m).
        have: f64,
        /// The update's resolution (m).
        update: f64,
    },
}

/// A reader's copy of the map: the states of all voxels, and how many there are of each.
#[derive(Debug, Clone)]
pub struct OccupancyGrid {
    states: Bricks<State>,
    resolution: f64,
    revision: u64,
    counts: [usize; 3],
}

impl OccupancyGrid {
    /// An unknown world with voxels of `resolution` (m), at revision 0.
    pub fn new(resolution: f64) -> Self {
        Self { states: Bricks::new(), resolution, revision: 0, counts: [0; 3] }
    }

    /// Edge of a voxel (m).
    pub fn resolution(&self) -> f64 {
        self.resolution
    }

    /// The revision of the last update applied.
    pub fn revision(&self) -> u64 {
        self.revision
    }

    /// The state of a voxel.
    pub fn state(&self, voxel: Voxel) -> State {
        self.states.get(voxel)
    }

    /// The states by brick, for walks that stay near.
    pub fn bricks(&self) -> &Bricks<State> {
        &self.states
    }

    /// Number of free voxels.
    pub fn free(&self) -> usize {
        self.counts[State::Free as usize]
    }

    /// Number of occupied voxels.
    pub fn occupied(&self) -> usize {
        self.counts[State::Occupied as usize]
    }

    /// Sets one voxel; answers whether that changed it.
    pub fn set(&mut self, voxel: Voxel, state: State) -> bool {
        if state == State::Unknown && self.states.brick(brick_of(voxel)).is_none() {
            return false;
        }
        let cell = self.states.get_mut(voxel);
        let before = std::mem::replace(cell, state);
        if before != state && before != State::Unknown {
            self.counts[before as usize] -= 1;
        }
        if before != state && state != State::Unknown {
            self.counts[state as usize] += 1;
        }
        before != state
    }

    /// Applies an update and answers the voxels that changed, in the update's order.
    pub fn apply(&mut self, update: &MapUpdate) -> Result<Vec<Voxel>, UpdateError> {
        if update.resolution != self.resolution {
            return Err(UpdateError::Resolution { have: self.resolution, update: update.resolution });
        }
        if update.since != 0 && update.since != self.revision {
            return Err(UpdateError::Gap { have: self.revision, since: update.since });
        }
        let mut changed = Vec::new();
        if update.since == 0 {
            self.forget_what_is_not_in(update, &mut changed);
        }
        for packed in &update.bricks {
            let brick = packed.position();
            for cell in 0..BRICK_CELLS {
                let voxel = voxel_at(brick, cell);
                if self.set(voxel, packed.state(cell)) {
                    changed.push(voxel);
                }
            }
        }
        self.revision = update.revision;
        Ok(changed)
    }

    fn forget_what_is_not_in(&mut self, update: &MapUpdate, changed: &mut Vec<Voxel>) {
        let kept: std::collections::BTreeSet<Voxel> = update.bricks.iter().map(BrickStates::position).collect();
        let known: Vec<Voxel> = self.states.voxels().filter(|(_, s)| *s != State::Unknown).map(|(v, _)| v).collect();
        for voxel in known.into_iter().filter(|v| !kept.contains(&brick_of(*v))) {
            self.set(voxel, State::Unknown);
            changed.push(voxel);
        }
    }

    /// The whole map as an update that any reader can apply.
    pub fn whole(&self, scan: u64) -> MapUpdate {
        let bricks = self.states.iter().map(|(b, cells)| BrickStates::pack(b, cells)).collect();
        MapUpdate { revision: self.revision, since: 0, scan, resolution: self.resolution, bricks }
    }

    /// Advances to the next revision and answers what changed: the bricks that hold `changed` voxels.
    pub fn advance(&mut self, changed: &[Voxel], scan: u64) -> MapUpdate {
        let touched: std::collections::BTreeSet<Voxel> = changed.iter().map(|v| brick_of(*v)).collect();
        let bricks = touched.into_iter().filter_map(|b| Some(BrickStates::pack(b, self.states.brick(b)?))).collect();
        // The first update is the whole map: there is no revision 0 to continue from.
        let since = self.revision;
        self.revision += 1;
        MapUpdate { revision: self.revision, since, scan, resolution: self.resolution, bricks }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_update_carries_a_change_to_a_reader() {
        let mut map = OccupancyGrid::new(0.1);
        let mut reader = OccupancyGrid::new(0.1);
        let cells = [(Voxel::new(0, 0, 0), State::Free), (Voxel::new(-1, 9, 3), State::Occupied)];
        for (scan, &(voxel, state)) in cells.iter().enumerate() {
            assert!(map.set(voxel, state) && !map.set(voxel, state));
            let update = map.advance(&[voxel], scan as u64);
            assert_eq!(reader.apply(&update).unwrap(), vec![voxel]);
            assert_eq!(reader.state(voxel), state);
        }
        assert_eq!((reader.free(), reader.occupied(), reader.revision()), (1, 1, 2));
    }

    #[test]
    fn a_gap_is_refused_and_mended_by_the_whole_map() {
        let mut map = OccupancyGrid::new(0.1);
        let mut late = OccupancyGrid::new(0.1);
        late.set(Voxel::new(500, 0, 0), State::Free);
        let mut last = None;
        for i in 0..3 {
            map.set(Voxel::new(i, 0, 0), State::Free);
            last = Some(map.advance(&[Voxel::new(i, 0, 0)], 0));
        }
        assert_eq!(late.apply(&last.unwrap()), Err(UpdateError::Gap { have: 0, since: 2 }));
        assert_eq!(late.apply(&map.whole(0)).unwrap().len(), 4, "three new ones, and one that the map never saw");
        assert_eq!((late.free(), late.revision()), (3, 3));
    }
}
