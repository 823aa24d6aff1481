//! Conjugate gradients (Hestenes and Stiefel, 1952), preconditioned by one multigrid cycle.
//!
//! The cycle sums residuals and interpolates corrections, so that it is not symmetric, and directions are made conjugate
//! with Polak and Ribière's β, which does not ask for that (Notay, *Flexible conjugate gradients*, 2000).

use super::block::{Block, Halo, row, sum};
use super::direct::Direct;
use super::lanes::wide;
use super::level::{Level, descend, prolong, smooth_backwards};
use super::stencil::{Counted, Rows, Stencil, Weighted};

/// Past this something is wrong with the problem, not with the number.
const MAX_ITERATIONS: usize = 500;

/// The vectors of a solution on a level, by slot.
#[derive(Debug, Clone, Default)]
pub struct Vectors {
    /// What is sought.
    pub psi: Vec<Block<f32>>,
    direction: Vec<Block<f32>>,
    image: Vec<Block<f32>>,
}

impl Vectors {
    /// Makes room for as many slots, in all.
    pub fn resize(&mut self, slots: usize) {
        for vector in [&mut self.psi, &mut self.direction, &mut self.image] {
            vector.resize(slots, [[0.0; 8]; 64]);
        }
    }

    /// Keeps only ψ.
    pub fn give_back(&mut self) {
        (self.direction, self.image) = (Vec::new(), Vec::new());
    }
}

/// A level with its equations, and those coarser than it; `open` is the weight of a face of the next one that is open all over.
pub struct System<'a, S> {
    pub fine: &'a mut Level<S>,
    pub coarse: &'a mut [Level<Weighted>],
    pub open: f32,
    pub direct: &'a Direct,
}

impl<S: Stencil> System<'_, S> {
    /// Adds to ψ what solves for the right-hand side, and leaves the residual there; `square` is the square of the first, and
    /// that of the last is at most `limit`, unless somebody is `stopping`. Answers the iterations.
    pub fn solve(&mut self, vectors: &mut Vectors, mut square: f64, limit: f64, stopping: impl Fn() -> bool) -> usize {
        let Self { fine, coarse, open, direct } = self;
        vectors.resize(fine.lattice.slots());
        let Vectors { psi, direction, image } = vectors;
        let (mut iterations, mut alpha, mut rz) = (0, 0.0, 0.0);
        while square > limit && iterations < MAX_ITERATIONS && !stopping() {
            let (next, conjugate) = cycle(fine, coarse, *open, direct, Some(image));
            let beta = if iterations == 0 { 0.0 } else { -alpha * conjugate / rz };
            rz = next;
            let curvature = turn(fine, beta as f32, direction, image);
            if curvature <= 0.0 || rz <= 0.0 {
                // Rounding has used up the precision: nothing more to gain.
                break;
            }
            alpha = rz / curvature;
            square = advance(fine, alpha as f32, direction, image, psi);
            iterations += 1;
        }
        iterations
    }
}

/// `x ≈ A⁻¹ b` on a level by one V-cycle over the coarser ones; `open` is the weight of a face of the next that is open all
/// over. Answers the products of x with b and with `other`, where one is asked for.
fn cycle<S: Stencil>(
    fine: &mut Level<S>,
    coarse: &mut [Level<Weighted>],
    open: f32,
    direct: &Direct,
    other: Option<&[Block<f32>]>,
) -> (f64, f64) {
    let Some((next, coarser)) = coarse.split_first_mut() else { return (0.0, 0.0) };
    descend(fine, next);
    match coarser.is_empty() {
        true => direct.solve(next),
        false => {
            cycle(next, coarser, 2.0 * open, direct, None);
        }
    }
    prolong(next, open, fine);
    smooth_backwards(fine, other)
}

wide! {
    /// What ψ leaves, into the right-hand side, and its square: fixed values stand in ψ, and flow in as others do.
    pub fn residual[L](fine: &mut Level<Counted>, psi: &[Block<f32>]) -> f64 {
        let (mut halo, mut square) = (Halo::new(), 0.0);
        for &slot in fine.lattice.order() {
            halo.gather(psi, slot, fine.lattice.neighbours(slot));
            let (rows, r) = (fine.stencil.rows(slot), &mut fine.b[slot as usize]);
            let mut sums = L::splat(0.0);
            for z in 0..8 {
                for y in 0..8 {
                    let left: L = rows.residual(y, z, L::splat(0.0), &halo);
                    left.to(&mut r[row(y, z)]);
                    sums = sums.plus(left.times(left));
                }
            }
            square += sum(sums);
        }
        square
    }
}

wide! {
    /// The next direction, `p = z + βp`, and its image, `Ap = Az + βAp`; answers the product of the two.
    fn turn[L, S: Stencil](
        fine: &Level<S>,
        beta: f32,
        direction: &mut [Block<f32>],
        image: &mut [Block<f32>],
    ) -> f64 {
        let (mut halo, mut product, beta) = (Halo::new(), 0.0, L::splat(beta));
        for &slot in fine.lattice.order() {
            halo.gather(&fine.x, slot, fine.lattice.neighbours(slot));
            let (rows, slot) = (fine.stencil.rows(slot), slot as usize);
            let mut sums = L::splat(0.0);
            for z in 0..8 {
                for y in 0..8 {
                    let row = row(y, z);
                    let (p, ap) = (&mut direction[slot][row], &mut image[slot][row]);
                    let left: L = rows.residual(y, z, L::splat(0.0), &halo);
                    let turned = L::of(halo.own(y, z)).plus(L::of(p).times(beta));
                    let seen = L::of(ap).times(beta).minus(left);
                    turned.to(p);
                    seen.to(ap);
                    sums = sums.plus(turned.times(seen));
                }
            }
            product += sum(sums);
        }
        product
    }
}

wide! {
    /// `ψ += αp` and `r −= αAp`; answers the square of `r`.
    fn advance[L, S: Stencil](
        fine: &mut Level<S>,
        alpha: f32,
        direction: &[Block<f32>],
        image: &[Block<f32>],
        psi: &mut [Block<f32>],
    ) -> f64 {
        let mut square = 0.0;
        for &slot in fine.lattice.order() {
            let slot = slot as usize;
            let (p, ap, psi, r) = (&direction[slot], &image[slot], &mut psi[slot], &mut fine.b[slot]);
            let mut sums = L::splat(0.0);
            for row in 0..64 {
                L::of(&psi[row]).plus(L::of(&p[row]).times(L::splat(alpha))).to(&mut psi[row]);
                let left = L::of(&r[row]).minus(L::of(&ap[row]).times(L::splat(alpha)));
                left.to(&mut r[row]);
                sums = sums.plus(left.times(left));
            }
            square += sum(sums);
        }
        square
    }
}
