//! What a step costs in the missions that come with elk, phase by phase: sensor, map, explorer and controller in one thread,
//! without a bus.
//!
//! `cargo bench -p elk-explorer --bench missions -- [WORLD… [TYPE…]]`, all by default. A step is from one scan to the next.
//! Times are CPU times of the thread; the digest is one of all plans: equal digests are equal runs.
//! `isovolumes=SHARE` has `Potential` seal isovolumes; with `curves`, there follow of each of its plans, separated by commas,
//! the share of the domain's blocks that is sealed and the time that the field takes (ms).

use std::collections::BTreeMap;
use std::hash::{DefaultHasher, Hash, Hasher};
use std::ops::AddAssign;

use elk_bus::clock::thread_cpu_secs;
use elk_controller::{Action, Follower};
use elk_explorer::strategies::Start;
use elk_explorer::{ClosestFrontier, Explorer, Policy, Potential, Settings, Strategy};
use elk_field::Solver;
use elk_filter::filters::distance;
use elk_geometry::{Bounds, Clearance, OccupancyGrid, Pose};
use elk_map::{MapConfig, OccupancyMap};
use elk_sensor::Robot;
use elk_sensor::simulator::{self, Simulator};
use elk_spatial::checks::MAX_REMEMBERED;
use elk_spatial::map::MapUpdate;
use elk_spatial::messages::{CameraPose, Decision, Plan, PlanRequest, PoseCommand};
use elk_world::{Placement, World};

const RESOLUTION: f64 = 0.1;
/// The mission's filter keeps what is nearer (m).
const THRESHOLD_M: f64 = 10.0;

/// A mission as its file has it: start (m), yaw and pitch (degrees), middle and size of the volume to explore (m).
struct Mission {
    world: &'static str,
    start: [f64; 3],
    heading: [f64; 2],
    mid: [f64; 3],
    dim: [f64; 3],
}

const fn mission(
    world: &'static str,
    (start, heading): ([f64; 3], [f64; 2]),
    (mid, dim): ([f64; 3], [f64; 3]),
) -> Mission {
    Mission { world, start, heading, mid, dim }
}

const MISSIONS: [Mission; 6] = [
    mission("car", ([0.0, 0.0, 0.8], [0.0, -15.0]), ([0.0, 0.0, 0.0], [5.7, 4.3, 4.5])),
    mission("apartment", ([2.2, 3.2, 1.2], [-120.0, -10.0]), ([3.0, 4.0, 1.0], [6.5, 8.5, 2.5])),
    mission("kitchen", ([1.6, 2.0, 1.4], [45.0, 0.0]), ([4.0, 4.0, 1.5], [8.5, 8.5, 3.5])),
    mission("garage", ([3.4, 3.0, 1.2], [90.0, 0.0]), ([3.5, 4.5, 1.0], [7.5, 9.5, 2.5])),
    mission("hall", ([6.5, 4.6, 1.2], [180.0, 0.0]), ([5.0, 5.0, 2.5], [10.5, 10.5, 5.5])),
    mission("hall-long", ([4.0, 4.8, 1.5], [-90.0, 0.0]), ([4.0, 9.0, 2.5], [8.5, 18.5, 5.5])),
];

/// Times of each step by phase, and the digest.
#[derive(Default)]
struct Record {
    steps: BTreeMap<String, Vec<f64>>,
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
        for (phase, steps) in &self.steps {
            let mut sorted = steps.clone();
            sorted.sort_by(f64::total_cmp);
            let at = |share: f64| 1e3 * sorted[((sorted.len() - 1) as f64 * share).round() as usize];
            let (sum, largest) = (steps.iter().sum::<f64>(), at(1.0));
            println!("    {phase:16} {:8.2} {:8.2} {largest:8.2} ms {sum:8.2} s", at(0.5), at(0.99));
        }
    }
}

/// All that takes part in a mission.
struct Run {
    robot: Robot,
    map: OccupancyMap,
    no_return: u64,
    grid: OccupancyGrid,
    explorer: Explorer,
    follower: Follower,
    steps: usize,
    record: Record,
    /// Of each plan the share of the blocks that is sealed, and what the field took (s).
    curve: Vec<(f64, f64)>,
}

impl Run {
    fn new(mission: &Mission, strategy: Box<dyn Strategy>) -> Self {
        let world = World::load(mission.world, &Placement::default()).expect("it is built in");
        let [yaw, pitch] = mission.heading.map(f64::to_radians);
        let start = Pose::from_yaw_pitch(mission.start.into(), yaw, pitch);
        let simulator = Simulator::new(world, simulator::Settings::default(), start);
        let explorer = Explorer::new(strategy, settings(mission));
        Self {
            robot: Robot::new(Box::new(simulator)).expect("the start is free"),
            map: OccupancyMap::new(MapConfig { max_range: 30.0, max_bricks: 32_768, ..MapConfig::default() })
                .expect("the settings make sense"),
            no_return: 0,
            grid: OccupancyGrid::new(RESOLUTION),
            explorer,
            follower: Follower::default(),
            steps: 0,
            record: Record::default(),
            curve: Vec::new(),
        }
    }

    /// Explores to the end.
    fn go(&mut self) {
        let camera = CameraPose { command: 0, pose: self.robot.pose() };
        let mut waiting = self.follower.on_camera_pose(&camera).expect("it is the first word");
        while !waiting.is_empty() {
            let said = std::mem::take(&mut waiting);
            for output in said {
                waiting.extend(match output {
                    Action::Command(command) => self.step(&command),
                    Action::Request(request) => self.plan(&request),
                    Action::Progress(_) | Action::Finished(_) => vec![],
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
        let update = record.time("map", step, || {
            let origin = scan.pose.position();
            let seen = map.insert_with(origin, scan.world_points(), scan.world_no_return(), scan.camera.range_m);
            MapUpdate::new(map.advance(&seen.changed), scan.id)
        });
        record.time("plan: update", step, || {
            let changes = grid.apply(&update.delta()).expect("no update is missing");
            explorer.hear_of_map(grid, changes.voxels());
        });
        explorer.hear_of_rays(self.no_return);
        explorer.hear_of_camera(&scan.camera);
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
        let phases = |explorer: &Explorer| explorer.journal().phases().to_vec();
        let counters = |explorer: &Explorer| explorer.journal().counters().to_vec();
        let (before, counted) = (phases(explorer), counters(explorer));
        let plan = record.time("plan", step, || explorer.plan(grid, request));
        for (n, (phase, secs)) in phases(explorer).into_iter().enumerate() {
            record.add(&format!("plan: {phase}"), secs - before.get(n).map_or(0.0, |(_, before)| *before), step);
        }
        let (now, counts) = (phases(explorer), counters(explorer));
        let secs = more(&now, &before, "field");
        if secs > 0.0 {
            let count = |what: &str| more(&counts, &counted, what) as f64;
            curve.push((count("sealed blocks") / count("blocks"), secs));
        }
        record.time("plan: memory", step, || explorer.memory(&plan));
        record.hash(&plan);
        record.time("controller", step, || follower.on_plan(&plan).expect("it is a plan of this map"))
    }

    fn print(&self, mission: &Mission) {
        let report = self.explorer.report().expect("it has ended");
        let digest = self.record.plans.finish();
        let motion = self.follower.memory(0, 0);
        println!(
            "{} {}: complete {}, {} scans, {} plans, {:.1} m, contacts {:?}, digest {digest:016x}",
            mission.world,
            report.explorer,
            report.complete,
            self.robot.scans(),
            report.plans,
            motion.path_length_m,
            self.robot.contacts(),
        );
        println!("    {:?}", report.frontiers_left);
        self.record.print();
    }
}

/// How much more there is of something.
fn more<T: Copy + Default + std::ops::Sub<Output = T>>(now: &[(String, T)], before: &[(String, T)], what: &str) -> T {
    let of = |all: &[(String, T)]| all.iter().find(|(name, _)| name == what).map_or(T::default(), |(_, much)| *much);
    of(now) - of(before)
}

fn settings(mission: &Mission) -> Settings {
    Settings {
        policy: Policy::elk(0.4),
        bounds: Some(Bounds::from_mid_dim(mission.mid.into(), mission.dim.into())),
        radius_m: 0.1,
        clearance: Clearance::new(0.1, RESOLUTION).expect("a voxel can be afforded"),
        max_voxels: 8_000_000,
        max_targets: MAX_REMEMBERED,
        min_frontier: 1,
        attempts: 4,
        max_scans: 10_000,
        patience: 100,
        clock: thread_cpu_secs,
        is_to_stop: || false,
    }
}

fn strategies(isovolumes: f64) -> [Box<dyn Strategy>; 2] {
    let potential = Potential::new(Start::Shortest, Solver::Multigrid, 1e-6).with_isovolumes(isovolumes);
    [Box::new(ClosestFrontier), Box::new(potential)]
}

fn main() {
    let wanted: Vec<String> = std::env::args().skip(1).filter(|word| !word.starts_with("--")).collect();
    let is_named = |word: &str| wanted.iter().any(|name| name == word);
    let worlds = MISSIONS.iter().any(|mission| is_named(mission.world));
    let share = wanted.iter().find_map(|word| word.strip_prefix("isovolumes="));
    let share = share.map_or(0.0, |share| share.parse().expect("a share is a number"));
    let types = strategies(share).iter().any(|strategy| is_named(strategy.name()));
    println!("by step:                  p50      p99  largest            sum");
    for mission in MISSIONS.iter().filter(|mission| !worlds || is_named(mission.world)) {
        for strategy in strategies(share).into_iter().filter(|strategy| !types || is_named(strategy.name())) {
            let mut run = Run::new(mission, strategy);
            run.go();
            run.print(mission);
            if is_named("curves") {
                run.curve.iter().for_each(|(sealed, secs)| println!("{sealed:.4},{:.3}", 1e3 * secs));
            }
        }
    }
}
