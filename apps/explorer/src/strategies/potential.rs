//! The thesis' own method (6.4, 6.5.1.5): follow a streamline of the harmonic potential between robot and frontier.

mod inflow;

use std::collections::{BTreeMap, BTreeSet};

use elk_bus::tell;
use elk_field::{Cell, Field, Isovolumes, Problem, Solution, Solver, Streamline, Termination, solve_unless};
use elk_geometry::bricks::{BRICK_CELLS, brick_of, cell_of};
use elk_geometry::mask::{self, Mask};
use elk_geometry::{Polyline, Voxel, astar};
use elk_mission::{AppType, Kind, ParamSpec, Params, joined};
use nalgebra::{Point3, Vector3};

use super::card::Card;
use crate::app::{COMMON, app, param};
use crate::extent::Extent;
use crate::journal::Journal;
use crate::pictures;
use crate::strategy::{Route, Strategy, View};
use inflow::Inflow;

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
        Kind::Choice(&["policy", "flux", "shortest", "frontier"]),
        "policy",
        "The streamline to follow: the one of largest flux, the shortest of 26, or as the policy has it (thesis: flux, elk: \
         shortest). frontier: of the 26 the one to the goals, of those that lie together, into which most flows for its length.",
    ),
    param(
        "Solver",
        Kind::Choice(&["cascade", "multigrid", "jacobi", "thesis", "gpu"]),
        "cascade",
        "How Laplace's equation is solved: conjugate gradients preconditioned by multigrid or by the diagonal, or \
         Gauss-Seidel as in the thesis; gpu: the first of them on a graphics card, where there is one; cascade: on voxels of \
         twice the edge, then smoothed, and by multigrid where a streamline of that leads nowhere.",
    ),
    param(
        "Tolerance",
        Kind::Number { unit: "", min: 0.0, max: 1.0 },
        "0",
        "When the solver stops: relative residual, for Solver thesis largest relative change; 0: 1e-6, for cascade 1e-3 (on \
         the larger voxels) and for thesis 1e-4.",
    ),
    param(
        "MaxVoxels",
        Kind::Integer { min: 10_000, max: 1_000_000_000 },
        "8000000",
        "Voxels that the field is solved over, at about 40 bytes for each free one: for Solver cascade and multigrid of the \
         bricks that the robot can get to, or, if that is too much, of the box of what is near; for the others of a box of all \
         that is known, or of what the robot can get to.",
    ),
    param(
        "Isovolumes",
        Kind::Number { unit: "", min: 0.0, max: 1.0 },
        "0",
        "Solver multigrid leaves out volumes in which nothing flows, as long as no more than this share of the flow from the \
         robot may depend on it; 0: none.",
    ),
];

fn potential(params: &Params) -> Potential {
    let solver = match params.text("Solver") {
        "cascade" => Solver::Cascade,
        "thesis" => Solver::Thesis,
        "jacobi" => Solver::Jacobi,
        _ => Solver::Multigrid,
    };
    let start = match (params.text("Start"), params.text("Policy")) {
        ("flux", _) | ("policy", "thesis") => Start::Flux,
        ("frontier", _) => Start::Frontier,
        _ => Start::Shortest,
    };
    let tolerance = match params.number("Tolerance") {
        0.0 => solver.usual_tolerance(),
        tolerance => tolerance,
    };
    let card = (params.text("Solver") == "gpu").then(Card::open).and_then(|card| card.map_err(warn).ok());
    let isovolumes = params.number("Isovolumes");
    if isovolumes > 0.0 && params.text("Solver") != "multigrid" {
        tell(format_args!("Isovolumes is of no use with Solver {}: only multigrid seals any", params.text("Solver")));
    }
    let potential = Potential::new(start, solver, tolerance).with_isovolumes(isovolumes);
    // The table keeps it positive.
    let max_voxels = params.integer("MaxVoxels") as usize;
    Potential { card, max_voxels, ..potential }
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
    /// Of the same 26 the one whose length is the least for what flows into the goals, of those that lie together, at its end.
    Frontier,
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
    /// Voxels that the field is solved over, at most.
    max_voxels: usize,
    /// Where they are, as it was at the plan before.
    extent: Option<Extent>,
    /// Where the robot can be in it, with its place and its goals, and ψ.
    domain: Isovolumes,
    /// Bricks of `domain` with the robot's place or with goals in them.
    fixed: BTreeSet<Voxel>,
}

impl Strategy for Potential {
    fn name(&self) -> &'static str {
        "Potential"
    }

    fn describe(&self) -> String {
        let start = match self.start {
            Start::Flux => "the streamline of largest flux",
            Start::Shortest => "the shortest of 26 streamlines",
            Start::Frontier => "of 26 streamlines the one to the frontier into which most flows for its length",
        };
        if let Some(card) = &self.card {
            return format!("{start}; field by {}, residual {:e}", card.name(), self.tolerance);
        }
        if self.domain.share() > 0.0 && self.solver == Solver::Multigrid {
            let share = self.domain.share();
            return format!("{start}; field by multigrid-CG, residual {:e}, isovolumes {share}", self.tolerance);
        }
        let solver = match self.solver {
            Solver::Cascade => "cascade, residual",
            Solver::Multigrid => "multigrid-CG, residual",
            Solver::Jacobi => "Jacobi-CG, residual",
            Solver::Thesis => "Gauss-Seidel, largest relative change",
        };
        format!("{start}; field by {solver} {:e}", self.tolerance)
    }

    fn plan(&mut self, view: &View<'_>, journal: &mut Journal) -> Option<Route> {
        let stopping = journal.stop_signal();
        let iterations = journal.time("field", || self.solve(view, stopping))?;
        journal.count("iterations", iterations as u64);
        journal.count("blocks", self.domain.blocks().count() as u64);
        journal.count("sealed blocks", self.domain.sealed().count() as u64);
        let is_watched = journal.is_watched();
        let mut ways = journal.time("streamline", || self.follow(view, is_watched));
        if self.solver == Solver::Cascade && ways.arrived == 0 && !journal.is_to_stop() {
            // What is nearly solved leads nowhere, so it is solved.
            let tolerance = Solver::Multigrid.usual_tolerance();
            let iterations = journal.time("field", || self.domain.solve_on(tolerance, stopping).iterations);
            journal.count("iterations after a cascade", iterations as u64);
            ways = journal.time("streamline", || self.follow(view, is_watched));
        }
        journal.count("stalls", ways.stalled);
        journal.draw(|| pictures::slice(self.domain.domain(), view.from, view.space.resolution()));
        journal.draw(|| pictures::streamlines(&ways.lines, view.space.resolution()));
        ways.best.filter(|_| !journal.is_to_stop()).map(|(_, route)| route)
    }
}

/// What streamlines lead to: how many arrived, how many stalled, and the route of all that costs least.
#[derive(Default)]
struct Ways {
    arrived: u64,
    stalled: u64,
    /// What it costs, and the route.
    best: Option<(f64, Route)>,
    /// The streamlines themselves (m), if they are to be drawn.
    lines: Vec<Vec<Point3<f64>>>,
}

impl Potential {
    /// The same, of which multigrid may leave out what no more than this `share` of the flow depends on ([`Isovolumes`]). What
    /// is sealed is not left to a successor: its plans are as good, but not the same to the bit.
    pub fn with_isovolumes(self, share: f64) -> Self {
        Self { domain: Isovolumes::new(share), ..self }
    }

    /// One that has not planned yet, without a card.
    pub fn new(start: Start, solver: Solver, tolerance: f64) -> Self {
        let (domain, fixed) = (Isovolumes::new(0.0), BTreeSet::new());
        Self { start, solver, tolerance, card: None, max_voxels: MAX_VOXELS, extent: None, domain, fixed }
    }

    /// Solves for ψ in the domain, and answers in how many iterations; `None`: there is nothing to solve.
    fn solve(&mut self, view: &View<'_>, stopping: impl Fn() -> bool) -> Option<usize> {
        let is_by_blocks = self.card.is_none() && matches!(self.solver, Solver::Cascade | Solver::Multigrid);
        let extent = match is_by_blocks {
            true => Extent::of_bricks(view.space, self.max_voxels),
            false => Extent::of(view.space, self.max_voxels),
        };
        self.update(view, &extent);
        let is_in = |(brick, cells): (Voxel, &Mask)| mask::and(cells, &extent.cells(brick)) != mask::NONE;
        if !view.goals.bricks().any(is_in) {
            return None;
        }
        match self.solver {
            Solver::Cascade => return Some(self.domain.cascade(self.tolerance, stopping)),
            Solver::Multigrid if is_by_blocks => return Some(self.domain.solve(self.tolerance, stopping).0.iterations),
            _ => {}
        }
        // The region has a margin of what is outside, so this is a problem.
        let region = extent.region(view.space.resolution());
        let cells = (0..region.len()).map(|i| self.domain.cell(region.voxel(i))).collect();
        let problem = Problem::new(region.clone(), cells).ok()?;
        let solution = self.solve_by_card(&problem, &stopping);
        let solution = solution.unwrap_or_else(|| solve_unless(&problem, self.solver, self.tolerance, stopping));
        self.domain.take_psi(&region, &solution.psi);
        Some(solution.iterations)
    }

    /// By the card, if there is one that is large enough and does not fail; it is not asked again if not.
    fn solve_by_card(&mut self, problem: &Problem, stopping: impl Fn() -> bool) -> Option<Solution> {
        match self.card.as_ref()?.solve_unless(problem, self.tolerance, stopping) {
            Ok(solution) => Some(solution),
            Err(why) => {
                warn(why);
                self.card = None;
                None
            }
        }
    }

    /// Tells the domain what is other than it was at the plan before: ψ is 1 where the route starts, 0 at the goals, and sought
    /// wherever else the robot can be.
    fn update(&mut self, view: &View<'_>, extent: &Extent) {
        let start = view.space.start();
        let mut goals: BTreeMap<Voxel, Mask> = view.goals.bricks().map(|(brick, cells)| (brick, *cells)).collect();
        goals.entry(brick_of(start)).or_insert(mask::NONE);
        let before = std::mem::replace(&mut self.fixed, goals.keys().copied().collect());
        let is_as_it_was = self.extent.replace(*extent).is_some_and(|before| before.has_the_same_reached(extent));
        let bricks: BTreeSet<Voxel> = match view.changed.filter(|_| is_as_it_was) {
            Some(changed) => changed.iter().chain(&before).chain(&self.fixed).copied().collect(),
            None => view.space.reach.bricks().map(|(brick, _)| brick).chain(self.domain.blocks()).collect(),
        };
        for brick in bricks {
            let open = mask::and(view.space.reach.brick(brick), &extent.cells(brick));
            let mut cells = [Cell::Outside; BRICK_CELLS];
            mask::cells(&open).for_each(|cell| cells[cell] = Cell::Inside);
            if let Some(goals) = goals.get(&brick) {
                mask::cells(&mask::and(goals, &open)).for_each(|cell| cells[cell] = Cell::Sink);
            }
            if brick == brick_of(start) {
                cells[cell_of(start)] = Cell::Source;
            }
            self.domain.set_block(brick, &cells);
        }
    }

    fn follow(&self, view: &View<'_>, is_watched: bool) -> Ways {
        let mut field = Field::of(self.domain.domain(), view.space.resolution());
        let seeds = match self.start {
            Start::Flux => largest_flux(view, &field).into_iter().collect(),
            Start::Shortest | Start::Frontier => seeds(view, &mut field),
        };
        let (inflow, lines) = match self.start {
            // Each to its end: a longer one may lead to where more flows.
            Start::Frontier => {
                let lines = seeds.iter().flat_map(|seed| field.trace(view.from, &[*seed], LONGEST_M)).collect();
                (Some(Inflow::of(view.goals.iter().map(|goal| goal.voxel), &field)), lines)
            }
            Start::Flux | Start::Shortest => (None, field.trace(view.from, &seeds, LONGEST_M)),
        };
        let mut ways = Ways::default();
        for line in lines {
            match line.end {
                Termination::Goal(_) => ways.arrived += 1,
                Termination::Stalled(_) => ways.stalled += 1,
                Termination::TooLong => {}
            }
            if is_watched {
                ways.lines.push(line.points.clone());
            }
            let Some(route) = arrive(view, &mut field, line) else {
                continue;
            };
            let length = Polyline::new(route.points.iter().copied()).map_or(0.0, |p| p.length());
            let cost = inflow.as_ref().map_or(length, |inflow| length / inflow.share(route.goal));
            if ways.best.as_ref().is_none_or(|(least, _)| cost < *least) {
                ways.best = Some((cost, route));
            }
        }
        ways
    }
}

/// The centre of the face neighbour that most flows into.
fn largest_flux(view: &View<'_>, field: &Field<'_>) -> Option<Point3<f64>> {
    let mut best: Option<Voxel> = None;
    for n in face_neighbours(view, field) {
        if best.is_none_or(|b| field.psi(n) < field.psi(b)) {
            best = Some(n);
        }
    }
    best.map(|n| view.space.center(n))
}

fn face_neighbours(view: &View<'_>, field: &Field<'_>) -> impl Iterator<Item = Voxel> {
    view.space.start().face_neighbours().into_iter().filter(|n| field.cell(*n) != Cell::Outside)
}

/// The centres of the face neighbours, and points evenly around the start (a Fibonacci lattice on the sphere).
fn seeds(view: &View<'_>, field: &mut Field<'_>) -> Vec<Point3<f64>> {
    let golden = std::f64::consts::PI * (3.0 - 5f64.sqrt());
    let around = (0..SEED_DIRECTIONS).map(|k| {
        let z = 1.0 - (2 * k + 1) as f64 / SEED_DIRECTIONS as f64;
        let r = (1.0 - z * z).sqrt();
        let angle = golden * k as f64;
        view.from + SEED_DISTANCE_M * Vector3::new(r * angle.cos(), r * angle.sin(), z)
    });
    let mut seeds: Vec<Point3<f64>> = face_neighbours(view, field).map(|n| view.space.center(n)).collect();
    seeds.extend(around.filter(|p| field.connected(view.from, *p)));
    seeds
}

/// The route along a streamline. Where it stalls, on by steepest descent over voxels, and if that ends too, by A*.
fn arrive(view: &View<'_>, field: &mut Field<'_>, line: Streamline) -> Option<Route> {
    let mut points = line.points;
    let goal = match line.end {
        Termination::Goal(goal) => goal,
        Termination::TooLong => return None,
        Termination::Stalled(at) => {
            let way = rescue(view, field, at)?;
            points.extend(way.iter().map(|voxel| view.space.center(*voxel)));
            *way.last()?
        }
    };
    Some(Route { points, goal })
}

fn rescue(view: &View<'_>, field: &mut Field<'_>, at: Voxel) -> Option<Vec<Voxel>> {
    let descended = field.descend(at).ok();
    let is_goal = |voxel| view.goals.contains(voxel);
    descended.or_else(|| astar::closest_of(&view.space.reach, at, is_goal, || view.goals.boxes()))
}
