//! The map as pages draw it: bricks of states, and which of their voxels are frontier.

use std::collections::BTreeSet;

use elk_geometry::delta::Changes;
use elk_geometry::frontier::FrontierSet;
use elk_geometry::mask::{self, Mask};
use elk_geometry::{OccupancyGrid, Voxel};
use elk_spatial::checks::MAX_BRICKS;
use elk_spatial::keyframe::MapPart;
use elk_spatial::map::{MapUpdate, UpdateError};
use elk_spatial::replica::Replica;

use crate::journal::Journal;

/// Planes of a brick in a frame of bricks.
const KNOWN: u8 = 1;
const OCCUPIED: u8 = 2;
const FRONTIER: u8 = 4;
/// The first byte of such a frame.
const BRICKS: u8 = 1;
/// Bytes before its bricks.
const HEAD: usize = 12;
/// The longest brick (bytes): position, planes, and three planes of 512 bits.
const LONGEST_BRICK: usize = 8 + 3 * 64;

/// A copy of the map.
#[derive(Clone)]
pub struct World {
    replica: Replica,
    frontier: FrontierSet,
    /// Bricks in the order in which they last changed.
    changed: Journal<Voxel, ()>,
}

impl World {
    /// A copy of nothing yet.
    pub fn new() -> Self {
        Self { replica: Replica::new(None, MAX_BRICKS), frontier: FrontierSet::new(None), changed: Journal::default() }
    }

    /// The map as far as it is known.
    pub fn grid(&self) -> &OccupancyGrid {
        self.replica.grid()
    }

    /// Frontier voxels.
    pub fn frontier(&self) -> usize {
        self.frontier.len()
    }

    /// Whether the map is to be asked for all it knows; see [`Replica::take_question`].
    pub fn take_question(&mut self) -> bool {
        self.replica.take_question()
    }

    /// Takes an update, or the whole map.
    ///
    /// # Errors
    /// It does not fit what is known.
    pub fn take(&mut self, update: &MapUpdate) -> Result<(), UpdateError> {
        let changes = self.replica.take(update)?;
        self.note(&changes.unwrap_or_default());
        Ok(())
    }

    /// Takes a part of the whole map.
    ///
    /// # Errors
    /// It does not fit what is known.
    pub fn take_part(&mut self, part: &MapPart) -> Result<(), UpdateError> {
        let changes = self.replica.take_part(part)?;
        self.note(&changes.unwrap_or_default());
        Ok(())
    }

    fn note(&mut self, changes: &Changes) {
        // What became known beside a brick may take frontier from it.
        let beside: BTreeSet<Voxel> = changes.bricks().iter().flat_map(|(brick, _)| neighbours(*brick)).collect();
        let before: Vec<(Voxel, Mask)> = beside.iter().map(|brick| (*brick, *self.frontier.brick(*brick))).collect();
        self.frontier.update(self.replica.grid(), changes.voxels());
        for (brick, _) in changes.bricks() {
            self.changed.put(*brick, ());
        }
        for (brick, frontier) in before {
            if *self.frontier.brick(brick) != frontier {
                self.changed.put(brick, ());
            }
        }
    }

    /// A frame with the bricks that changed after `seen`, the oldest first, of at most `most` bytes; `None`: there are none.
    /// The reader has seen them then.
    pub fn frame(&self, seen: &mut u64, most: usize) -> Option<Vec<u8>> {
        let room = (most.saturating_sub(HEAD) / LONGEST_BRICK).max(1);
        let mut frame = vec![BRICKS, 0, 0, 0];
        frame.extend((self.grid().resolution() as f32).to_le_bytes());
        let mut count = 0u32;
        frame.extend(count.to_le_bytes());
        for (number, brick, ()) in self.changed.since(*seen).take(room) {
            self.put_brick(*brick, &mut frame);
            count += 1;
            *seen = number;
        }
        frame[8..HEAD].copy_from_slice(&count.to_le_bytes());
        (count > 0).then_some(frame)
    }

    fn put_brick(&self, brick: Voxel, frame: &mut Vec<u8>) {
        // A map's bricks have indices of 16 bits.
        [brick.x, brick.y, brick.z].iter().for_each(|index| frame.extend((*index as i16).to_le_bytes()));
        let cells = self.grid().bricks().brick(brick);
        let none = (&mask::NONE, &mask::NONE);
        let (known, occupied) = cells.map_or(none, |cells| (cells.known(), cells.occupied()));
        let planes = [(KNOWN, known), (OCCUPIED, occupied), (FRONTIER, self.frontier.brick(brick))];
        let there = || planes.iter().filter(|(_, plane)| **plane != mask::NONE);
        frame.extend([there().map(|(bit, _)| bit).sum(), 0]);
        there().for_each(|(_, plane)| put_plane(plane, frame));
    }
}

impl Default for World {
    fn default() -> Self {
        Self::new()
    }
}

fn put_plane(plane: &Mask, frame: &mut Vec<u8>) {
    plane.iter().for_each(|layer| frame.extend(layer.to_le_bytes()));
}

fn neighbours(brick: Voxel) -> [Voxel; 6] {
    let Voxel { x, y, z } = brick;
    [(-1, 0, 0), (1, 0, 0), (0, -1, 0), (0, 1, 0), (0, 0, -1), (0, 0, 1)]
        .map(|(dx, dy, dz)| Voxel::new(x + dx, y + dy, z + dz))
}

#[cfg(test)]
mod tests {
    use std::collections::BTreeMap;

    use elk_geometry::State;
    use elk_geometry::bricks::{brick_of, cell_of, voxel_at};
    use proptest::prelude::*;

    use super::*;

    /// What a page makes of frames: planes by brick.
    fn read(frame: &[u8], page: &mut BTreeMap<Voxel, [Vec<u8>; 3]>) {
        let count = u32::from_le_bytes(frame[8..HEAD].try_into().unwrap());
        let mut at = HEAD;
        for _ in 0..count {
            let index = |i: usize| i32::from(i16::from_le_bytes([frame[at + 2 * i], frame[at + 2 * i + 1]]));
            let (brick, planes) = (Voxel::new(index(0), index(1), index(2)), frame[at + 6]);
            at += 8;
            let mut plane = |bit: u8| {
                let there = planes & bit != 0;
                let bytes = if there { frame[at..at + 64].to_vec() } else { vec![0; 64] };
                at += if there { 64 } else { 0 };
                bytes
            };
            page.insert(brick, [KNOWN, OCCUPIED, FRONTIER].map(&mut plane));
        }
        assert_eq!(at, frame.len());
    }

    proptest! {
        /// A page that takes frames of any size at any time has the map and its frontier in the end.
        #[test]
        fn a_page_has_the_map_and_its_frontier(
            scans in prop::collection::vec((prop::collection::vec((-9i32..20, -9i32..20, 0i32..9, 0u8..3), 1..60), any::<bool>()), 1..20),
            most in 1usize..3_000,
        ) {
            let (mut grid, mut world) = (OccupancyGrid::new(0.1), World::new());
            let (mut page, mut seen) = (BTreeMap::new(), 0);
            for (number, (voxels, looks)) in (1..).zip(scans) {
                let states = [State::Unknown, State::Free, State::Occupied];
                let mut changed = Vec::new();
                for (x, y, z, state) in voxels {
                    let voxel = Voxel::new(x, y, z);
                    if grid.set(voxel, states[usize::from(state)]) {
                        changed.push(voxel);
                    }
                }
                let delta = grid.advance(&changed);
                world.take(&MapUpdate::new(delta, number)).unwrap();
                if looks && let Some(frame) = world.frame(&mut seen, most) {
                    read(&frame, &mut page);
                }
            }
            while let Some(frame) = world.frame(&mut seen, most) {
                read(&frame, &mut page);
            }
            for (brick, planes) in &page {
                for cell in 0..512 {
                    let voxel = voxel_at(*brick, cell);
                    let has = |plane: usize| planes[plane][cell / 8] >> (cell % 8) & 1 == 1;
                    let state = grid.state(voxel);
                    prop_assert_eq!(has(0), state != State::Unknown);
                    prop_assert_eq!(has(1), state == State::Occupied);
                    prop_assert_eq!(has(2), elk_geometry::frontier::is_frontier(&grid, voxel));
                }
            }
            for (voxel, state) in grid.bricks().voxels() {
                prop_assert!(state == State::Unknown || page.contains_key(&brick_of(voxel)), "{} {}", voxel.x, cell_of(voxel));
            }
        }
    }
}
