//! A reader's copy of the map, kept up to date with what the map publishes.

use crate::map::{MapUpdate, OccupancyGrid, UpdateError};
use crate::voxel::Voxel;

/// What came of an update.
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum Arrival {
    /// It was applied; these voxels changed.
    Applied(Vec<Voxel>),
    /// It says nothing that is not known, or the whole map is on its way.
    Old,
    /// Updates before it are missing, and nobody has asked for the whole map yet: ask for it ([`crate::keys::MAP_REQUEST`]).
    Gap,
}

/// A copy of the map.
#[derive(Debug, Clone)]
pub struct Replica {
    grid: OccupancyGrid,
    /// Whether the resolution is that of the map, and not still to be learned from it.
    resolution_known: bool,
    asked: bool,
    /// The last scan in it.
    scan: u64,
}

impl Replica {
    /// A copy of nothing yet, of a map with voxels of `resolution` (m); `None`: whatever voxels the map has.
    pub fn new(resolution: Option<f64>) -> Self {
        Self {
            grid: OccupancyGrid::new(resolution.unwrap_or(1.0)),
            resolution_known: resolution.is_some(),
            asked: false,
            scan: 0,
        }
    }

    /// The map as far as it is known.
    pub fn grid(&self) -> &OccupancyGrid {
        &self.grid
    }

    /// The whole map, for a map that was killed and asks who has a copy of `revision` or a later one
    /// ([`crate::keys::MAP_RECALL`]); `None`: this one is older.
    pub fn copy_of(&self, revision: f64) -> Option<MapUpdate> {
        (self.grid.revision() as f64 >= revision).then(|| self.grid.whole(self.scan))
    }

    /// Takes an update, or the whole map.
    ///
    /// # Errors
    /// The map has voxels of another size.
    pub fn take(&mut self, update: &MapUpdate) -> Result<Arrival, UpdateError> {
        if !self.resolution_known {
            self.grid = OccupancyGrid::new(update.resolution);
            self.resolution_known = true;
        }
        if update.revision <= self.grid.revision() {
            return Ok(Arrival::Old);
        }
        match self.grid.apply(update) {
            Ok(changed) => {
                self.asked = false;
                self.scan = update.scan;
                Ok(Arrival::Applied(changed))
            }
            Err(UpdateError::Gap { .. }) if self.asked => Ok(Arrival::Old),
            Err(UpdateError::Gap { .. }) => {
                self.asked = true;
                Ok(Arrival::Gap)
            }
            Err(error) => Err(error),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::map::State;

    #[test]
    fn a_gap_is_asked_for_once_and_mended_by_the_whole_map() {
        let mut map = OccupancyGrid::new(0.2);
        let mut replica = Replica::new(None);
        let mut publish = |x: i32| {
            map.set(Voxel::new(x, 0, 0), State::Free);
            (map.advance(&[Voxel::new(x, 0, 0)], 0), map.whole(0))
        };
        let (first, _) = publish(0);
        assert_eq!(replica.take(&first), Ok(Arrival::Applied(vec![Voxel::new(0, 0, 0)])));
        assert_eq!(replica.take(&first), Ok(Arrival::Old));
        let _lost = publish(1);
        assert_eq!(replica.take(&publish(2).0), Ok(Arrival::Gap));
        let (late, whole) = publish(3);
        assert_eq!(replica.take(&late), Ok(Arrival::Old), "the whole map was asked for already");
        assert!(matches!(replica.take(&whole), Ok(Arrival::Applied(changed)) if changed.len() == 3));
        assert!(matches!(replica.take(&publish(4).0), Ok(Arrival::Applied(_))));
        assert_eq!((replica.grid().free(), replica.grid().resolution()), (5, 0.2));
    }

    #[test]
    fn a_copy_is_the_map_itself_for_who_does_not_ask_for_a_later_one() {
        let mut map = OccupancyGrid::new(0.2);
        let mut replica = Replica::new(None);
        for x in 0..2 {
            map.set(Voxel::new(9 * x, 0, 0), State::Free);
            replica.take(&map.advance(&[Voxel::new(9 * x, 0, 0)], 7)).unwrap();
        }
        assert_eq!((replica.copy_of(1.0), replica.copy_of(2.0)), (Some(map.whole(7)), Some(map.whole(7))));
        assert_eq!(replica.copy_of(3.0), None);
    }

    #[test]
    fn voxels_of_another_size_are_refused() {
        let whole = OccupancyGrid::new(0.2).advance(&[], 0);
        assert!(matches!(Replica::new(Some(0.1)).take(&whole), Err(UpdateError::Resolution { .. })));
    }
}
