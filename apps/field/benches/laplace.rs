//! Laplace's equation on boxes full of furniture, in one run: multigrid-CG beside Jacobi-CG and the thesis' Gauss-Seidel;
//! cubes of growing size, and flat domains, down to one layer of voxels; and what a change of 1 % of a cube costs.
//!
//! `cargo bench -p elk-field --bench laplace [-- rooms] [cubes] [flat] [change] [edge…]`: all of it, or what is named; edges
//! are those of cubes. Bytes are what a process grows by, and mean something for the first box of a process only, and for
//! larger ones after it. Time is CPU time of the thread, the smallest of a few solves (one for Gauss-Seidel); the error is the
//! largest difference from a multigrid solution of residual 1e-7 on ψ's range of 1; turned is by how much gradients point
//! elsewhere than those of that, at the median and in the worst hundredth.

use elk_field::{Cell, Domain, Problem, Solution, Solver, solve};
use elk_geometry::{Region, Voxel};
use rustix::time::{ClockId, clock_gettime};

/// Edges of the cubes (voxels).
const EDGES: [usize; 4] = [51, 100, 200, 300];
/// Flat domains (voxels).
const FLAT: [[usize; 3]; 6] =
    [[65, 65, 5], [257, 257, 5], [1025, 1025, 5], [65, 65, 1], [257, 257, 1], [1025, 1025, 1]];
/// Edge of the cube that changes.
const CHANGED: usize = 100;

/// Seconds of CPU that this thread has used.
fn thread_cpu_secs() -> f64 {
    let now = clock_gettime(ClockId::ThreadCPUTime);
    now.tv_sec as f64 + now.tv_nsec as f64 * 1e-9
}

fn main() {
    let arguments: Vec<String> = std::env::args().skip(1).filter(|arg| arg != "--bench").collect();
    let is_asked = |what: &str| arguments.is_empty() || arguments.iter().any(|argument| argument == what);
    let edges: Vec<usize> = arguments.iter().filter_map(|argument| argument.parse().ok()).collect();
    if is_asked("rooms") {
        rooms();
    }
    if is_asked("cubes") {
        scale(EDGES.map(|edge| [edge; 3]));
    }
    if !edges.is_empty() {
        scale(edges.into_iter().map(|edge| [edge; 3]));
    }
    if is_asked("flat") {
        scale(FLAT);
    }
    if is_asked("change") {
        change(CHANGED);
    }
}

/// A cube in which a box of 1 % of the voxels is filled. What it takes to bring the equations into line with that, and the
/// field that comes of it from there: from the field before, from nothing, and nearly, by a cascade.
fn change(edge: usize) {
    let problem = scattered([edge; 3]);
    let mut cells = problem.cells().to_vec();
    for (i, cell) in cells.iter_mut().enumerate().filter(|(_, cell)| **cell == Cell::Inside) {
        let voxel = problem.region().voxel(i).to_array();
        if voxel.iter().all(|c| (40..62).contains(c)) {
            *cell = Cell::Outside;
        }
    }
    let changed = Problem::new(problem.region().clone(), cells).expect("all faces are outside");
    let (_, cold) = fastest(3, || solve(&changed, Solver::Multigrid, 1e-6));
    println!("a change of 1 % in {edge}³, shares of a cold solution of {:.1} ms", cold * 1e3);
    println!("from          equations  residual there  iterations  solution");
    for name in ["the field", "nothing", "a cascade"] {
        let mut domain = Domain::of(&problem);
        domain.solve(1e-6, || false);
        // No iteration: the equations are made, and what is left is looked at twice.
        let (left, equations) = timed(|| {
            domain.update(&changed);
            if name == "nothing" {
                domain.forget();
            }
            domain.solve(f64::INFINITY, || false).residual
        });
        let (iterations, secs) = timed(|| match name {
            "a cascade" => domain.cascade(1e-3, || false),
            _ => domain.solve(1e-6, || false).iterations,
        });
        println!("{name:12}  {:9.3}  {left:14.1e}  {iterations:10}  {:8.3}", equations / cold, secs / cold);
    }
}

/// What some work answers, and the seconds of CPU that it took.
fn timed<T>(work: impl FnOnce() -> T) -> (T, f64) {
    let start = thread_cpu_secs();
    let answer = work();
    (answer, thread_cpu_secs() - start)
}

fn rooms() {
    println!(
        "unknowns  sinks  solver                 iterations  residual  error    turned, °      ms        of multigrid"
    );
    // The thesis' apartment, kitchen and small hall, in voxels of 0.1 m; the last one late in a run, with few goals left.
    for (inner, sinks) in [([60, 80, 20], 40), ([80, 80, 30], 40), ([80, 80, 30], 1), ([100, 100, 50], 1)] {
        compare(&furnished(inner, sinks));
    }
    println!();
}

/// Boxes of voxels with furniture in them that takes 12 %.
fn scale(boxes: impl IntoIterator<Item = [usize; 3]>) {
    println!("box          unknowns  iterations  residual       ms  ns an unknown  bytes an unknown");
    for inner in boxes {
        let runs = (216_000 / inner.iter().product::<usize>()).clamp(2, 20);
        let problem = scattered(inner);
        let unknowns = problem.cells().iter().filter(|c| **c == Cell::Inside).count() as f64;
        // The peak is counted anew from here.
        std::fs::write("/proc/self/clear_refs", "5").expect("Linux allows it");
        let before = status("VmRSS");
        drop(solve(&problem, Solver::Multigrid, 1e-6));
        let bytes = status("VmHWM") - before;
        let (solution, secs) = fastest(runs, || solve(&problem, Solver::Multigrid, 1e-6));
        println!(
            "{:11}  {unknowns:8}  {:10}  {:8.1e}  {:7.1}  {:13.1}  {:16.1}",
            inner.map(|n| n.to_string()).join("×"),
            solution.iterations,
            solution.residual,
            secs * 1e3,
            secs * 1e9 / unknowns,
            bytes / unknowns,
        );
    }
    println!();
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
        ("multigrid-CG 1e-2", Solver::Multigrid, 1e-2, 3),
        ("cascade 1e-3", Solver::Cascade, 1e-3, 3),
        ("Jacobi-CG 1e-6", Solver::Jacobi, 1e-6, 3),
        ("thesis' GS, eps 1e-4", Solver::Thesis, 1e-4, 1),
    ] {
        let (solution, secs) = fastest(runs, || solve(problem, solver, tolerance));
        if baseline.is_nan() {
            baseline = secs;
        }
        let turned = turned(problem, &solution, &exact);
        println!(
            "{:8}  {:5}  {name:21}  {:10}  {:8.1e}  {:7.1e}  {:5.1} {:5.1}  {:8.1}  {:8.2}",
            count(Cell::Inside),
            count(Cell::Sink),
            solution.iterations,
            solution.residual,
            error(&solution, &exact),
            turned[0],
            turned[1],
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

/// By how much gradients are turned (degrees), at the median and in the worst hundredth, where all six neighbours are inside.
fn turned(problem: &Problem, a: &Solution, b: &Solution) -> [f64; 2] {
    let [nx, ny, _] = problem.dim();
    let is_inside = |i: usize| problem.cells()[i] == Cell::Inside;
    let steps = [1, nx, nx * ny];
    let among = (0..a.psi.len()).filter(|i| is_inside(*i));
    let slopes = |psi: &[f32], i: usize| steps.map(|step| f64::from(psi[i + step] - psi[i - step]));
    let product = |a: [f64; 3], b: [f64; 3]| a.iter().zip(b).map(|(a, b)| a * b).sum::<f64>();
    let mut angles: Vec<f64> = among
        .filter(|i| steps.iter().all(|step| is_inside(i + step) && is_inside(i - step)))
        .map(|i| {
            let (a, b) = (slopes(&a.psi, i), slopes(&b.psi, i));
            (product(a, b) / (product(a, a) * product(b, b)).sqrt()).clamp(-1.0, 1.0).acos().to_degrees()
        })
        .collect();
    angles.sort_by(f64::total_cmp);
    [0.5, 0.99].map(|share| angles[(angles.len() as f64 * share) as usize])
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
        self.fill(self.inner.map(|n| 1.min(n - 1)), [1, 1, 1], Cell::Source);
        let region = Region::new(Voxel::new(0, 0, 0), self.inner.map(|n| n + 2), 0.1);
        Problem::new(region, self.cells).expect("all faces are outside").connected()
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

/// A box of `inner` voxels with furniture all over it that takes 12 %, and two patches of goals on the far wall.
fn scattered(inner: [usize; 3]) -> Problem {
    let mut room = Furniture::new(inner);
    let (mut taken, all) = (0, inner.iter().product::<usize>());
    let [nx, ny, nz] = inner;
    while taken * 100 < all * 12 {
        let from = [4 + room.below(nx - 8), 4 + room.below(ny - 8), room.below(nz.saturating_sub(4).max(1))];
        let size = [2 + room.below(7), 2 + room.below(7), 2 + room.below(7)];
        taken += room.fill(from, size, Cell::Outside);
    }
    for part in [4, 2] {
        room.fill([nx - 1, ny / part, nz / part], [1, 4, 4], Cell::Sink);
    }
    room.problem()
}
