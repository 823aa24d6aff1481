//! The whole map, said in parts between the scans: how far that is.

use elk_geometry::OccupancyGrid;
use elk_spatial::keyframe::{MapPart, Round};

/// Bricks of a part: packing and publishing them takes less than a scan of a mission does.
const PART_BRICKS: usize = 2048;

/// The map's rounds through its bricks, one for all who ask.
#[derive(Debug, Default)]
pub struct Keyframes {
    /// The number of the first brick of the next part.
    next: u64,
    /// The present round; none: nobody waits for one.
    round: Option<Round>,
}

impl Keyframes {
    /// Somebody asks: from here on, all is to be said once more.
    pub fn ask(&mut self) {
        self.round = Some(Round::from(self.next));
    }

    /// The next part, if there is more to say; `scan` is the last one in the map.
    pub fn part(&mut self, grid: &OccupancyGrid, scan: u64) -> Option<MapPart> {
        let round = self.round.as_mut()?;
        let part = MapPart::of(grid, scan, round.next() as usize, PART_BRICKS);
        let over = round.take(&part);
        self.next = round.next();
        if over {
            self.round = None;
        }
        Some(part)
    }
}
