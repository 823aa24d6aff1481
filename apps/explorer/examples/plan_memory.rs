//! How much memory a plan takes for each voxel of its box: `cargo run --release -p elk-explorer --example plan_memory
//! [EDGE]`, of a hall so many voxels long, wide and high.

use elk_explorer::strategies::Start;
use elk_explorer::{ClosestFrontier, Explorer, Policy, Potential, Settings, Strategy};
use elk_field::Solver;
use elk_geometry::clearance::Clearance;
use elk_geometry::{OccupancyGrid, Pose, State, Voxel};
use elk_spatial::messages::{Outcome, PlanRequest};

const RESOLUTION: f64 = 0.1;

/// A free hall with walls of which one is open.
fn hall(edge: i32) -> OccupancyGrid {
    let mut grid = OccupancyGrid::new(RESOLUTION);
    let walled = |v: Voxel| v.to_array().contains(&0) || v.y == edge - 1 || v.z == edge - 1;
    for voxel in (0..edge.pow(3)).map(|i| Voxel::new(i % edge, i / edge % edge, i / edge / edge)) {
        grid.set(voxel, if walled(voxel) { State::Occupied } else { State::Free });
    }
    grid.advance(&[]);
    grid
}

fn settings() -> Settings {
    Settings {
        policy: Policy::elk(0.4),
        bounds: None,
        confidence: None,
        planar: false,
        radius_m: 0.1,
        clearance: Clearance::new(0.1, RESOLUTION).expect("a voxel can be afforded"),
        min_frontier: 1,
        attempts: 4,
        max_scans: 1000,
        patience: 100,
        clock: || 0.0,
        is_to_stop: || false,
    }
}

/// A line of this process' status (bytes).
fn status(line: &str) -> f64 {
    let status = std::fs::read_to_string("/proc/self/status").expect("Linux has it");
    let line = status.lines().find_map(|l| l.strip_prefix(line)).expect("Linux has the line");
    line.split_whitespace().nth(1).and_then(|kib| kib.parse().ok()).map_or(f64::NAN, |kib: f64| kib * 1024.0)
}

fn main() {
    let edge = std::env::args().nth(1).and_then(|edge| edge.parse().ok()).unwrap_or(160);
    let grid = hall(edge);
    let potential = Potential::new(Start::Shortest, Solver::Cascade, Solver::Cascade.usual_tolerance());
    let strategies: [Box<dyn Strategy>; 2] = [Box::new(ClosestFrontier), Box::new(potential)];
    for strategy in strategies {
        let name = strategy.name();
        let mut explorer = Explorer::new(strategy, settings());
        explorer.hear_of_map(&grid, grid.bricks().voxels().map(|(voxel, _)| voxel));
        let middle = Voxel::new(edge / 2, edge / 2, edge / 2).center(RESOLUTION);
        let pose = Pose::from_yaw_pitch(middle, 0.0, 0.0);
        // The peak is counted anew from here.
        std::fs::write("/proc/self/clear_refs", "5").expect("Linux allows it");
        let before = status("VmRSS");
        explorer.plan(&grid, &PlanRequest { id: 1, pose, revision: 1, outcome: Outcome::First });
        let each = (status("VmHWM") - before) / f64::from(edge + 4).powi(3);
        println!("{name}: {each:.0} bytes a voxel");
    }
}
