//! The thesis' solver (6.4.1): Gauss-Seidel sweeps in place, stopped by the largest relative change (6.29).
//!
//! Two things differ from its letter, because without them it fails: it starts from the middle value, since a start at
//! the goals' value leaves plateaus that streamlines stall on, and missing neighbours are left out of the average
//! instead of mirrored (see [`super`]).

use super::operator::strides;
use crate::problem::{Cell, Problem};

/// The thesis stops by change alone; this bounds a tolerance that is never met.
const MAX_SWEEPS: usize = 100_000;

/// Sweeps until no cell changes by `epsilon` or more of its value, or somebody is `stopping`; answers ψ and the sweeps.
pub fn gauss_seidel(problem: &Problem, epsilon: f64, stopping: impl Fn() -> bool) -> (Vec<f32>, usize) {
    let start = |c: &Cell| match c {
        Cell::Inside => 0.5,
        fixed => f64::from(fixed.fixed().unwrap_or(0.0)),
    };
    let mut psi: Vec<f64> = problem.cells().iter().map(start).collect();
    let stencils = stencils(problem);
    let mut sweeps = 0;
    while sweeps < MAX_SWEEPS {
        sweeps += 1;
        if sweep(&stencils, &mut psi) < epsilon || stopping() {
            break;
        }
    }
    (psi.into_iter().map(|p| p as f32).collect(), sweeps)
}

/// A cell inside, and which of its neighbours exist.
struct Stencil {
    cell: u32,
    count: u32,
    neighbours: [u32; 6],
}

fn stencils(problem: &Problem) -> Vec<Stencil> {
    let inside = |i: &usize| problem.cells()[*i] == Cell::Inside;
    (0..problem.cells().len())
        .filter(inside)
        .map(|i| {
            let mut stencil = Stencil { cell: i as u32, count: 0, neighbours: [0; 6] };
            for n in strides(problem.dim()).into_iter().flat_map(|s| [i - s, i + s]) {
                if problem.cells()[n] != Cell::Outside {
                    stencil.neighbours[stencil.count as usize] = n as u32;
                    stencil.count += 1;
                }
            }
            stencil
        })
        .collect()
}

/// One sweep; answers the largest relative change. A cell without neighbours keeps its value.
fn sweep(stencils: &[Stencil], psi: &mut [f64]) -> f64 {
    let mut largest = 0.0f64;
    for s in stencils.iter().filter(|s| s.count > 0) {
        let neighbours = &s.neighbours[..s.count as usize];
        let sum: f64 = neighbours.iter().map(|n| psi[*n as usize]).sum();
        let new = sum / f64::from(s.count);
        let old = std::mem::replace(&mut psi[s.cell as usize], new);
        largest = largest.max(((new - old) / old).abs());
    }
    largest
}
