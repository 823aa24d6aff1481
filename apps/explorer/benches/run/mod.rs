//! A run of sensor, map, explorer and controller in one thread, without a bus, phase by phase.

use std::collections::BTreeMap;
use std::hash::{DefaultHasher, Hash, Hasher};
use std::ops::AddAssign;

use elk_bus::clock::thread_cpu_secs;
use elk_bus::codec::{self, encode_onto};
use elk_controller::{Action, Allowance, Follower};
use elk_explorer::strategies::Start;
use elk_explorer::{
    ClosestFrontier, Explorer, InformationGain, Policy, Potential, Random, RecedingHorizon, Settings, Strategy, Tour,
    WeightedInformationGain,
};
use elk_field::Solver;
use elk_filter::filters::distance;
use elk_geometry::{Bounds, Clearance, OccupancyGrid, Pose};
use elk_map::{MapConfig, OccupancyMap};
use elk_sensor::Robot;
use elk_sensor::simulator::{self, Simulator};
use elk_sensor::surroundings::Body;
use elk_spatial::checks::MAX_BRICKS;
use elk_spatial::map::MapUpdate;
use elk_spatial::messages::{CameraPose, Decision, MotionReport, Plan, PlanRequest, PoseCommand};
use elk_world::World;

pub const RESOLUTION: f64 = 0.1;
/// What stands in the columns of a record: of the slowest hundredth of the steps each phase's mean.
pub const HEADER: &str = "by step:                  p50      p99  largest  slowest            sum";
/// The mission's filter keeps what is nearer (m).
const THRESHOLD_M: f64 = 10.0;

/// Times of each step by phase, and the digest.
#[derive(Default)]
pub struct Record {
    pub steps: BTreeMap<String, Vec<f64>>,
    plans: DefaultHasher,
}

impl Record {
    /// Adds to the present step's time.
    fn add(&mut self, phase: &str, secs: f64, step: usize) {
        let steps = self.steps.entry(phase.to_owned()).or_default();
        steps.resize(step.max(steps.len()), 0.0);
        steps.last_mut().expect("steps count from 1").add_assign(secs);
    }

    /// Does a part of a step.
    fn time<T>(&mut self, part: &str, step: usize, work: impl FnOnce() -> T) -> T {
        let start = thread_cpu_secs();
        let done = work();
        let secs = thread_cpu_secs() - start;
        self.add(part, secs, step);
        self.add("step", secs, step);
        done
    }

    fn hash(&mut self, plan: &Plan) {
        let Decision::Go(path) = &plan.decision else { return };
        (plan.request, path.target).hash(&mut self.plans);
        let looks = path.looks.iter().map(Pose::position);
        let numbers = path.points.iter().copied().chain(looks).flat_map(|p| [p.x, p.y, p.z]);
        numbers.for_each(|number| self.plans.write_u64(number.to_bits()));
    }

    fn print(&self) {
        let whole = self.steps.get("step").cloned().unwrap_or_default();
        let mut slowest: Vec<usize> = (0..whole.len()).collect();
        slowest.sort_by(|a, b| whole[*b].total_cmp(&whole[*a]));
        slowest.truncate(whole.len().div_ceil(100));
        for (phase, steps) in &self.steps {
            let mut sorted = steps.clone();
            sorted.sort_by(f64::total_cmp);
            let at = |share: f64| 1e3 * sorted[((sorted.len() - 1) as f64 * share).round() as usize];
            let (sum, largest) = (steps.iter().sum::<f64>(), at(1.0));
            let of = |step: &usize| steps.get(*step).copied().unwrap_or_default();
            let worst = 1e3 * slowest.iter().map(of).sum::<f64>() / slowest.len().max(1) as f64;
            println!("    {phase:16} {:8.2} {:8.2} {largest:8.2} {worst:8.2} ms {sum:8.2} s", at(0.5), at(0.99));
        }
    }
}

/// All that takes part in a mission.
pub struct Run {
    pub robot: Robot,
    pub map: OccupancyMap,
    no_return: u64,
    pub grid: OccupancyGrid,
    pub explorer: Explorer,
    pub follower: Follower,
    /// Way to each share of the free voxels that are known in the end, once it has ended.
    report: Option<MotionReport>,
    steps: usize,
    pub record: Record,
    /// Of each plan that solved for a field the share of its blocks that is sealed, and what it took (s).
    pub curve: Vec<(f64, f64)>,
}

impl Run {
    /// A robot at `start` in `world` that explores what is in `bounds`, and knows nothing yet.
    pub fn new(world: World, start: Pose, bounds: Bounds, strategy: Box<dyn Strategy>) -> Self {
        let simulator = Simulator::new(Body::new(world, start, 0.05), simulator::Settings::default());
        Self {
            robot: Robot::new(Box::new(simulator)).expect("the start is free"),
            map: OccupancyMap::new(config()).expect("the settings make sense"),
            no_return: 0,
            grid: OccupancyGrid::new(RESOLUTION),
            explorer: Explorer::new(strategy, settings(bounds)),
            follower: Follower::default(),
            report: None,
            steps: 0,
            record: Record::default(),
            curve: Vec::new(),
        }
    }

    /// The same for one that knows this much from before.
    pub fn knowing(mut self, known: &OccupancyGrid) -> Self {
        self.map = OccupancyMap::from_states(config(), &known.whole()).expect("it fits");
        let whole = known.whole();
        let changes = self.grid.apply(&whole).expect("it is whole");
        self.explorer.hear_of_map(&self.grid, changes.voxels());
        self.follower.on_map(&MapUpdate::new(whole, 0)).expect("it is the first map");
        self
    }

    /// Explores until so many steps are done, or to the end.
    pub fn go(&mut self, steps: usize) {
        let camera = CameraPose { command: 0, pose: self.robot.pose() };
        let mut waiting = self.follower.on_camera_pose(&camera).expect("it is the first word");
        while !waiting.is_empty() && self.steps < steps {
            let said = std::mem::take(&mut waiting);
            for output in said {
                waiting.extend(match output {
                    Action::Command(command) => self.step(&command),
                    Action::Request(request) => self.plan(&request),
                    Action::Progress(_) => vec![],
                    Action::Finished(report) => {
                        self.report = Some(report);
                        vec![]
                    }
                });
            }
        }
    }

    fn step(&mut self, command: &PoseCommand) -> Vec<Action> {
        self.steps += 1;
        let step = self.steps;
        let Self { robot, map, grid, explorer, follower, record, .. } = self;
        let scan = record.time("sensor", step, || {
            robot.go(command);
            robot.scan(0.0).expect("a simulator always sees")
        });
        let scan = scan.with_points(distance(&scan.points, THRESHOLD_M));
        self.no_return += scan.no_return.len() as u64;
        let delta = record.time("map", step, || {
            let origin = scan.pose.position();
            let seen = map.insert_with(origin, scan.world_points(), scan.world_no_return(), scan.camera.range_m);
            map.advance(&seen.changed)
        });
        let (update, changes) = record.time("publication", step, || {
            let mut bytes = Vec::new();
            encode_onto(&MapUpdate::new(delta, scan.id), &mut bytes).expect("it can be encoded");
            let update = codec::decode::<MapUpdate>(&bytes).expect("it was encoded");
            let changes = grid.apply(&update.delta()).expect("no update is missing");
            (update, changes)
        });
        record.time("plan: frontier", step, || explorer.hear_of_map(grid, changes.voxels()));
        explorer.hear_of_rays(self.no_return);
        explorer.hear_of_camera(&scan.camera, grid.resolution());
        let camera = CameraPose { command: robot.command(), pose: robot.pose() };
        record.time("controller", step, || {
            let mut said = follower.on_camera_pose(&camera).expect("it did as it was told");
            said.extend(follower.on_map(&update).expect("no update is missing"));
            said
        })
    }

    fn plan(&mut self, request: &PlanRequest) -> Vec<Action> {
        let step = self.steps;
        let Self { grid, explorer, follower, record, curve, .. } = self;
        let noted =
            |explorer: &Explorer| (explorer.journal().phases().to_vec(), explorer.journal().counters().to_vec());
        let (before, counted) = noted(explorer);
        let plan = record.time("plan", step, || explorer.plan(grid, request));
        let (now, counts) = noted(explorer);
        for (n, (phase, secs)) in now.iter().enumerate() {
            record.add(&format!("plan: {phase}"), secs - before.get(n).map_or(0.0, |(_, before)| *before), step);
        }
        let secs = more(&now, &before, "field");
        if secs > 0.0 {
            let count = |what: &str| more(&counts, &counted, what) as f64;
            curve.push((count("sealed blocks") / count("blocks"), secs));
        }
        record.time("plan: memory", step, || {
            let mut bytes = Vec::new();
            encode_onto(&explorer.memory(&plan).0, &mut bytes).expect("it can be encoded");
            explorer.take_past().iter().for_each(|past| encode_onto(past, &mut bytes).expect("it can be encoded"));
        });
        record.hash(&plan);
        record.time("controller", step, || follower.on_plan(&plan).expect("it is a plan of this map"))
    }

    /// Says how it went.
    pub fn print(&self, world: &str) {
        let digest = self.record.plans.finish();
        let motion = self.follower.memory(&Allowance::default());
        let ended = self.explorer.report().map(|report| (report.complete, report.plans));
        println!(
            "{world} {}: complete and plans {ended:?}, {} scans, {:.1} m, contacts {:?}, digest {digest:016x}",
            self.explorer.describe().split([':', ';']).next().unwrap_or_default(),
            self.robot.scans(),
            motion.path_length_m,
            self.robot.contacts(),
        );
        let marks = self.report.iter().flat_map(|report| &report.marks);
        let marks: Vec<String> = marks.map(|m| format!("{:.1} m at {} %", m.path_length_m, 100.0 * m.share)).collect();
        println!("    {}", marks.join(", "));
        self.explorer.report().iter().for_each(|report| println!("    {:?}", report.frontiers_left));
        println!("    {:?}", self.explorer.journal().counters());
        self.record.print();
    }
}

/// How much more there is of something.
fn more<T: Copy + Default + std::ops::Sub<Output = T>>(now: &[(String, T)], before: &[(String, T)], what: &str) -> T {
    let of = |all: &[(String, T)]| all.iter().find(|(name, _)| name == what).map_or(T::default(), |(_, much)| *much);
    of(now) - of(before)
}

fn config() -> MapConfig {
    MapConfig { max_range: 30.0, max_bricks: MAX_BRICKS, ..MapConfig::default() }
}

fn settings(bounds: Bounds) -> Settings {
    Settings {
        policy: Policy::elk(0.4),
        bounds: Some(bounds),
        confidence: None,
        planar: false,
        radius_m: 0.1,
        clearance: Clearance::new(0.1, RESOLUTION).expect("a voxel can be afforded"),
        min_frontier: 1,
        attempts: 4,
        max_scans: 10_000,
        patience: 100,
        clock: thread_cpu_secs,
        is_to_stop: || false,
    }
}

/// Those that are run if nobody names any: the ones of elk's missions.
pub const USUAL: [&str; 2] = ["ClosestFrontier", "Potential"];

/// All there are, the one with a field by this solver, as near as usual or this near, with isovolumes of this share.
pub fn strategies(solver: Solver, tolerance: Option<f64>, isovolumes: f64) -> Vec<Box<dyn Strategy>> {
    let tolerance = tolerance.unwrap_or(solver.usual_tolerance());
    let potential = Potential::new(Start::Shortest, solver, tolerance).with_isovolumes(isovolumes);
    let (seed, lambda) = (0, 0.2);
    vec![
        Box::new(ClosestFrontier),
        Box::new(potential),
        Box::new(Random { seed }),
        Box::new(InformationGain::new(seed)),
        Box::new(WeightedInformationGain::new(seed, lambda)),
        Box::new(Tour),
        Box::<RecedingHorizon>::default(),
    ]
}
