//! What is occupied with little confidence is looked at again, once no frontier is left, until the map is sure of it or it is given up.

use super::*;

/// A room of 20 × 20 × 12 free voxels and its walls, two voxels thick, all of it known but for what `unknown` leaves open.
fn room(unknown: &[Voxel]) -> OccupancyGrid {
    let mut grid = OccupancyGrid::new(RESOLUTION);
    let side = |last: i32| -2..last + 2;
    let all = side(20).flat_map(|x| side(20).flat_map(move |y| side(12).map(move |z| Voxel::new(x, y, z))));
    for voxel in all.filter(|voxel| !unknown.contains(voxel)) {
        let is_in = voxel == voxel.sup(Voxel::new(0, 0, 0)).inf(Voxel::new(19, 19, 11));
        grid.set(voxel, if is_in { State::Free } else { State::Occupied });
    }
    grid
}

/// A patch of 5 × 5 voxels of the wall at x = 20, what lies behind two of these in the wall, and a voxel of the wall on the other side.
fn patch() -> Vec<Voxel> {
    let side = || 6..11;
    let patch = side().flat_map(|y| side().map(move |z| Voxel::new(20, y, z)));
    patch.chain([Voxel::new(21, 6, 6), Voxel::new(21, 7, 6), Voxel::new(-1, 10, 5)]).collect()
}

fn explorer(grid: &OccupancyGrid, confidence: Option<f64>) -> Explorer {
    let settings = Settings { confidence, ..settings(Policy::elk(0.4)) };
    let mut explorer = Explorer::new(Box::new(ClosestFrontier), settings);
    explorer.hear_of_camera(&camera(), RESOLUTION);
    explorer.hear_of_map(grid, grid.bricks().voxels().map(|(voxel, _)| voxel));
    explorer
}

/// The plan number `id` from `at`, by what became of the one before.
fn plan(explorer: &mut Explorer, grid: &OccupancyGrid, (id, outcome): (u64, Outcome), at: Point3<f64>) -> Plan {
    explorer.plan(grid, &PlanRequest { id, pose: Pose::looking(at, Vector3::x()), revision: id, outcome })
}

fn path(plan: &Plan) -> Option<&Path> {
    match &plan.decision {
        Decision::Go(path) => Some(path),
        Decision::Done => None,
    }
}

fn counted(explorer: &Explorer, name: &str) -> u64 {
    let report = explorer.report().unwrap();
    report.counters.iter().find(|(counter, _)| counter == name).unwrap_or_else(|| panic!("{name}: {report:?}")).1
}

fn middle() -> Point3<f64> {
    Voxel::new(10, 10, 6).center(RESOLUTION)
}

/// Which of these voxels the looks of a path have in view, and in sight.
fn viewed(path: &Path, grid: &OccupancyGrid, voxels: &[Voxel]) -> usize {
    let (end, sight) = (path.points[path.points.len() - 1], Sight::of(&camera(), RESOLUTION));
    let in_view = |voxel: &Voxel| {
        let toward = voxel.center(RESOLUTION) - end;
        path.looks.iter().any(|look| sight.has_in_view(&look.forward(), &toward))
    };
    let is_free = |voxel: Voxel| grid.state(voxel) == State::Free;
    let in_sight = |voxel: &&Voxel| elk_geometry::visibility::in_sight(RESOLUTION, is_free, end, **voxel);
    voxels.iter().filter(in_sight).filter(|voxel| in_view(voxel)).count()
}

#[test]
fn the_frontier_goes_first_and_one_place_serves_many() {
    let hole = Voxel::new(4, 4, -1);
    let mut grid = room(&[hole]);
    let mut explorer = explorer(&grid, Some(0.9));
    explorer.hear_of_unsure(patch().into_iter().collect());
    let first = plan(&mut explorer, &grid, (1, Outcome::First), middle());
    let frontier = path(&first).unwrap();
    assert_eq!((frontier.target, frontier.again), (Voxel::new(4, 4, 0), false));
    grid.set(hole, State::Occupied);
    explorer.hear_of_map(&grid, [hole]);
    let end = frontier.points[frontier.points.len() - 1];
    let second = plan(&mut explorer, &grid, (2, Outcome::Resolved), end);
    let inspection = path(&second).unwrap();
    assert!(inspection.again && patch().contains(&inspection.target), "{inspection:?}");
    assert!(viewed(inspection, &grid, &patch()) >= 25, "{inspection:?}");
    // The map has become sure meanwhile.
    explorer.hear_of_unsure(VoxelSet::new());
    let end = inspection.points[inspection.points.len() - 1];
    assert_eq!(path(&plan(&mut explorer, &grid, (3, Outcome::Unresolved), end)), None);
    let report = explorer.report().unwrap();
    assert!(report.complete && report.reason.contains("of 28 such voxels before there are 0 now"), "{report:?}");
    assert_eq!((counted(&explorer, UNSURE), counted(&explorer, INSPECTED)), (28, 1));
}

/// Regression: what stayed unsure was looked at until the run had taken all the scans that it may. And a successor that has nothing but
/// the memory goes on the same way.
#[test]
fn what_stays_unsure_is_given_up_and_counted_whoever_goes_on() {
    let grid = room(&[]);
    let paths = |is_relieved: bool| {
        let mut explorer = explorer(&grid, Some(0.9));
        explorer.hear_of_unsure(patch().into_iter().collect());
        let (mut at, mut outcome, mut paths) = (middle(), Outcome::First, Vec::new());
        let mut past = ExplorerPast::default();
        for id in 1..50 {
            let plan = plan(&mut explorer, &grid, (id, outcome), at);
            let memory = explorer.memory(&plan).0;
            past = explorer.take_past().unwrap_or(past);
            let Some(path) = path(&plan) else { break };
            (at, outcome) = (path.points[path.points.len() - 1], Outcome::Unresolved);
            paths.push(path.clone());
            if is_relieved {
                explorer = self::explorer(&grid, Some(0.9));
                explorer.hear_of_unsure(patch().into_iter().collect());
                explorer.hear_of_past(past.clone());
                assert_eq!(explorer.succeed(&memory), None);
            }
        }
        let report = explorer.report().unwrap();
        assert!(report.complete && report.frontiers_left.total() == 0, "no hole in the map: {report:?}");
        let left = [IN_VAIN, UNSEEN, OPEN].map(|name| counted(&explorer, name));
        assert_eq!(left, [26, 2, 0], "what lies in the wall is seen from nowhere: {report:?}");
        paths
    };
    let alone = paths(false);
    // Three places for each voxel, for all of the patch mostly the same.
    assert!((3..=9).contains(&alone.len()), "{}", alone.len());
    assert_eq!(alone, paths(true));
}

/// Places that the robot never gets to, since it is cut off each time, are given up too.
#[test]
fn an_inspection_that_is_cut_off_each_time_ends() {
    let grid = room(&[]);
    let mut explorer = explorer(&grid, Some(0.9));
    explorer.hear_of_unsure([Voxel::new(20, 10, 5)].into_iter().collect());
    let ended = (1..100).find(|id| path(&plan(&mut explorer, &grid, (*id, Outcome::Cut), middle())).is_none());
    assert!(ended.is_some_and(|id| id <= 10), "{ended:?}");
    assert_eq!((counted(&explorer, IN_VAIN), counted(&explorer, OPEN)), (1, 0));
}

#[test]
fn only_what_lies_in_the_volume_is_inspected() {
    let grid = room(&[]);
    let mut explorer = explorer(&grid, Some(0.9));
    explorer.settings.bounds = Some(Bounds { min: [0.0; 3].into(), max: [1.5, 2.0, 1.2].into() });
    explorer.hear_of_unsure(patch().into_iter().collect());
    assert_eq!(path(&plan(&mut explorer, &grid, (1, Outcome::First), middle())), None);
    assert_eq!([UNSURE, OPEN, UNSEEN].map(|name| counted(&explorer, name)), [0; 3]);
}

#[test]
fn without_the_mode_nothing_is_inspected_or_said_of_it() {
    let grid = room(&[]);
    let mut explorer = explorer(&grid, None);
    explorer.hear_of_unsure(patch().into_iter().collect());
    assert_eq!(path(&plan(&mut explorer, &grid, (1, Outcome::First), middle())), None);
    let report = explorer.report().unwrap();
    assert!(report.complete && !report.reason.contains("Confidence") && report.counters.is_empty(), "{report:?}");
}
