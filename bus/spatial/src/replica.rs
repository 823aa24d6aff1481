//! A reader's copy of the map, kept up to date with what the map publishes.

use std::collections::BTreeMap;

use elk_bus::{AppError, Comms};
use elk_geometry::delta::Changes;
use elk_geometry::state::BrickStates;
use elk_geometry::{OccupancyGrid, Voxel};

use crate::checks::MAX_REVISIONS_AHEAD;
use crate::keyframe::{Keyframe, MapPart, Step};
use crate::keys::MAP;
use crate::map::{MapUpdate, UpdateError};

/// So many updates in a row without a part of the whole map that was asked for: the last part was lost.
const MOST_BETWEEN_PARTS: u32 = 16;

/// A copy of the map.
///
/// Nobody can tell from an update alone whether it is the map's: anybody may write one, and whoever starts is given the last.
/// So one that contradicts what is known is not taken, and the map itself is asked; the next whole map is believed then,
/// whatever it says. If that was wrong as well, the next word of the map contradicts it.
///
/// The answer comes in parts (see [`crate::keyframe`]), beside the updates; what is known stays what it was until it is whole.
/// A part or an update that does not continue what has come begins it anew, and the map is asked again.
#[derive(Debug, Clone)]
pub struct Replica {
    grid: OccupancyGrid,
    /// The resolution that was given (m); else it is learned from the map.
    given: Option<f64>,
    max_bricks: usize,
    /// Whether the whole map is on its way.
    asked: bool,
    /// What has come of it.
    coming: Option<Keyframe>,
    /// Updates since its last part.
    between_parts: u32,
    /// Whether that is still to be asked for.
    question: bool,
    /// Whether that is because something contradicts what is known.
    doubtful: bool,
    /// The last scan in it.
    scan: u64,
    /// What the last update continued; 0: it was the whole map.
    since: u64,
    /// Bricks of the last update.
    said: usize,
}

impl Replica {
    /// A copy of nothing yet, of a map with voxels of `resolution` (m) and at most `max_bricks` bricks; `None`: whatever
    /// voxels the map has.
    pub fn new(resolution: Option<f64>, max_bricks: usize) -> Self {
        let grid = OccupancyGrid::new(resolution.unwrap_or(1.0));
        Self {
            grid,
            given: resolution,
            max_bricks,
            asked: false,
            coming: None,
            between_parts: 0,
            question: false,
            doubtful: false,
            scan: 0,
            since: 0,
            said: 0,
        }
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
        (own > 0 && own as f64 >= revision).then(|| MapUpdate::new(self.grid.whole(), self.scan))
    }

    /// Answers a map that was killed and asks for a copy of `revision` ([`MAP_RECALL`](crate::keys::MAP_RECALL)), if there is
    /// one.
    ///
    /// # Errors
    /// The bus failed.
    pub fn answer(&self, comms: &mut Comms, revision: f64) -> Result<(), AppError> {
        self.copy_of(revision).map_or(Ok(()), |copy| Ok(comms.publish(&MAP, &copy)?))
    }

    /// Takes note that the map is at `revision` for somebody else; this one may be ahead.
    pub fn hear_of(&mut self, revision: u64) {
        if self.grid.revision() > revision {
            self.doubt();
        }
    }

    /// Whether the whole map is to be asked for now ([`crate::keys::MAP_REQUEST`]); look after each update and each word of a
    /// revision. It is said once: the answer is on its way then; and again if that does not come through.
    pub fn take_question(&mut self) -> bool {
        std::mem::take(&mut self.question)
    }

    fn ask(&mut self) {
        self.question |= !std::mem::replace(&mut self.asked, true);
    }

    /// Asks although the answer may be on its way: what came of it is of no use.
    fn ask_again(&mut self) {
        self.coming = None;
        (self.asked, self.question) = (true, true);
    }

    fn doubt(&mut self) {
        self.doubtful = true;
        self.ask();
    }

    /// Takes an update, or the whole map; what it changed. `None`: it says nothing that is not known, updates before it are
    /// missing, or the whole map is on its way.
    ///
    /// # Errors
    /// It does not fit: it is of a map with other voxels, too large, or too far from what is known.
    pub fn take(&mut self, update: &MapUpdate) -> Result<Option<Changes>, UpdateError> {
        self.look_at_size(update)?;
        self.look_at_resolution(update.resolution)?;
        self.follow(update);
        let (whole, have) = (update.since == 0, self.grid.revision());
        match whole {
            true if self.asked || have == 0 => self.believe(update),
            true if update.revision > have + MAX_REVISIONS_AHEAD => {
                self.doubt();
                Err(UpdateError::Ahead { have, update: update.revision })
            }
            // The update that was taken, or the map that it led to.
            _ if update.revision == have && self.agrees_with(update) => Ok(None),
            // Said before what is known, and given late; or what is known is not the map.
            _ if update.revision <= have => {
                self.doubt();
                Ok(None)
            }
            true => self.believe(update),
            false if update.since == have => self.believe(update),
            false => {
                self.ask();
                Ok(None)
            }
        }
    }

    /// Takes a part of the whole map; what it changed, if it was the last one. `None`: it says nothing that is not known, or
    /// others are to come.
    ///
    /// # Errors
    /// It does not fit: it is of a map with other voxels, too large, or too far from what is known.
    pub fn take_part(&mut self, part: &MapPart) -> Result<Option<Changes>, UpdateError> {
        self.look_at_number(part.total as usize)?;
        self.look_at_resolution(part.resolution)?;
        let have = self.grid.revision();
        if !self.asked && have > 0 {
            match part.revision {
                far if far > have + MAX_REVISIONS_AHEAD => {
                    self.doubt();
                    return Err(UpdateError::Ahead { have, update: far });
                }
                // An answer to others.
                same if same == have && part.scan == self.scan && self.knows(&part.bricks) => return Ok(None),
                ahead if ahead > have => self.ask(),
                // Said before what is known, and given late; or what is known is not the map.
                _ => {
                    self.doubt();
                    return Ok(None);
                }
            }
        }
        self.between_parts = 0;
        match self.continue_with(part) {
            Step::Taken => Ok(None),
            Step::Whole(map) => {
                (self.asked, self.coming) = (true, None);
                self.take(&map)
            }
            Step::Apart => {
                self.ask_again();
                // Any part may be the first.
                self.continue_with(part);
                Ok(None)
            }
        }
    }

    fn continue_with(&mut self, part: &MapPart) -> Step {
        let resolution = self.coming.as_ref().map(Keyframe::resolution);
        if resolution.is_some_and(|coming| coming != part.resolution) {
            return Step::Apart;
        }
        self.coming.get_or_insert_with(|| Keyframe::new(part.resolution)).take(part)
    }

    /// Has what comes of the whole map follow an update.
    fn follow(&mut self, update: &MapUpdate) {
        if update.since == 0 {
            return;
        }
        self.between_parts += u32::from(self.asked);
        if self.between_parts >= MOST_BETWEEN_PARTS {
            (self.between_parts, self.question) = (0, true);
        }
        let most = self.max_bricks;
        let apart = |coming: &mut Keyframe| coming.follow(update) == Step::Apart || coming.len() > most;
        if self.coming.as_mut().is_some_and(apart) {
            self.ask_again();
        }
    }

    fn believe(&mut self, update: &MapUpdate) -> Result<Option<Changes>, UpdateError> {
        if update.resolution != self.grid.resolution() {
            self.grid = OccupancyGrid::new(update.resolution);
        }
        let changes = self.grid.apply(&update.delta())?;
        (self.scan, self.since, self.said) = (update.scan, update.since, update.bricks.len());
        if update.since == 0 {
            (self.asked, self.question, self.doubtful) = (false, false, false);
            (self.coming, self.between_parts) = (None, 0);
        }
        Ok(Some(changes))
    }

    /// Whether an update of the revision that is known says what is known; the whole map leads where the update before led.
    fn agrees_with(&self, update: &MapUpdate) -> bool {
        let same_step = match update.since == self.since {
            true => update.bricks.len() == self.said,
            false => update.since == 0 || self.since == 0,
        };
        same_step && update.scan == self.scan && self.knows(&update.bricks)
    }

    /// Whether these bricks are known to be so.
    fn knows(&self, bricks: &[BrickStates]) -> bool {
        bricks.iter().all(|brick| self.grid.knows(brick))
    }

    fn look_at_size(&self, update: &MapUpdate) -> Result<(), UpdateError> {
        let known = self.grid.bricks();
        let before = if update.since == 0 { 0 } else { known.len() };
        if before + update.bricks.len() <= self.max_bricks {
            return Ok(());
        }
        // Some may be known already, or are given back; of one that is said twice the last word counts.
        let said: BTreeMap<Voxel, bool> = update.bricks.iter().map(|b| (b.position(), b.is_unknown())).collect();
        let is_old = |brick: Voxel| update.since > 0 && known.brick(brick).is_some();
        let count = |wanted: (bool, bool)| {
            said.iter().filter(|(brick, unknown)| (is_old(**brick), **unknown) == wanted).count()
        };
        self.look_at_number(before + count((false, false)) - count((true, true)))
    }

    fn look_at_number(&self, bricks: usize) -> Result<(), UpdateError> {
        match self.max_bricks {
            most if bricks > most => Err(UpdateError::TooMany { bricks, most }),
            _ => Ok(()),
        }
    }

    /// Whether these are the voxels of the map that is known; they are learned with a whole map that was asked for, if none
    /// were given.
    fn look_at_resolution(&mut self, resolution: f64) -> Result<(), UpdateError> {
        let learning = self.given.is_none() && (self.asked || self.grid.revision() == 0);
        if resolution == self.given.unwrap_or(self.grid.resolution()) || learning {
            return Ok(());
        }
        let why = UpdateError::Resolution { have: self.grid.resolution(), update: resolution };
        if self.given.is_none() {
            self.doubt();
        }
        Err(why)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use elk_geometry::State;

    /// A map that grows by a voxel a scan: the update, and the whole map after it.
    fn publisher(resolution: f64) -> impl FnMut() -> (MapUpdate, MapUpdate) {
        let mut map = OccupancyGrid::new(resolution);
        move || {
            let voxel = Voxel::new(map.revision() as i32, 0, 0);
            map.set(voxel, State::Free);
            (MapUpdate::new(map.advance(&[voxel]), 0), MapUpdate::new(map.whole(), 0))
        }
    }

    fn applied(taken: Result<Option<Changes>, UpdateError>) -> usize {
        match taken {
            Ok(Some(changes)) => changes.voxels().count(),
            other => panic!("{other:?}"),
        }
    }

    #[test]
    fn a_gap_is_asked_for_once_and_mended_by_the_whole_map() {
        let mut replica = Replica::new(None, 9);
        let mut publish = publisher(0.2);
        let (first, _) = publish();
        assert_eq!(applied(replica.take(&first)), 1);
        assert_eq!((replica.take(&first), replica.take_question()), (Ok(None), false));
        let _lost = publish();
        assert_eq!((replica.take(&publish().0), replica.take_question()), (Ok(None), true));
        let (late, whole) = publish();
        assert_eq!(
            (replica.take(&late), replica.take_question()),
            (Ok(None), false),
            "the whole map was asked for already"
        );
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
            replica.take(&MapUpdate::new(map.advance(&[Voxel::new(9 * x, 0, 0)]), 7)).unwrap();
        }
        assert_eq!(
            (replica.copy_of(1.0), replica.copy_of(2.0)),
            (Some(MapUpdate::new(map.whole(), 7)), Some(MapUpdate::new(map.whole(), 7)))
        );
        assert_eq!(replica.copy_of(3.0), None);
    }

    #[test]
    fn voxels_of_another_size_are_refused() {
        let whole = MapUpdate::new(OccupancyGrid::new(0.2).advance(&[]), 0);
        let misfit = Replica::new(Some(0.1), 9).take(&whole).unwrap_err();
        assert!(matches!(misfit, UpdateError::Resolution { .. }));
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
                let mut take = |update: &MapUpdate, whole: &Option<MapUpdate>| {
                    let _ = replica.take(update);
                    if replica.take_question() {
                        whole.iter().for_each(|whole| drop(replica.take(whole)));
                    }
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
            (MapUpdate::new(map.advance(&[voxel]), scan), MapUpdate::new(map.whole(), scan))
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
            assert_eq!((replica.take(&lie), replica.take_question()), (Ok(None), false), "the same again");
            assert_eq!((replica.take(&second), replica.take_question()), (Ok(None), true));
            assert_eq!((replica.take(&second), replica.take_question()), (Ok(None), false), "asked once");
            assert!(replica.is_doubtful() && matches!(replica.take(&whole), Ok(Some(_))));
            assert_eq!((replica.copy_of(2.0), replica.scan()), (Some(whole.clone()), 2));
            for old in [&second, &whole] {
                assert_eq!((replica.take(old), replica.take_question()), (Ok(None), false));
            }
            assert_eq!(applied(replica.take(&third)), 1);
        }
    }

    #[test]
    fn a_copy_that_is_ahead_of_others_is_doubted_once() {
        let (mut replica, (_, whole)) = (Replica::new(None, 9), publisher(0.2)());
        replica.take(&MapUpdate { revision: 7, ..whole.clone() }).unwrap();
        let asks = [7, 1, 1].map(|revision| {
            replica.hear_of(revision);
            replica.take_question()
        });
        assert!(asks == [false, true, false] && replica.is_doubtful());
        replica.take(&whole).unwrap();
        assert_eq!((replica.grid().revision(), replica.is_doubtful()), (1, false));
    }

    /// Regression: whoever gave a brick back three times was believed to have three fewer.
    #[test]
    fn of_a_brick_that_is_said_again_the_last_word_counts() {
        let mut map = OccupancyGrid::new(0.2);
        let mut replica = Replica::new(None, 2);
        let at = |x: i32| Voxel::new(8 * x, 0, 0);
        map.set(at(0), State::Free);
        replica.take(&MapUpdate::new(map.advance(&[at(0)]), 0)).unwrap();
        map.set(at(0), State::Unknown);
        assert!((1..3).all(|x| map.set(at(x), State::Free)));
        let fits = MapUpdate::new(map.advance(&[at(0), at(1), at(2)]), 1);
        let mut lie = fits.clone();
        let back = lie.bricks.iter().find(|brick| brick.is_unknown()).cloned().unwrap();
        let brick = |x: i32| BrickStates { brick: [x as i16, 0, 0], ..lie.bricks[1].clone() };
        lie.bricks = [vec![back; 3], (1..5).map(brick).collect()].concat();
        assert_eq!(replica.take(&lie).unwrap_err(), UpdateError::TooMany { bricks: 4, most: 2 });
        replica.take(&fits).unwrap();
        assert_eq!(replica.grid().bricks().len(), 2);
    }

    #[test]
    fn no_more_bricks_are_kept_than_were_agreed() {
        let mut map = OccupancyGrid::new(0.2);
        let mut replica = Replica::new(None, 2);
        let mut grow = |x: i32| {
            map.set(Voxel::new(8 * x, 0, 0), State::Free);
            MapUpdate::new(map.advance(&[Voxel::new(8 * x, 0, 0)]), 0)
        };
        let updates = [0, 1, 1, 2].map(&mut grow);
        updates[..3].iter().for_each(|update| drop(replica.take(update).unwrap()));
        let too_many = UpdateError::TooMany { bricks: 3, most: 2 };
        assert_eq!(replica.take(&updates[3]), Err(too_many));
        assert_eq!(replica.take(&MapUpdate::new(map.whole(), 0)), Err(too_many));
        assert_eq!(replica.grid().bricks().len(), 2);
    }
}
