//! The map: what is known of every voxel, as log-odds of being occupied, L(n|z₁…ₜ) = L(n|z₁…ₜ₋₁) + L(n|zₜ) (thesis 6.3.1;
//! Shade and Newman, *Choosing Where To Go*, ICRA 2011, (12) and (13); Hornung et al., *OctoMap*, 2013, section 3.1).

use elk_geometry::bricks::{brick_of, cell_of, swap_remove, voxel_at};
use elk_geometry::delta::{Changes, Delta};
use elk_geometry::limits::RESOLUTIONS_M;
use elk_geometry::mask::{self, Mask};
use elk_geometry::{Bounds, OccupancyGrid, State, Voxel, VoxelSet};

use crate::fan::Ray;
use crate::log_odds::{Codes, LogOdds};
use crate::marks::Scratch;
use crate::table::BrickTable;
use crate::volume::Volume;

/// When a ray that passes through a voxel does not count against it.
///
/// A voxel that a surface only partly fills is hit by some rays and passed by others; far away, at grazing incidence,
/// passed more often than hit. With log-odds alone floors and walls dissolve under such rays and open frontiers that
/// nothing can resolve.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum Grazing {
    /// It always counts: plain log-odds, as the thesis has it.
    None,
    /// Not if the voxel was ever hit and a neighbour (of 26) was hit in the same scan: the ray grazed the surface there.
    /// Elsewhere a quarter, if the voxel was ever hit; and not at all what passed before it was first hit. Lone voxels, as
    /// noise makes them, are still freed.
    #[default]
    Guard,
    /// Not if the voxel was ever hit. Never frees what was hit once: only honest without noise and with nothing moving.
    Sticky,
}

/// Which rays of a scan are walked.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum Integration {
    /// One to every point.
    #[default]
    Rays,
    /// One to the middle of every voxel that points lie in (OctoMap's `discretize`): fewer, and so faster where many points
    /// share a voxel; voxels that only other rays would have passed are not freed.
    EndVoxels,
}

/// How scans become log-odds.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct MapConfig {
    /// Edge of a voxel (m).
    pub resolution: f64,
    /// Added to a voxel in which a ray of the scan ended: l_occ of ICRA 2011, (13) (log-odds, > 0).
    pub hit: f32,
    /// Added to a voxel that rays of the scan only passed through: l_free of ICRA 2011, (13) (log-odds, < 0).
    pub miss: f32,
    /// The smallest log-odds that a voxel can have; at most `clamp_max`.
    pub clamp_min: f32,
    /// The largest log-odds that a voxel can have.
    pub clamp_max: f32,
    /// Which passing rays do not count.
    pub grazing: Grazing,
    /// Which rays are walked.
    pub integration: Integration,
    /// How far a point is moved along its ray (m): one that lies on the border of two voxels, as those on walls that follow
    /// the lattice do, falls into the voxel behind the surface, whatever rounding did to it. 0, as OctoMap has it: not at all.
    pub advance: f64,
    /// Farther points (m from the sensor) are no hits, and their rays free voxels only up to here; 0: no limit.
    pub max_range: f64,
    /// How far a ray without a return frees voxels (m); 0: not at all, as nothing is known of where it ended.
    pub free_no_return: f64,
    /// Bricks that the map may have (8³ voxels and about 1.3 kB each); what lies in others is left out. One of which nothing is
    /// known any more is given back.
    pub max_bricks: usize,
    /// The volume in which frontiers count; `None`: everywhere.
    pub bounds: Option<Bounds>,
}

impl Default for MapConfig {
    /// The thesis' values: +0.85, −0.4, clamped to −2 … 3.5, voxels of 0.1 m.
    fn default() -> Self {
        Self {
            resolution: 0.1,
            hit: 0.85,
            miss: -0.4,
            clamp_min: -2.0,
            clamp_max: 3.5,
            grazing: Grazing::default(),
            integration: Integration::default(),
            advance: 1e-4,
            max_range: 0.0,
            free_no_return: 0.0,
            max_bricks: 1 << 18,
            bounds: None,
        }
    }
}

impl MapConfig {
    /// What OctoMap has unless it is told otherwise: a map that equals its `OcTree` voxel for voxel, and log-odds for log-odds.
    pub fn octomap(resolution: f64) -> Self {
        let log_odds = |probability: f64| (probability / (1.0 - probability)).ln() as f32;
        Self {
            resolution,
            hit: log_odds(0.7),
            miss: log_odds(0.4),
            clamp_min: log_odds(0.1192),
            clamp_max: log_odds(0.971),
            grazing: Grazing::None,
            advance: 0.0,
            ..Self::default()
        }
    }

    /// How far a ray frees voxels of which the sensor says that it saw nothing up to `range` (m; 0: as far as there is
    /// anything).
    pub(crate) fn reach_without_return(&self, range: f64) -> f64 {
        let limits = [range, self.max_range].into_iter().filter(|limit| *limit > 0.0);
        limits.fold(self.free_no_return, f64::min)
    }
}

/// Why no map can be made with some settings.
#[derive(Debug, Clone, Copy, PartialEq, thiserror::Error)]
pub enum ConfigError {
    /// No edge of a voxel.
    #[error("voxels of {metres} m: take a size between {} and {} m", RESOLUTIONS_M.start(), RESOLUTIONS_M.end())]
    Resolution {
        /// What it is to be (m).
        metres: f64,
    },
    /// A hit that counts against a voxel, or a miss that counts for it.
    #[error("a hit adds {hit} to a voxel's log-odds and a miss {miss}: a hit has to add more than 0, a miss less")]
    Steps {
        /// What a hit adds.
        hit: f32,
        /// What a miss adds.
        miss: f32,
    },
    /// Bounds of log-odds between which there is nothing.
    #[error("log-odds between {min} and {max}: take a smallest that is not above the largest")]
    Clamp {
        /// The smallest.
        min: f32,
        /// The largest.
        max: f32,
    },
    /// A length that is none.
    #[error("{name} is {metres} m: take a length of 0 or more")]
    Length {
        /// Which.
        name: &'static str,
        /// It (m).
        metres: f64,
    },
    /// More bricks than can be numbered.
    #[error("{0} bricks are more than a map can number: take at most {MOST_BRICKS}")]
    Bricks(usize),
}

/// The most bricks that a map can number.
const MOST_BRICKS: usize = u32::MAX as usize - 1;

impl MapConfig {
    /// Whether a map can be made with these settings.
    ///
    /// # Errors
    /// The first setting that makes no sense.
    pub fn check(&self) -> Result<(), ConfigError> {
        let &Self { resolution, hit, miss, clamp_min: min, clamp_max: max, max_bricks, .. } = self;
        let lengths =
            [("max_range", self.max_range), ("free_no_return", self.free_no_return), ("advance", self.advance)];
        let is_length = |metres: f64| metres.is_finite() && metres >= 0.0;
        if !RESOLUTIONS_M.contains(&resolution) {
            return Err(ConfigError::Resolution { metres: resolution });
        }
        if !(hit > 0.0 && miss < 0.0 && hit.is_finite() && miss.is_finite()) {
            return Err(ConfigError::Steps { hit, miss });
        }
        if !(min <= max && min.is_finite() && max.is_finite()) {
            return Err(ConfigError::Clamp { min, max });
        }
        if let Some(&(name, metres)) = lengths.iter().find(|(_, metres)| !is_length(*metres)) {
            return Err(ConfigError::Length { name, metres });
        }
        if max_bricks > MOST_BRICKS {
            return Err(ConfigError::Bricks(max_bricks));
        }
        Ok(())
    }
}

/// A brick of the map. A voxel that was ever updated is occupied if its log-odds are above 0, and free otherwise.
#[derive(Debug, Clone)]
pub(crate) struct Brick {
    pub log_odds: LogOdds,
    /// Ever updated.
    pub known: Mask,
    pub occupied: Mask,
    /// Ever hit.
    pub ever_hit: Mask,
    /// At the smallest log-odds that they can have, and at the largest: misses, and hits, change nothing there.
    pub at_min: Mask,
    pub at_max: Mask,
    pub frontier: Mask,
}

impl Brick {
    pub fn new() -> Self {
        Self {
            log_odds: LogOdds::new(),
            known: mask::NONE,
            occupied: mask::NONE,
            ever_hit: mask::NONE,
            at_min: mask::NONE,
            at_max: mask::NONE,
            frontier: mask::NONE,
        }
    }

    /// What of it the grid shows: known cells, and the occupied ones of them.
    pub fn shown(&self) -> [Mask; 2] {
        [self.known, self.occupied]
    }

    /// Its free cells.
    pub fn free(&self) -> Mask {
        mask::without(&self.known, &self.occupied)
    }
}

/// What is being changed in a map, brick by brick in the order in which it is to be told.
#[derive(Debug, Default)]
pub(crate) struct Changed {
    /// The voxels whose state changed.
    states: Changes,
    /// The numbers of their bricks, and the cells that have become known or unknown.
    extents: Vec<(usize, Mask)>,
    /// Bricks of which nothing is known any more.
    unknown: Vec<Voxel>,
}

/// A log-odds occupancy map with its frontier. Of each of its bricks something is known.
#[derive(Debug, Clone)]
pub struct OccupancyMap {
    pub(crate) config: MapConfig,
    pub(crate) table: BrickTable,
    pub(crate) bricks: Vec<Brick>,
    pub(crate) codes: Codes,
    /// What the scan being inserted says.
    pub(crate) scratch: Scratch,
    pub(crate) rays: Vec<Ray>,
    pub(crate) grid: OccupancyGrid,
    pub(crate) volume: Volume,
    pub(crate) frontier_len: usize,
    /// Whether the frontier is that of a full map.
    pub(crate) full: bool,
}

impl OccupancyMap {
    /// An unknown world.
    ///
    /// # Errors
    /// A setting makes no sense.
    pub fn new(config: MapConfig) -> Result<Self, ConfigError> {
        config.check()?;
        Ok(Self {
            config,
            table: BrickTable::new(config.max_bricks),
            bricks: Vec::new(),
            codes: Codes::default(),
            scratch: Scratch::default(),
            rays: Vec::new(),
            grid: OccupancyGrid::new(config.resolution),
            volume: Volume::new(config.bounds, config.resolution),
            frontier_len: 0,
            full: false,
        })
    }

    /// How this map takes scans in.
    pub fn config(&self) -> &MapConfig {
        &self.config
    }

    /// The map as its readers see it: free, occupied or unknown.
    pub fn grid(&self) -> &OccupancyGrid {
        &self.grid
    }

    /// The log-odds of a voxel; `None` if it was never observed.
    pub fn log_odds(&self, voxel: Voxel) -> Option<f32> {
        let brick = &self.bricks[self.table.find(brick_of(voxel))?];
        let cell = cell_of(voxel);
        mask::has(&brick.known, cell).then(|| brick.log_odds.get(cell, &self.codes))
    }

    /// Every observed voxel with its log-odds, brick by brick.
    pub fn known(&self) -> impl Iterator<Item = (Voxel, f32)> + '_ {
        self.bricks.iter().enumerate().flat_map(move |(i, brick)| {
            let position = self.table.position(i);
            mask::cells(&brick.known).map(move |cell| (voxel_at(position, cell), brick.log_odds.get(cell, &self.codes)))
        })
    }

    /// The occupied voxels of which the map is less sure than of the log-odds `below`. What is as sure as the map ever is
    /// ([`MapConfig::clamp_max`]) is none of them.
    pub fn unsure(&self, below: f32) -> VoxelSet {
        let below = below.min(self.config.clamp_max);
        let mut unsure = VoxelSet::new();
        for (i, brick) in self.bricks.iter().enumerate() {
            let mut cells = mask::NONE;
            let is_unsure = |cell: &usize| brick.log_odds.get(*cell, &self.codes) < below;
            mask::cells(&brick.occupied).filter(is_unsure).for_each(|cell| mask::set(&mut cells, cell));
            unsure.replace(self.table.position(i), &cells);
        }
        unsure
    }

    /// Advances to the next revision and answers what changed since the one before: `changed` is what
    /// [`OccupancyMap::insert`] answered.
    pub fn advance(&mut self, changed: &Changes) -> Delta<'static> {
        self.grid.advance_bricks(changed.bricks().iter().map(|(brick, _)| *brick))
    }

    /// Whether it has all the bricks that it may have.
    pub fn is_full(&self) -> bool {
        self.table.room() == 0
    }

    /// The state that log-odds stand for.
    pub fn state_of(log_odds: f32) -> State {
        if log_odds > 0.0 { State::Occupied } else { State::Free }
    }

    /// Makes room for the bricks that the table has numbered since.
    pub(crate) fn grow(&mut self) {
        let (have, want) = (self.bricks.len(), self.table.len());
        if want > self.bricks.capacity() {
            // By an eighth: twice as much would be the largest part of a map's memory.
            self.bricks.reserve_exact((want - have).max(have / 8));
        }
        self.bricks.resize_with(want, Brick::new);
    }

    /// Changes brick `i`, and has the grid show it.
    pub(crate) fn change_brick(
        &mut self,
        i: usize,
        changed: &mut Changed,
        change: impl FnOnce(&mut Brick, &mut Codes),
    ) {
        let brick = &mut self.bricks[i];
        let before = brick.shown();
        change(brick, &mut self.codes);
        self.show_brick(i, before, changed);
    }

    /// Has the grid show brick `i`, which it shows as it was `before`.
    pub(crate) fn show_brick(&mut self, i: usize, [known, occupied]: [Mask; 2], changed: &mut Changed) {
        let (position, brick) = (self.table.position(i), &self.bricks[i]);
        let extent: Mask = std::array::from_fn(|z| known[z] ^ brick.known[z]);
        let states: Mask = std::array::from_fn(|z| extent[z] | (occupied[z] ^ brick.occupied[z]));
        if states != mask::NONE {
            self.grid.set_cells(position, &states, &brick.known, &brick.occupied);
            changed.states.add((position, states));
            changed.extents.push((i, extent));
        }
        changed.unknown.extend((brick.known == mask::NONE).then_some(position));
    }

    /// Gives back the bricks of which nothing is known any more, and brings the frontier up to date with those that changed;
    /// answers the voxels whose state changed.
    pub(crate) fn conclude(&mut self, changed: Changed) -> Changes {
        let mut revise = self.beside(&changed.extents);
        if !changed.unknown.is_empty() {
            let positions: Vec<Voxel> = revise.into_iter().map(|i| self.table.position(i)).collect();
            changed.unknown.into_iter().for_each(|position| self.give_back(position));
            revise = positions.into_iter().filter_map(|position| self.table.find(position)).collect();
        }
        // A map that has become full, or has room again, has another frontier everywhere.
        match self.is_full() == self.full {
            true => self.update_frontier(&revise),
            false => self.update_all_of_the_frontier(),
        }
        changed.states
    }

    fn give_back(&mut self, position: Voxel) {
        if let Some(i) = self.table.remove(position) {
            self.frontier_len -= mask::count(&swap_remove(&mut self.bricks, i).frontier);
        }
    }
}

#[cfg(test)]
mod tests {
    use std::collections::BTreeSet;

    use proptest::prelude::*;

    use super::*;

    proptest! {
        /// After any scans: by a look at each voxel.
        #[test]
        fn unsure_is_what_is_occupied_with_less(
            ends in prop::collection::vec((-1.0..1.0, -1.0..1.0, -1.0..1.0), 1..60),
            below in 0.0..5.0_f32,
        ) {
            let mut map = OccupancyMap::new(MapConfig { grazing: crate::Grazing::None, ..MapConfig::default() }).unwrap();
            for end in &ends {
                map.insert([0.01; 3].into(), [nalgebra::Point3::from(<[f64; 3]>::from(*end))]);
            }
            let most = below.min(map.config().clamp_max);
            let unsure: BTreeSet<Voxel> =
                map.known().filter(|(_, log_odds)| *log_odds > 0.0 && *log_odds < most).map(|(voxel, _)| voxel).collect();
            prop_assert_eq!(map.unsure(below).iter().collect::<BTreeSet<_>>(), unsure);
            prop_assert!(map.unsure(0.0).is_empty());
        }
    }

    #[test]
    fn settings_that_make_no_sense_are_refused() {
        let refused = |config: MapConfig| OccupancyMap::new(config).map(|_| ()).unwrap_err();
        let good = MapConfig::default();
        for resolution in [0.0, -0.1, 1e-6, f64::NAN, f64::INFINITY] {
            assert!(
                matches!(refused(MapConfig { resolution, ..good }), ConfigError::Resolution { .. }),
                "{resolution}"
            );
        }
        for (hit, miss) in [(0.0, -0.4), (0.85, 0.0), (f32::NAN, -0.4), (f32::INFINITY, -0.4)] {
            assert!(matches!(refused(MapConfig { hit, miss, ..good }), ConfigError::Steps { .. }), "{hit} {miss}");
        }
        for (clamp_min, clamp_max) in [(1.0, 0.5), (f32::NAN, 1.0), (-1.0, f32::INFINITY)] {
            assert!(matches!(refused(MapConfig { clamp_min, clamp_max, ..good }), ConfigError::Clamp { .. }));
        }
        for metres in [-1.0, f64::NAN, f64::INFINITY] {
            let settings = [
                MapConfig { max_range: metres, ..good },
                MapConfig { free_no_return: metres, ..good },
                MapConfig { advance: metres, ..good },
            ];
            assert!(settings.into_iter().all(|config| matches!(refused(config), ConfigError::Length { .. })));
        }
        assert!(matches!(refused(MapConfig { max_bricks: usize::MAX, ..good }), ConfigError::Bricks(_)));
        assert!([good, MapConfig::octomap(0.05)].into_iter().all(|config| OccupancyMap::new(config).is_ok()));
    }
}
