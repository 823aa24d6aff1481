//! The three-valued map as it travels.

use std::borrow::Cow;

use elk_bus::payload;
use elk_geometry::delta::{Delta, DeltaError};
use elk_geometry::limits::RESOLUTIONS_M;
use elk_geometry::state::BrickStates;

use crate::checks::{self, MAX_REVISIONS_AHEAD};

/// What changed in a map from one revision to another: the bricks in which anything changed, whole.
/// `since == 0` makes it the whole map.
#[payload]
#[describe(check = check, drawn = "voxels")]
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
    #[describe(unit = "m", range = RESOLUTIONS_M)]
    pub resolution: f64,
    /// The bricks in which something changed.
    #[describe(longest = checks::MAX_BRICKS)]
    pub bricks: Vec<BrickStates>,
}

impl MapUpdate {
    /// What changed in a grid, because of this scan.
    pub fn new(delta: Delta<'_>, scan: u64) -> Self {
        let Delta { revision, since, resolution, bricks } = delta;
        Self { revision, since, scan, resolution, bricks: bricks.into_owned() }
    }

    /// What it says of the grid.
    pub fn delta(&self) -> Delta<'_> {
        let Self { revision, since, scan: _, resolution, ref bricks } = *self;
        Delta { revision, since, resolution, bricks: Cow::Borrowed(bricks) }
    }
}

/// An update goes forward.
fn check(update: &MapUpdate) -> checks::Checked {
    checks::holds("since", update.since <= update.revision, update.since, "no later than the revision")
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

impl From<DeltaError> for UpdateError {
    fn from(error: DeltaError) -> Self {
        match error {
            DeltaError::Gap { have, since } => Self::Gap { have, since },
            DeltaError::Resolution { have, delta } => Self::Resolution { have, update: delta },
        }
    }
}
