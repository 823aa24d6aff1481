//! Laplace's equation, ∇²ψ = 0 (thesis 6.2.5, (6.19)), by finite differences on voxels (6.4.1, (6.27)).
//!
//! ψ is 1 at the source and 0 at the sinks (Dirichlet, (6.23)); no flux passes into anything else (Neumann, (6.24)). The thesis'
//! ±1 scale would lose digits where ψ is flat, and its mirror rule (6.28) gives a matrix that is not symmetric, is not
//! defined where both neighbours are missing, and moves ψ by up to 0.14; so a voxel here is the average of the
//! neighbours that exist, which is the finite volume form of zero flux, symmetric and positive definite.
//!
//! [`solve`] does it by conjugate gradients with a geometric multigrid preconditioner ([`crate::domain`]), with the
//! diagonal, or as the thesis does, by Gauss-Seidel sweeps until the largest relative change falls below ε
//! ([`relaxation`]). That rule bounds no error: on a late map it stops a quarter of the full range away from the solution,
//! after many times the work (docs/figures.md).

mod conjugate_gradients;
pub mod operator;
pub mod relaxation;

use operator::Operator;

use crate::domain::{Convergence, Domain};
use crate::problem::Problem;

/// How to solve it.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Solver {
    /// Conjugate gradients, preconditioned by a multigrid V-cycle.
    Multigrid,
    /// The same on cells merged 2 × 2 × 2, interpolated and smoothed ([`Domain::cascade`]): nearly a solution, whatever the
    /// tolerance.
    Cascade,
    /// Conjugate gradients, preconditioned by the diagonal.
    Jacobi,
    /// The thesis: Gauss-Seidel from the middle value until the largest relative change (6.29) is below the tolerance.
    Thesis,
}

impl Solver {
    /// The tolerance that serves: streamlines end in the same places from a residual of 1e-2 on, 1e-6 leaves a margin;
    /// the thesis has 1e-4.
    pub fn usual_tolerance(self) -> f64 {
        match self {
            Solver::Multigrid | Solver::Jacobi => 1e-6,
            Solver::Cascade => 1e-3,
            Solver::Thesis => 1e-4,
        }
    }
}

/// The field, and what it took.
#[derive(Debug, Clone, PartialEq)]
pub struct Solution {
    /// ψ of every cell of the box; 0 outside the domain.
    pub psi: Vec<f32>,
    /// Iterations, or sweeps.
    pub iterations: usize,
    /// ‖b − Aψ‖ / ‖b‖, computed from the field that is returned. Single precision keeps it above what the iteration
    /// itself arrives at, the more so the more cells there are; ψ is right to about 1e-6 all the same.
    pub residual: f64,
}

/// Solves a problem. `tolerance` is the residual relative to the right-hand side, or for [`Solver::Thesis`] its ε.
///
/// A source that no sink is connected to has no gradient: ψ is 1 all over its component then.
pub fn solve(problem: &Problem, solver: Solver, tolerance: f64) -> Solution {
    solve_unless(problem, solver, tolerance, || false)
}

/// As [`solve`]; it is given up, and the field is none, once somebody is `stopping`.
pub fn solve_unless(problem: &Problem, solver: Solver, tolerance: f64, stopping: impl Fn() -> bool) -> Solution {
    match solver {
        Solver::Multigrid | Solver::Cascade => {
            let mut domain = Domain::of(problem);
            let (iterations, residual) = match solver {
                Solver::Cascade => (domain.cascade(tolerance, stopping), domain.residual()),
                _ => {
                    let Convergence { iterations, residual } = domain.solve(tolerance, stopping);
                    (iterations, residual)
                }
            };
            Solution { psi: domain.into_psi_of(problem.region()), iterations, residual }
        }
        Solver::Jacobi => {
            on_the_box(problem, |operator, b| conjugate_gradients::solve(operator, b, tolerance, stopping))
        }
        Solver::Thesis => on_the_box(problem, |_, _| relaxation::gauss_seidel(problem, tolerance, stopping)),
    }
}

/// A solution by a solver that works on the whole box.
fn on_the_box(problem: &Problem, solve: impl FnOnce(&Operator, &[f32]) -> (Vec<f32>, usize)) -> Solution {
    let operator = Operator::of(problem);
    let b = operator::right_hand_side(problem);
    let (mut psi, iterations) = solve(&operator, &b);
    let residual = operator.relative_residual(&psi, &b);
    for (psi, fixed) in psi.iter_mut().zip(problem.cells().iter().map(|c| c.fixed())) {
        *psi = fixed.unwrap_or(*psi);
    }
    Solution { psi, iterations, residual }
}

#[cfg(test)]
mod tests;
