//! All that a map knows, to be kept and had again: from a snapshot it is the same map, from a copy of its three-valued grid as
//! good a one as can be made of three values.

use std::borrow::Cow;
use std::ops::RangeInclusive;

use elk_geometry::bricks::BRICK;
use elk_geometry::delta::{Delta, DeltaError};
use elk_geometry::mask::{self, Mask};
use elk_geometry::state::{BrickStates, Cells, State};
use elk_geometry::voxel::{INDEX_RANGE, Voxel};

use crate::log_odds::Codes;
use crate::occupancy::{Brick, ConfigError, MapConfig, OccupancyMap};

/// All that a map knows.
#[derive(Debug, Clone, PartialEq)]
pub struct Snapshot {
    /// The revision of its grid.
    pub revision: u64,
    /// Edge of a voxel (m).
    pub resolution: f64,
    /// The bricks, in the map's order; something is known of each.
    pub bricks: Vec<BrickSnapshot>,
}

/// A brick of a map.
#[derive(Debug, Clone, PartialEq)]
pub struct BrickSnapshot {
    /// Its position, in bricks.
    pub position: Voxel,
    /// The cells that were ever updated.
    pub known: Mask,
    /// The cells that were ever hit.
    pub ever_hit: Mask,
    /// Log-odds of being occupied of the known cells, ascending by cell.
    pub log_odds: Vec<f32>,
}

/// Why a map cannot be had again.
#[derive(Debug, Clone, Copy, PartialEq, thiserror::Error)]
pub enum RestoreError {
    /// It had voxels of another size.
    #[error("its voxels are of {saved} m, this map's of {own} m: a map goes on with voxels of the size that it had")]
    Resolution {
        /// The edge of its voxels (m).
        saved: f64,
        /// That of this map's (m).
        own: f64,
    },
    /// This is not all of it.
    #[error(transparent)]
    Grid(#[from] DeltaError),
    /// No map can be made with these settings.
    #[error(transparent)]
    Config(#[from] ConfigError),
    /// It is larger than this one may be.
    #[error(
        "it has {bricks} bricks of 8x8x8 voxels, and {most} are the most that this map may have: allow for more, or use larger \
         voxels"
    )]
    TooMany {
        /// Bricks that it has.
        bricks: usize,
        /// The most that this one may have.
        most: usize,
    },
    /// A brick is none of a map.
    #[error(
        "the brick at {position:?} is none of a map: it lies outside, or its log-odds are not one finite number a known cell"
    )]
    Brick {
        /// Its position, in bricks.
        position: Voxel,
    },
    /// A brick is there twice.
    #[error("the brick at {position:?} is there twice: a map has each once")]
    Twice {
        /// Its position, in bricks.
        position: Voxel,
    },
}

impl MapConfig {
    /// Whether a map with these settings can be one of so many bricks and of voxels of `saved` (m).
    pub(crate) fn see_whether_it_fits(&self, bricks: usize, saved: f64) -> Result<(), RestoreError> {
        let &Self { resolution: own, max_bricks: most, .. } = self;
        match (saved == own, bricks <= most) {
            (false, _) => Err(RestoreError::Resolution { saved, own }),
            (true, false) => Err(RestoreError::TooMany { bricks, most }),
            (true, true) => Ok(()),
        }
    }
}

impl OccupancyMap {
    /// All that the map knows.
    pub fn snapshot(&self) -> Snapshot {
        let bricks = self.bricks.iter().enumerate();
        Snapshot {
            revision: self.grid.revision(),
            resolution: self.config.resolution,
            bricks: bricks.map(|(i, brick)| brick.remember(self.table.position(i), &self.codes)).collect(),
        }
    }

    /// The map of which this is a snapshot. Log-odds beyond what this map's may be become the nearest that they may be.
    ///
    /// # Errors
    /// Its voxels were not of this size, it is larger than this one may be, or it is none of a map.
    pub fn restore(config: MapConfig, snapshot: &Snapshot) -> Result<Self, RestoreError> {
        let known = || snapshot.bricks.iter().filter(|brick| brick.known != mask::NONE);
        let mut map = Self::with_room_for(config, known().count(), snapshot.resolution)?;
        for brick in known() {
            let recalled = Brick::recall(brick, &config, &mut map.codes)?;
            map.put(brick.position, recalled)?;
        }
        map.shown_at(snapshot.revision)
    }

    /// A map that has the states of a copy of its grid.
    ///
    /// How sure the map was is lost; a voxel is as sure as if one scan had seen it, which is a map that every exploration
    /// begins with and copes with: what is seen from now on counts in full, and what the copy has wrong is soon forgotten.
    ///
    /// # Errors
    /// The copy's voxels are not of this size, it is not the whole grid, or it is larger than this map may be.
    pub fn from_states(config: MapConfig, whole: &Delta<'_>) -> Result<Self, RestoreError> {
        let known = || whole.bricks.iter().filter(|brick| !brick.is_unknown());
        let mut map = Self::with_room_for(config, known().count(), whole.resolution)?;
        for states in known() {
            let seen = Brick::seen_once(states, &config, &mut map.codes);
            map.put(states.position(), seen)?;
        }
        map.show(whole)?;
        Ok(map)
    }

    /// Calls itself `revision`, because somebody may have a copy that is called so, and needs the next one whole.
    pub fn skip_to(&mut self, revision: u64) {
        self.grid.skip_to(revision);
    }

    pub(crate) fn with_room_for(config: MapConfig, bricks: usize, resolution: f64) -> Result<Self, RestoreError> {
        config.see_whether_it_fits(bricks, resolution)?;
        Ok(Self::new(config)?)
    }

    fn put(&mut self, position: Voxel, brick: Brick) -> Result<(), RestoreError> {
        const POSITIONS: RangeInclusive<i32> = *INDEX_RANGE.start() / BRICK..=*INDEX_RANGE.end() / BRICK;
        if !position.to_array().iter().all(|c| POSITIONS.contains(c)) {
            return Err(RestoreError::Brick { position });
        }
        if self.table.find(position).is_some() {
            return Err(RestoreError::Twice { position });
        }
        if let Some(i) = self.table.find_or_add(position) {
            self.grow();
            self.bricks[i] = brick;
        }
        Ok(())
    }

    /// Shows what its bricks hold, as `revision`.
    pub(crate) fn shown_at(mut self, revision: u64) -> Result<Self, RestoreError> {
        let states = self.bricks.iter().enumerate().map(|(i, brick)| brick.states(self.table.position(i))).collect();
        let resolution = self.config.resolution;
        self.show(&Delta { revision, since: 0, resolution, bricks: Cow::Owned(states) })?;
        Ok(self)
    }

    /// Shows these states, which are those of all bricks.
    fn show(&mut self, states: &Delta<'_>) -> Result<(), DeltaError> {
        self.grid.apply(states)?;
        self.update_all_of_the_frontier();
        Ok(())
    }
}

impl Brick {
    fn remember(&self, position: Voxel, codes: &Codes) -> BrickSnapshot {
        BrickSnapshot {
            position,
            known: self.known,
            ever_hit: self.ever_hit,
            log_odds: mask::cells(&self.known).map(|cell| self.log_odds.get(cell, codes)).collect(),
        }
    }

    fn recall(left: &BrickSnapshot, config: &MapConfig, codes: &mut Codes) -> Result<Self, RestoreError> {
        if left.log_odds.len() != mask::count(&left.known) || !left.log_odds.iter().all(|one| one.is_finite()) {
            return Err(RestoreError::Brick { position: left.position });
        }
        let mut brick = Self { ever_hit: mask::and(&left.ever_hit, &left.known), ..Self::new() };
        for (cell, log_odds) in mask::cells(&left.known).zip(&left.log_odds) {
            brick.know(cell, log_odds.clamp(config.clamp_min, config.clamp_max), config, codes);
        }
        Ok(brick)
    }

    fn seen_once(states: &BrickStates, config: &MapConfig, codes: &mut Codes) -> Self {
        let mut brick = Self::new();
        let cells = states.unpack();
        let (miss, hit) = (config.miss.max(config.clamp_min), config.hit.min(config.clamp_max));
        mask::cells(&cells.free()).for_each(|cell| brick.know(cell, miss, config, codes));
        mask::cells(cells.occupied()).for_each(|cell| brick.know(cell, hit, config, codes));
        brick.ever_hit = *cells.occupied();
        brick
    }

    pub(crate) fn know(&mut self, cell: usize, log_odds: f32, config: &MapConfig, codes: &mut Codes) {
        let (layer, bit) = (cell >> 6, 1 << (cell & 63));
        self.log_odds.set(cell, log_odds, codes);
        self.known[layer] |= bit;
        let sets = [
            (&mut self.occupied, OccupancyMap::state_of(log_odds) == State::Occupied),
            (&mut self.at_min, log_odds == config.clamp_min),
            (&mut self.at_max, log_odds == config.clamp_max),
        ];
        for (set, is_in) in sets {
            set[layer] = set[layer] & !bit | if is_in { bit } else { 0 };
        }
    }

    fn states(&self, position: Voxel) -> BrickStates {
        BrickStates::pack(position, &Cells::new(&self.known, &self.occupied))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use nalgebra::Point3;
    use proptest::prelude::*;

    type Scans = Vec<(Point3<f64>, Vec<Point3<f64>>)>;

    fn scans(most: usize) -> impl Strategy<Value = Scans> {
        let point = || prop::array::uniform3(-1.5..1.5f64).prop_map(Point3::from);
        prop::collection::vec((point(), prop::collection::vec(point(), 1..30)), 1..most)
    }

    fn insert(map: &mut OccupancyMap, scans: &Scans) -> Vec<Delta<'static>> {
        let scan = |(origin, points): &(Point3<f64>, Vec<Point3<f64>>)| {
            let changed = map.insert(*origin, points.iter().copied()).changed;
            map.advance(&changed)
        };
        scans.iter().map(scan).collect()
    }

    proptest! {
        #![proptest_config(ProptestConfig::with_cases(64))]

        /// Whatever comes after it, a map from a snapshot says what the map itself would have said.
        #[test]
        fn a_map_from_a_snapshot_is_the_same_map(before in scans(5), after in scans(5)) {
            let mut map = OccupancyMap::new(MapConfig::default()).unwrap();
            insert(&mut map, &before);
            let mut successor = OccupancyMap::restore(MapConfig::default(), &map.snapshot()).unwrap();
            prop_assert_eq!(successor.frontier_len(), map.frontier_len());
            prop_assert_eq!(successor.snapshot(), map.snapshot());
            prop_assert_eq!(insert(&mut successor, &after), insert(&mut map, &after));
            prop_assert_eq!(successor.frontier_len(), map.frontier_len());
            for (voxel, log_odds) in map.known() {
                prop_assert_eq!(successor.log_odds(voxel), Some(log_odds));
            }
        }

        /// A map from a copy shows what the map showed, and goes on from its revision.
        #[test]
        fn a_map_from_a_copy_shows_the_same(before in scans(5), after in scans(3)) {
            let mut map = OccupancyMap::new(MapConfig::default()).unwrap();
            insert(&mut map, &before);
            let mut successor = OccupancyMap::from_states(MapConfig::default(), &map.grid().whole()).unwrap();
            prop_assert_eq!(successor.frontier_len(), map.frontier_len());
            prop_assert_eq!(successor.grid().whole(), map.grid().whole());
            for (voxel, log_odds) in map.known() {
                prop_assert_eq!(OccupancyMap::state_of(successor.log_odds(voxel).unwrap()), OccupancyMap::state_of(log_odds));
            }
            let mut reader = map.grid().clone();
            for update in insert(&mut successor, &after) {
                reader.apply(&update).unwrap();
            }
            prop_assert_eq!((reader.free(), reader.occupied()), (successor.grid().free(), successor.grid().occupied()));
        }
    }

    #[test]
    fn a_map_that_lost_everything_goes_on_behind_what_its_readers_have() {
        let mut map = OccupancyMap::new(MapConfig::default()).unwrap();
        insert(&mut map, &vec![([0.05; 3].into(), vec![[0.95, 0.05, 0.05].into()])]);
        let mut reader = map.grid().clone();
        let mut successor = OccupancyMap::new(MapConfig::default()).unwrap();
        successor.skip_to(reader.revision());
        insert(&mut successor, &vec![([0.05; 3].into(), vec![[0.55, 0.05, 0.05].into()])]);
        reader.apply(&successor.grid().whole()).unwrap();
        assert_eq!((reader.revision(), reader.free(), reader.occupied()), (2, 5, 1));
    }

    #[test]
    fn voxels_of_another_size_are_refused() {
        let map = OccupancyMap::new(MapConfig::default()).unwrap();
        let finer = MapConfig { resolution: 0.05, ..MapConfig::default() };
        assert!(matches!(
            OccupancyMap::restore(finer, &map.snapshot()),
            Err(RestoreError::Resolution { saved: 0.1, own: 0.05 })
        ));
        assert!(matches!(
            OccupancyMap::from_states(finer, &map.grid().whole()),
            Err(RestoreError::Resolution { saved: 0.1, own: 0.05 })
        ));
    }

    #[test]
    fn what_is_no_snapshot_is_refused() {
        let mut map = OccupancyMap::new(MapConfig::default()).unwrap();
        insert(&mut map, &vec![([0.05; 3].into(), vec![[0.95, 0.05, 0.05].into()])]);
        let spoilt = |spoil: fn(&mut BrickSnapshot)| {
            let mut snapshot = map.snapshot();
            spoil(&mut snapshot.bricks[0]);
            OccupancyMap::restore(MapConfig::default(), &snapshot).map(|_| ())
        };
        assert_eq!(spoilt(|_| ()), Ok(()));
        let spoils: [fn(&mut BrickSnapshot); 4] = [
            |brick| brick.position.x = 4096,
            |brick| brick.position.z = i32::MIN,
            |brick| brick.log_odds.truncate(1),
            |brick| brick.log_odds[0] = f32::NAN,
        ];
        assert!(spoils.into_iter().all(|spoil| matches!(spoilt(spoil), Err(RestoreError::Brick { .. }))));
        let mut twice = map.snapshot();
        twice.bricks.push(twice.bricks[0].clone());
        assert!(matches!(OccupancyMap::restore(MapConfig::default(), &twice), Err(RestoreError::Twice { .. })));
    }

    #[test]
    fn log_odds_are_brought_within_what_a_map_allows() {
        let mut map = OccupancyMap::new(MapConfig::default()).unwrap();
        insert(&mut map, &vec![([0.05; 3].into(), vec![[0.95, 0.05, 0.05].into()])]);
        let narrow = MapConfig { clamp_min: -0.3, clamp_max: 0.5, ..MapConfig::default() };
        let successor = OccupancyMap::restore(narrow, &map.snapshot()).unwrap();
        let values = [0, 9].map(|x| successor.log_odds(Voxel::new(x, 0, 0)));
        assert_eq!(values, [Some(-0.3), Some(0.5)]);
    }
}
