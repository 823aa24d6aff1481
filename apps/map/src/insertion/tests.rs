use std::collections::BTreeSet;

use super::*;
use crate::walk::Walk;
use elk_geometry::State;
use proptest::prelude::*;

fn point() -> impl Strategy<Value = Point3<f64>> {
    prop::array::uniform3(-2.0..2.0f64).prop_map(Point3::from)
}

fn map(grazing: Grazing) -> OccupancyMap {
    OccupancyMap::new(MapConfig { resolution: 1.0, grazing, ..MapConfig::default() }).unwrap()
}

fn at(x: f64, y: f64) -> Point3<f64> {
    Point3::new(x, y, 0.5)
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(64))]
    #[test]
    fn the_order_of_points_does_not_matter(origin in point(), points in prop::collection::vec(point(), 1..40), twice in any::<bool>()) {
        let (mut forward, mut backward) = (OccupancyMap::new(MapConfig::default()).unwrap(), OccupancyMap::new(MapConfig::default()).unwrap());
        for _ in 0..1 + usize::from(twice) {
            let there = forward.insert(origin, points.iter().copied());
            let back = backward.insert(origin, points.iter().rev().copied());
            prop_assert_eq!(there, back);
        }
        let voxels = |m: &OccupancyMap| {
            let mut all: Vec<_> = m.known().collect();
            all.sort_by_key(|(v, _)| *v);
            all
        };
        prop_assert_eq!(voxels(&forward), voxels(&backward));
    }

    /// What the masks make of a scan is what one set of hits and one of misses, voxel by voxel, make of it.
    #[test]
    fn masks_equal_sets(
        origin in prop::array::uniform3(coordinate()),
        points in prop::collection::vec(prop::array::uniform3(coordinate()), 1..60),
        resolution in prop_oneof![Just(0.1), Just(0.05), 0.02..0.3f64],
        max_range in prop_oneof![Just(0.0), 0.5..5.0f64],
    ) {
        let config = MapConfig { max_range, ..MapConfig::octomap(resolution) };
        let mut map = OccupancyMap::new(config).unwrap();
        let of = |p: Point| Point3::from(p.map(f64::from));
        let insertion = map.insert(of(origin), points.iter().copied().map(of));
        let (hits, misses) = by_sets(&config, origin, &points);
        let all: BTreeSet<Voxel> = map.known().map(|(voxel, _)| voxel).collect();
        prop_assert_eq!(all, hits.union(&misses).copied().collect::<BTreeSet<Voxel>>());
        prop_assert_eq!(insertion.changed.len(), hits.union(&misses).count());
        for v in &misses {
            let expected = if hits.contains(v) { config.hit } else { config.miss };
            prop_assert_eq!(map.log_odds(*v), Some(expected));
        }
        prop_assert_eq!(map.grid().occupied(), hits.len());
        prop_assert_eq!(map.grid().free(), misses.difference(&hits).count());
    }
}

/// Regression: a ray from the border of its voxel, where rounding put the sensor into the next one.
#[test]
fn a_ray_from_a_border_passes_the_voxel_that_it_starts_in() {
    let mut map = OccupancyMap::new(MapConfig::octomap(0.1)).unwrap();
    let (origin, point) = ([2.0, 1.5, 2.3], [1.9560462, 0.0, -0.05]);
    map.insert(Point3::from(origin.map(f64::from)), [Point3::from(point.map(f64::from))]);
    let (_, misses) = by_sets(map.config(), origin, &[point]);
    assert_eq!(misses.iter().find(|voxel| map.log_odds(**voxel).is_none()), None);
    assert_eq!(map.known().count(), misses.len() + 1);
}

/// Coordinates of all kinds: anywhere, on the borders of voxels, in their middles, far away.
fn coordinate() -> impl Strategy<Value = f32> {
    prop_oneof![
        4 => -3.0..3.0f32,
        2 => (-30..30i32).prop_map(|k| k as f32 * 0.1),
        2 => (-30..30i32).prop_map(|k| k as f32 * 0.25),
        1 => (-30..30i32).prop_map(|k| k as f32 * 0.1 + 0.05),
        1 => -60.0..60.0f32,
    ]
}

/// The voxels that a scan hits, and those that its rays pass, as OctoMap's `computeUpdate` finds them: ray by ray.
fn by_sets(config: &MapConfig, origin: Point, points: &[Point]) -> (BTreeSet<Voxel>, BTreeSet<Voxel>) {
    let lattice = Lattice::new(config.resolution);
    let (mut hits, mut misses) = (BTreeSet::new(), BTreeSet::new());
    for &point in points {
        let [x, y, z]: [f32; 3] = std::array::from_fn(|i| point[i] - origin[i]);
        let range = f64::from(x * x + y * y + z * z).sqrt();
        let mut end = point;
        if range == 0.0 {
            continue;
        }
        if config.max_range > 0.0 && range > config.max_range {
            let [x, y, z] = [x, y, z].map(|c| c / range as f32 * config.max_range as f32);
            end = [origin[0] + x, origin[1] + y, origin[2] + z];
        } else {
            hits.insert(lattice.voxel(point));
        }
        misses.extend(Walk::new(&lattice, origin, end));
    }
    (hits, misses)
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(64))]
    /// A scan as a camera takes it, whose rays mostly go the way of the one before: still what the rays one by one make of it.
    #[test]
    fn what_neighbours_share_is_marked(origin in prop::array::uniform3(coordinate()), yaw in -3.2..3.2f32, wall in 0.3..12.0f32) {
        let config = MapConfig::octomap(0.05);
        let points: Vec<Point> = (0..900).map(|i| {
            let (right, up) = ((i % 30) as f32 * 0.03 - 0.45, (i / 30) as f32 * 0.03 - 0.45);
            let range = if i % 7 == 0 { 0.6 * wall } else { wall };
            let way = [yaw.cos() - right * yaw.sin(), yaw.sin() + right * yaw.cos(), up];
            std::array::from_fn(|axis| origin[axis] + way[axis] * range)
        }).collect();
        let mut map = OccupancyMap::new(config).unwrap();
        let of = |p: Point| Point3::from(p.map(f64::from));
        map.insert(of(origin), points.iter().copied().map(of));
        let (hits, misses) = by_sets(&config, origin, &points);
        let state = |occupied: bool| map.known().filter(move |(_, l)| (*l > 0.0) == occupied).map(|(v, _)| v).collect::<BTreeSet<Voxel>>();
        prop_assert_eq!(state(false), misses.difference(&hits).copied().collect::<BTreeSet<Voxel>>());
        prop_assert_eq!(state(true), hits);
    }

    /// With one ray to each end voxel, points are as good as the middles of their voxels; and of those every ray is walked.
    #[test]
    fn end_voxels_stand_for_their_points(origin in point(), points in prop::collection::vec(point(), 1..60)) {
        let of_voxels = MapConfig { integration: Integration::EndVoxels, ..MapConfig::octomap(0.1) };
        let lattice = Lattice::new(0.1);
        let middles = points.iter().map(|p| Point3::from(lattice.center(lattice.voxel(single(*p))).map(f64::from)));
        let (mut map, mut of_middles) = (OccupancyMap::new(of_voxels).unwrap(), OccupancyMap::new(MapConfig::octomap(0.1)).unwrap());
        let there = map.insert(origin, points.iter().copied());
        let back = of_middles.insert(origin, middles);
        prop_assert_eq!(there.changed, back.changed);
        prop_assert!(map.known().eq(of_middles.known()));
    }
}

#[test]
fn a_scan_hits_once_and_frees_up_to_the_hit() {
    let mut map = map(Grazing::None);
    let seen = map.insert(at(0.5, 0.5), vec![at(3.5, 0.5); 5]);
    assert_eq!(seen.changed.len(), 4);
    assert_eq!(map.log_odds(Voxel::new(3, 0, 0)), Some(0.85));
    assert_eq!(map.log_odds(Voxel::new(0, 0, 0)), Some(-0.4));
    assert_eq!(map.log_odds(Voxel::new(4, 0, 0)), None);
}

#[test]
fn a_wall_on_the_lattice_lies_behind_its_face() {
    for noise in [-1e-9, 0.0, 1e-9] {
        let mut map = map(Grazing::None);
        map.insert(at(0.5, 0.5), [at(3.0 + noise, 0.5)]);
        map.insert(at(5.5, 0.5), [at(3.0 + noise, 0.5)]);
        let state = |x| map.grid().state(Voxel::new(x, 0, 0));
        assert_eq!((state(2), state(3)), (State::Occupied, State::Occupied));
    }
}

#[test]
fn log_odds_stay_within_their_bounds() {
    let mut map = map(Grazing::None);
    for _ in 0..20 {
        map.insert(at(0.5, 0.5), [at(3.5, 0.5)]);
    }
    assert_eq!(map.log_odds(Voxel::new(3, 0, 0)), Some(3.5));
    assert_eq!(map.log_odds(Voxel::new(1, 0, 0)), Some(-2.0));
}

#[test]
fn beyond_the_largest_range_nothing_is_hit() {
    let mut map = OccupancyMap::new(MapConfig { resolution: 1.0, max_range: 2.5, ..MapConfig::default() }).unwrap();
    let seen = map.insert(at(0.5, 0.5), [at(9.5, 0.5), at(2.5, 0.5)]);
    assert_eq!((map.grid().free(), map.grid().occupied()), (2, 1));
    assert_eq!(map.grid().state(Voxel::new(3, 0, 0)), State::Unknown);
    assert_eq!(seen.cut, 1, "it is counted, and so can be said");
}

#[test]
fn of_any_scan_something_is_made() {
    let absurd = [f64::NAN, f64::INFINITY, f64::MAX, 1e30, 1e19, 1e9, 4e3, 1e-30, -1e-30, 0.0];
    let points: Vec<Point3<f64>> = absurd.iter().flat_map(|x| absurd.map(|y| Point3::new(*x, -y, 0.3 * x))).collect();
    for integration in [Integration::Rays, Integration::EndVoxels] {
        for (advance, max_range) in [(0.0, 0.0), (1e-4, 5.0)] {
            let config = MapConfig { integration, advance, max_range, max_bricks: 3000, ..MapConfig::default() };
            let mut map = OccupancyMap::new(config).unwrap();
            let seen = map.insert(Point3::origin(), points.iter().copied());
            assert!(seen.dropped.invalid > 50 && map.snapshot().bricks.len() <= 3000, "{seen:?}");
            for origin in absurd.map(|x| Point3::new(x, 0.0, 0.0)) {
                map.insert(origin, points.iter().copied());
                map.insert(origin, []);
            }
            assert!(map.known().all(|(_, log_odds)| (-2.0..=3.5).contains(&log_odds)));
        }
    }
}

#[test]
fn ten_million_points_are_a_scan() {
    let mut map = OccupancyMap::new(MapConfig::default()).unwrap();
    let points =
        (0..10_000_000).map(|i| Point3::new(2.0, f64::from(i % 3163) * 1e-3 - 1.5, f64::from(i / 3163) * 1e-3 - 1.5));
    let seen = map.insert(Point3::new(0.03, 0.02, 0.01), points);
    assert_eq!((seen.dropped, seen.cut), (Dropped::default(), 0));
    // 3.163 m either way, and those at its lower end lie behind the border of two voxels.
    assert_eq!(map.grid().occupied(), 33 * 33);
}

/// Regression: 10,000 points at 500 m took 4 GB.
#[test]
fn no_more_bricks_come_into_being_than_there_is_room_for() {
    let config = MapConfig { resolution: 1.0, max_bricks: 3, ..MapConfig::default() };
    let mut map = OccupancyMap::new(config).unwrap();
    let near = map.insert(at(0.5, 0.5), [at(3.5, 0.5)]);
    assert_eq!(near.dropped, Dropped::default());
    let far = map.insert(at(0.5, 0.5), (0..100).map(|i| at(500.5, f64::from(i) * 5.0)));
    assert!(far.dropped.no_room > 90, "{:?}", far.dropped);
    assert_eq!((map.snapshot().bricks.len(), map.grid().bricks().len()), (3, 3));
    let elsewhere = map.insert(at(-400.5, 0.5), [at(-402.5, 0.5)]);
    assert_eq!((elsewhere.dropped.no_room, elsewhere.changed.len()), (1, 0));
    let again = map.insert(at(0.5, 0.5), [at(2.5, 0.5)]);
    assert_eq!(again.dropped, Dropped::default(), "what it has it still updates");
    assert!(OccupancyMap::restore(config, &map.snapshot()).is_ok());
    let smaller = MapConfig { max_bricks: 2, ..config };
    assert!(OccupancyMap::restore(smaller, &map.snapshot()).is_err());
    assert!(OccupancyMap::from_states(smaller, &map.grid().whole()).is_err());
}

/// Regression: of blocks beyond the window around the sensor the first 2¹⁸ were kept, whatever came behind them.
#[test]
fn where_there_is_not_room_for_all_the_nearest_count_in_any_order() {
    let end = |i: i32| {
        let angle = f64::from(i) * 0.031;
        Point3::new(3000.0 * angle.cos(), 3000.0 * angle.sin(), f64::from(i % 7) * 400.0 - 1200.0)
    };
    let config = MapConfig { max_bricks: 20_000, ..MapConfig::default() };
    let maps = [false, true].map(|backward| {
        let mut map = OccupancyMap::new(config).unwrap();
        map.insert(Point3::origin(), [Point3::new(700.0, 0.5, 0.25)]);
        let points: Vec<_> = (0..200).map(|i| end(if backward { 199 - i } else { i })).collect();
        (map.insert(Point3::origin(), points), map)
    });
    let [(seen, map), (of_backward, backward)] = maps;
    assert_eq!((seen.dropped.no_room, map.is_full()), (200, true));
    assert!(seen == of_backward);
    assert!(map.snapshot() == backward.snapshot());
    // Each ray frees as far as any does.
    let brick = |point: Point3<f64>| brick_of(Voxel::containing(point, 0.1)).distance(Voxel::new(0, 0, 0));
    let known = |i: i32| {
        let along = |share: f64| Point3::origin() + (end(i) - Point3::origin()) * share;
        let is_known = |step: &i32| map.log_odds(Voxel::containing(along(f64::from(*step) * 1e-4), 0.1)).is_some();
        brick(along(f64::from((1..10_000).take_while(is_known).last().unwrap()) * 1e-4))
    };
    let reach: Vec<f64> = (1..200).map(known).collect();
    let ends = reach.iter().fold([f64::MAX, 0.0f64], |[low, high], r| [low.min(*r), high.max(*r)]);
    assert!(ends[0] > 40.0 && ends[1] - ends[0] < 3.0, "{ends:?}");
}

#[test]
fn grazing_rules_differ_in_what_they_spare() {
    let wall = Voxel::new(3, 0, 0);
    let freed_after = |grazing, neighbour_hit: bool| {
        let mut map = map(grazing);
        map.insert(at(0.5, 0.5), [at(3.5, 0.5)]);
        let mut points = vec![at(8.5, 0.5)];
        points.extend(neighbour_hit.then_some(at(3.5, 1.5)));
        (1..=10).find(|_| {
            map.insert(at(0.5, 0.5), points.iter().copied());
            map.grid().state(wall) == State::Free
        })
    };
    assert_eq!(freed_after(Grazing::None, true), Some(3));
    assert_eq!(freed_after(Grazing::Guard, true), None, "its neighbour was hit");
    assert_eq!(freed_after(Grazing::Guard, false), Some(9), "a lone voxel is noise, though slower than by log-odds");
    assert_eq!(freed_after(Grazing::Sticky, false), None);
}

#[test]
fn the_guard_looks_over_the_border_of_a_brick() {
    let mut map = map(Grazing::Guard);
    map.insert(at(0.5, 7.5), [at(7.5, 7.5)]);
    for _ in 0..10 {
        map.insert(at(0.5, 7.5), [at(9.5, 7.5), at(8.5, 8.5)]);
    }
    assert_eq!(map.grid().state(Voxel::new(7, 7, 0)), State::Occupied);
}

#[test]
fn what_is_no_point_is_dropped_and_counted() {
    let mut map = map(Grazing::Guard);
    let points = [at(f64::NAN, 0.0), at(f64::INFINITY, 0.0), at(0.5, 0.5), at(4e4, 0.0), at(2.5, 0.5)];
    let seen = map.insert(at(0.5, 0.5), points);
    assert_eq!(seen.dropped, Dropped { invalid: 3, out_of_range: 1, no_room: 0 });
    assert_eq!(seen.changed.len(), 32_768, "the ray that leaves the map frees its way there; on it there is one hit");
    let nowhere = map.insert(at(1e9, 0.5), points);
    assert_eq!(nowhere.dropped, Dropped { invalid: 0, out_of_range: 5, no_room: 0 });
}

#[test]
fn the_update_carries_what_the_scan_changed() {
    let mut map = map(Grazing::Guard);
    let mut reader = elk_geometry::OccupancyGrid::new(1.0);
    for y in [0.5, 9.5, -20.5] {
        let changed = map.insert(at(0.5, 0.5), [at(6.5, y)]).changed;
        let update = map.advance(&changed);
        assert_eq!(reader.apply(&update).unwrap(), changed);
    }
    assert_eq!((reader.free(), reader.occupied()), (map.grid().free(), map.grid().occupied()));
}

#[test]
fn a_ray_without_a_return_frees_as_far_as_it_is_believed() {
    let freed = |free_no_return: f64, max_range: f64, sensor_range: f64| {
        let config = MapConfig { resolution: 1.0, free_no_return, max_range, ..MapConfig::default() };
        let mut map = OccupancyMap::new(config).unwrap();
        map.insert_with(at(0.5, 0.5), [], [Vector3::x()], sensor_range);
        assert_eq!(map.grid().occupied(), 0);
        map.grid().free()
    };
    assert_eq!(freed(0.0, 0.0, 0.0), 0, "unless it is asked for, nothing is known of such a ray");
    assert_eq!(freed(5.0, 0.0, 0.0), 5);
    assert_eq!(freed(5.0, 3.0, 0.0), 3, "no farther than any ray");
    assert_eq!(freed(5.0, 0.0, 2.0), 2, "no farther than the sensor sees");
    let mut map = OccupancyMap::new(MapConfig { free_no_return: 5.0, ..MapConfig::default() }).unwrap();
    map.insert_with(at(0.5, 0.5), [], [Vector3::zeros(), Vector3::x() * f64::NAN, Vector3::x() * f64::INFINITY], 0.0);
    assert_eq!(map.grid().free(), 0, "what is no direction frees nothing");
}

/// Regression: a ray to a point outside freed nothing of what it passed inside, and that stayed a frontier for ever.
#[test]
fn a_ray_that_leaves_the_map_frees_it_to_its_last_voxel() {
    let last = *INDEX_RANGE.end();
    let mut map = map(Grazing::None);
    let origin = at(f64::from(last) - 2.5, 0.5);
    let seen = map.insert(origin, [at(f64::from(last) + 9.0, 0.5), at(f64::from(last) + 0.5, 0.5)]);
    assert_eq!((seen.dropped.out_of_range, map.grid().free(), map.grid().occupied()), (1, 3, 1));
    let mut alone = self::map(Grazing::None);
    alone.insert(origin, [at(f64::from(last) + 9.0, 0.5)]);
    assert_eq!(alone.grid().state(Voxel::new(last, 0, 0)), State::Free);
    assert_eq!((alone.grid().free(), alone.grid().bricks().len()), (4, 1));
    let outside = alone.insert(at(f64::from(last) + 5.0, 0.5), [origin]);
    assert_eq!((outside.dropped.out_of_range, outside.changed.len()), (1, 0), "from outside nothing is inserted");
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(64))]
    /// Wherever a ray leaves the map, its end is inside, and it has not turned.
    #[test]
    fn a_ray_is_cut_where_the_map_ends(start in prop::array::uniform3(-32767.9..32767.9f64), way in prop::array::uniform3(-1e5..1e5f64)) {
        let (start, way) = (Point3::from(start), Vector3::from(way));
        let is_inside = |p: Point3<f64>| p.iter().all(|c| (LOW..HIGH).contains(c));
        prop_assume!(!is_inside(start + way));
        let end = cut_to_map(start, start + way);
        prop_assert!(is_inside(end) && is_inside(end.map(|c| f64::from(c as f32))));
        let gone = end - start;
        prop_assert!(gone.cross(&way).norm() <= 2.0 * INSIDE * way.norm(), "{} {}", gone, way);
    }
}

#[test]
fn what_a_full_map_has_no_room_for_is_no_frontier() {
    let mut map = OccupancyMap::new(MapConfig { resolution: 1.0, max_bricks: 1, ..MapConfig::default() }).unwrap();
    let seen = map.insert(at(0.5, 0.5), [at(20.5, 0.5), at(4.5, 0.5)]);
    assert_eq!((seen.dropped.no_room, map.is_full()), (1, true));
    let at_its_end = Voxel::new(7, 0, 0);
    assert_eq!(map.grid().state(at_its_end), State::Free);
    assert!(map.frontier().all(|voxel| voxel.face_neighbours().iter().any(|n| brick_of(*n) == brick_of(voxel))));
    assert!(map.frontier().any(|voxel| voxel == at_its_end), "beside it, in its own brick, there is more to be known");
}
