//! The frontier: free voxels with an unknown face neighbour (thesis 6.3.1.1), kept up to date as voxels change.

use std::borrow::Borrow;
use std::collections::BTreeSet;

use crate::bricks::Bricks;
use crate::map::{OccupancyGrid, State};
use crate::voxel::{Bounds, Voxel};

/// Whether `voxel` is free and has an unknown face neighbour.
pub fn is_frontier(grid: &OccupancyGrid, voxel: Voxel) -> bool {
    grid.state(voxel) == State::Free && unknown_neighbours(grid, voxel).next().is_some()
}

/// The face neighbours of `voxel` that are unknown, in the order of [`crate::voxel::FACES`].
pub fn unknown_neighbours(grid: &OccupancyGrid, voxel: Voxel) -> impl Iterator<Item = Voxel> + '_ {
    voxel.face_neighbours().into_iter().filter(|n| grid.state(*n) == State::Unknown)
}

/// All frontier voxels inside a bounded volume, in lexicographic order.
#[derive(Debug, Clone, Default)]
pub struct FrontierSet {
    voxels: BTreeSet<Voxel>,
    bounds: Option<Bounds>,
}

impl FrontierSet {
    /// No frontier yet; voxels whose unknown neighbours all lie outside `bounds` will not count.
    pub fn new(bounds: Option<Bounds>) -> Self {
        Self { voxels: BTreeSet::new(), bounds }
    }

    /// Takes note that these voxels of `grid` changed.
    pub fn update(&mut self, grid: &OccupancyGrid, changed: impl IntoIterator<Item = impl Borrow<Voxel>>) {
        // Each voxel is looked at once, however many of its neighbours changed.
        let mut touched: Bricks<bool> = Bricks::new();
        for voxel in changed {
            let voxel = *voxel.borrow();
            std::iter::once(voxel).chain(voxel.face_neighbours()).for_each(|near| *touched.get_mut(near) = true);
        }
        touched.voxels().filter(|(_, touched)| *touched).for_each(|(voxel, _)| self.revise(grid, voxel));
    }

    fn revise(&mut self, grid: &OccupancyGrid, voxel: Voxel) {
        if self.counts(grid, voxel) {
            self.voxels.insert(voxel);
        } else {
            self.voxels.remove(&voxel);
        }
    }

    fn counts(&self, grid: &OccupancyGrid, voxel: Voxel) -> bool {
        let inside = |v: Voxel| self.bounds.is_none_or(|b| b.contains(v.center(grid.resolution())));
        grid.state(voxel) == State::Free && inside(voxel) && unknown_neighbours(grid, voxel).any(inside)
    }

    /// Whether `voxel` is a frontier voxel.
    pub fn contains(&self, voxel: Voxel) -> bool {
        self.voxels.contains(&voxel)
    }

    /// The frontier voxels in lexicographic order.
    pub fn iter(&self) -> impl Iterator<Item = Voxel> + '_ {
        self.voxels.iter().copied()
    }

    /// Number of frontier voxels.
    pub fn len(&self) -> usize {
        self.voxels.len()
    }

    /// Whether no frontier is left.
    pub fn is_empty(&self) -> bool {
        self.voxels.is_empty()
    }

    /// The volume that counts.
    pub fn bounds(&self) -> Option<Bounds> {
        self.bounds
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    proptest! {
        /// Kept up to date change by change, the set is what a look at every voxel would find.
        #[test]
        fn incremental_equals_exhaustive(changes in prop::collection::vec(((0..6i32, 0..6i32, 0..6i32), 0..3u8), 1..150)) {
            let mut grid = OccupancyGrid::new(0.1);
            let mut set = FrontierSet::new(None);
            for ((x, y, z), s) in changes {
                let state = [State::Unknown, State::Free, State::Occupied][s as usize];
                let voxel = Voxel::new(x, y, z);
                if grid.set(voxel, state) {
                    set.update(&grid, [voxel]);
                }
            }
            let all: BTreeSet<Voxel> = grid.bricks().voxels().map(|(v, _)| v).filter(|v| is_frontier(&grid, *v)).collect();
            prop_assert_eq!(set.iter().collect::<BTreeSet<_>>(), all);
        }
    }

    #[test]
    fn outside_the_bounds_nothing_counts() {
        let mut grid = OccupancyGrid::new(1.0);
        let bounds = Bounds { min: [0.0; 3].into(), max: [2.0; 3].into() };
        let mut set = FrontierSet::new(Some(bounds));
        let inside = Voxel::new(1, 1, 1);
        grid.set(inside, State::Free);
        set.update(&grid, [inside]);
        assert!(set.contains(inside), "its neighbour (0, 1, 1) is unknown and inside");
        for n in [Voxel::new(0, 1, 1), Voxel::new(1, 0, 1), Voxel::new(1, 1, 0)] {
            grid.set(n, State::Occupied);
            set.update(&grid, [n]);
        }
        assert!(set.is_empty(), "what is left unknown lies outside");
    }
}
