//! A map's successor: from its memory it is the same map, from a reader's copy as good a one as can be made of three values.

use elk_spatial::bricks::BRICK_CELLS;
use elk_spatial::map::{BrickStates, MapUpdate, UpdateError, room_for};
use elk_spatial::mask;
use elk_spatial::messages::{BrickMemory, MapMemory};
use elk_spatial::{State, Voxel};

use crate::occupancy::{Brick, MapConfig, OccupancyMap};

impl OccupancyMap {
    /// All that the map knows, `scan` being the last one in it.
    pub fn memory(&self, scan: u64) -> MapMemory {
        let bricks = self.bricks.iter().enumerate();
        let known = bricks.filter(|(_, brick)| brick.known != mask::NONE);
        MapMemory {
            revision: self.grid.revision(),
            scan,
            resolution: self.config.resolution,
            bricks: known.map(|(i, brick)| brick.remember(self.table.position(i))).collect(),
        }
    }

    /// The map that left this memory.
    ///
    /// # Errors
    /// Its voxels were not of this size, or it is larger than this one may be.
    pub fn from_memory(config: MapConfig, memory: &MapMemory) -> Result<Self, UpdateError> {
        room_for(memory.bricks.len(), config.max_bricks)?;
        let mut map = Self::new(config);
        for brick in &memory.bricks {
            map.put(brick.brick.map(i32::from).into(), Brick::recall(brick));
        }
        let states = map.bricks.iter().enumerate().map(|(i, brick)| brick.states(map.table.position(i))).collect();
        map.show(&MapUpdate {
            revision: memory.revision,
            since: 0,
            scan: memory.scan,
            resolution: memory.resolution,
            bricks: states,
        })?;
        Ok(map)
    }

    /// A map that has the states of a reader's copy.
    ///
    /// How sure the map was is lost; a voxel is as sure as if one scan had seen it, which is a map that every exploration
    /// begins with and copes with: what is seen from now on counts in full, and what the copy has wrong is soon forgotten.
    ///
    /// # Errors
    /// The copy's voxels are not of this size, or it is larger than this one may be.
    pub fn from_copy(config: MapConfig, copy: &MapUpdate) -> Result<Self, UpdateError> {
        room_for(copy.bricks.len(), config.max_bricks)?;
        let mut map = Self::new(config);
        for states in &copy.bricks {
            map.put(states.position(), Brick::seen_once(states, &config));
        }
        map.show(copy)?;
        Ok(map)
    }

    /// Calls itself `revision`, because readers may have one that is called so. They need the next one whole.
    pub fn skip_to(&mut self, revision: u64) -> Result<(), UpdateError> {
        let whole = MapUpdate { revision, ..self.grid.whole(0) };
        self.grid.apply(&whole).map(|_| ())
    }

    fn put(&mut self, position: Voxel, brick: Brick) {
        if let Some(i) = self.table.find_or_add(position) {
            self.grow();
            self.bricks[i] = brick;
        }
    }

    /// Shows readers these states, which are those of all bricks.
    fn show(&mut self, states: &MapUpdate) -> Result<(), UpdateError> {
        self.grid.apply(states)?;
        let all: Vec<usize> = (0..self.bricks.len()).collect();
        self.update_frontier(&all);
        Ok(())
    }
}

impl Brick {
    fn remember(&self, position: Voxel) -> BrickMemory {
        BrickMemory {
            // The map's voxels have 16-bit indices, so its bricks have shorter ones.
            brick: position.to_array().map(|c| c as i16),
            known: self.known,
            ever_hit: self.ever_hit,
            log_odds: mask::cells(&self.known).map(|cell| self.log_odds[cell]).collect(),
        }
    }

    fn recall(memory: &BrickMemory) -> Self {
        let mut brick = Self { ever_hit: memory.ever_hit, ..Self::new() };
        for (cell, log_odds) in mask::cells(&memory.known).zip(&memory.log_odds) {
            brick.know(cell, *log_odds);
        }
        brick
    }

    fn seen_once(states: &BrickStates, config: &MapConfig) -> Self {
        let mut brick = Self::new();
        for cell in 0..BRICK_CELLS {
            match states.state(cell) {
                State::Unknown => {}
                State::Free => brick.know(cell, config.miss.max(config.clamp_min)),
                State::Occupied => {
                    brick.know(cell, config.hit.min(config.clamp_max));
                    mask::set(&mut brick.ever_hit, cell);
                }
            }
        }
        brick
    }

    fn know(&mut self, cell: usize, log_odds: f32) {
        self.log_odds[cell] = log_odds;
        mask::set(&mut self.known, cell);
        if OccupancyMap::state_of(log_odds) == State::Occupied {
            mask::set(&mut self.occupied, cell);
        }
    }

    fn states(&self, position: Voxel) -> BrickStates {
        let mut cells = [State::Unknown; BRICK_CELLS];
        for cell in mask::cells(&self.known) {
            cells[cell] = OccupancyMap::state_of(self.log_odds[cell]);
        }
        BrickStates::pack(position, &cells)
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

    fn insert(map: &mut OccupancyMap, scans: &Scans) -> Vec<MapUpdate> {
        let scan = |(origin, points): &(Point3<f64>, Vec<Point3<f64>>)| {
            let changed = map.insert(*origin, points.iter().copied()).changed;
            map.advance(&changed, 0)
        };
        scans.iter().map(scan).collect()
    }

    proptest! {
        #![proptest_config(ProptestConfig::with_cases(64))]

        /// Whatever comes after it, a map from memory says what the map itself would have said.
        #[test]
        fn a_map_from_memory_is_the_same_map(before in scans(5), after in scans(5)) {
            let mut map = OccupancyMap::new(MapConfig::default());
            insert(&mut map, &before);
            let mut successor = OccupancyMap::from_memory(MapConfig::default(), &map.memory(9)).unwrap();
            prop_assert_eq!(successor.frontier_len(), map.frontier_len());
            prop_assert_eq!(successor.memory(9), map.memory(9));
            prop_assert_eq!(insert(&mut successor, &after), insert(&mut map, &after));
            prop_assert_eq!(successor.frontier_len(), map.frontier_len());
            for (voxel, log_odds) in map.known() {
                prop_assert_eq!(successor.log_odds(voxel), Some(log_odds));
            }
        }

        /// A map from a copy shows what the map showed, and goes on from its revision.
        #[test]
        fn a_map_from_a_copy_shows_the_same(before in scans(5), after in scans(3)) {
            let mut map = OccupancyMap::new(MapConfig::default());
            insert(&mut map, &before);
            let mut successor = OccupancyMap::from_copy(MapConfig::default(), &map.grid().whole(0)).unwrap();
            prop_assert_eq!(successor.frontier_len(), map.frontier_len());
            prop_assert_eq!(successor.grid().whole(0), map.grid().whole(0));
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
        let mut map = OccupancyMap::new(MapConfig::default());
        insert(&mut map, &vec![([0.05; 3].into(), vec![[0.95, 0.05, 0.05].into()])]);
        let mut reader = map.grid().clone();
        let mut successor = OccupancyMap::new(MapConfig::default());
        successor.skip_to(reader.revision()).unwrap();
        insert(&mut successor, &vec![([0.05; 3].into(), vec![[0.55, 0.05, 0.05].into()])]);
        reader.apply(&successor.grid().whole(0)).unwrap();
        assert_eq!((reader.revision(), reader.free(), reader.occupied()), (2, 5, 1));
    }

    #[test]
    fn voxels_of_another_size_are_refused() {
        let map = OccupancyMap::new(MapConfig::default());
        let finer = MapConfig { resolution: 0.05, ..MapConfig::default() };
        assert!(matches!(OccupancyMap::from_memory(finer, &map.memory(0)), Err(UpdateError::Resolution { .. })));
        assert!(matches!(OccupancyMap::from_copy(finer, &map.grid().whole(0)), Err(UpdateError::Resolution { .. })));
    }
}
