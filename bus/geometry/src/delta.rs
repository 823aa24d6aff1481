//! What changed in a grid: as it goes to whoever keeps a copy, and as the copy says it when it has taken it.

use std::borrow::Cow;
use std::collections::BTreeSet;

use crate::bricks::voxel_at;
use crate::mask::{self, Mask};
use crate::state::BrickStates;
use crate::states::States;
use crate::voxel::Voxel;

/// What changed in a grid from one revision to another: the bricks in which anything changed, whole, and those that have got another
/// number ([`OccupancyGrid::packed`](crate::OccupancyGrid::packed)). `since == 0` makes it the whole grid.
#[derive(Debug, Clone, PartialEq)]
pub struct Delta<'a> {
    /// The revision that the bricks belong to.
    pub revision: u64,
    /// The revision that a copy must have for this to apply to; 0: any, it is the whole grid.
    pub since: u64,
    /// Edge of a voxel (m).
    pub resolution: f64,
    /// The bricks in which something changed.
    pub bricks: Cow<'a, [BrickStates]>,
}

/// Why a delta cannot be applied.
#[derive(Debug, Clone, Copy, PartialEq, thiserror::Error)]
pub enum DeltaError {
    /// A revision is missing.
    #[error("the grid is at revision {have}, the delta continues from {since}: apply the whole grid first")]
    Gap {
        /// The grid's revision.
        have: u64,
        /// The revision that the delta continues from.
        since: u64,
    },
    /// The delta is of a grid with other voxels.
    #[error("the grid has voxels of {have} m, the delta of {delta} m: only grids of one resolution are kept in step")]
    Resolution {
        /// The grid's resolution (m).
        have: f64,
        /// The delta's resolution (m).
        delta: f64,
    },
}

/// The voxels that a delta changed, brick by brick: a bit each, however many they are.
#[derive(Debug, Clone, PartialEq, Eq, Default)]
pub struct Changes(Vec<(Voxel, Mask)>);

impl Changes {
    /// Adds the cells of a brick, unless there are none.
    pub fn add(&mut self, (brick, cells): (Voxel, Mask)) {
        if cells != mask::NONE {
            self.0.push((brick, cells));
        }
    }

    /// Adds all that was known `before` in bricks that are not among these.
    pub(crate) fn add_what_is_not_in(&mut self, bricks: &[BrickStates], before: &States) {
        let kept: BTreeSet<Voxel> = bricks.iter().map(BrickStates::position).collect();
        for (brick, cells) in before.iter().filter(|(brick, _)| !kept.contains(brick)) {
            self.add((brick, *cells.known()));
        }
    }

    /// The bricks in which anything changed, in order, and the cells that did.
    pub fn bricks(&self) -> &[(Voxel, Mask)] {
        &self.0
    }

    /// Number of voxels.
    pub fn len(&self) -> usize {
        self.0.iter().map(|(_, cells)| mask::count(cells)).sum()
    }

    /// Whether nothing changed.
    pub fn is_empty(&self) -> bool {
        self.0.is_empty()
    }

    /// The voxels, in order.
    pub fn voxels(&self) -> impl Iterator<Item = Voxel> + '_ {
        self.0.iter().flat_map(|(brick, cells)| mask::cells(cells).map(|cell| voxel_at(*brick, cell)))
    }
}
