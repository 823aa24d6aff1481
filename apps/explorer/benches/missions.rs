//! What a step costs in the missions that come with elk, phase by phase: sensor, map, explorer and controller in one thread,
//! without a bus.
//!
//! `cargo bench -p elk-explorer --bench missions -- [WORLD… [TYPE…]]`, all worlds by default, and the types of elk's missions. A step is from one scan to the next.
//! Times are CPU times of the thread, of each phase at the median, the 99th percentile and the largest, in the mean of the slowest
//! hundredth of all steps, and the sum of the run; the digest is one of all plans: equal digests are equal runs.
//! `solver=multigrid` has `Potential` solve in full, to `tolerance=RESIDUAL`, and with `isovolumes=SHARE` seal isovolumes; with
//! `curves`, there follow of each of its plans, separated by commas, the share of the domain's blocks that is sealed and the time
//! that the field takes (ms).
//! `starts=N` has each run from so many places: the mission's, and free ones drawn by lot, the same for all.

#[allow(dead_code, reason = "the benchmark of the building uses the rest")]
mod run;

use std::f64::consts::TAU;

use elk_field::Solver;
use elk_geometry::random::Random;
use elk_geometry::{Bounds, Pose};
use elk_world::{Placement, START_CLEARANCE_M, World};
use run::{HEADER, Run, USUAL, strategies};

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

impl Mission {
    /// Where a run begins: as the file has it, or where lot number `number` falls.
    fn start(&self, number: u64, world: &World) -> Pose {
        let [yaw, pitch] = self.heading.map(f64::to_radians);
        let mut random = Random::new(number, 0);
        match number {
            0 => Pose::from_yaw_pitch(self.start.into(), yaw, pitch),
            _ => {
                let place = world.draw_place(START_CLEARANCE_M, &mut random).expect("there is room");
                Pose::from_yaw_pitch(place, random.between(0.0, TAU), 0.0)
            }
        }
    }
}

const MISSIONS: [Mission; 6] = [
    mission("car", ([0.0, 0.0, 0.8], [0.0, -15.0]), ([0.0, 0.0, 0.0], [5.7, 4.3, 4.5])),
    mission("apartment", ([2.2, 3.2, 1.2], [-120.0, -10.0]), ([3.0, 4.0, 1.0], [6.5, 8.5, 2.5])),
    mission("kitchen", ([1.6, 2.0, 1.4], [45.0, 0.0]), ([4.0, 4.0, 1.5], [8.5, 8.5, 3.5])),
    mission("garage", ([3.4, 3.0, 1.2], [90.0, 0.0]), ([3.5, 4.5, 1.0], [7.5, 9.5, 2.5])),
    mission("hall", ([6.5, 4.6, 1.2], [180.0, 0.0]), ([5.0, 5.0, 2.5], [10.5, 10.5, 5.5])),
    mission("hall-long", ([4.0, 4.8, 1.5], [-90.0, 0.0]), ([4.0, 9.0, 2.5], [8.5, 18.5, 5.5])),
];

fn main() {
    let wanted: Vec<String> = std::env::args().skip(1).filter(|word| !word.starts_with("--")).collect();
    let is_named = |word: &str| wanted.iter().any(|name| name == word);
    let worlds = MISSIONS.iter().any(|mission| is_named(mission.world));
    let value = |name: &str| wanted.iter().find_map(|word| word.strip_prefix(name)?.strip_prefix('='));
    let number = |name: &str| value(name).map(|number| number.parse::<f64>().expect("it is a number"));
    let solver = match value("solver") {
        None | Some("cascade") => Solver::Cascade,
        Some("multigrid") => Solver::Multigrid,
        Some(other) => panic!("solver={other}: cascade or multigrid"),
    };
    let all = || strategies(solver, number("tolerance"), number("isovolumes").unwrap_or(0.0));
    assert!(value("isovolumes").is_none() || solver == Solver::Multigrid, "isovolumes are of solver=multigrid");
    let starts = value("starts").map_or(1, |starts| starts.parse::<u64>().expect("starts are a number"));
    let types = all().iter().any(|strategy| is_named(strategy.name()));
    println!("{HEADER}");
    for mission in MISSIONS.iter().filter(|mission| !worlds || is_named(mission.world)) {
        let chosen = || {
            all().into_iter().filter(|strategy| match types {
                true => is_named(strategy.name()),
                false => USUAL.contains(&strategy.name()),
            })
        };
        for (number, strategy) in (0..starts).flat_map(|number| chosen().map(move |strategy| (number, strategy))) {
            let world = World::load(mission.world, &Placement::default()).expect("it is built in");
            let start = mission.start(number, &world);
            let bounds = Bounds::from_mid_dim(mission.mid.into(), mission.dim.into());
            let mut run = Run::new(world, start, bounds, strategy);
            run.go(usize::MAX);
            run.print(&format!("{} from {number}", mission.world));
            if is_named("curves") {
                run.curve.iter().for_each(|(sealed, secs)| println!("{sealed:.4},{:.3}", 1e3 * secs));
            }
        }
    }
}
