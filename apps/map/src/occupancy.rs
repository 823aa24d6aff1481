//! The map: what is known of every voxel, as log-odds of being occupied (thesis 6.3.1; Hornung et al., *OctoMap*, 2013,
//! section 3.1).

use elk_geometry::bricks::{BRICK_CELLS, brick_of, cell_of, voxel_at};
use elk_geometry::delta::Delta;
use elk_geometry::mask::{self, Mask};
use elk_geometry::{Bounds, OccupancyGrid, State, Voxel};

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

/// How scans become log-odds.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct MapConfig {
    /// Edge of a voxel (m).
    pub resolution: f64,
    /// Added to a voxel in which a ray of the scan ended (log-odds, > 0).
    pub hit: f32,
    /// Added to a voxel that rays of the scan only passed through (log-odds, < 0).
    pub miss: f32,
    /// The smallest log-odds that a voxel can have; at most `clamp_max`.
    pub clamp_min: f32,
    /// The largest log-odds that a voxel can have.
    pub clamp_max: f32,
    /// Which passing rays do not count.
    pub grazing: Grazing,
    /// Farther points (m from the sensor) are no hits, and their rays free voxels only up to here; 0: no limit.
    pub max_range: f64,
    /// How far a ray without a return frees voxels (m); 0: not at all, as nothing is known of where it ended.
    pub free_no_return: f64,
    /// Bricks that the map may have (8³ voxels and about 3 kB each); what lies in others is left out.
    pub max_bricks: usize,
    /// The volume in which frontiers count; `None`: everywhere.
    pub bounds: Option<Bounds>,
}

impl Default for MapConfig {
    /// The thesis' and OctoMap's values: +0.85, −0.4, clamped to −2 … 3.5, voxels of 0.1 m.
    fn default() -> Self {
        Self {
            resolution: 0.1,
            hit: 0.85,
            miss: -0.4,
            clamp_min: -2.0,
            clamp_max: 3.5,
            grazing: Grazing::default(),
            max_range: 0.0,
            free_no_return: 0.0,
            max_bricks: 1 << 18,
            bounds: None,
        }
    }
}

impl MapConfig {
    /// How far a ray frees voxels of which the sensor says that it saw nothing up to `range` (m; 0: as far as there is
    /// anything).
    pub(crate) fn reach_without_return(&self, range: f64) -> f64 {
        let limits = [range, self.max_range].into_iter().filter(|limit| *limit > 0.0);
        limits.fold(self.free_no_return, f64::min)
    }
}

/// A brick of the map. A voxel that was ever updated is occupied if its log-odds are above 0, and free otherwise.
#[derive(Debug, Clone)]
pub(crate) struct Brick {
    pub log_odds: Box<[f32; BRICK_CELLS]>,
    /// Ever updated.
    pub known: Mask,
    pub occupied: Mask,
    /// Ever hit.
    pub ever_hit: Mask,
    pub frontier: Mask,
}

impl Brick {
    pub fn new() -> Self {
        Self {
            log_odds: Box::new([0.0; BRICK_CELLS]),
            known: mask::NONE,
            occupied: mask::NONE,
            ever_hit: mask::NONE,
            frontier: mask::NONE,
        }
    }
}

/// What the scan being inserted says of a brick.
#[derive(Debug, Clone, Copy, Default)]
pub(crate) struct Marks {
    pub hit: Mask,
    pub passed: Mask,
    pub touched: bool,
}

/// A log-odds occupancy map with its frontier.
#[derive(Debug, Clone)]
pub struct OccupancyMap {
    pub(crate) config: MapConfig,
    pub(crate) table: BrickTable,
    pub(crate) bricks: Vec<Brick>,
    pub(crate) marks: Vec<Marks>,
    /// Bricks that the scan being inserted has entered.
    pub(crate) touched: Vec<usize>,
    pub(crate) grid: OccupancyGrid,
    pub(crate) volume: Volume,
    pub(crate) frontier_len: usize,
    /// Whether the frontier is that of a full map.
    pub(crate) full: bool,
}

impl OccupancyMap {
    /// An unknown world.
    pub fn new(config: MapConfig) -> Self {
        Self {
            config,
            table: BrickTable::new(config.max_bricks),
            bricks: Vec::new(),
            marks: Vec::new(),
            touched: Vec::new(),
            grid: OccupancyGrid::new(config.resolution),
            volume: Volume::new(config.bounds, config.resolution),
            frontier_len: 0,
            full: false,
        }
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
        mask::has(&brick.known, cell).then(|| brick.log_odds[cell])
    }

    /// Every observed voxel with its log-odds, brick by brick.
    pub fn known(&self) -> impl Iterator<Item = (Voxel, f32)> + '_ {
        self.bricks.iter().enumerate().flat_map(|(i, brick)| {
            let position = self.table.position(i);
            mask::cells(&brick.known).map(move |cell| (voxel_at(position, cell), brick.log_odds[cell]))
        })
    }

    /// Advances to the next revision and answers what changed since the one before: `changed` is what
    /// [`OccupancyMap::insert`] answered.
    pub fn advance(&mut self, changed: &[Voxel]) -> Delta<'static> {
        self.grid.advance(changed)
    }

    /// Whether it has all the bricks that it may have.
    pub fn is_full(&self) -> bool {
        self.table.is_full()
    }

    /// The state that log-odds stand for.
    pub fn state_of(log_odds: f32) -> State {
        if log_odds > 0.0 { State::Occupied } else { State::Free }
    }

    /// Makes room for the bricks that the table has numbered since.
    pub(crate) fn grow(&mut self) {
        self.bricks.resize_with(self.table.len(), Brick::new);
        self.marks.resize(self.table.len(), Marks::default());
    }
}
