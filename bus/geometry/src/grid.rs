//! The three-valued map as it travels and as readers keep it: free, occupied, or unknown.

use elk_bus::describe::Shape;
use elk_bus::payload;

use crate::bricks::{BRICK_CELLS, Bricks, brick_of, voxel_at};
use crate::checks::{self, MAX_REVISIONS_AHEAD};
use crate::mask::{self, Mask};
use crate::voxel::Voxel;

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
#[payload]
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct BrickStates {
    /// The brick's position, in bricks.
    #[describe(check = checks::brick)]
    pub brick: [i16; 3],
    /// `?` for unknown, `.` for free, `#` for occupied, x fastest; 128 bytes.
    #[describe(shape = State::PACKED, any, check = checks::cells)]
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

/// What changed in a map from one revision to another: the bricks in which anything changed, whole.
/// `since == 0` makes it the whole map.
#[payload]
#[describe(check = checks::map_update, drawn = "voxels")]
#[derive(Debug, Clone, PartialEq)]
pub struct MapUpdate {
    /// The revision that the bricks belong to; grows by one a scan.
    #[describe(count)]
    pub revision: u64,
    /// The revision that a reader must have for this update to apply to; 0: any, the update is the whole map.
    #[describe(count)]
    pub since: u64,
    /// The scan that caused it (see [`crate::Scan::id`]).
    #[describe(count)]
    pub scan: u64,
    /// Edge of a voxel (m).
    #[describe(unit = "m", range = checks::RESOLUTIONS_M)]
    pub resolution: f64,
    /// The bricks in which something changed.
    #[describe(longest = checks::MAX_BRICKS)]
    pub bricks: Vec<BrickStates>,
}
/// The voxels that an update changed, brick by brick: a bit each, however many they are.
#[derive(Debug, Clone, PartialEq, Eq, Default)]
pub struct Changes(Vec<(Voxel, Mask)>);

impl Changes {
    fn add(&mut self, (brick, cells): (Voxel, Mask)) {
        if cells != mask::NONE {
            self.0.push((brick, cells));
        }
    }

    /// All that was known `before` in bricks that the update does not have.
    fn add_what_is_not_in(&mut self, update: &MapUpdate, before: &Bricks<State>) {
        let kept: std::collections::BTreeSet<Voxel> = update.bricks.iter().map(BrickStates::position).collect();
        for (brick, states) in before.iter().filter(|(brick, _)| !kept.contains(brick)) {
            let mut cells = mask::NONE;
            let known = (0..BRICK_CELLS).filter(|cell| states[*cell] != State::Unknown);
            known.for_each(|cell| mask::set(&mut cells, cell));
            self.add((brick, cells));
        }
    }

    /// The voxels, in order.
    pub fn voxels(&self) -> impl Iterator<Item = Voxel> + '_ {
        self.0.iter().flat_map(|(brick, cells)| mask::cells(cells).map(|cell| voxel_at(*brick, cell)))
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
    /// A map that is far ahead of what was heard of it.
    #[error(
        "its revision {update} is more than {} above {have}: not believed without asking for the whole map",
        MAX_REVISIONS_AHEAD
    )]
    Ahead {
        /// The reader's revision, or what it knows that the map's cannot be far from.
        have: u64,
        /// The update's revision.
        update: u64,
    },
    /// More bricks than a reader keeps.
    #[error("with its bricks there would be {bricks} of them; at most {most} are kept (MaxBricks)")]
    TooMany {
        /// Bricks with those of the update.
        bricks: usize,
        /// The most that are kept.
        most: usize,
    },
}

/// Whether so many bricks are no more than are kept.
///
/// # Errors
/// They are more ([`UpdateError::TooMany`]).
pub fn room_for(bricks: usize, most: usize) -> Result<(), UpdateError> {
    if bricks > most { Err(UpdateError::TooMany { bricks, most }) } else { Ok(()) }
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

    /// Whether anything is known of the brick that a voxel lies in, or of one beside it.
    pub fn knows_near(&self, voxel: Voxel) -> bool {
        let own = brick_of(voxel);
        std::iter::once(own).chain(own.neighbours()).any(|brick| self.states.brick(brick).is_some())
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

    /// Applies an update and answers what changed, in the update's order.
    ///
    /// # Errors
    /// It is of a map with other voxels, or does not continue from this revision.
    pub fn apply(&mut self, update: &MapUpdate) -> Result<Changes, UpdateError> {
        if update.resolution != self.resolution {
            return Err(UpdateError::Resolution { have: self.resolution, update: update.resolution });
        }
        if update.since != 0 && update.since != self.revision {
            return Err(UpdateError::Gap { have: self.revision, since: update.since });
        }
        let mut changes = Changes::default();
        if update.since == 0 {
            // Anew, so that nothing piles up of maps that replace each other.
            let before = std::mem::take(&mut self.states);
            self.counts = [0; 3];
            changes.add_what_is_not_in(update, &before);
            update.bricks.iter().for_each(|packed| changes.add(self.write(packed, Some(&before))));
        } else {
            update.bricks.iter().for_each(|packed| changes.add(self.write(packed, None)));
        }
        self.revision = update.revision;
        Ok(changes)
    }

    /// Writes a brick; answers the cells that are other than they were, `before` or until now.
    fn write(&mut self, packed: &BrickStates, before: Option<&Bricks<State>>) -> (Voxel, Mask) {
        let (position, new) = (packed.position(), packed.unpack());
        let own = self.states.brick(position);
        let old = own.copied().unwrap_or([State::Unknown; BRICK_CELLS]);
        if own.is_some() || new != old {
            *self.states.brick_mut(position) = new;
        }
        for state in [State::Free, State::Occupied] {
            let number = |cells: &[State]| cells.iter().filter(|s| **s == state).count();
            self.counts[state as usize] += number(&new);
            self.counts[state as usize] -= number(&old);
        }
        let before = before.map_or(old, |b| b.brick(position).copied().unwrap_or([State::Unknown; BRICK_CELLS]));
        let mut cells = mask::NONE;
        let changed = (0..BRICK_CELLS).filter(|cell| before[*cell] != new[*cell]);
        changed.for_each(|cell| mask::set(&mut cells, cell));
        (position, cells)
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
    use crate::bricks::cell_of;
    use proptest::prelude::*;

    /// Some cells of some bricks, and what they are to be.
    fn cells() -> impl Strategy<Value = Vec<(Voxel, State)>> {
        let state = prop_oneof![Just(State::Unknown), Just(State::Free), Just(State::Occupied)];
        let voxel = prop::array::uniform3(-9..9i32).prop_map(Voxel::from);
        prop::collection::vec((voxel, state), 0..60)
    }

    fn set_all(grid: &mut OccupancyGrid, cells: &[(Voxel, State)]) -> Vec<Voxel> {
        cells.iter().filter(|(voxel, state)| grid.set(*voxel, *state)).map(|(voxel, _)| *voxel).collect()
    }

    proptest! {
        /// Brick by brick or voxel by voxel, it is the same map, and the same has changed.
        #[test]
        fn what_is_written_brick_by_brick_is_what_was_set(first in cells(), then in cells(), whole in any::<bool>()) {
            let mut map = OccupancyGrid::new(0.1);
            let changed = set_all(&mut map, &first);
            let mut reader = OccupancyGrid::new(0.1);
            reader.apply(&map.advance(&changed, 1)).unwrap();
            let before = reader.clone();
            let changed = set_all(&mut map, &then);
            let update = map.advance(&changed, 2);
            let update = if whole { map.whole(2) } else { update };
            let said: std::collections::BTreeSet<Voxel> = reader.apply(&update).unwrap().voxels().collect();
            let differs = |voxel: &Voxel| before.state(*voxel) != map.state(*voxel);
            let all = then.iter().map(|(voxel, _)| *voxel);
            prop_assert_eq!(said, all.filter(differs).collect());
            prop_assert!(map.bricks().voxels().all(|(voxel, state)| reader.state(voxel) == state));
            prop_assert_eq!((reader.free(), reader.occupied()), (map.free(), map.occupied()));
        }
    }

    #[test]
    fn a_brick_is_unpacked_as_it_was_packed() {
        let mut states = [State::Unknown; BRICK_CELLS];
        states[cell_of(Voxel::new(1, 2, 3))] = State::Occupied;
        states[cell_of(Voxel::new(7, 7, 7))] = State::Free;
        assert_eq!(BrickStates::pack(Voxel::new(-1, 0, 1), &states).unpack(), states);
    }

    #[test]
    fn an_update_carries_a_change_to_a_reader() {
        let mut map = OccupancyGrid::new(0.1);
        let mut reader = OccupancyGrid::new(0.1);
        let cells = [(Voxel::new(0, 0, 0), State::Free), (Voxel::new(-1, 9, 3), State::Occupied)];
        for (scan, &(voxel, state)) in cells.iter().enumerate() {
            assert!(map.set(voxel, state) && !map.set(voxel, state));
            let update = map.advance(&[voxel], scan as u64);
            assert!(reader.apply(&update).unwrap().voxels().eq([voxel]));
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
        let changed: Vec<Voxel> = late.apply(&map.whole(0)).unwrap().voxels().collect();
        let lost = Voxel::new(500, 0, 0);
        assert_eq!(changed, [lost, Voxel::new(0, 0, 0), Voxel::new(1, 0, 0), Voxel::new(2, 0, 0)]);
        assert_eq!(
            (late.free(), late.revision(), late.bricks().len()),
            (3, 3, 1),
            "nothing is kept of what it never saw"
        );
    }
}
