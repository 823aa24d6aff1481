//! Laplace's equation on boxes full of furniture: multigrid-CG beside Jacobi-CG and the thesis' Gauss-Seidel, in one run.
//!
//! `cargo bench -p elk-field --bench laplace`. Then cubes of growing size, multigrid only. Time is CPU time of the thread, the smallest of three solves (one for
//! Gauss-Seidel); the error is the largest difference from a multigrid solution of residual 1e-7 on ψ's range of 1.

use elk_field::{Cell, Domain, Problem, Solution, Solver, solve};
use elk_geometry::{Region, Voxel};
use rustix::time::{ClockId, clock_gettime};

/// Seconds of CPU that this thread has used.
fn thread_cpu_secs() -> f64 {
    let now = clock_gettime(ClockId::ThreadCPUTime);
    now.tv_sec as f64 + now.tv_nsec as f64 * 1e-9
}

fn main() {
    let edges: Vec<usize> = std::env::args().filter_map(|arg| arg.parse().ok()).collect();
    if edges.is_empty() {
        rooms();
    }
    println!("edge  unknowns  iterations  residual       ms  ns an unknown  bytes an unknown");
    for edge in if edges.is_empty() { vec![51, 100, 200, 300] } else { edges } {
        scale(edge);
    }
    println!("edge  change  of cold  iterations  of");
    change(100);
}

/// A cube in which a box of 1 % of the voxels is filled, and the field that comes of it, from the equations that were kept:
/// from the field before, and from nothing.
fn change(edge: usize) {
    let problem = scattered(edge);
    let mut cells = problem.cells().to_vec();
    for (i, cell) in cells.iter_mut().enumerate().filter(|(_, cell)| **cell == Cell::Inside) {
        let voxel = problem.region().voxel(i).to_array();
        if voxel.iter().all(|c| (40..62).contains(c)) {
            *cell = Cell::Outside;
        }
    }
    let changed = Problem::new(problem.region().clone(), cells).expect("all faces are outside");
    let (cold, cold_secs) = timed(|| solve(&changed, Solver::Multigrid, 1e-6).iterations);
    for (name, forgets) in [("warm", false), ("kept", true)] {
        let mut domain = Domain::of(&problem);
        domain.solve(1e-6, || false);
        let (iterations, secs) = timed(|| {
            domain.update(&changed);
            if forgets {
                domain.forget();
            }
            domain.solve(1e-6, || false).iterations
        });
        println!("{edge:4}  {name:6}  {:7.2}  {iterations:10}  {cold}", secs / cold_secs);
    }
}

/// What some work answers, and the seconds of CPU that it took.
fn timed<T>(work: impl FnOnce() -> T) -> (T, f64) {
    let start = thread_cpu_secs();
    let answer = work();
    (answer, thread_cpu_secs() - start)
}

fn rooms() {
    println!("unknowns  sinks  solver                 iterations  residual  error    ms        of multigrid");
    // The thesis' apartment, kitchen and small hall, in voxels of 0.1 m; the last one late in a run, with few goals left.
    for (inner, sinks) in [([60, 80, 20], 40), ([80, 80, 30], 40), ([80, 80, 30], 1), ([100, 100, 50], 1)] {
        compare(&furnished(inner, sinks));
    }
    println!();
}

/// A cube of `edge` voxels with boxes in it that take 12 %.
fn scale(edge: usize) {
    let runs = (60 / edge).pow(2).max(2);
    let problem = scattered(edge);
    let unknowns = problem.cells().iter().filter(|c| **c == Cell::Inside).count() as f64;
    // The peak is counted anew from here.
    std::fs::write("/proc/self/clear_refs", "5").expect("Linux allows it");
    let before = status("VmRSS");
    drop(solve(&problem, Solver::Multigrid, 1e-6));
    let bytes = status("VmHWM") - before;
    let (solution, secs) = fastest(runs, || solve(&problem, Solver::Multigrid, 1e-6));
    println!(
        "{edge:4}  {unknowns:8}  {:10}  {:8.1e}  {:7.1}  {:13.1}  {:16.1}",
        solution.iterations,
        solution.residual,
        secs * 1e3,
        secs * 1e9 / unknowns,
        bytes / unknowns,
    );
}

/// A line of this process' status (bytes).
fn status(line: &str) -> f64 {
    let status = std::fs::read_to_string("/proc/self/status").expect("Linux has it");
    let line = status.lines().find_map(|l| l.strip_prefix(line)).expect("Linux has the line");
    line.split_whitespace().nth(1).and_then(|kib| kib.parse().ok()).map_or(f64::NAN, |kib: f64| kib * 1024.0)
}

fn compare(problem: &Problem) {
    let count = |kind| problem.cells().iter().filter(|c| **c == kind).count();
    let exact = solve(problem, Solver::Multigrid, 1e-7);
    let mut baseline = f64::NAN;
    for (name, solver, tolerance, runs) in [
        ("multigrid-CG 1e-6", Solver::Multigrid, 1e-6, 3),
        ("Jacobi-CG 1e-6", Solver::Jacobi, 1e-6, 3),
        ("thesis' GS, eps 1e-4", Solver::Thesis, 1e-4, 1),
    ] {
        let (solution, secs) = fastest(runs, || solve(problem, solver, tolerance));
        if baseline.is_nan() {
            baseline = secs;
        }
        println!(
            "{:8}  {:5}  {name:21}  {:10}  {:8.1e}  {:7.1e}  {:8.1}  {:8.1}",
            count(Cell::Inside),
            count(Cell::Sink),
            solution.iterations,
            solution.residual,
            error(&solution, &exact),
            secs * 1e3,
            secs / baseline
        );
    }
}

fn fastest(runs: usize, solve: impl Fn() -> Solution) -> (Solution, f64) {
    let (mut solution, mut best) = timed(&solve);
    for _ in 1..runs {
        let (again, secs) = timed(&solve);
        (solution, best) = (again, best.min(secs));
    }
    (solution, best)
}

fn error(a: &Solution, b: &Solution) -> f32 {
    a.psi.iter().zip(&b.psi).map(|(a, b)| (a - b).abs()).fold(0.0, f32::max)
}

/// A box of `inner` voxels that is being furnished, with a margin of one voxel around it.
struct Furniture {
    inner: [usize; 3],
    cells: Vec<Cell>,
    random: u64,
}

impl Furniture {
    fn new(inner: [usize; 3]) -> Self {
        let dim = inner.map(|n| n + 2);
        let mut room = Self { inner, cells: vec![Cell::Outside; dim.iter().product()], random: 1 };
        room.fill([0; 3], inner, Cell::Inside);
        room
    }

    fn below(&mut self, n: usize) -> usize {
        self.random = self.random.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        (self.random >> 33) as usize % n
    }

    /// Fills a box; answers how many cells were something else.
    fn fill(&mut self, from: [usize; 3], size: [usize; 3], cell: Cell) -> usize {
        let dim = self.inner.map(|n| n + 2);
        let end = |axis: usize| (from[axis] + size[axis]).min(self.inner[axis]);
        let mut changed = 0;
        for z in from[2]..end(2) {
            for y in from[1]..end(1) {
                let start = ((z + 1) * dim[1] + y + 1) * dim[0] + 1;
                for at in &mut self.cells[start + from[0]..start + end(0)] {
                    changed += usize::from(*at != cell);
                    *at = cell;
                }
            }
        }
        changed
    }

    /// What the robot in the corner can get to.
    fn problem(mut self) -> Problem {
        self.fill([1, 1, 1], [1, 1, 1], Cell::Source);
        let dim = self.inner.map(|n| n + 2);
        connected(dim, &mut self.cells);
        Problem::new(Region::new(Voxel::new(0, 0, 0), dim, 0.1), self.cells).expect("all faces are outside")
    }
}

/// A room of `inner` voxels with the robot in one corner, boxes of furniture in it, and in `sinks` places of the far
/// wall a patch of goals.
fn furnished(inner: [usize; 3], sinks: usize) -> Problem {
    let mut room = Furniture::new(inner);
    for _ in 0..inner[0] * inner[1] / 150 {
        let from = [4 + room.below(inner[0] - 8), 4 + room.below(inner[1] - 8), 0];
        let size = [3 + room.below(10), 3 + room.below(10), 3 + room.below(inner[2])];
        room.fill(from, size, Cell::Outside);
    }
    for _ in 0..sinks {
        let from = [inner[0] - 1, room.below(inner[1] - 4), room.below(inner[2] - 4)];
        room.fill(from, [1, 4, 4], Cell::Sink);
    }
    room.problem()
}

/// A cube with boxes all over it that take 12 % of its voxels, and two patches of goals on the far wall.
fn scattered(edge: usize) -> Problem {
    let mut room = Furniture::new([edge; 3]);
    let mut taken = 0;
    while taken * 100 < edge.pow(3) * 12 {
        let from = [4 + room.below(edge - 8), 4 + room.below(edge - 8), room.below(edge - 4)];
        let size = [2 + room.below(7), 2 + room.below(7), 2 + room.below(7)];
        taken += room.fill(from, size, Cell::Outside);
    }
    for place in [edge / 4, edge / 2] {
        room.fill([edge - 1, place, place], [1, 4, 4], Cell::Sink);
    }
    room.problem()
}

/// Leaves out what the robot cannot get to.
fn connected([nx, ny, _]: [usize; 3], cells: &mut [Cell]) {
    let start = cells.iter().position(|c| *c == Cell::Source).unwrap_or_default();
    let mut found = vec![false; cells.len()];
    found[start] = true;
    let mut open = vec![start];
    while let Some(i) = open.pop() {
        for n in [i - 1, i + 1, i - nx, i + nx, i - nx * ny, i + nx * ny] {
            if !found[n] && cells[n] != Cell::Outside {
                found[n] = true;
                open.push(n);
            }
        }
    }
    for (cell, found) in cells.iter_mut().zip(found) {
        if !found {
            *cell = Cell::Outside;
        }
    }
}
