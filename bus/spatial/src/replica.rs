//! A reader's copy of the map, kept up to date with what the map publishes.

use elk_bus::{AppError, Comms, Mail};

use crate::checks::MAX_REVISIONS_AHEAD;
use crate::keys::MAP;
use crate::map::{BrickStates, Changes, MapUpdate, OccupancyGrid, UpdateError, room_for};

/// What came of an update.
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum Arrival {
    /// It was applied, and changed this.
    Applied(Changes),
    /// It says nothing that is not known, or the whole map is on its way.
    Old,
    /// Updates before it are missing, or it is older than what is known, and nobody has asked for the whole map yet: ask for
    /// it ([`crate::keys::MAP_REQUEST`]).
    Gap,
}

/// An update that does not fit what is known.
#[derive(Debug, Clone, Copy, PartialEq, thiserror::Error)]
#[error("{why}")]
pub struct Misfit {
    /// Why.
    pub why: UpdateError,
    /// Whether to ask for the whole map now ([`crate::keys::MAP_REQUEST`]): perhaps what is known is what is wrong.
    pub ask: bool,
}

impl From<UpdateError> for Misfit {
    fn from(why: UpdateError) -> Self {
        Self { why, ask: false }
    }
}

/// A copy of the map.
///
/// Nobody can tell from an update alone whether it is the map's: anybody may write one, and whoever starts is given the last.
/// So one that contradicts what is known is not taken, and the map itself is asked; the next whole map is believed then,
/// whatever it says. If that was wrong as well, the next word of the map contradicts it.
#[derive(Debug, Clone)]
pub struct Replica {
    grid: OccupancyGrid,
    /// The resolution that was given (m); else it is learned from the map.
    given: Option<f64>,
    max_bricks: usize,
    /// Whether the whole map is on its way.
    asked: bool,
    /// Whether that is because something contradicts what is known.
    doubtful: bool,
    /// The last scan in it.
    scan: u64,
    /// What the last update continued; 0: it was the whole map.
    since: u64,
}

impl Replica {
    /// A copy of nothing yet, of a map with voxels of `resolution` (m) and at most `max_bricks` bricks; `None`: whatever
    /// voxels the map has.
    pub fn new(resolution: Option<f64>, max_bricks: usize) -> Self {
        let grid = OccupancyGrid::new(resolution.unwrap_or(1.0));
        Self { grid, given: resolution, max_bricks, asked: false, doubtful: false, scan: 0, since: 0 }
    }

    /// The map as far as it is known.
    pub fn grid(&self) -> &OccupancyGrid {
        &self.grid
    }

    /// The map as far as it is known, for who needs no more of it.
    pub fn into_grid(self) -> OccupancyGrid {
        self.grid
    }

    /// The last scan in it.
    pub fn scan(&self) -> u64 {
        self.scan
    }

    /// Whether what is known was contradicted, and the whole map has not come yet that decides.
    pub fn is_doubtful(&self) -> bool {
        self.doubtful
    }

    /// The whole map, for a map that was killed and asks who has a copy of `revision` or a later one
    /// ([`crate::keys::MAP_RECALL`]); `None`: this one is older, or of nothing.
    pub fn copy_of(&self, revision: f64) -> Option<MapUpdate> {
        let own = self.grid.revision();
        (own > 0 && own as f64 >= revision).then(|| self.grid.whole(self.scan))
    }

    /// Answers a map that was killed and asks for a copy ([`MAP_RECALL`](crate::keys::MAP_RECALL)), if there is one.
    ///
    /// # Errors
    /// What it asks is no number; or the bus failed.
    pub fn answer(&self, comms: &mut Comms, recall: &Mail<'_>) -> Result<(), AppError> {
        self.copy_of(recall.number()?).map_or(Ok(()), |copy| Ok(comms.publish(&MAP, &copy)?))
    }

    /// Takes note that the map is at `revision` for somebody else; whether to ask for the whole map, as this one is ahead.
    pub fn hear_of(&mut self, revision: u64) -> bool {
        self.grid.revision() > revision && self.doubt_own()
    }

    /// Doubts what is known; whether to ask for the whole map now.
    fn doubt_own(&mut self) -> bool {
        self.doubtful = true;
        !std::mem::replace(&mut self.asked, true)
    }

    /// Takes an update, or the whole map.
    ///
    /// # Errors
    /// It does not fit: it is of a map with other voxels, too large, or too far from what is known.
    pub fn take(&mut self, update: &MapUpdate) -> Result<Arrival, Misfit> {
        self.look_at_size(update)?;
        let (whole, have) = (update.since == 0, self.grid.revision());
        let learning = self.given.is_none() && (self.asked || have == 0);
        if update.resolution != self.given.unwrap_or(self.grid.resolution()) && !learning {
            let why = UpdateError::Resolution { have: self.grid.resolution(), update: update.resolution };
            return Err(if self.given.is_some() { why.into() } else { self.doubt(why) });
        }
        match whole {
            true if self.asked || have == 0 => self.believe(update),
            true if update.revision > have + MAX_REVISIONS_AHEAD => {
                Err(self.doubt(UpdateError::Ahead { have, update: update.revision }))
            }
            // The update that was taken, or the map that it led to.
            _ if update.revision == have && self.agrees_with(update) => Ok(Arrival::Old),
            // Said before what is known, and given late; or what is known is not the map.
            _ if update.revision <= have => Ok(if self.doubt_own() { Arrival::Gap } else { Arrival::Old }),
            true => self.believe(update),
            false if update.since == have => self.believe(update),
            // Once asked, the answer is on its way.
            false if self.asked => Ok(Arrival::Old),
            false => {
                self.asked = true;
                Ok(Arrival::Gap)
            }
        }
    }

    fn believe(&mut self, update: &MapUpdate) -> Result<Arrival, Misfit> {
        if update.resolution != self.grid.resolution() {
            self.grid = OccupancyGrid::new(update.resolution);
        }
        let changes = self.grid.apply(update)?;
        (self.scan, self.since) = (update.scan, update.since);
        if update.since == 0 {
            (self.asked, self.doubtful) = (false, false);
        }
        Ok(Arrival::Applied(changes))
    }

    /// Whether an update of the revision that is known says what is known; the whole map leads where the update before led.
    fn agrees_with(&self, update: &MapUpdate) -> bool {
        let same_step = update.since == self.since || update.since == 0 || self.since == 0;
        let known = |packed: &BrickStates| {
            let cells = self.grid.bricks().brick(packed.position());
            cells.is_some_and(|cells| BrickStates::pack(packed.position(), cells) == *packed)
        };
        same_step && update.scan == self.scan && update.bricks.iter().all(known)
    }

    fn doubt(&mut self, why: UpdateError) -> Misfit {
        Misfit { why, ask: self.doubt_own() }
    }

    fn look_at_size(&self, update: &MapUpdate) -> Result<(), UpdateError> {
        let known = self.grid.bricks();
        let bricks = match update.since {
            0 => update.bricks.len(),
            _ => known.len() + update.bricks.iter().filter(|b| known.brick(b.position()).is_none()).count(),
        };
        room_for(bricks, self.max_bricks)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::map::State;
    use crate::voxel::Voxel;

    /// A map that grows by a voxel a scan: the update, and the whole map after it.
    fn publisher(resolution: f64) -> impl FnMut() -> (MapUpdate, MapUpdate) {
        let mut map = OccupancyGrid::new(resolution);
        move || {
            let voxel = Voxel::new(map.revision() as i32, 0, 0);
            map.set(voxel, State::Free);
            (map.advance(&[voxel], 0), map.whole(0))
        }
    }

    fn applied(taken: Result<Arrival, Misfit>) -> usize {
        match taken {
            Ok(Arrival::Applied(changes)) => changes.voxels().count(),
            other => panic!("{other:?}"),
        }
    }

    #[test]
    fn a_gap_is_asked_for_once_and_mended_by_the_whole_map() {
        let mut replica = Replica::new(None, 9);
        let mut publish = publisher(0.2);
        let (first, _) = publish();
        assert_eq!(applied(replica.take(&first)), 1);
        assert_eq!(replica.take(&first), Ok(Arrival::Old));
        let _lost = publish();
        assert_eq!(replica.take(&publish().0), Ok(Arrival::Gap));
        let (late, whole) = publish();
        assert_eq!(replica.take(&late), Ok(Arrival::Old), "the whole map was asked for already");
        assert!(!replica.is_doubtful(), "a gap is no contradiction");
        assert_eq!(applied(replica.take(&whole)), 3);
        assert_eq!(applied(replica.take(&publish().0)), 1);
        assert_eq!((replica.grid().free(), replica.grid().resolution()), (5, 0.2));
    }

    #[test]
    fn a_copy_is_the_map_itself_for_who_does_not_ask_for_a_later_one() {
        let mut map = OccupancyGrid::new(0.2);
        let mut replica = Replica::new(None, 9);
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
        let misfit = Replica::new(Some(0.1), 9).take(&whole).unwrap_err();
        assert!(matches!(misfit, Misfit { why: UpdateError::Resolution { .. }, ask: false }));
    }

    /// Whoever comes first, the map or somebody who makes one up: what is known in the end is the map.
    #[test]
    fn what_contradicts_is_asked_about_and_the_map_has_the_last_word() {
        let far = MapUpdate { revision: 1_000_000, ..publisher(0.2)().1 };
        let coarse = publisher(0.5)().1;
        let ahead = MapUpdate { revision: 40, ..publisher(0.2)().1 };
        for lie in [far, coarse, ahead] {
            for before in [true, false] {
                let (mut replica, mut publish) = (Replica::new(None, 9), publisher(0.2));
                let mut whole = None;
                let mut take = |update: &MapUpdate, whole: &Option<MapUpdate>| match replica.take(update) {
                    Err(Misfit { ask: true, .. }) | Ok(Arrival::Gap) => {
                        whole.iter().for_each(|whole| drop(replica.take(whole)));
                    }
                    _ => {}
                };
                for step in 0..4 {
                    if (step == 0) == before && step < 2 {
                        take(&lie, &whole);
                    }
                    let (update, all) = publish();
                    whole = Some(all);
                    take(&update, &whole);
                }
                let known = replica.copy_of(0.0).unwrap();
                assert_eq!(Some(known), whole, "{lie:?} before: {before}");
                assert!(!replica.is_doubtful());
            }
        }
    }

    /// Regression: a liar's next revision was taken, the map's own one was old for ever.
    #[test]
    fn another_update_of_the_revision_that_is_known_is_asked_about() {
        let (mut map, voxels) =
            (OccupancyGrid::new(0.2), [Voxel::new(0, 0, 0), Voxel::new(9, 0, 0), Voxel::new(0, 9, 0)]);
        let mut publish = |voxel: Voxel, scan| {
            map.set(voxel, State::Free);
            (map.advance(&[voxel], scan), map.whole(scan))
        };
        let first = publish(voxels[0], 1).0;
        let (second, whole) = publish(voxels[1], 2);
        let third = publish(voxels[2], 3).0;
        let lies = [
            MapUpdate { scan: 1, ..second.clone() },
            MapUpdate { scan: 1, ..whole.clone() },
            MapUpdate { bricks: first.bricks.clone(), ..second.clone() },
        ];
        for lie in lies {
            let mut replica = Replica::new(None, 9);
            [&first, &lie].into_iter().for_each(|update| drop(replica.take(update).unwrap()));
            assert_eq!(replica.take(&lie), Ok(Arrival::Old), "the same again");
            assert_eq!(replica.take(&second), Ok(Arrival::Gap));
            assert_eq!(replica.take(&second), Ok(Arrival::Old), "asked once");
            assert!(replica.is_doubtful() && matches!(replica.take(&whole), Ok(Arrival::Applied(_))));
            assert_eq!((replica.copy_of(2.0), replica.scan()), (Some(whole.clone()), 2));
            for old in [&second, &whole] {
                assert_eq!(replica.take(old), Ok(Arrival::Old));
            }
            assert_eq!(applied(replica.take(&third)), 1);
        }
    }

    #[test]
    fn a_copy_that_is_ahead_of_others_is_doubted_once() {
        let (mut replica, (_, whole)) = (Replica::new(None, 9), publisher(0.2)());
        replica.take(&MapUpdate { revision: 7, ..whole.clone() }).unwrap();
        assert!(!replica.hear_of(7) && replica.hear_of(1) && !replica.hear_of(1) && replica.is_doubtful());
        replica.take(&whole).unwrap();
        assert_eq!((replica.grid().revision(), replica.is_doubtful()), (1, false));
    }

    #[test]
    fn no_more_bricks_are_kept_than_were_agreed() {
        let mut map = OccupancyGrid::new(0.2);
        let mut replica = Replica::new(None, 2);
        let mut grow = |x: i32| {
            map.set(Voxel::new(8 * x, 0, 0), State::Free);
            map.advance(&[Voxel::new(8 * x, 0, 0)], 0)
        };
        let updates = [0, 1, 1, 2].map(&mut grow);
        updates[..3].iter().for_each(|update| drop(replica.take(update).unwrap()));
        let too_many = UpdateError::TooMany { bricks: 3, most: 2 };
        assert_eq!(replica.take(&updates[3]), Err(too_many.into()));
        assert_eq!(replica.take(&map.whole(0)), Err(too_many.into()));
        assert_eq!(replica.grid().bricks().len(), 2);
    }
}
