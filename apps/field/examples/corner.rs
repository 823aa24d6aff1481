//! Around a corner: the field in an L-shaped corridor, and the streamline from one end to the other.

use elk_field::{Cell, Field, Problem, Solver, Termination, solve};
use elk_geometry::{Polyline, Region, Voxel};

/// Edge of a voxel (m).
const RESOLUTION: f64 = 0.1;

fn main() -> Result<(), Box<dyn std::error::Error>> {
    // A corridor of 1 m: 3 m along x, then 3 m along y. The box has a margin of one voxel that is outside.
    let region = Region::new(Voxel::new(-1, -1, -1), [32, 32, 12], RESOLUTION);
    let source = Voxel::new(2, 5, 5);
    let cell = |voxel: Voxel| {
        let along_x = (0..30).contains(&voxel.x) && (0..10).contains(&voxel.y);
        let along_y = (20..30).contains(&voxel.x) && (0..30).contains(&voxel.y);
        match voxel {
            _ if voxel == source => Cell::Source,
            _ if !(along_x || along_y) || !(0..10).contains(&voxel.z) => Cell::Outside,
            Voxel { y: 29, .. } => Cell::Sink,
            _ => Cell::Inside,
        }
    };
    let cells = (0..region.len()).map(|i| cell(region.voxel(i))).collect();
    let problem = Problem::new(region, cells)?;

    let solution = solve(&problem, Solver::Multigrid, 1e-6);
    println!("{} iterations, residual {:.1e}", solution.iterations, solution.residual);
    assert!(solution.residual < 1e-5);

    // From beside the source down to the sink, in the middle of the corridor all the way.
    let field = Field { problem: &problem, psi: &solution.psi };
    let (points, end) = field.trace((source + Voxel::new(1, 0, 0)).center(RESOLUTION), 100.0);
    assert!(matches!(end, Termination::Goal(_)), "{end:?}");
    let way = Polyline::new(points).ok_or("a streamline has its first point")?;
    println!("a way of {:.2} m through {} points", way.length(), way.points().len());
    assert!((4.0..5.0).contains(&way.length()), "{}", way.length());
    Ok(())
}
