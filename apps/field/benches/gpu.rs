//! Laplace's equation on a graphics card, beside the CPU: boxes with 12 % walls, from 51³ to 512³ cells.
//!
//! `cargo bench -p elk-field --features gpu --bench gpu [-- [--cpu-up-to=N] [size]…]`. Times are those of a clock on
//! the wall, for the card the median of ten: `set-up` brings the problem to the card and makes its levels, `solve` is
//! the solver to a residual of 1e-6, `answer` brings the field back. The residual is that of the field in single
//! precision. The CPU's is one solve, and only up to 200³ unless asked.

use elk_field::gpu::{Domain, Gpu};
use elk_field::{Cell, Problem, Solver, solve};
use elk_geometry::{Region, Voxel};
use rustix::time::{ClockId, clock_gettime};

const SIZES: [usize; 6] = [51, 100, 200, 300, 400, 512];
const TOLERANCE: f64 = 1e-6;
const RUNS: usize = 10;
/// Of a hundred cells, how many are wall.
const WALLS: u64 = 12;

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let arguments: Vec<String> = std::env::args().skip(1).collect();
    let mut sizes: Vec<usize> = arguments.iter().filter_map(|argument| argument.parse().ok()).collect();
    if sizes.is_empty() {
        sizes = SIZES.to_vec();
    }
    let asked = arguments.iter().find_map(|argument| argument.strip_prefix("--cpu-up-to=")?.parse().ok());
    let cpu_up_to = asked.unwrap_or(200);
    let (gpu, secs) = timed(Gpu::or_software);
    let gpu = gpu?;
    println!("{}, opened in {:.0} ms", gpu.name(), 1e3 * secs);
    print!("size   unknowns    set-up ms   solve ms  (fastest)  iterations  residual  answer ms");
    println!("   CPU ms  iterations  apart");
    for size in sizes {
        measure(&gpu, size, size <= cpu_up_to)?;
    }
    Ok(())
}

fn measure(gpu: &Gpu, size: usize, on_cpu: bool) -> Result<(), Box<dyn std::error::Error>> {
    let problem = walled(size);
    let unknowns = problem.cells().iter().filter(|cell| **cell == Cell::Inside).count();
    let (domain, set_up) = timed(|| {
        let domain = Domain::new(gpu, &problem)?;
        // No iteration: it waits until the levels are made.
        domain.solve(f64::INFINITY, || false).map(|_| domain)
    });
    let domain = domain?;
    let mut times = Vec::new();
    for _ in 0..RUNS {
        let (iterations, secs) = timed(|| domain.solve(TOLERANCE, || false));
        iterations?;
        times.push(secs);
    }
    times.sort_by(f64::total_cmp);
    let (solution, answer) = timed(|| domain.answer());
    let solution = solution?;
    print!(
        "{size:4}  {unknowns:9}  {:11.1}  {:9.2}  {:9.2}  {:10}  {:8.1e}  {:9.1}",
        1e3 * set_up,
        1e3 * times[RUNS / 2],
        1e3 * times[0],
        solution.iterations,
        solution.residual,
        1e3 * answer,
    );
    if on_cpu {
        let (cpu, secs) = timed(|| solve(&problem, Solver::Multigrid, TOLERANCE));
        let apart = cpu.psi.iter().zip(&solution.psi).map(|(a, b)| (a - b).abs()).fold(0.0, f32::max);
        print!("  {:7.1}  {:10}  {apart:5.0e}", 1e3 * secs, cpu.iterations);
    }
    println!();
    Ok(())
}

fn timed<T>(run: impl FnOnce() -> T) -> (T, f64) {
    let now = || {
        let now = clock_gettime(ClockId::Monotonic);
        now.tv_sec as f64 + now.tv_nsec as f64 * 1e-9
    };
    let start = now();
    let result = run();
    (result, now() - start)
}

/// A cube with walls strewn all over it, the robot in one corner, and a patch of goals in the opposite face.
fn walled(size: usize) -> Problem {
    let dim = size + 2;
    let mut random = 1_u64;
    let mut is_wall = || {
        random = random.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        (random >> 33) % 100 < WALLS
    };
    let mut cells = vec![Cell::Outside; dim * dim * dim];
    for z in 1..=size {
        for y in 1..=size {
            let row = (z * dim + y) * dim;
            for cell in &mut cells[row + 1..=row + size] {
                *cell = if is_wall() { Cell::Outside } else { Cell::Inside };
            }
        }
    }
    let at = |x: usize, y: usize, z: usize| (z * dim + y) * dim + x;
    for (y, z) in (size / 2..size / 2 + 4).flat_map(|y| (size / 2..size / 2 + 4).map(move |z| (y, z))) {
        cells[at(size, y, z)] = Cell::Sink;
    }
    cells[at(2, 2, 2)] = Cell::Source;
    let region = Region::new(Voxel::new(0, 0, 0), [dim; 3], 0.1);
    Problem::new(region, cells).expect("all faces are outside").connected()
}
