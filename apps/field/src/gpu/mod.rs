//! Laplace's equation on a graphics card, by Vulkan (feature `gpu`).
//!
//! Conjugate gradients with a V-cycle before them, as [`crate::domain`], of simpler parts: coarse operators are half of
//! PᵀAP with fixed values as near as they are, a coarse value goes to all its children, and either half of a cycle has two
//! Jacobi sweeps with Chebyshev's damping.
//! What bounds a card is how many bytes it moves. An iteration goes over the cells five times, never more often than one
//! value depends on another's neighbours: what could be a pass of its own is done where its operands are at hand. Scalars
//! stay on the card, too: it finds out itself when it has done enough, and is asked once for a dozen iterations.
//!
//! Sums are made in a fixed order, so that the same card gives the same field each time; another card may round
//! otherwise.
//!
//! # Kernels
//! | file | does |
//! |---|---|
//! | `start`, `coarsen` | the finest level from the cells, and each coarser from the next finer |
//! | `direction`, `alpha` | p = z + βp and Ap; x along the last direction |
//! | `descend`, `check` | r − αAp, and two sweeps from zero on it |
//! | `restrict` | what is left, summed for the next coarser level |
//! | `smooth_from_zero`, `coarsest` | the same there, and all of the coarsest level |
//! | `correct`, `smooth`, `beta` | two sweeps on the way back up |
//! | `answer`, `residual` | ψ by the problem's own voxels, and how well it fulfils the equation |

mod device;
mod domain;
mod grid;
mod kernels;

pub use device::{Gpu, GpuError, NoGpu};
pub use domain::Domain;

use crate::laplace::Solution;
use crate::problem::Problem;

impl Gpu {
    /// Solves a problem to the residual that [`solve`](crate::solve) comes to with
    /// [`Solver::Multigrid`](crate::Solver::Multigrid).
    ///
    /// # Errors
    /// The card is too small, or fails.
    pub fn solve(&self, problem: &Problem, tolerance: f64) -> Result<Solution, GpuError> {
        self.solve_unless(problem, tolerance, || false)
    }

    /// As [`Gpu::solve`]; it is given up, and the field is none, once somebody is `stopping`: asked every dozen
    /// iterations.
    ///
    /// # Errors
    /// The card is too small, or fails.
    pub fn solve_unless(
        &self,
        problem: &Problem,
        tolerance: f64,
        stopping: impl Fn() -> bool,
    ) -> Result<Solution, GpuError> {
        let domain = Domain::new(self, problem)?;
        domain.solve(tolerance, stopping)?;
        domain.answer()
    }
}
