//! What is done to a map on request, beside scans: a box is forgotten, everything fades, another map is taken in.
//!
//! Each answers the voxels whose state changed, for [`OccupancyMap::advance`], as [`OccupancyMap::insert`] does; grid and
//! frontier are kept up with it. A brick of which nothing is known any more is given back, by the map and, once they have heard
//! of that, by its copies.

use elk_geometry::delta::Changes;
use elk_geometry::mask::{self, Mask};
use elk_geometry::voxel::reach_m;
use elk_geometry::{Bounds, Voxel};

use crate::log_odds::Codes;
use crate::occupancy::{Brick, Changed, OccupancyMap};
use crate::snapshot::RestoreError;
use crate::volume::Volume;

impl OccupancyMap {
    /// Forgets what is known of the voxels whose centres lie in a box (m, world): they are unknown, as if never seen. Costs by the
    /// bricks of the box, or by those of the map where these are fewer.
    pub fn clear_box(&mut self, bounds: Bounds) -> Changes {
        let reach = reach_m(self.config.resolution);
        // Where there is no map there is nothing to forget; a box of no numbers holds nothing.
        let within =
            Bounds { min: bounds.min.map(|c| c.clamp(-reach, reach)), max: bounds.max.map(|c| c.clamp(-reach, reach)) };
        if within.min.iter().chain(within.max.iter()).any(|c| c.is_nan()) {
            return Changes::default();
        }
        let volume = Volume::new(Some(within), self.config.resolution);
        self.edit(self.bricks_in(&volume), |position, brick, codes| brick.forget(&volume.mask(position), codes))
    }

    /// The bricks that have voxels in a volume.
    fn bricks_in(&self, volume: &Volume) -> Vec<Voxel> {
        let all = (0..self.table.len()).map(|i| self.table.position(i));
        let Some([x, y, z]) = volume.bricks() else { return all.collect() };
        let length = |[from, to]: [i32; 2]| (to - from).max(0) as usize;
        if [x, y, z].map(length).into_iter().product::<usize>() > self.table.len() {
            let is_in = |at: &Voxel| at.to_array().iter().zip([x, y, z]).all(|(c, [from, to])| (from..to).contains(c));
            return all.filter(is_in).collect();
        }
        let columns = (x[0]..x[1]).flat_map(|x| (y[0]..y[1]).map(move |y| (x, y)));
        let places = columns.flat_map(|(x, y)| (z[0]..z[1]).map(move |z| Voxel::new(x, y, z)));
        places.filter(|position| self.table.find(*position).is_some()).collect()
    }

    /// Brings all log-odds nearer to 0 by `step` (> 0): a voxel that comes to 0 is unknown again. What is seen once more is
    /// refreshed by that; what is not fades. Costs by all that is known, as all of it changes.
    pub fn decay(&mut self, step: f32) -> Changes {
        if step.is_nan() || step <= 0.0 {
            return Changes::default();
        }
        let config = self.config;
        let all = (0..self.table.len()).map(|i| self.table.position(i)).collect();
        self.edit(all, |_, brick, codes| {
            let mut faded = mask::NONE;
            for cell in mask::cells(&{ brick.known }) {
                let before = brick.log_odds.get(cell, codes);
                let log_odds = before - before.clamp(-step, step);
                brick.know(cell, log_odds, &config, codes);
                if log_odds == 0.0 {
                    mask::set(&mut faded, cell);
                }
            }
            brick.forget(&faded, codes);
        })
    }

    /// Takes in what another map of the same voxels knows, as if what it saw had been seen here as well: log-odds add up, within
    /// what this map allows. Costs by what the other one knows.
    ///
    /// # Errors
    /// Its voxels are not of this size, or there is no room for its bricks; nothing is taken in then.
    pub fn merge(&mut self, other: &OccupancyMap) -> Result<Changes, RestoreError> {
        let mut theirs: Vec<Voxel> = (0..other.table.len()).map(|i| other.table.position(i)).collect();
        theirs.sort_unstable();
        let new = theirs.iter().filter(|position| self.table.find(**position).is_none()).count();
        self.config.see_whether_it_fits(self.table.len() + new, other.config.resolution)?;
        for position in &theirs {
            self.table.find_or_add(*position);
        }
        self.grow();
        let config = self.config;
        Ok(self.edit(theirs, |position, brick, codes| {
            let Some(theirs) = other.table.find(position).map(|i| &other.bricks[i]) else { return };
            for cell in mask::cells(&theirs.known) {
                let sum = brick.log_odds.get(cell, codes) + theirs.log_odds.get(cell, &other.codes);
                brick.know(cell, sum.clamp(config.clamp_min, config.clamp_max), &config, codes);
            }
            brick.ever_hit = mask::or(&brick.ever_hit, &theirs.ever_hit);
        }))
    }

    /// Changes these bricks one by one.
    fn edit(&mut self, mut bricks: Vec<Voxel>, change: impl Fn(Voxel, &mut Brick, &mut Codes)) -> Changes {
        bricks.sort_unstable();
        let mut changed = Changed::default();
        for position in bricks {
            if let Some(i) = self.table.find(position) {
                self.change_brick(i, &mut changed, |brick, codes| change(position, brick, codes));
            }
        }
        self.conclude(changed)
    }
}

impl Brick {
    /// Knows no more of these cells than if they had never been seen.
    pub(crate) fn forget(&mut self, cells: &Mask, codes: &mut Codes) {
        for cell in mask::cells(&std::array::from_fn(|z| cells[z] & self.known[z])) {
            self.log_odds.set(cell, 0.0, codes);
        }
        for set in [&mut self.known, &mut self.occupied, &mut self.ever_hit, &mut self.at_min, &mut self.at_max] {
            *set = std::array::from_fn(|z| set[z] & !cells[z]);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::occupancy::MapConfig;
    use elk_geometry::bricks::{BRICK_CELLS, brick_of};
    use elk_geometry::voxel::FACES;
    use elk_geometry::{FrontierSet, State};
    use nalgebra::Point3;
    use proptest::prelude::*;
    use std::collections::{BTreeMap, BTreeSet};

    type Scans = Vec<(Point3<f64>, Vec<Point3<f64>>)>;

    fn point() -> impl Strategy<Value = Point3<f64>> {
        prop::array::uniform3(-1.5..1.5f64).prop_map(Point3::from)
    }

    fn scans() -> impl Strategy<Value = Scans> {
        prop::collection::vec((point(), prop::collection::vec(point(), 1..30)), 1..4)
    }

    #[derive(Debug, Clone)]
    enum Edit {
        Scan(Point3<f64>, Vec<Point3<f64>>),
        Clear(Bounds),
        Decay(f32),
        Merge(Scans),
    }

    fn edit() -> impl Strategy<Value = Edit> {
        let side = || prop::array::uniform3(0.1..4.0f64).prop_map(nalgebra::Vector3::from);
        prop_oneof![
            (point(), prop::collection::vec(point(), 1..30)).prop_map(|(origin, points)| Edit::Scan(origin, points)),
            (point(), side()).prop_map(|(mid, dim)| Edit::Clear(Bounds::from_mid_dim(mid, dim))),
            prop_oneof![0.05..1.0f32, Just(10.0)].prop_map(Edit::Decay),
            scans().prop_map(Edit::Merge),
        ]
    }

    fn map_of(scans: &Scans) -> OccupancyMap {
        let mut map = OccupancyMap::new(MapConfig::default()).unwrap();
        see(&mut map, scans);
        map
    }

    fn see(map: &mut OccupancyMap, scans: &Scans) {
        for (origin, points) in scans {
            let changed = map.insert(*origin, points.iter().copied()).changed;
            map.advance(&changed);
        }
    }

    fn known(map: &OccupancyMap) -> BTreeMap<Voxel, f32> {
        map.known().collect()
    }

    /// The sets of every brick are what its log-odds say.
    fn assert_sets(map: &OccupancyMap) {
        let MapConfig { clamp_min, clamp_max, .. } = *map.config();
        for brick in &map.bricks {
            let of = |is_in: &dyn Fn(f32) -> bool| {
                let mut set = mask::NONE;
                mask::cells(&brick.known)
                    .filter(|cell| is_in(brick.log_odds.get(*cell, &map.codes)))
                    .for_each(|cell| mask::set(&mut set, cell));
                set
            };
            assert_eq!(brick.occupied, of(&|log_odds| log_odds > 0.0));
            assert_eq!(brick.at_min, of(&|log_odds| log_odds == clamp_min));
            assert_eq!(brick.at_max, of(&|log_odds| log_odds == clamp_max));
            let unknown = (0..BRICK_CELLS).filter(|cell| !mask::has(&brick.known, *cell));
            assert!(
                unknown
                    .into_iter()
                    .all(|cell| brick.log_odds.get(cell, &map.codes) == 0.0 && !mask::has(&brick.ever_hit, cell))
            );
        }
    }

    /// It has the bricks in which something is known, in the order of its grid, each beside its neighbours, and room for as many as
    /// it may still have.
    fn assert_bricks(map: &OccupancyMap) {
        let known: BTreeSet<Voxel> = map.known().map(|(voxel, _)| brick_of(voxel)).collect();
        let own: Vec<Voxel> = (0..map.table.len()).map(|i| map.table.position(i)).collect();
        assert_eq!(
            (own.iter().copied().collect::<BTreeSet<_>>(), own.len(), map.bricks.len()),
            (known, own.len(), own.len())
        );
        assert_eq!(map.grid().bricks().iter().map(|(brick, _)| brick).collect::<Vec<_>>(), own);
        for (i, position) in own.iter().enumerate() {
            assert_eq!(map.table.find(*position), Some(i));
            let beside = |face: usize| own.iter().position(|other| *other == *position + FACES[face]);
            assert!((0..6).all(|face| map.table.beyond(i, face) == beside(face)));
        }
        assert_eq!(map.is_full(), own.len() == map.config().max_bricks);
        assert!(map.bricks.capacity() <= own.len() + own.len() / 4 + 5);
    }

    /// Sets, grid, frontier and copy are what the log-odds say, looked at anew; `reader` is a copy of before, `changed` what it
    /// is told.
    fn assert_in_step(map: &mut OccupancyMap, reader: &mut elk_geometry::OccupancyGrid, changed: &Changes) {
        assert_sets(map);
        assert_bricks(map);
        reader.apply(&map.advance(changed)).unwrap();
        let states = |grid: &elk_geometry::OccupancyGrid| -> BTreeMap<Voxel, State> {
            grid.bricks().voxels().filter(|(_, state)| *state != State::Unknown).collect()
        };
        let right: BTreeMap<Voxel, bool> = map.known().map(|(v, log_odds)| (v, log_odds > 0.0)).collect();
        let shown: BTreeMap<Voxel, bool> =
            states(map.grid()).into_iter().map(|(v, state)| (v, state == State::Occupied)).collect();
        assert_eq!(shown, right);
        assert_eq!(states(reader), states(map.grid()));
        assert_eq!(reader.bricks().len(), map.grid().bricks().len());
        let occupied = right.values().filter(|occupied| **occupied).count();
        assert_eq!((map.grid().occupied(), map.grid().free()), (occupied, right.len() - occupied));
        let free: Vec<Voxel> = right.iter().filter(|(_, occupied)| !**occupied).map(|(v, _)| *v).collect();
        let mut all = FrontierSet::new(map.config().bounds);
        all.set_full(map.is_full(), map.grid());
        all.update(map.grid(), &free);
        assert_eq!(map.frontier().collect::<BTreeSet<_>>(), all.iter().collect::<BTreeSet<_>>());
        assert_eq!(map.frontier_len(), all.len());
    }

    proptest! {
        #![proptest_config(ProptestConfig::with_cases(24))]

        #[test]
        fn a_cleared_box_is_unknown_and_nothing_else_is(scans in scans(), after in scans(), mid in point(), dim in 0.1..3.0f64) {
            let mut map = map_of(&scans);
            let (before, mut reader) = (known(&map), map.grid().clone());
            let bounds = Bounds::from_mid_dim(mid, nalgebra::Vector3::new(dim, 0.7, 1.1));
            let changed = map.clear_box(bounds);
            let left: BTreeMap<Voxel, f32> = before.into_iter().filter(|(v, _)| !bounds.contains(v.center(0.1))).collect();
            prop_assert_eq!(known(&map), left);
            assert_in_step(&mut map, &mut reader, &changed);
            // What is seen again there is as if seen for the first time.
            let mut restored = OccupancyMap::restore(MapConfig::default(), &map.snapshot()).unwrap();
            see(&mut map, &after);
            see(&mut restored, &after);
            prop_assert_eq!(known(&map), known(&restored));
        }

        /// Whatever is done to it, a map is what it would be of the voxels that survived, in as much room.
        #[test]
        fn edits_in_any_order_leave_what_survives(edits in prop::collection::vec(edit(), 1..12), max_bricks in 20..90usize) {
            let mut map = OccupancyMap::new(MapConfig { max_bricks, ..MapConfig::default() }).unwrap();
            let (mut reader, mut survives) = (map.grid().clone(), BTreeMap::new());
            for edit in edits {
                let changed = match edit {
                    Edit::Scan(origin, points) => {
                        let changed = map.insert(origin, points).changed;
                        survives = known(&map);
                        changed
                    }
                    Edit::Clear(bounds) => {
                        survives.retain(|voxel, _| !bounds.contains(voxel.center(0.1)));
                        map.clear_box(bounds)
                    }
                    Edit::Decay(step) => {
                        survives.values_mut().for_each(|l| *l -= l.clamp(-step, step));
                        survives.retain(|_, l| *l != 0.0);
                        map.decay(step)
                    }
                    Edit::Merge(scans) => match map.merge(&map_of(&scans)) {
                        Ok(changed) => {
                            for (voxel, l) in known(&map_of(&scans)) {
                                let own = survives.entry(voxel).or_insert(0.0);
                                *own = (*own + l).clamp(-2.0, 3.5);
                            }
                            changed
                        }
                        Err(error) => {
                            let bricks: BTreeSet<Voxel> =
                                survives.keys().copied().chain(known(&map_of(&scans)).into_keys()).map(brick_of).collect();
                            prop_assert_eq!(error, RestoreError::TooMany { bricks: bricks.len(), most: max_bricks });
                            Changes::default()
                        }
                    },
                };
                prop_assert_eq!(&known(&map), &survives);
                assert_in_step(&mut map, &mut reader, &changed);
            }
        }

        #[test]
        fn what_fades_comes_nearer_to_unknown(scans in scans(), step in 0.01..1.5f32) {
            let mut map = map_of(&scans);
            let (before, mut reader) = (known(&map), map.grid().clone());
            let changed = map.decay(step);
            let faded = |log_odds: f32| log_odds - log_odds.clamp(-step, step);
            let right: BTreeMap<Voxel, f32> =
                before.into_iter().map(|(v, l)| (v, faded(l))).filter(|(_, l)| *l != 0.0).collect();
            prop_assert_eq!(known(&map), right);
            assert_in_step(&mut map, &mut reader, &changed);
            let changed = map.decay(10.0);
            map.advance(&changed);
            prop_assert_eq!((map.grid().free(), map.grid().occupied(), map.frontier_len()), (0, 0, 0));
        }

        #[test]
        fn of_two_maps_each_takes_in_the_other_and_knows_the_same(one in scans(), other in scans(), after in scans()) {
            let maps = [map_of(&one), map_of(&other)];
            let [mut a, mut b] = maps.clone();
            let mut reader = a.grid().clone();
            let changed = a.merge(&maps[1]).unwrap();
            assert_in_step(&mut a, &mut reader, &changed);
            b.merge(&maps[0]).unwrap();
            prop_assert_eq!(known(&a), known(&b));
            let sum = |v: &Voxel| maps.iter().filter_map(|map| map.log_odds(*v)).sum::<f32>().clamp(-2.0, 3.5);
            for (voxel, log_odds) in known(&a) {
                prop_assert!((log_odds - sum(&voxel)).abs() < 1e-6);
            }
            let all: BTreeSet<Voxel> = maps.iter().flat_map(|map| known(map).into_keys()).collect();
            prop_assert_eq!(known(&a).into_keys().collect::<BTreeSet<_>>(), all);
            [&mut a, &mut b].into_iter().for_each(|map| see(map, &after));
            prop_assert_eq!(known(&a), known(&b), "what was ever hit is the same");
        }
    }

    /// Found by their places in a box that has fewer than the map, else by looking at all of the map's.
    #[test]
    fn the_bricks_of_a_box_are_those_that_have_voxels_in_it() {
        let map = map_of(&vec![([0.05; 3].into(), vec![[9.95, 0.05, 0.05].into(), [0.05, -7.0, 0.05].into()])]);
        for (dim, few) in [(0.5, true), (2.0, false), (30.0, false)] {
            let volume = Volume::new(
                Some(Bounds::from_mid_dim(Point3::new(3.0, 0.0, 0.0), nalgebra::Vector3::new(dim, dim, 0.5))),
                0.1,
            );
            let places: i32 = volume.bricks().unwrap().iter().map(|[from, to]| to - from).product();
            assert_eq!((places as usize) < map.table.len(), few);
            let all = (0..map.table.len()).map(|i| map.table.position(i));
            let right: BTreeSet<Voxel> = all.filter(|position| volume.mask(*position) != mask::NONE).collect();
            let found: BTreeSet<Voxel> = map.bricks_in(&volume).into_iter().collect();
            assert!(!found.is_empty() && found == right, "{dim}: {found:?}, {right:?}");
        }
    }

    #[test]
    fn what_makes_no_sense_changes_nothing() {
        let mut map = map_of(&vec![([0.05; 3].into(), vec![[3.95, 0.05, 0.05].into()])]);
        let before = map.snapshot();
        let no_number = Bounds { min: Point3::new(f64::NAN, 0.0, 0.0), max: Point3::new(1.0, 1.0, 1.0) };
        let none = Changes::default;
        assert_eq!((map.clear_box(no_number), map.decay(f32::NAN), map.decay(-1.0)), (none(), none(), none()));
        let inside_out = Bounds { min: Point3::new(1.0, 1.0, 1.0), max: Point3::origin() };
        assert_eq!(map.clear_box(inside_out), none());
        let finer = OccupancyMap::new(MapConfig { resolution: 0.05, ..MapConfig::default() }).unwrap();
        assert_eq!(map.merge(&finer), Err(RestoreError::Resolution { saved: 0.05, own: 0.1 }));
        let mut small = OccupancyMap::new(MapConfig { max_bricks: 2, ..MapConfig::default() }).unwrap();
        assert_eq!(small.merge(&map), Err(RestoreError::TooMany { bricks: 5, most: 2 }));
        assert_eq!((map.snapshot(), small.snapshot().bricks), (before, vec![]));
    }

    #[test]
    fn everything_is_a_box_too() {
        let mut map = map_of(&vec![([0.05; 3].into(), vec![[3.95, 0.05, 0.05].into()])]);
        let [min, max] = [f64::NEG_INFINITY, f64::INFINITY].map(|c| Point3::new(c, c, c));
        assert_eq!(map.clear_box(Bounds { min, max }).len(), 40);
        assert_eq!((map.grid().free(), map.grid().occupied(), map.frontier_len()), (0, 0, 0));
    }
}
