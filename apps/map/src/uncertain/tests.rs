use std::collections::{BTreeMap, BTreeSet};

use super::*;
use elk_geometry::State;
use elk_geometry::random::Random;
use proptest::prelude::*;

const RESOLUTION: f64 = 0.1;

fn map(config: MapConfig) -> OccupancyMap {
    OccupancyMap::new(config).unwrap()
}

fn insert(map: &mut OccupancyMap, origin: Point3<f64>, points: &[Point3<f64>], error: &DepthError) -> Insertion {
    map.insert_uncertain(origin, points.iter().copied(), ([], 0.0), error)
}

/// The same in the plainest way: sets of voxels, ray by ray, and a table of log-odds.
#[derive(Default)]
struct Reference {
    log_odds: BTreeMap<Voxel, f32>,
}

impl Reference {
    fn is(&self, voxel: Voxel, state: State) -> bool {
        self.log_odds.get(&voxel).map_or(State::Unknown, |one| OccupancyMap::state_of(*one)) == state
    }

    fn insert(&mut self, origin: Point3<f64>, points: &[Point3<f64>], error: &DepthError, config: &MapConfig) {
        let lattice = Lattice::new(config.resolution);
        let (mut passed, mut heard, mut near) = (BTreeSet::new(), BTreeMap::<Voxel, i64>::new(), BTreeSet::new());
        for point in points {
            let Some(measured) = error.of(origin, *point, config.resolution) else { continue };
            let certain = single(measured.certain_end());
            passed.extend(Walk::new(&lattice, single(origin), certain));
            let Some(likely) = measured.likely_end() else { continue };
            let mut is_behind = false;
            for voxel in Walk::new(&lattice, certain, single(likely)).chain([lattice.voxel(single(likely))]) {
                near.insert(voxel);
                if !is_behind {
                    let evidence = measured.evidence(voxel.to_array());
                    *heard.entry(voxel).or_default() += (evidence * 1024.0).round() as i64;
                    is_behind = evidence > 0.0 && self.is(voxel, State::Occupied);
                }
            }
        }
        let around = |voxel: Voxel| {
            let steps = (0..27).map(|n| Voxel::new(n % 3 - 1, n / 3 % 3 - 1, n / 9 - 1));
            steps.map(move |step| voxel + step)
        };
        let touched: BTreeSet<Voxel> = passed.iter().chain(heard.keys()).copied().collect();
        let was: BTreeSet<Voxel> = self.log_odds.keys().filter(|v| self.is(**v, State::Occupied)).copied().collect();
        for voxel in touched {
            let guarded = config.grazing == Grazing::Guard && was.contains(&voxel);
            let spared = guarded && around(voxel).any(|next| near.contains(&next));
            let missed = match (passed.contains(&voxel) && !spared, guarded) {
                (false, _) => 0.0,
                (true, true) => config.miss * 0.25,
                (true, false) => config.miss,
            };
            let sum = (heard.get(&voxel).copied().unwrap_or(0) as f64 / 1024.0) as f32;
            let step = if sum > 0.0 { sum.min(config.hit) } else { sum.max(config.miss).min(missed) };
            let before = self.log_odds.get(&voxel).copied();
            if step != 0.0 && (before.is_some() || step.abs() >= config.hit.min(-config.miss)) {
                let after = (before.unwrap_or(0.0) + step).clamp(config.clamp_min, config.clamp_max);
                self.log_odds.insert(voxel, after);
            }
        }
        let bricks: BTreeSet<Voxel> = passed.iter().chain(&near).map(|voxel| brick_of(*voxel)).collect();
        let is_hidden = |voxel: &Voxel| {
            let occupied = self.is(*voxel, State::Occupied) && bricks.contains(&brick_of(*voxel));
            occupied && !around(*voxel).any(|next| self.is(next, State::Free))
        };
        let hidden: Vec<Voxel> = self.log_odds.keys().filter(|voxel| is_hidden(voxel)).copied().collect();
        hidden.iter().for_each(|voxel| _ = self.log_odds.remove(voxel));
    }
}

fn place() -> impl Strategy<Value = Point3<f64>> {
    prop::array::uniform3(-1.2..1.2f64).prop_map(Point3::from)
}

fn axis() -> impl Strategy<Value = Vector3<f64>> {
    prop::array::uniform3(-1.0..1.0f64).prop_filter_map("no direction", |d| Vector3::from(d).try_normalize(1e-3))
}

fn scan() -> impl Strategy<Value = (Point3<f64>, Vector3<f64>, Vec<Point3<f64>>)> {
    (place(), axis(), prop::collection::vec(place(), 1..40))
}

fn all_of(map: &OccupancyMap) -> BTreeMap<Voxel, u32> {
    map.known().map(|(voxel, log_odds)| (voxel, log_odds.to_bits())).collect()
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(96))]

    /// What the masks and the sums by brick make of scans is what voxel by voxel comes out, to the bit; and the grid shows it.
    #[test]
    fn it_equals_a_plain_implementation(
        scans in prop::collection::vec(scan(), 1..7),
        inverse_depth_sigma in prop_oneof![1e-4..1e-2f64, 0.01..0.5f64],
        grazing in prop_oneof![Just(Grazing::None), Just(Grazing::Guard)],
    ) {
        let config = MapConfig { grazing, ..MapConfig::default() };
        let (mut map, mut plain) = (map(config), Reference::default());
        let mut reader = elk_geometry::OccupancyGrid::new(RESOLUTION);
        for (origin, axis, points) in scans {
            let error = DepthError { inverse_depth_sigma, axis };
            let seen = insert(&mut map, origin, &points, &error);
            plain.insert(origin, &points, &error, &config);
            prop_assert_eq!(reader.apply(&map.advance(&seen.changed)).unwrap(), seen.changed);
        }
        let expected: BTreeMap<Voxel, u32> = plain.log_odds.iter().map(|(voxel, one)| (*voxel, one.to_bits())).collect();
        prop_assert_eq!(all_of(&map), expected);
        let count = |state: State| plain.log_odds.keys().filter(|voxel| plain.is(**voxel, state)).count();
        prop_assert_eq!((reader.free(), reader.occupied()), (count(State::Free), count(State::Occupied)));
        let mut frontier = elk_geometry::FrontierSet::new(None);
        frontier.update(map.grid(), map.known().map(|(voxel, _)| voxel).collect::<Vec<_>>());
        prop_assert_eq!(map.frontier().collect::<BTreeSet<_>>(), frontier.iter().collect::<BTreeSet<_>>());
        let known = map.snapshot().bricks.iter().all(|brick| brick.known != mask::NONE);
        prop_assert!(known, "a brick of which nothing is known is given back");
    }

    #[test]
    fn the_order_of_points_does_not_matter(scans in prop::collection::vec(scan(), 1..4), inverse_depth_sigma in 0.001..0.3f64) {
        let (mut forward, mut backward) = (map(MapConfig::default()), map(MapConfig::default()));
        for (origin, axis, mut points) in scans {
            let error = DepthError { inverse_depth_sigma, axis };
            let there = insert(&mut forward, origin, &points, &error);
            points.reverse();
            prop_assert_eq!(there, insert(&mut backward, origin, &points, &error));
        }
        prop_assert_eq!(all_of(&forward), all_of(&backward));
    }
}

/// A wall at x = 2 and a bit, as a camera sees it that errs so much, from these places.
struct Wall {
    error: DepthError,
    random: Random,
}

const WALL_M: f64 = 2.04;
const BEFORE: i32 = 19;
const IN_IT: i32 = 20;

impl Wall {
    fn new(inverse_depth_sigma: f64) -> Self {
        Self { error: DepthError { inverse_depth_sigma, axis: Vector3::x() }, random: Random::new(7, 7) }
    }

    /// Points on it and their errors, a pixel each.
    fn points(&mut self, from: Point3<f64>) -> Vec<Point3<f64>> {
        let pixels = (-40..40).flat_map(|v| (-40..40).map(move |u| (f64::from(u) + 0.5, f64::from(v) + 0.5)));
        let (sigma, random) = (self.error.inverse_depth_sigma, &mut self.random);
        let measured = pixels.filter_map(|(u, v)| {
            let inverse = 1.0 / (WALL_M - from.x) + sigma * random.normal_pair().0;
            (inverse > 0.0).then(|| from + Vector3::new(1.0, u / 65.0, v / 65.0) / inverse)
        });
        measured.collect()
    }
}

/// Shares of the voxels in the middle of the wall: free before it, occupied in it, unknown behind.
fn shares(map: &OccupancyMap) -> [f64; 3] {
    let all: Vec<(i32, i32)> = (-4..4).flat_map(|y| (-4..4).map(move |z| (y, z))).collect();
    let share = |x: i32, state: State| {
        let right = all.iter().filter(|(y, z)| map.grid().state(Voxel::new(x, *y, *z)) == state).count();
        right as f64 / all.len() as f64
    };
    let behind = (1..8).map(|n| share(IN_IT + n, State::Unknown)).fold(1.0, f64::min);
    [share(BEFORE, State::Free), share(IN_IT, State::Occupied), behind]
}

/// The wall from 16 places.
fn seen_wall(inverse_depth_sigma: f64, is_believed_exact: bool) -> OccupancyMap {
    let (mut wall, mut map) = (Wall::new(inverse_depth_sigma), map(MapConfig::default()));
    for n in 0..16 {
        let from = Point3::new(0.21 + 0.05 * f64::from(n % 4), 0.03 * f64::from(n), 0.02);
        let points = wall.points(from);
        match is_believed_exact {
            true => map.insert(from, points),
            false => insert(&mut map, from, &points, &wall.error),
        };
    }
    map
}

/// An error of 0.7 voxels at the wall's distance; a map that takes depth as exact is two voxels thick and more.
#[test]
fn many_uncertain_rays_find_a_surface_more_precisely_than_one() {
    let [before, within, behind] = shares(&seen_wall(0.02, false));
    assert!(before >= 0.97 && within >= 0.97 && behind >= 0.97, "{before} {within} {behind}");
    let [before, _, behind] = shares(&seen_wall(0.02, true));
    assert!(before < 0.1 && behind < 0.5, "what the model is needed for: {before} {behind}");
}

#[test]
fn nearly_exact_depth_is_as_good_as_exact() {
    assert_eq!((shares(&seen_wall(1e-4, false)), shares(&seen_wall(1e-4, true))), ([1.0; 3], [1.0; 3]));
}

#[test]
fn from_far_away_only_what_is_certain_is_free() {
    let mut map = map(MapConfig::default());
    let (error, origin) = (DepthError { inverse_depth_sigma: 0.1, axis: Vector3::x() }, Point3::new(0.05, 0.05, 0.05));
    insert(&mut map, origin, &[Point3::new(4.05, 0.05, 0.05)], &error);
    // 1 / (1/4 + 0.4) = 1.54 m
    assert_eq!((map.grid().free(), map.grid().occupied()), (15, 0));
    assert_eq!(map.grid().state(Voxel::new(14, 0, 0)), State::Free);
}

/// One scan of a far wall is not sure enough, and three of the same are not either: each has to be, by itself.
#[test]
fn what_no_scan_is_sure_of_is_not_known() {
    let mut map = map(MapConfig::default());
    let (error, origin) = (DepthError { inverse_depth_sigma: 0.02, axis: Vector3::x() }, Point3::new(0.05, 0.05, 0.05));
    for _ in 0..3 {
        insert(&mut map, origin, &[Point3::new(3.05, 0.05, 0.05)], &error);
    }
    assert_eq!((map.grid().occupied(), map.grid().state(Voxel::new(30, 0, 0))), (0, State::Unknown));
    insert(&mut map, origin, &[Point3::new(3.05, 0.05, 0.05); 40], &error);
    assert_eq!(map.grid().state(Voxel::new(30, 0, 0)), State::Occupied);
}

/// A thin wall between two rooms: what is seen of one says nothing of the other.
#[test]
fn a_surface_hides_what_is_behind_it() {
    let (mut wall, mut map) = (Wall::new(0.02), map(MapConfig::default()));
    let there = Point3::new(4.0, 0.0, 0.02);
    let beyond = DepthError { axis: -Vector3::x(), ..wall.error };
    for _ in 0..8 {
        let here = Point3::new(0.21, 0.0, 0.02);
        let points = wall.points(here);
        insert(&mut map, here, &points, &wall.error);
        // From behind, the wall's other side is at 2.14 m.
        let points = (-40..40)
            .flat_map(|v| (-40..40).map(move |u| Vector3::new(-1.0, f64::from(u) / 65.0, f64::from(v) / 65.0)));
        let points: Vec<_> = points.map(|way| there + way * 1.86).collect();
        insert(&mut map, there, &points, &beyond);
    }
    for x in [23, 24, 26] {
        let free = (-3..3).all(|y| map.grid().state(Voxel::new(x, y, 0)) == State::Free);
        assert!(free, "{x}");
    }
    assert_eq!(map.grid().state(Voxel::new(IN_IT, 0, 0)), State::Occupied);
}

#[test]
fn what_is_no_point_is_dropped_and_counted() {
    let mut map = map(MapConfig { max_range: 5.0, ..MapConfig::default() });
    let (error, origin) = (DepthError { inverse_depth_sigma: 0.02, axis: Vector3::x() }, Point3::new(0.05, 0.05, 0.05));
    let points = [
        [f64::NAN, 0.0, 0.0],
        [f64::INFINITY, 0.0, 0.0],
        [0.05; 3],
        [-1.0, 0.05, 0.05],
        [9.0, 0.05, 0.05],
        [4e3, 0.0, 0.0],
    ];
    let seen = insert(&mut map, origin, &points.map(Point3::from), &error);
    assert_eq!((seen.dropped, seen.cut), (Dropped { invalid: 4, ..Dropped::default() }, 2));
    assert_eq!(map.grid().occupied(), 0);
    let nowhere = insert(&mut map, Point3::new(1e9, 0.0, 0.0), &points.map(Point3::from), &error);
    assert_eq!((nowhere.dropped.out_of_range, nowhere.changed.len()), (6, 0));
}

#[test]
fn no_more_bricks_come_into_being_than_there_is_room_for() {
    let config = MapConfig { max_bricks: 3, ..MapConfig::default() };
    let mut map = map(config);
    let (error, origin) = (DepthError { inverse_depth_sigma: 1e-4, axis: Vector3::x() }, Point3::new(0.05, 0.05, 0.05));
    let points: Vec<_> = (0..100).map(|i| Point3::new(8.0, f64::from(i) * 0.1 - 5.0, 0.05)).collect();
    let seen = insert(&mut map, origin, &points, &error);
    assert_eq!((seen.dropped.no_room, map.snapshot().bricks.len()), (100, 3));
    assert!(OccupancyMap::restore(config, &map.snapshot()).is_ok());
}

/// What the sensor did not see up to its range is as free as of any sensor.
#[test]
fn a_ray_without_a_return_frees_as_far_as_it_is_believed() {
    let mut map = map(MapConfig { resolution: 1.0, free_no_return: 5.0, ..MapConfig::default() });
    let error = DepthError { inverse_depth_sigma: 0.02, axis: Vector3::x() };
    map.insert_uncertain(Point3::new(0.5, 0.5, 0.5), [], ([Vector3::x()], 2.0), &error);
    assert_eq!((map.grid().free(), map.grid().occupied()), (2, 0));
}
