//! Around a corner: the field in an L-shaped corridor, and the streamline from one end to the other.

use elk_field::{Cell, Domain, Field, Problem, Termination};
use elk_geometry::{Region, Voxel};

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

    let mut domain = Domain::of(&problem);
    let convergence = domain.solve(1e-6, || false);
    println!("{} iterations, residual {:.1e}", convergence.iterations, convergence.residual);
    assert!(convergence.residual < 1e-5);

    // From the source through the voxel beside it down to the sink, in the middle of the corridor all the way.
    let seed = (source + Voxel::new(1, 0, 0)).center(RESOLUTION);
    let lines = Field::of(&domain, RESOLUTION).trace(source.center(RESOLUTION), &[seed], 100.0);
    let line = lines.first().ok_or("a streamline for each seed")?;
    assert!(matches!(line.end, Termination::Goal(_)), "{:?}", line.end);
    println!("a way of {:.2} m through {} points", line.length, line.points.len());
    assert!((4.0..5.0).contains(&line.length), "{}", line.length);
    Ok(())
}
