use elk_geometry::clearance::Clearance;
use elk_geometry::{FrontierSet, OccupancyGrid, State};
use elk_spatial::CameraInfo;
use proptest::prelude::*;

use super::*;
use crate::goals::{Goal, Goals};
use crate::sight::Sight;
use crate::space::Space;
use crate::target::{Known, Target};
use crate::verdicts::Verdicts;

/// All poses drawn under `seed` that see any of the frontier, each worked out goal by goal as the thesis has it.
pub fn every<'a>(view: &View<'a>, seed: u64) -> Vec<Candidate<'a>> {
    let goals: Vec<(&Goal, bool)> = view.goals.iter_all().collect();
    draw(view, seed).filter_map(|pose| looked_from(view, &goals, &pose)).collect()
}

fn looked_from<'a>(view: &View<'_>, goals: &[(&'a Goal, bool)], pose: &Pose) -> Option<Candidate<'a>> {
    let (from, sight) = (view.space.center(pose.place), view.sight);
    let (mut gain, mut aim) = (0, None);
    for (goal, is_first) in goals {
        let toward = goal.target.voxel.center(view.space.resolution()) - from;
        let distance = toward.norm();
        let off_axis = toward.dot(&pose.axis) / distance.max(1e-9);
        let in_view = distance <= sight.range_m && (distance < 1e-9 || sight.covers(&pose.axis, &(toward / distance)));
        if in_view && goal.target.seen_from(view.space, from) {
            gain += 1;
            if *is_first && aim.is_none_or(|(best, _)| off_axis > best) {
                aim = Some((off_axis, *goal));
            }
        }
    }
    aim.map(|(_, goal)| Candidate { place: pose.place, gain, goal })
}

#[test]
fn directions_are_even_over_the_sphere() {
    let mut random = Random::new(1, 1);
    let sum: Vector3<f64> = (0..20_000).map(|_| direction(random.unit(), random.unit())).sum();
    // Five standard errors of each component's mean, whose variance is a third.
    assert!((sum / 20_000.0).amax() < 5.0 * (1.0 / 3.0f64 / 20_000.0).sqrt(), "{sum}");
}

/// What follows from a seed and a voxel, evenly below `below`.
fn lot(seed: u64, voxel: Voxel, below: usize) -> usize {
    let [z, y, x] = voxel.raster().map(|c| u64::from(c as u16));
    Random::new(seed, z << 32 | y << 16 | x).below(below)
}

/// A hall far from the origin, of which one voxel in so many is occupied, and one in so many unknown.
fn hall(seed: u64, [occupied, unknown]: [usize; 2]) -> OccupancyGrid {
    let mut grid = OccupancyGrid::new(0.1);
    let side = |edge: i32| -1..=edge;
    for voxel in side(26).flat_map(|x| side(20).flat_map(move |y| side(12).map(move |z| Voxel::new(x - 9, y + 300, z))))
    {
        let is_wall =
            [(voxel.x + 9, 26), (voxel.y - 300, 20), (voxel.z, 12)].iter().any(|(c, edge)| [-1, *edge].contains(c));
        let lot = |number: u64, of: usize| lot(seed + number, voxel, of) == 0;
        let state = match (is_wall, lot(0, occupied), lot(1, unknown)) {
            (_, _, true) => State::Unknown,
            (true, ..) | (_, true, _) => State::Occupied,
            _ => State::Free,
        };
        grid.set(voxel, state);
    }
    grid
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(96))]
    /// It is the one that is best of all when every pose is looked from, whatever weighs; also where cameras see little or all
    /// around, where some places were looked from in vain, and where goals are seen from afar.
    #[test]
    fn the_best_is_the_best_of_all(
        seed in 0..1_000_000u64,
        shares in [prop_oneof![Just(8usize), Just(60), Just(100_000)], prop_oneof![Just(12usize), Just(80), Just(900)]],
        (fov, range_m) in (prop_oneof![Just(20.0f64), Just(75.0), Just(130.0), Just(300.0)], prop_oneof![Just(0.7), Just(30.0)]),
        (from_afar, in_vain) in any::<(bool, bool)>(),
    ) {
        let grid = hall(seed, shares);
        let mut frontier = FrontierSet::new(None);
        frontier.update(&grid, grid.bricks().voxels().map(|(voxel, _)| voxel));
        let fov = fov.to_radians();
        let sight = Sight::of(&CameraInfo { fov_x: fov, fov_y: fov, range_m, ..CameraInfo::default() }, 0.1);
        let known = Known { grid: &grid, frontier: &frontier, sight };
        let robot = grid.bricks().voxels().find(|(voxel, _)| grid.state(*voxel) == State::Free).expect("some are free").0;
        let clearance = Clearance::new(0.0, 0.1).unwrap();
        let space = Space::around(&grid, robot, &clearance, (&[], &[]));
        let tried = |voxel: Voxel| match in_vain && lot(seed, voxel, 3) == 0 {
            true => vec![voxel + Voxel::new(2, 0, 1)],
            false => Vec::new(),
        };
        let targets: Vec<Target> = frontier.iter().map(|voxel| Target::new(known, voxel, tried(voxel))).collect();
        let goals = match from_afar {
            true => Goals::far(&space, range_m, &targets, &mut Verdicts::default()).0,
            false => Goals::near(&space, range_m, &targets),
        };
        for plan in 1..4 {
            let view = View { space: &space, from: space.center(robot), goals: &goals, open: &[], changed: None, sight, plan };
            let by_lot = |voxel: Voxel| Some(lot(seed, voxel, 7)).filter(|lot| *lot > 0).map(|lot| 1.0 / lot as f64);
            let weights: [&dyn Fn(Voxel) -> Option<f64>; 3] = [&|_| Some(1.0), &by_lot, &|_| Some(0.0)];
            for weight in weights {
                let all = every(&view, seed);
                let priced = all.iter().filter_map(|one| Some((one.gain as f64 * weight(one.place)?, one)));
                let expected = priced.rev().max_by(|(one, _), (other, _)| one.total_cmp(other)).map(|(_, one)| one);
                let what = |one: &Candidate| (one.place, one.gain, one.goal.clone());
                prop_assert_eq!(best(&view, seed, weight).as_ref().map(what), expected.map(what));
            }
        }
    }
}
