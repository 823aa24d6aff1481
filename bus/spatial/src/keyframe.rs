//! The whole map in parts, so that to say it never takes longer than a part does.
//!
//! A map's bricks stand in one order, to whose end alone new ones are added. The map says them part by part, round and round: each
//! part is as the map is when it is said, and what changes between two parts goes out as it always does. So whoever hears all
//! parts of one round, and the updates between them, has the whole map of the last part's revision, wherever in the order the
//! first of them began. (This is a carousel as of DSM-CC, ISO/IEC 13818-6, with updates between its blocks.) In the place of a
//! brick that is given back stands the last one, which the update has as well, and so nobody misses it; where the order ends
//! before the next part by then, it begins anew.
//!
//! The part that a round began with also ends it, and has to say what is known by then: so for the place of each part there is a
//! word of the map after whatever somebody else may have said there, and a lie that was taken does not fit.

use std::borrow::Cow;
use std::collections::BTreeSet;

use elk_bus::payload;
use elk_geometry::delta::Delta;
use elk_geometry::limits::RESOLUTIONS_M;
use elk_geometry::state::BrickStates;
use elk_geometry::{OccupancyGrid, Voxel};

use crate::checks::{self, MAX_BRICKS};
use crate::map::MapUpdate;

/// A part of the whole map: bricks that follow each other in the map's order, as they are at its revision.
#[payload]
#[describe(check = check, drawn = "voxels")]
#[derive(Debug, Clone, PartialEq)]
pub struct MapPart {
    /// The map's revision; updates up to it have been said before.
    #[describe(count)]
    pub revision: u64,
    /// The last scan in the map (see [`crate::Scan::id`]).
    #[describe(count)]
    pub scan: u64,
    /// Edge of a voxel (m).
    #[describe(unit = "m", range = RESOLUTIONS_M)]
    pub resolution: f64,
    /// Bricks of the map that come before these.
    #[describe(range = 0..=MAX_BRICKS as u64)]
    pub first: u64,
    /// Bricks of the whole map.
    #[describe(range = 0..=MAX_BRICKS as u64)]
    pub total: u64,
    /// The bricks.
    #[describe(longest = MAX_BRICKS)]
    pub bricks: Vec<BrickStates>,
}

/// A part lies in its map; only an empty map has an empty one.
fn check(part: &MapPart) -> checks::Checked {
    let end = part.first + part.bricks.len() as u64;
    checks::holds("total", end <= part.total, part.total, "no less than what comes before the part, with the part")?;
    let empty = part.bricks.is_empty() && part.total > 0;
    checks::holds("bricks", !empty, "empty", "at least one of a map that has bricks")
}

impl MapPart {
    /// At most so many bricks of a map, from the one that `first` others come before, or from the first one if there are no more
    /// than those; `scan` is the last one in it.
    pub fn of(grid: &OccupancyGrid, scan: u64, first: usize, most: usize) -> Self {
        let (revision, resolution, total) = (grid.revision(), grid.resolution(), grid.bricks().len() as u64);
        let first = if first < grid.bricks().len() { first } else { 0 };
        Self { revision, scan, resolution, first: first as u64, total, bricks: grid.packed(first, most) }
    }

    /// The number of the first brick of the part that follows: the order's first one follows its last.
    fn next(&self) -> u64 {
        match self.first + self.bricks.len() as u64 {
            end if end >= self.total => 0,
            end => end,
        }
    }

    fn delta(&self, since: u64) -> Delta<'_> {
        let Self { revision, resolution, ref bricks, .. } = *self;
        Delta { revision, since, resolution, bricks: Cow::Borrowed(bricks) }
    }
}

/// One round through a map's bricks, from any of them.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Round {
    start: u64,
    next: u64,
    /// The order's end was passed.
    turned: bool,
}

impl Round {
    /// A round that begins with the brick of this number.
    pub fn from(start: u64) -> Self {
        Self { start, next: start, turned: false }
    }

    /// The number of the first brick of the next part.
    pub fn next(&self) -> u64 {
        self.next
    }

    /// Whether this is the next part.
    fn fits(&self, part: &MapPart) -> bool {
        part.first == if self.next < part.total { self.next } else { 0 }
    }

    /// Takes the next part, from [`Round::next`] on; whether that was the round's last: the one that it began with, or the only
    /// one that there is.
    pub fn take(&mut self, part: &MapPart) -> bool {
        let (turned, is_all) = (self.turned, part.bricks.len() as u64 == part.total);
        self.next = part.next();
        self.turned |= self.next == 0;
        is_all || turned && (self.next > self.start || self.next == 0)
    }
}

/// A whole map that is coming, part by part.
#[derive(Debug, Clone)]
pub struct Keyframe {
    grid: OccupancyGrid,
    scan: u64,
    /// The bricks of the parts so far, the round's first one first.
    order: Vec<Voxel>,
    /// How many of these come before the map's first one.
    before_first: usize,
    /// The fewest bricks that the map can have, after what was given back of those of the last part's.
    fewest: u64,
    /// None: nothing has come yet.
    round: Option<Round>,
}

/// Whether a part says what is known of the brick that a round began with, and of those behind it, as far as there are any.
fn says_again(part: &MapPart, start: u64, known: &OccupancyGrid) -> bool {
    if start >= part.total {
        return true;
    }
    let place = start.checked_sub(part.first).and_then(|place| usize::try_from(place).ok());
    let again = place.and_then(|place| part.bricks.get(place..)).unwrap_or_default();
    !again.is_empty() && again.iter().all(|brick| known.knows(brick))
}

/// How a keyframe goes on with a message.
#[derive(Debug, Clone, PartialEq)]
pub enum Step {
    /// It was taken; more is to come.
    Taken,
    /// It was the last part: the whole map, its bricks in the map's order.
    Whole(MapUpdate),
    /// It does not continue what was taken: something between was lost, or somebody lies.
    Apart,
}

impl Keyframe {
    /// One that begins with the next part of a map with such voxels (m), whichever that is.
    pub fn new(resolution: f64) -> Self {
        let grid = OccupancyGrid::new(resolution);
        Self { grid, scan: 0, order: Vec::new(), before_first: 0, fewest: 0, round: None }
    }

    /// Takes the next part.
    pub fn take(&mut self, part: &MapPart) -> Step {
        if self.round.is_none() {
            self.grid.skip_to(part.revision);
            self.scan = part.scan;
        }
        let round = self.round.get_or_insert(Round::from(part.first));
        let follows = (part.revision, part.scan) == (self.grid.revision(), self.scan) && round.fits(part);
        if !follows || part.total < self.fewest {
            return Step::Apart;
        }
        self.fewest = part.total;
        let was_turned = round.turned;
        round.turned |= part.first < round.next();
        if !was_turned && round.turned {
            self.before_first = self.order.len();
        }
        let turned = round.turned;
        let over = round.take(part);
        if over && turned && !says_again(part, round.start, &self.grid)
            || self.grid.apply(&part.delta(part.revision)).is_err()
        {
            return Step::Apart;
        }
        self.order.extend(part.bricks.iter().map(BrickStates::position));
        if !turned && round.turned {
            self.before_first = self.order.len();
        }
        match over {
            false => Step::Taken,
            // A brick that only somebody else has said is one more than the map has.
            true if self.len() as u64 != part.total => Step::Apart,
            true => Step::Whole(self.whole()),
        }
    }

    /// Takes what the map says between two parts.
    pub fn follow(&mut self, update: &MapUpdate) -> Step {
        if self.round.is_none() {
            return Step::Taken;
        }
        if update.since == 0 || self.grid.apply(&update.delta()).is_err() {
            return Step::Apart;
        }
        self.scan = update.scan;
        let given_back = update.bricks.iter().filter(|brick| brick.is_unknown()).count();
        self.fewest = self.fewest.saturating_sub(given_back as u64);
        Step::Taken
    }

    /// Edge of a voxel (m).
    pub fn resolution(&self) -> f64 {
        self.grid.resolution()
    }

    /// Bricks that it has.
    pub fn len(&self) -> usize {
        self.grid.bricks().len()
    }

    /// Whether it has none.
    pub fn is_empty(&self) -> bool {
        self.grid.bricks().is_empty()
    }

    /// All of it. Bricks that no part had are those that the map has got since the round began, in their own order; those that have
    /// got another place meanwhile stand where they were.
    fn whole(&mut self) -> MapUpdate {
        self.order.rotate_left(self.before_first);
        let mut said = BTreeSet::new();
        self.order.retain(|brick| said.insert(*brick));
        let bricks = self.grid.bricks();
        let new = bricks.iter().map(|(brick, _)| brick).filter(|brick| !said.contains(brick));
        let packed = self.order.iter().copied().chain(new);
        let packed = packed.filter_map(|brick| Some(BrickStates::pack(brick, bricks.brick(brick)?)));
        let (revision, resolution) = (self.grid.revision(), self.grid.resolution());
        MapUpdate { revision, since: 0, scan: self.scan, resolution, bricks: packed.collect() }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use elk_geometry::State;
    use proptest::prelude::*;

    /// Bricks of a part in these tests.
    const MOST: usize = 3;

    /// A map that says itself in parts.
    struct Speaker {
        grid: OccupancyGrid,
        scan: u64,
        next: u64,
    }

    impl Speaker {
        fn part(&mut self) -> MapPart {
            let part = MapPart::of(&self.grid, self.scan, self.next as usize, MOST);
            self.next = part.next();
            part
        }

        fn change(&mut self, voxels: &[(Voxel, State)]) -> MapUpdate {
            let changed: Vec<Voxel> =
                voxels.iter().filter(|(v, state)| self.grid.set(*v, *state)).map(|v| v.0).collect();
            self.scan += 1;
            MapUpdate::new(self.grid.advance(&changed), self.scan)
        }
    }

    fn voxels() -> impl Strategy<Value = Vec<(Voxel, State)>> {
        let state = prop_oneof![Just(State::Unknown), Just(State::Free), Just(State::Occupied)];
        // Few in a brick, so that some bricks come to hold none.
        let voxel = prop::array::uniform3(-4..4i32).prop_map(|v| Voxel::from(v.map(|c| 5 * c)));
        prop::collection::vec((voxel, state), 0..20)
    }

    proptest! {
        /// Wherever the round begins, and whatever changes between its parts, known bricks and new ones, it is the map at the end,
        /// its bricks in the map's order, and took as many parts as it had to.
        #[test]
        fn a_round_gives_the_map_that_is_there_at_its_end(
            before in voxels(), skipped in 0..9usize, between in prop::collection::vec(voxels(), 0..30)
        ) {
            let mut map = Speaker { grid: OccupancyGrid::new(0.1), scan: 0, next: 0 };
            map.change(&before);
            (0..skipped).for_each(|_| drop(map.part()));
            let (mut keyframe, mut between) = (Keyframe::new(0.1), between.into_iter());
            let (mut parts, mut most) = (0, map.grid.bricks().len());
            let whole = loop {
                parts += 1;
                match keyframe.take(&map.part()) {
                    Step::Whole(whole) => break whole,
                    step => prop_assert_eq!(step, Step::Taken),
                }
                prop_assert!(parts < 99);
                if let Some(changes) = between.next() {
                    prop_assert_eq!(keyframe.follow(&map.change(&changes)), Step::Taken);
                    most = most.max(map.grid.bricks().len());
                }
            };
            let mut right = MapUpdate::new(map.grid.whole(), map.scan);
            let mut whole = whole;
            whole.bricks.sort_by_key(|b| b.brick);
            right.bricks.sort_by_key(|b| b.brick);
            prop_assert_eq!(whole, right);
            prop_assert!(parts <= most / MOST + 3);
        }
    }

    fn row(bricks: i32) -> Speaker {
        let mut map = Speaker { grid: OccupancyGrid::new(0.1), scan: 0, next: 0 };
        map.change(&(0..bricks).map(|x| (Voxel::new(8 * x, 0, 0), State::Free)).collect::<Vec<_>>());
        map
    }

    #[test]
    fn bricks_stand_in_the_maps_order_wherever_the_round_began() {
        for skipped in 0..4 {
            let mut map = row(10);
            (0..skipped).for_each(|_| drop(map.part()));
            let mut keyframe = Keyframe::new(0.1);
            let mut steps: Vec<Step> = (0..2).map(|_| keyframe.take(&map.part())).collect();
            // One that no part had yet, and one that is new.
            let update = map.change(&[(Voxel::new(1, 0, 0), State::Free), (Voxel::new(0, 0, -9), State::Occupied)]);
            assert_eq!(keyframe.follow(&update), Step::Taken);
            while !matches!(steps.last(), Some(Step::Whole(_))) {
                steps.push(keyframe.take(&map.part()));
            }
            assert_eq!(steps.last(), Some(&Step::Whole(MapUpdate::new(map.grid.whole(), map.scan))), "{skipped}");
        }
    }

    #[test]
    fn what_does_not_follow_is_apart() {
        let mut map = row(10);
        let (parts, late) = ([map.part(), map.part(), map.part()], map.change(&[]));
        let lost = map.change(&[]);
        let begun = || {
            let mut keyframe = Keyframe::new(0.1);
            assert_eq!(keyframe.take(&parts[0]), Step::Taken);
            keyframe
        };
        assert_eq!(begun().take(&parts[2]), Step::Apart, "a part is missing");
        assert_eq!(begun().take(&parts[0]), Step::Apart, "a part comes twice");
        assert_eq!(begun().take(&MapPart { revision: 2, ..parts[1].clone() }), Step::Apart, "an update is missing");
        assert_eq!(begun().take(&MapPart { scan: 7, ..parts[1].clone() }), Step::Apart, "of another scan");
        assert_eq!(begun().take(&MapPart { resolution: 0.2, ..parts[1].clone() }), Step::Apart, "of another map");
        assert_eq!(begun().follow(&lost), Step::Apart);
        assert_eq!(begun().follow(&MapUpdate { since: 0, ..late.clone() }), Step::Apart);
        assert_eq!(begun().follow(&late), Step::Taken);
        assert_eq!(Keyframe::new(0.1).follow(&lost), Step::Taken, "nothing has begun");
    }

    #[test]
    fn a_map_of_nothing_is_whole_at_once() {
        let grid = OccupancyGrid::new(0.1);
        let whole = MapUpdate::new(grid.whole(), 0);
        assert_eq!(Keyframe::new(0.1).take(&MapPart::of(&grid, 0, 0, MOST)), Step::Whole(whole));
    }

    #[test]
    fn a_part_that_cannot_be_one_is_not_believed() {
        let part = row(4).part();
        assert!(check(&part).is_ok());
        assert!(check(&MapPart { total: 2, ..part.clone() }).is_err(), "it has more bricks than the map");
        assert!(check(&MapPart { bricks: vec![], ..part.clone() }).is_err(), "it says nothing");
        assert!(check(&MapPart { bricks: vec![], total: 0, ..part }).is_ok());
    }
}
