//! The cascade (Bornemann and Deuflhard, *The cascadic multigrid method for elliptic problems*, 1996), of two levels: solved on
//! cells merged 2 × 2 × 2, interpolated, and smoothed on the finest.
//!
//! What is left then is smooth: how the two discretisations differ, which is little where ψ bends little. Where it bends much,
//! at a source, at sinks and along walls, smoothing is what solves. Of the finest level that takes three passes, where an
//! iteration of [`System::solve`] takes five.

use super::block::{Block, row};
use super::conjugate_gradients::{System, Vectors};
use super::direct::Direct;
use super::lanes::wide;
use super::lattice::NONE;
use super::level::{Level, octant, pairs, parent, prolong, smooth_backwards, smooth_forwards};
use super::stencil::{Counted, Weighted};

/// Nearly solves for `fine.x`, where the right-hand side is zero but in the blocks `given`; on the level below the residual is
/// at most `tolerance` of it, unless somebody is `stopping`. Answers the iterations there.
pub fn solve(
    fine: &mut Level<Counted>,
    given: &[u32],
    (coarse, direct): (&mut [Level<Weighted>], &Direct),
    vectors: &mut Vectors,
    tolerance: f64,
    stopping: impl Fn() -> bool,
) -> usize {
    let Some((next, coarser)) = coarse.split_first_mut() else { return 0 };
    sum_up(fine, given, next);
    let mut iterations = 0;
    if coarser.is_empty() {
        direct.solve(next);
    } else {
        let square = square(next);
        vectors.psi.clear();
        let mut system = System { fine: next, coarse: coarser, open: 4.0, direct };
        iterations = system.solve(vectors, square, tolerance * tolerance * square, stopping);
        std::mem::swap(&mut next.x, &mut vectors.psi);
    }
    fine.x.fill([[0.0; 8]; 64]);
    prolong(next, 2.0, fine);
    smooth_forwards(fine);
    smooth_backwards(fine, None);
    iterations
}

wide! {
    /// Sums the right-hand side of a level, which is zero but in the blocks `given`, into the coarser one.
    fn sum_up[L](fine: &Level<Counted>, given: &[u32], coarse: &mut Level<Weighted>) {
        coarse.b.fill([[0.0; 8]; 64]);
        for &slot in given {
            let position = fine.lattice.position(slot);
            let (into, [ox, oy, oz]) = (coarse.lattice.slot(parent(position)), octant(position));
            if into == NONE {
                continue;
            }
            let (b, to) = (&fine.b[slot as usize], &mut coarse.b[into as usize]);
            for z in 0..4 {
                for y in 0..4 {
                    let (low, high) = (row(2 * y, 2 * z), row(2 * y, 2 * z + 1));
                    let sums = L::of(&b[low]).plus(L::of(&b[low + 1])).plus(L::of(&b[high]).plus(L::of(&b[high + 1])));
                    to[row(4 * oy + y, 4 * oz + z)][4 * ox..4 * ox + 4].copy_from_slice(&pairs(sums));
                }
            }
        }
    }
}

/// The square of the right-hand side of a level.
fn square(level: &Level<Weighted>) -> f64 {
    let blocks = level.lattice.order().iter().map(|slot| &level.b[*slot as usize]);
    blocks.flat_map(|block: &Block<f32>| block.as_flattened()).map(|number| f64::from(*number).powi(2)).sum()
}
