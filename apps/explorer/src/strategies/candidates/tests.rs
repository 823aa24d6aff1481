use elk_geometry::bricks::brick_of;
use elk_geometry::clearance::Clearance;
use elk_geometry::random::Random;
use elk_geometry::{FrontierSet, OccupancyGrid, State};
use elk_spatial::CameraInfo;
use proptest::prelude::*;

use super::sightings::MOST;
use super::*;
use crate::goals::{Goal, Goals};
use crate::sight::Sight;
use crate::space::Space;
use crate::target::{Known, Target};
use crate::verdicts::Verdicts;

/// A pose, all of it worked out goal by goal as the thesis has it.
#[derive(Debug, Clone)]
pub struct Looked<'a> {
    pub place: Voxel,
    pub gain: usize,
    goal: &'a Goal,
}

/// All poses drawn under `seed` that see any of the frontier: of the first draw of which any does.
pub fn every<'a>(view: &View<'a>, seed: u64) -> Vec<Looked<'a>> {
    let goals: Vec<&Goal> = view.goals.iter().collect();
    let mut places: Vec<Voxel> = view.space.reach.iter().collect();
    places.sort_unstable();
    let drawn = |draw: u64| {
        let lots = Lots::new(seed, draw);
        let mut targets: Vec<&Target> = view.goals.targets().collect();
        targets.sort_by_key(|target| (lots.number(target.voxel), target.voxel));
        targets.truncate(MOST);
        let poses = places.iter().filter_map(|place| lots.pose(*place));
        poses.filter_map(|pose| looked_from(view, (&targets, &goals), &pose)).collect::<Vec<_>>()
    };
    (0..DRAWS).map(drawn).find(|seen| !seen.is_empty()).unwrap_or_default()
}

fn looked_from<'a>(view: &View<'_>, (targets, goals): (&[&Target], &[&'a Goal]), pose: &Pose) -> Option<Looked<'a>> {
    let (from, sight) = (view.space.center(pose.place), view.sight);
    let off_axis = |target: &Target| {
        let toward = target.voxel.center(view.space.resolution()) - from;
        let distance = toward.norm();
        let in_view = distance <= sight.range_m && (distance < 1e-9 || sight.covers(&pose.axis, &(toward / distance)));
        (in_view && target.seen_from(view.space, from)).then(|| toward.dot(&pose.axis) / distance.max(1e-9))
    };
    let near = |target: &Target, other: &Target| target.voxel.distance(other.voxel) <= 5.0;
    let is_in_vain =
        |place: Voxel, target: &Target| view.goals.targets().any(|other| !other.untried(place) && near(target, other));
    let here = Voxel::containing(view.from, view.space.resolution());
    let is_hopeless = |target: &Target| {
        is_in_vain(pose.place, target) || is_in_vain(here, target) && target.seen_from(view.space, view.from)
    };
    let gain = targets.iter().filter(|target| !is_in_vain(pose.place, target) && off_axis(target).is_some()).count();
    let seen = goals.iter().filter(|goal| !is_hopeless(&goal.target));
    let seen = seen.filter_map(|goal| Some((off_axis(&goal.target)?, *goal)));
    let goal = seen.rev().max_by(|(one, _), (other, _)| one.total_cmp(other)).map(|(_, goal)| goal);
    goal.filter(|_| gain > 0).map(|goal| Looked { place: pose.place, gain, goal })
}

/// A weight that says nothing until it is asked, and then no more than it said before.
struct Lot<F>(F);

impl<F: Fn(Voxel) -> Option<f64>> Weight for Lot<F> {
    fn at_most(&self, place: Voxel) -> f64 {
        (self.0)(place).unwrap_or(0.25) * 1.5
    }

    fn of(&mut self, place: Voxel) -> Option<f64> {
        (self.0)(place)
    }
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
        (fov, range_m) in (prop_oneof![Just(20.0f64), Just(75.0), Just(130.0), Just(300.0)], prop_oneof![Just(0.72), Just(30.0)]),
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
        let view = View { space: &space, from: space.center(robot), goals: &goals, open: &[], changed: None, sight, plan: 1 };
        let by_lot = |voxel: Voxel| Some(lot(seed, voxel, 7)).filter(|lot| *lot > 0).map(|lot| 1.0 / lot as f64);
        let weights: [&dyn Fn(Voxel) -> Option<f64>; 3] = [&|_| Some(1.0), &by_lot, &|_| Some(0.0)];
        let mut candidates = Candidates::new(seed);
        for weight in weights {
            let all = every(&view, seed);
            let priced = all.iter().filter_map(|one| Some((one.gain as f64 * weight(one.place)?, one)));
            let expected = priced.rev().max_by(|(one, _), (other, _)| one.total_cmp(other)).map(|(_, one)| one);
            // Of other draws none is asked for while any pose of this one sees anything that weighs nothing.
            if expected.is_some() || all.is_empty() {
                let best = candidates.best(&view, &mut 0, &mut Lot(weight));
                prop_assert_eq!(best.map(|one| (one.place, one.goal.clone())), expected.map(|one| (one.place, one.goal.clone())));
            }
        }
    }

    /// Edit by edit, what is kept of each pose is what is worked out anew, and so is the choice: wherever the map changes, targets
    /// are looked at in vain, and the robot gets to more and less.
    #[test]
    fn what_is_kept_is_what_is_worked_out_anew(
        seed in 0..1_000_000u64,
        shares in [prop_oneof![Just(8usize), Just(60)], prop_oneof![Just(12usize), Just(300)]],
        (fov, range_m) in (prop_oneof![Just(20.0f64), Just(75.0), Just(300.0)], prop_oneof![Just(0.72), Just(30.0)]),
        edits in prop::collection::vec((prop::collection::vec((cell(), 0..6u8), 0..40), prop::option::of(cell())), 2..7),
    ) {
        let (mut grid, mut frontier) = (hall(seed, shares), FrontierSet::new(None));
        frontier.update(&grid, grid.bricks().voxels().map(|(voxel, _)| voxel));
        let fov = fov.to_radians();
        let sight = Sight::of(&CameraInfo { fov_x: fov, fov_y: fov, range_m, ..CameraInfo::default() }, 0.1);
        let robot = grid.bricks().voxels().find(|(voxel, _)| grid.state(*voxel) == State::Free).expect("some are free").0;
        let mut space = Space::around(&grid, robot, &Clearance::new(0.0, 0.1).unwrap(), (&[], &[]));
        let (mut kept, mut tried, mut changed) = (Candidates::new(seed), Vec::new(), None);
        for (cells, look) in edits {
            let mut bricks = std::collections::BTreeSet::new();
            for (voxel, state) in cells.into_iter().filter(|(voxel, _)| *voxel != robot) {
                if grid.set(voxel, [State::Occupied, State::Free, State::Unknown][usize::from(state.min(2))]) {
                    frontier.update(&grid, [voxel]);
                    bricks.insert(brick_of(voxel));
                }
            }
            tried.extend(look);
            let turned = space.follow(&grid, robot, bricks, ([], []));
            changed = changed.map(|_: std::collections::BTreeSet<Voxel>| turned.bricks().map(|(brick, _)| brick).collect());
            let known = Known { grid: &grid, frontier: &frontier, sight };
            let near = |voxel: Voxel| tried.iter().copied().filter(|one: &Voxel| one.distance(voxel) < 6.0).collect();
            let targets: Vec<Target> = frontier.iter().map(|voxel| Target::new(known, voxel, near(voxel))).collect();
            let goals = Goals::near(&space, range_m, &targets);
            let view = View { space: &space, from: space.center(robot), goals: &goals, open: &[], changed: changed.as_ref(), sight, plan: 1 };
            let mut anew = Candidates::new(seed);
            let weight = |voxel: Voxel| Some(1.0 / (1 + lot(seed, voxel, 7)) as f64);
            let choice = |candidates: &mut Candidates| {
                candidates.best(&view, &mut 0, &mut Lot(weight)).map(|one| (one.place, one.goal.clone()))
            };
            prop_assert_eq!(choice(&mut kept), choice(&mut anew));
            let draws = kept.draws.iter().zip(&mut anew.draws);
            for (kept, anew) in draws {
                let all: Vec<(kept::Number, kept::Drawn)> = anew.all().map(|(number, drawn)| (number, *drawn)).collect();
                let mut of: Vec<kept::Drawn> = kept.all().map(|(_, drawn)| *drawn).collect();
                of.sort_by_key(|drawn| drawn.pose.place);
                let mut by_place: Vec<_> = all.iter().map(|(number, drawn)| (drawn.pose.place, *number, *drawn)).collect();
                by_place.sort_by_key(|(place, ..)| *place);
                prop_assert_eq!(of.len(), by_place.len());
                for (own, (_, number, other)) in of.iter().zip(by_place) {
                    prop_assert_eq!((own.pose, own.in_view), (other.pose, other.in_view));
                    prop_assert!(own.seen.is_none_or(|seen| seen == anew.look(&view, number)), "{:?}", own);
                }
            }
            changed = changed.or(Some(Default::default()));
        }
    }
}

/// A voxel of the hall, or of its walls.
fn cell() -> impl Strategy<Value = Voxel> {
    (-10..18i32, 299..321i32, -1..13i32).prop_map(|(x, y, z)| Voxel::new(x, y, z))
}
