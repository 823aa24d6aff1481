//! The three-valued grid: what is known of every voxel, in numbered revisions, so that others can keep copies of it.

use std::borrow::Cow;
use std::collections::BTreeSet;

use crate::bricks::{brick_of, cell_of};
use crate::delta::{Changes, Delta, DeltaError};
use crate::mask::{self, Mask};
use crate::state::{BrickStates, Cells, State};
use crate::states::States;
use crate::voxel::Voxel;

/// The states of all voxels, and how many there are of each.
#[derive(Debug, Clone)]
pub struct OccupancyGrid {
    states: States,
    resolution: f64,
    revision: u64,
    counts: [usize; 3],
    /// Bricks that stand elsewhere in their order since the last revision.
    moved: BTreeSet<Voxel>,
}

impl OccupancyGrid {
    /// An unknown world with voxels of `resolution` (m), at revision 0.
    pub fn new(resolution: f64) -> Self {
        Self { states: States::default(), resolution, revision: 0, counts: [0; 3], moved: BTreeSet::new() }
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
    pub fn bricks(&self) -> &States {
        &self.states
    }

    /// The free cells of a brick (in bricks).
    pub fn free_cells(&self, brick: Voxel) -> Mask {
        self.states.brick(brick).map_or(mask::NONE, Cells::free)
    }

    /// Whether anything is known of the brick that a voxel lies in, or of one beside it.
    pub fn knows_near(&self, voxel: Voxel) -> bool {
        let own = brick_of(voxel);
        std::iter::once(own).chain(own.neighbours()).any(|brick| self.states.brick(brick).is_some())
    }

    /// Whether a brick is as these states say.
    pub fn knows(&self, packed: &BrickStates) -> bool {
        packed.unpack() == self.states.brick(packed.position()).copied().unwrap_or_default()
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
        let mut cells = self.states.brick(brick_of(voxel)).copied().unwrap_or_default();
        cells.set(cell_of(voxel), state);
        self.replace(brick_of(voxel), &cells) != mask::NONE
    }

    /// Sets cells of a brick: to occupied where `occupied` has them, else to free where `known` has them, else to unknown.
    pub fn set_cells(&mut self, brick: Voxel, cells: &Mask, known: &Mask, occupied: &Mask) {
        let own = self.states.brick(brick).copied().unwrap_or_default();
        let put = |own: &Mask, new: &Mask| std::array::from_fn(|z| own[z] & !cells[z] | new[z] & cells[z]);
        self.replace(brick, &Cells::new(&put(own.known(), known), &put(own.occupied(), occupied)));
    }

    /// Gives a brick other cells; answers those that were not as they are now. Of which nothing is known there is no brick.
    fn replace(&mut self, brick: Voxel, new: &Cells) -> Mask {
        let before = match *new == Cells::UNKNOWN {
            true => self.give_back(brick),
            false => std::mem::replace(self.states.brick_mut(brick), *new),
        };
        for (state, of) in
            [(State::Free, [before.free(), new.free()]), (State::Occupied, [before, *new].map(|c| *c.occupied()))]
        {
            let [before, now] = of.map(|cells| mask::count(&cells));
            self.counts[state as usize] = self.counts[state as usize] + now - before;
        }
        before.differing(new)
    }

    /// Forgets a brick; answers what its cells were.
    fn give_back(&mut self, brick: Voxel) -> Cells {
        let before = self.states.brick(brick).copied().unwrap_or_default();
        self.moved.extend(self.states.remove(brick));
        self.moved.remove(&brick);
        before
    }

    /// Applies what changed in another grid, of which this is a copy; answers what that changed here, in the delta's order.
    ///
    /// # Errors
    /// It is of a grid with other voxels, or does not continue from this revision.
    pub fn apply(&mut self, delta: &Delta<'_>) -> Result<Changes, DeltaError> {
        if delta.resolution != self.resolution {
            return Err(DeltaError::Resolution { have: self.resolution, delta: delta.resolution });
        }
        if delta.since != 0 && delta.since != self.revision {
            return Err(DeltaError::Gap { have: self.revision, since: delta.since });
        }
        let mut changes = Changes::default();
        if delta.since == 0 {
            // Anew, so that nothing piles up of maps that replace each other.
            let before = std::mem::take(&mut self.states);
            self.counts = [0; 3];
            changes.add_what_is_not_in(&delta.bricks, &before);
            delta.bricks.iter().for_each(|packed| changes.add(self.write(packed, Some(&before))));
        } else {
            delta.bricks.iter().for_each(|packed| changes.add(self.write(packed, None)));
        }
        self.revision = delta.revision;
        self.moved.clear();
        Ok(changes)
    }

    /// Writes a brick; answers the cells that are other than they were, `before` or until now.
    fn write(&mut self, packed: &BrickStates, before: Option<&States>) -> (Voxel, Mask) {
        let (position, new) = (packed.position(), packed.unpack());
        let before = before.unwrap_or(&self.states).brick(position).copied().unwrap_or_default();
        self.replace(position, &new);
        (position, before.differing(&new))
    }

    /// Calls itself `revision`, because somebody may have a copy that is called so, and needs the next one whole.
    pub fn skip_to(&mut self, revision: u64) {
        self.revision = revision;
    }

    /// The whole grid, as any copy can apply it.
    pub fn whole(&self) -> Delta<'static> {
        let bricks = self.packed(0, self.states.len());
        Delta { revision: self.revision, since: 0, resolution: self.resolution, bricks: Cow::Owned(bricks) }
    }

    /// At most so many of its bricks, from the one that so many others come before, in the order of [`States::iter`]. The number
    /// of a brick changes only if it takes the place of one that is given back, and the next delta has it then.
    pub fn packed(&self, first: usize, most: usize) -> Vec<BrickStates> {
        self.states.iter_from(first).take(most).map(|(b, cells)| BrickStates::pack(b, cells)).collect()
    }

    /// Advances to the next revision and answers what changed: the bricks that hold `changed` voxels.
    pub fn advance(&mut self, changed: &[Voxel]) -> Delta<'static> {
        let touched: BTreeSet<Voxel> = changed.iter().map(|v| brick_of(*v)).collect();
        self.advance_bricks(touched)
    }

    /// The same, of the bricks in which anything changed, in this order; those that have got another number follow.
    pub fn advance_bricks(&mut self, changed: impl IntoIterator<Item = Voxel>) -> Delta<'static> {
        let mut moved = std::mem::take(&mut self.moved);
        let mut changed: Vec<Voxel> = changed.into_iter().collect();
        for brick in &changed {
            moved.remove(brick);
        }
        changed.extend(moved);
        let pack = |brick| BrickStates::pack(brick, self.states.brick(brick).unwrap_or(&Cells::UNKNOWN));
        let bricks = changed.into_iter().map(pack).collect();
        // The first delta is the whole grid: there is no revision 0 to continue from.
        let since = self.revision;
        self.revision += 1;
        Delta { revision: self.revision, since, resolution: self.resolution, bricks: Cow::Owned(bricks) }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;
    use std::collections::BTreeMap;

    /// Some cells of some bricks, and what they are to be.
    fn cells() -> impl Strategy<Value = Vec<(Voxel, State)>> {
        let state = prop_oneof![Just(State::Unknown), Just(State::Free), Just(State::Occupied)];
        // Few in a brick, so that some bricks come to hold none.
        let voxel = prop::array::uniform3(-2..2i32).prop_map(|v| Voxel::from(v.map(|c| 5 * c)));
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
            reader.apply(&map.advance(&changed)).unwrap();
            let before = reader.clone();
            let changed = set_all(&mut map, &then);
            let update = map.advance(&changed);
            let update = if whole { map.whole() } else { update };
            let said: BTreeSet<Voxel> = reader.apply(&update).unwrap().voxels().collect();
            let differs = |voxel: &Voxel| before.state(*voxel) != map.state(*voxel);
            let all = then.iter().map(|(voxel, _)| *voxel);
            prop_assert_eq!(said, all.filter(differs).collect());
            prop_assert!(map.bricks().voxels().all(|(voxel, state)| reader.state(voxel) == state));
            let known = |grid: &OccupancyGrid| grid.bricks().iter().map(|(brick, cells)| (brick, *cells)).collect::<BTreeMap<_, _>>();
            prop_assert_eq!(known(&reader), known(&map));
            prop_assert!(map.bricks().iter().all(|(_, cells)| *cells != Cells::UNKNOWN), "what is not known takes no brick");
            prop_assert_eq!((reader.free(), reader.occupied()), (map.free(), map.occupied()));
        }
    }

    #[test]
    fn a_delta_carries_a_change_to_a_copy() {
        let mut map = OccupancyGrid::new(0.1);
        let mut reader = OccupancyGrid::new(0.1);
        let cells = [(Voxel::new(0, 0, 0), State::Free), (Voxel::new(-1, 9, 3), State::Occupied)];
        for (voxel, state) in cells {
            assert!(map.set(voxel, state) && !map.set(voxel, state));
            let update = map.advance(&[voxel]);
            assert!(reader.apply(&update).unwrap().voxels().eq([voxel]));
            assert_eq!(reader.state(voxel), state);
        }
        assert_eq!((reader.free(), reader.occupied(), reader.revision()), (1, 1, 2));
    }

    #[test]
    fn a_brick_that_is_given_back_is_said_and_the_one_in_its_place_again() {
        let mut map = OccupancyGrid::new(0.1);
        let voxels = [0, 8, 16].map(|x| Voxel::new(x, 0, 0));
        assert!(voxels.iter().all(|voxel| map.set(*voxel, State::Free)));
        map.advance(&voxels);
        map.set(voxels[0], State::Unknown);
        let said = map.advance(&voxels[..1]);
        assert_eq!(said.bricks.iter().map(BrickStates::position).collect::<Vec<_>>(), [voxels[0], brick_of(voxels[2])]);
        assert_eq!((said.bricks[0].unpack(), map.bricks().len()), (Cells::UNKNOWN, 2));
        let order: Vec<Voxel> = map.bricks().iter().map(|(brick, _)| brick).collect();
        assert_eq!(order, [brick_of(voxels[2]), brick_of(voxels[1])]);
        assert_eq!(map.advance(&[]).bricks.len(), 0, "once");
    }

    #[test]
    fn a_gap_is_refused_and_mended_by_the_whole_map() {
        let mut map = OccupancyGrid::new(0.1);
        let mut late = OccupancyGrid::new(0.1);
        late.set(Voxel::new(500, 0, 0), State::Free);
        let mut last = None;
        for i in 0..3 {
            map.set(Voxel::new(i, 0, 0), State::Free);
            last = Some(map.advance(&[Voxel::new(i, 0, 0)]));
        }
        assert_eq!(late.apply(&last.unwrap()), Err(DeltaError::Gap { have: 0, since: 2 }));
        let changed: Vec<Voxel> = late.apply(&map.whole()).unwrap().voxels().collect();
        let lost = Voxel::new(500, 0, 0);
        assert_eq!(changed, [lost, Voxel::new(0, 0, 0), Voxel::new(1, 0, 0), Voxel::new(2, 0, 0)]);
        assert_eq!(
            (late.free(), late.revision(), late.bricks().len()),
            (3, 3, 1),
            "nothing is kept of what it never saw"
        );
    }
}
