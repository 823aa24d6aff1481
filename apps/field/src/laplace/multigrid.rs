//! A geometric multigrid V-cycle, as preconditioner for conjugate gradients.
//!
//! After McAdams, Sifakis and Teran, *A parallel multigrid Poisson solver for fluids simulation on large grids* (2010),
//! with the simplest parts that are symmetric: cells are merged 2 × 2 × 2, a coarse value is taken over by all its
//! children, residuals are summed, and the smoother is damped Jacobi, the same number of sweeps before and after.

use super::operator::{Operator, Weights};

/// Damping of the Jacobi sweeps; 6/7 smooths best in three dimensions.
const OMEGA: f32 = 6.0 / 7.0;
/// Sweeps on the coarsest level, which has a few cells.
const COARSEST_SWEEPS: usize = 24;
/// A level of no more cells than this along each axis is not made coarser.
const COARSEST_DIM: usize = 5;

/// The levels of a V-cycle, finest first, with their working vectors.
pub struct Cycle {
    levels: Vec<Level>,
}

struct Level {
    operator: Operator,
    /// Right-hand side, solution, and a vector to work in.
    b: Vec<f32>,
    x: Vec<f32>,
    scratch: Vec<f32>,
}

impl Level {
    fn new(operator: Operator) -> Self {
        let zero = vec![0.0; operator.len()];
        Self { operator, b: zero.clone(), x: zero.clone(), scratch: zero }
    }

    /// Sweeps from zero: the first is a division.
    fn smooth_from_zero(&mut self, sweeps: usize) {
        for ((x, b), i) in self.x.iter_mut().zip(&self.b).zip(&self.operator.inverse) {
            *x = OMEGA * i * b;
        }
        self.smooth(sweeps - 1);
    }

    fn smooth(&mut self, sweeps: usize) {
        for _ in 0..sweeps {
            self.operator.relax(&self.x, &self.b, OMEGA, &mut self.scratch);
            std::mem::swap(&mut self.x, &mut self.scratch);
        }
    }
}

impl Cycle {
    /// Builds the coarser levels of an operator.
    pub fn new(operator: &Operator) -> Self {
        let mut levels = vec![Level::new(operator.clone())];
        while let Some(coarse) = levels.last().and_then(|l| coarsen(&l.operator)) {
            levels.push(Level::new(coarse));
        }
        Self { levels }
    }

    /// `z ≈ A⁻¹ r` by one V-cycle; linear, symmetric and positive definite in `r`.
    pub fn apply(&mut self, r: &[f32], z: &mut [f32]) {
        self.levels[0].b.copy_from_slice(r);
        self.descend(0);
        z.copy_from_slice(&self.levels[0].x);
    }

    fn descend(&mut self, level: usize) {
        let (fine, coarse) = self.levels.split_at_mut(level + 1);
        let fine = &mut fine[level];
        let Some(next) = coarse.first_mut() else {
            return fine.smooth_from_zero(COARSEST_SWEEPS);
        };
        fine.smooth_from_zero(2);
        fine.operator.residual(&fine.x, &fine.b, &mut fine.scratch);
        restrict(&fine.operator, &fine.scratch, next.operator.dim, &mut next.b);
        self.descend(level + 1);
        let (fine, coarse) = self.levels.split_at_mut(level + 1);
        let fine = &mut fine[level];
        prolong(&fine.operator, &coarse[0].operator, &coarse[0].x, &mut fine.x);
        fine.smooth(2);
    }
}

/// The coarse cell of a fine one, along one axis: the halo (0) stays, then two become one.
fn parent(fine: usize) -> usize {
    fine.div_ceil(2)
}

/// Index of the first cell of the coarse row that a fine row belongs to.
fn parent_row(fine: [usize; 3], coarse: [usize; 3], row_start: usize) -> usize {
    let (y, z) = (row_start / fine[0] % fine[1], row_start / (fine[0] * fine[1]));
    (parent(z) * coarse[1] + parent(y)) * coarse[0]
}

/// The next coarser operator: half of `PᵀAP`, since a coarse value taken over by all children is twice too stiff.
fn coarsen(fine: &Operator) -> Option<Operator> {
    if fine.dim.iter().all(|n| *n <= COARSEST_DIM) {
        return None;
    }
    // The last cell inside is the last but one; after its parent comes the halo.
    let dim = fine.dim.map(|n| parent(n - 2) + 2);
    let size = dim[0] * dim[1] * dim[2];
    let mut weights = [0; 3].map(|_| vec![0.0; size]);
    let mut diagonal = vec![0.0; size];
    for &(from, to) in &fine.rows {
        let base = parent_row(fine.dim, dim, from);
        let (y, z) = (from / fine.dim[0] % fine.dim[1], from / (fine.dim[0] * fine.dim[1]));
        for i in from..to {
            let x = i % fine.dim[0];
            let c = base + parent(x);
            diagonal[c] += 0.5 * fine.diagonal[i];
            for (axis, at) in [x, y, z].into_iter().enumerate() {
                let w = 0.5 * inside_weight(fine, i, axis);
                if at.is_multiple_of(2) {
                    weights[axis][c] += w;
                } else {
                    // Both ends have the same parent: the flux between them vanishes.
                    diagonal[c] -= 2.0 * w;
                }
            }
        }
    }
    Some(Operator::new(dim, Weights::Each(weights), diagonal))
}

/// The weight from a cell of a row, which may be outside itself, to the next along `axis`.
fn inside_weight(fine: &Operator, cell: usize, axis: usize) -> f32 {
    if fine.diagonal[cell] > 0.0 { fine.weight(cell, axis) } else { 0.0 }
}

/// Where a fine row's pairs of siblings lie: the row's range without a first cell that is the second of its pair, that
/// pair's first coarse cell, and whether there is such a cell.
struct Pairs {
    start: usize,
    coarse: usize,
    odd_one_before: bool,
}

impl Pairs {
    fn of(fine: &Operator, coarse_dim: [usize; 3], from: usize) -> Self {
        let x = from % fine.dim[0];
        let odd_one_before = x.is_multiple_of(2);
        Self {
            start: from + usize::from(odd_one_before),
            coarse: parent_row(fine.dim, coarse_dim, from) + parent(x) + usize::from(odd_one_before),
            odd_one_before,
        }
    }
}

/// Sums the residuals of each coarse cell's children.
fn restrict(fine: &Operator, r: &[f32], dim: [usize; 3], b: &mut [f32]) {
    b.fill(0.0);
    for &(from, to) in &fine.rows {
        let pairs = Pairs::of(fine, dim, from);
        if pairs.odd_one_before {
            b[pairs.coarse - 1] += r[from];
        }
        let (children, parents) = (&r[pairs.start..to], &mut b[pairs.coarse..]);
        for (parent, pair) in parents.iter_mut().zip(children.chunks(2)) {
            *parent += pair.iter().sum::<f32>();
        }
    }
}

/// Adds to each cell inside the value of its parent.
fn prolong(fine: &Operator, coarse: &Operator, e: &[f32], x: &mut [f32]) {
    for &(from, to) in &fine.rows {
        let pairs = Pairs::of(fine, coarse.dim, from);
        if pairs.odd_one_before && fine.diagonal[from] > 0.0 {
            x[from] += e[pairs.coarse - 1];
        }
        let children = x[pairs.start..to].chunks_mut(2).zip(fine.diagonal[pairs.start..to].chunks(2));
        for (parent, (pair, inside)) in e[pairs.coarse..].iter().zip(children) {
            for (x, d) in pair.iter_mut().zip(inside) {
                *x += if *d > 0.0 { *parent } else { 0.0 };
            }
        }
    }
}
