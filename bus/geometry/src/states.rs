//! The states of many voxels, sparse: two bits each, in bricks of 8×8×8 cells that are found through a hash of their position.

use crate::bricks::{BRICK_CELLS, BrickIndex, brick_of, cell_of, push, swap_remove, voxel_at};
use crate::state::{Cells, State};
use crate::voxel::Voxel;

/// The states of voxels; those never written are unknown. Bricks are kept in the order in which they were first written, and in the
/// place of one that is given back stands the last one, so that every walk over them is the same on every run.
#[derive(Debug, Clone, Default)]
pub struct States {
    index: BrickIndex,
    bricks: Vec<(Voxel, Cells)>,
}

impl States {
    /// The state of a voxel.
    pub fn get(&self, voxel: Voxel) -> State {
        self.brick(brick_of(voxel)).map_or(State::Unknown, |cells| cells.state(cell_of(voxel)))
    }

    /// The cells of the brick at `brick` (in bricks), if any of them was ever written.
    pub fn brick(&self, brick: Voxel) -> Option<&Cells> {
        self.index.find(brick, |i| self.bricks[i].0).map(|i| &self.bricks[i].1)
    }

    /// The cells of the brick at `brick`, for writing; comes into being if it was not there.
    pub(crate) fn brick_mut(&mut self, brick: Voxel) -> &mut Cells {
        let next = self.bricks.len();
        let found = self.index.find(brick, |i| self.bricks[i].0);
        if found.is_none() {
            push(&mut self.bricks, (brick, Cells::UNKNOWN));
            self.index.insert(next, |i| self.bricks[i].0);
        }
        &mut self.bricks[found.unwrap_or(next)].1
    }

    /// Gives a brick back: its cells are unknown. Answers the brick that stands in its place now, if another one does.
    pub(crate) fn remove(&mut self, brick: Voxel) -> Option<Voxel> {
        let place = self.index.find(brick, |i| self.bricks[i].0)?;
        self.index.swap_remove(place, self.bricks.len() - 1, |i| self.bricks[i].0);
        swap_remove(&mut self.bricks, place);
        self.bricks.get(place).map(|(moved, _)| *moved)
    }

    /// All bricks with their cells, in their order.
    pub fn iter(&self) -> impl Iterator<Item = (Voxel, &Cells)> {
        self.iter_from(0)
    }

    /// The same without the first so many; none if there are fewer.
    pub fn iter_from(&self, first: usize) -> impl Iterator<Item = (Voxel, &Cells)> {
        self.bricks.get(first..).unwrap_or_default().iter().map(|(brick, cells)| (*brick, cells))
    }

    /// All voxels of all bricks, in the order of [`States::iter`].
    pub fn voxels(&self) -> impl Iterator<Item = (Voxel, State)> {
        let of = |(brick, cells): (Voxel, &Cells)| {
            let cells = *cells;
            (0..BRICK_CELLS).map(move |cell| (voxel_at(brick, cell), cells.state(cell)))
        };
        self.iter().flat_map(of)
    }

    /// Number of bricks.
    pub fn len(&self) -> usize {
        self.bricks.len()
    }

    /// Whether nothing was ever written.
    pub fn is_empty(&self) -> bool {
        self.bricks.is_empty()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::mask;
    use proptest::prelude::*;

    proptest! {
        #[test]
        fn what_was_written_is_read(writes in prop::collection::vec((prop::array::uniform3(-9..9i32), 0..3usize, 0..4), 0..200)) {
            let (mut states, mut model) = (States::default(), std::collections::BTreeMap::new());
            for (voxel, state, gone) in writes {
                let (voxel, state) = (Voxel::from(voxel), [State::Unknown, State::Free, State::Occupied][state]);
                states.brick_mut(brick_of(voxel)).set(cell_of(voxel), state);
                model.insert(voxel, state);
                if gone == 0 {
                    states.remove(brick_of(voxel));
                    model.retain(|other, _| brick_of(*other) != brick_of(voxel));
                }
            }
            prop_assert!(model.iter().all(|(voxel, state)| states.get(*voxel) == *state));
            let bricks: std::collections::BTreeSet<Voxel> = model.keys().map(|voxel| brick_of(*voxel)).collect();
            prop_assert_eq!((states.iter().map(|(brick, _)| brick).collect(), states.len()), (bricks.clone(), bricks.len()));
            let all = states.voxels().filter(|(_, state)| *state != State::Unknown).count();
            prop_assert_eq!(all, model.values().filter(|state| **state != State::Unknown).count());
            for (_, cells) in states.iter() {
                let of = |state| (0..BRICK_CELLS).filter(move |cell| cells.state(*cell) == state);
                prop_assert!(of(State::Free).eq(mask::cells(&cells.free())));
                prop_assert!(of(State::Occupied).eq(mask::cells(cells.occupied())));
                prop_assert_eq!(Cells::new(cells.known(), cells.occupied()), *cells);
                prop_assert!(mask::cells(&cells.differing(&Cells::UNKNOWN)).eq(mask::cells(cells.known())));
            }
        }
    }
}
