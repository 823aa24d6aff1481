//! The thesis' own method (6.4, 6.5.1.5): follow a streamline of the harmonic potential between robot and frontier.

use elk_bus::tell;
use elk_field::{Cell, Convergence, Domain, Field, Problem, ProblemError, Solution, Solver, Termination, solve_unless};
use elk_geometry::{Polyline, Voxel, astar};
use elk_mission::{AppType, Kind, ParamSpec, Params, joined};
use nalgebra::{Point3, Vector3};

use super::card::Card;
use crate::app::{COMMON, app, param};
use crate::extent::Extent;
use crate::journal::Journal;
use crate::strategy::{Route, Strategy, View};

/// Distance from the robot at which streamlines start, beside those through its face neighbours (m).
const SEED_DISTANCE_M: f64 = 0.15;
/// Directions in which they start.
const SEED_DIRECTIONS: usize = 20;
/// Past this a streamline has lost its way (m).
const LONGEST_M: f64 = 1000.0;

/// Voxels that a field is solved over at most, if nothing is said.
const MAX_VOXELS: usize = 8_000_000;

/// Its row in the table of explorers.
pub const TYPE: AppType = AppType {
    element: "Explorer",
    name: "Potential",
    summary: "Follows a streamline of the harmonic potential between robot and frontier (Laplace's equation, RK4).",
    params: &joined::<{ COMMON.len() + PARAMS.len() }>(COMMON, PARAMS),
    build: |params| app(params, Box::new(potential(params))),
    preflight: None,
};

const PARAMS: &[ParamSpec] = &[
    param(
        "Start",
        Kind::Choice(&["policy", "flux", "shortest"]),
        "policy",
        "The streamline to follow: the one of largest flux, the shortest of 26, or as the policy has it (thesis: flux, elk: \
         shortest).",
    ),
    param(
        "Solver",
        Kind::Choice(&["multigrid", "jacobi", "thesis", "gpu"]),
        "multigrid",
        "How Laplace's equation is solved: conjugate gradients preconditioned by multigrid or by the diagonal, or \
         Gauss-Seidel as in the thesis; gpu: the first of them on a graphics card, where there is one.",
    ),
    param(
        "Tolerance",
        Kind::Number { unit: "", min: 0.0, max: 1.0 },
        "0",
        "When the solver stops: relative residual, for Solver thesis largest relative change; 0: 1e-6, and 1e-4 for thesis.",
    ),
    param(
        "MaxVoxels",
        Kind::Integer { min: 10_000, max: 1_000_000_000 },
        "8000000",
        "Voxels of the box that the field is solved over, at about 42 bytes each. Of a larger map it is what the robot can get to, \
         or, if that is too much, what of it is near.",
    ),
];

fn potential(params: &Params) -> Potential {
    let solver = match params.text("Solver") {
        "thesis" => Solver::Thesis,
        "jacobi" => Solver::Jacobi,
        _ => Solver::Multigrid,
    };
    let start = match (params.text("Start"), params.text("Policy")) {
        ("flux", _) | ("policy", "thesis") => Start::Flux,
        _ => Start::Shortest,
    };
    let tolerance = match params.number("Tolerance") {
        0.0 => solver.usual_tolerance(),
        tolerance => tolerance,
    };
    let card = (params.text("Solver") == "gpu").then(Card::open).and_then(|card| card.map_err(warn).ok());
    // The table keeps it positive.
    let max_voxels = params.integer("MaxVoxels") as usize;
    Potential { card, max_voxels, ..Potential::new(start, solver, tolerance) }
}

/// Says why the CPU solves.
fn warn(why: String) {
    tell(format_args!("the field is solved by the CPU: {why}"));
}

/// Which streamline to follow.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Start {
    /// The one through the face neighbour of largest flux: the thesis' letter.
    Flux,
    /// The shortest of 26: through the face neighbours, and in 20 directions evenly around.
    Shortest,
}

/// Follows a streamline.
#[derive(Debug, Clone)]
pub struct Potential {
    /// Which streamline.
    pub start: Start,
    /// How the field is solved.
    pub solver: Solver,
    /// When the solver has done enough (see [`elk_field::solve`]).
    pub tolerance: f64,
    /// A card that does what [`Solver::Multigrid`] would.
    card: Option<Card>,
    /// Voxels of the box that the field is solved over, at most.
    max_voxels: usize,
    /// Multigrid's equations, as they were at the plan before.
    domain: Domain,
}

impl Strategy for Potential {
    fn name(&self) -> &'static str {
        "Potential"
    }

    fn describe(&self) -> String {
        let start = match self.start {
            Start::Flux => "the streamline of largest flux",
            Start::Shortest => "the shortest of 26 streamlines",
        };
        if let Some(card) = &self.card {
            return format!("{start}; field by {}, residual {:e}", card.name(), self.tolerance);
        }
        let solver = match self.solver {
            Solver::Multigrid => "multigrid-CG, residual",
            Solver::Jacobi => "Jacobi-CG, residual",
            Solver::Thesis => "Gauss-Seidel, largest relative change",
        };
        format!("{start}; field by {solver} {:e}", self.tolerance)
    }

    fn plan(&mut self, view: &View<'_>, journal: &mut Journal) -> Option<Route> {
        let extent = Extent::of(view.space, self.max_voxels);
        // Its region has a margin of what is outside, so this is one.
        let problem = problem(view, &extent).ok().filter(|problem| problem.cells().contains(&Cell::Sink))?;
        let stopping = journal.stop_signal();
        let solution = journal.time("field", || self.solve(&problem, stopping));
        if journal.is_to_stop() {
            return None;
        }
        journal.count("iterations", solution.iterations as u64);
        let field = Field { problem: &problem, psi: &solution.psi };
        let mut stalls = 0;
        let route = journal.time("streamline", || self.follow(view, &field, &mut stalls));
        journal.count("stalls", stalls);
        route
    }
}

impl Potential {
    /// One that has not planned yet, without a card.
    pub fn new(start: Start, solver: Solver, tolerance: f64) -> Self {
        Self { start, solver, tolerance, card: None, max_voxels: MAX_VOXELS, domain: Domain::new() }
    }

    /// By the card, if there is one that is large enough and does not fail; it is not asked again if not.
    fn solve(&mut self, problem: &Problem, stopping: impl Fn() -> bool) -> Solution {
        if let Some(card) = &self.card {
            match card.solve_unless(problem, self.tolerance, &stopping) {
                Ok(solution) => return solution,
                Err(why) => warn(why),
            }
            self.card = None;
        }
        self.solve_by_cpu(problem, stopping)
    }

    /// Multigrid keeps its equations from plan to plan, but not the field: a successor, which does not have it, would come to
    /// other roundings.
    fn solve_by_cpu(&mut self, problem: &Problem, stopping: impl Fn() -> bool) -> Solution {
        if self.solver != Solver::Multigrid {
            return solve_unless(problem, self.solver, self.tolerance, stopping);
        }
        self.domain.update(problem);
        self.domain.forget();
        let Convergence { iterations, residual } = self.domain.solve(self.tolerance, stopping);
        Solution { psi: self.domain.psi_of(problem.region()), iterations, residual }
    }

    fn follow(&self, view: &View<'_>, field: &Field<'_>, stalls: &mut u64) -> Option<Route> {
        let seeds = match self.start {
            Start::Flux => largest_flux(view, field).into_iter().collect(),
            Start::Shortest => seeds(view, field),
        };
        let mut best: Option<(f64, Route)> = None;
        for seed in seeds {
            let longest = best.as_ref().map_or(LONGEST_M, |(length, _)| *length);
            let Some(route) = flow(view, field, seed, longest, stalls) else {
                continue;
            };
            let length = Polyline::new(route.points.iter().copied()).map_or(0.0, |p| p.length());
            if length < longest {
                best = Some((length, route));
            }
        }
        best.map(|(_, route)| route)
    }
}

/// ψ is 1 where the route starts, 0 at the goals, and sought wherever else the robot can be.
fn problem(view: &View<'_>, extent: &Extent) -> Result<Problem, ProblemError> {
    let region = extent.region(view.space.resolution());
    let mut cells = vec![Cell::Outside; region.len()];
    for voxel in view.space.reach.iter().filter(|voxel| extent.contains(*voxel)) {
        if let Some(i) = region.index(voxel) {
            cells[i] = match voxel {
                _ if voxel == view.space.start() => Cell::Source,
                _ if view.goals.contains(voxel) => Cell::Sink,
                _ => Cell::Inside,
            };
        }
    }
    Problem::new(region, cells)
}

/// The centre of the face neighbour that most flows into.
fn largest_flux(view: &View<'_>, field: &Field<'_>) -> Option<Point3<f64>> {
    let mut best: Option<usize> = None;
    for n in face_neighbours(view, field) {
        if best.is_none_or(|b| field.psi[n] < field.psi[b]) {
            best = Some(n);
        }
    }
    best.map(|n| field.problem.region().center(n))
}

fn face_neighbours<'a>(view: &'a View<'_>, field: &'a Field<'_>) -> impl Iterator<Item = usize> + 'a {
    let region = field.problem.region();
    let beside = view.space.start().face_neighbours().into_iter().filter_map(|voxel| region.index(voxel));
    beside.filter(|n| field.problem.cells()[*n] != Cell::Outside)
}

/// The centres of the face neighbours, and points evenly around the start (a Fibonacci lattice on the sphere).
fn seeds(view: &View<'_>, field: &Field<'_>) -> Vec<Point3<f64>> {
    let golden = std::f64::consts::PI * (3.0 - 5f64.sqrt());
    let around = (0..SEED_DIRECTIONS).map(|k| {
        let z = 1.0 - (2 * k + 1) as f64 / SEED_DIRECTIONS as f64;
        let r = (1.0 - z * z).sqrt();
        let angle = golden * k as f64;
        view.from + SEED_DISTANCE_M * Vector3::new(r * angle.cos(), r * angle.sin(), z)
    });
    face_neighbours(view, field)
        .map(|n| field.problem.region().center(n))
        .chain(around.filter(|p| field.connected(view.from, *p)))
        .collect()
}

/// The streamline through `seed`. Where it stalls, on by steepest descent over voxels, and if that ends too, by A*.
fn flow(view: &View<'_>, field: &Field<'_>, seed: Point3<f64>, longest: f64, stalls: &mut u64) -> Option<Route> {
    let (line, end) = field.trace(seed, longest);
    let mut points = vec![view.from];
    points.extend(line);
    let region = field.problem.region();
    let goal = match end {
        Termination::Goal(goal) => region.voxel(goal),
        Termination::TooLong => return None,
        Termination::Stalled(at) => {
            *stalls += 1;
            let way = rescue(view, field, at)?;
            points.extend(way.iter().map(|voxel| view.space.center(*voxel)));
            *way.last()?
        }
    };
    Some(Route { points, goal })
}

fn rescue(view: &View<'_>, field: &Field<'_>, at: usize) -> Option<Vec<Voxel>> {
    let region = field.problem.region();
    let descended = field.descend(at).ok().map(|way| way.into_iter().map(|i| region.voxel(i)).collect());
    descended.or_else(|| astar::closest(&view.space.reach, region.voxel(at), |voxel| view.goals.contains(voxel)))
}
