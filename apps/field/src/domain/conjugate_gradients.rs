//! Conjugate gradients (Hestenes and Stiefel, 1952), preconditioned by one multigrid cycle.
//!
//! The cycle sums residuals and interpolates corrections, so that it is not symmetric, and directions are made conjugate
//! with Polak and Ribière's β, which does not ask for that (Notay, *Flexible conjugate gradients*, 2000).

use super::block::{Block, Halo, row, sum};
use super::direct::Direct;
use super::lanes::wide;
use super::level::{Level, prolong, restrict, smooth_backwards, smooth_from_zero};
use super::stencil::{Counted, Rows, Stencil, Weighted};

/// Past this something is wrong with the problem, not with the number.
const MAX_ITERATIONS: usize = 500;

/// What it took to solve.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Convergence {
    /// Iterations of conjugate gradients.
    pub iterations: usize,
    /// ‖b − Aψ‖ / ‖b‖, computed from the field as it is; ‖b − Aψ‖ where b is zero.
    pub residual: f64,
}

/// The equations of all levels, and the vectors of a solution on the finest.
pub struct System<'a> {
    /// Sums of squares of the right-hand side, by slot.
    pub squares: &'a [f32],
    pub fine: &'a mut Level<Counted>,
    pub coarse: &'a mut [Level<Weighted>],
    pub direct: &'a Direct,
    pub psi: &'a mut [Block<f32>],
    pub direction: &'a mut [Block<f32>],
    pub image: &'a mut [Block<f32>],
}

/// Solves from the ψ that is there.
pub fn solve(system: System<'_>, tolerance: f64, stopping: impl Fn() -> bool) -> Convergence {
    let System { squares, fine, coarse, direct, psi, direction, image } = system;
    let scale = fine.lattice.order().iter().map(|slot| f64::from(squares[*slot as usize])).sum::<f64>().sqrt();
    let scale = if scale > 0.0 { scale } else { 1.0 };
    let mut square = residual(fine, psi);
    let (mut iterations, mut alpha, mut rz) = (0, 0.0, 0.0);
    while square.sqrt() > tolerance * scale && iterations < MAX_ITERATIONS && !stopping() {
        precondition(fine, coarse, direct);
        let (next, conjugate) = products(fine, image);
        let beta = if iterations == 0 { 0.0 } else { -alpha * conjugate / rz };
        rz = next;
        turn(fine, beta as f32, direction);
        let curvature = multiply(fine, direction, image);
        if curvature <= 0.0 || rz <= 0.0 {
            // Rounding has used up the precision: nothing more to gain.
            break;
        }
        alpha = rz / curvature;
        square = advance(fine, alpha as f32, direction, image, psi);
        iterations += 1;
    }
    Convergence { iterations, residual: residual(fine, psi).sqrt() / scale }
}

/// `x ≈ A⁻¹ b` on the finest level by one V-cycle.
fn precondition(fine: &mut Level<Counted>, coarse: &mut [Level<Weighted>], direct: &Direct) {
    let Some(next) = coarse.first_mut() else { return };
    smooth_from_zero(fine);
    restrict(fine, next);
    descend(coarse, 2.0, direct);
    prolong(&coarse[0], 2.0, fine);
    smooth_backwards(fine);
}

/// The part of the cycle on a level and the coarser ones; `open` is the weight of a face there that is open all over.
fn descend(levels: &mut [Level<Weighted>], open: f32, direct: &Direct) {
    let Some((fine, coarse)) = levels.split_first_mut() else { return };
    let Some(next) = coarse.first_mut() else {
        return direct.solve(fine);
    };
    smooth_from_zero(fine);
    restrict(fine, next);
    descend(coarse, 2.0 * open, direct);
    prolong(&coarse[0], 2.0 * open, fine);
    smooth_backwards(fine);
}

wide! {
    /// What ψ leaves, into the right-hand side, and its square: fixed values stand in ψ, and flow in as others do.
    fn residual[L](fine: &mut Level<Counted>, psi: &[Block<f32>]) -> f64 {
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
    /// The products of the preconditioned residual with the residual and with the image of the direction.
    fn products[L](fine: &Level<Counted>, image: &[Block<f32>]) -> (f64, f64) {
        let (mut own, mut other) = (0.0, 0.0);
        for &slot in fine.lattice.order() {
            let slot = slot as usize;
            let (z, r, image) = (&fine.x[slot], &fine.b[slot], &image[slot]);
            let (mut zr, mut zi) = (L::splat(0.0), L::splat(0.0));
            for row in 0..64 {
                let z = L::of(&z[row]);
                zr = zr.plus(z.times(L::of(&r[row])));
                zi = zi.plus(z.times(L::of(&image[row])));
            }
            (own, other) = (own + sum(zr), other + sum(zi));
        }
        (own, other)
    }
}

wide! {
    /// The next direction: `p = z + βp`.
    fn turn[L](fine: &Level<Counted>, beta: f32, direction: &mut [Block<f32>]) {
        for &slot in fine.lattice.order() {
            let (z, p) = (&fine.x[slot as usize], &mut direction[slot as usize]);
            for (p, z) in p.iter_mut().zip(z) {
                L::of(z).plus(L::of(p).times(L::splat(beta))).to(p);
            }
        }
    }
}

wide! {
    /// `Ap`, and its product with `p`.
    fn multiply[L](fine: &Level<Counted>, direction: &[Block<f32>], image: &mut [Block<f32>]) -> f64 {
        let (mut halo, mut product) = (Halo::new(), 0.0);
        for &slot in fine.lattice.order() {
            halo.gather(direction, slot, fine.lattice.neighbours(slot));
            let (rows, image) = (fine.stencil.rows(slot), &mut image[slot as usize]);
            let mut sums = L::splat(0.0);
            for z in 0..8 {
                for y in 0..8 {
                    let left: L = rows.residual(y, z, L::splat(0.0), &halo);
                    let ap = L::splat(0.0).minus(left);
                    ap.to(&mut image[row(y, z)]);
                    sums = sums.plus(ap.times(L::of(halo.own(y, z))));
                }
            }
            product += sum(sums);
        }
        product
    }
}

wide! {
    /// `ψ += αp` and `r −= αAp`; answers the square of `r`.
    fn advance[L](
        fine: &mut Level<Counted>,
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
