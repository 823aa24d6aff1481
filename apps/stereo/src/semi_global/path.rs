//! Costs along paths.

use wide::u8x16;

use crate::lanes::{LANES, blocks, blocks_mut, plus, words};

/// What steps of disparity between neighbours cost, on the scale of costs, 0 to 43: a quarter of what nine pixels differ by, each in
/// up to 14 bits of its census and as 5 more in its change along rows.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Penalties {
    /// P₁, of a step of one level: slanted surfaces have many.
    pub small: u8,
    /// P₂, of a larger step: surfaces end seldom.
    pub large: u8,
    /// The same where the image has an edge: there they end.
    pub edge: u8,
    /// What is an edge: by how many grey levels neighbours differ at least.
    pub contrast: u8,
}

impl Default for Penalties {
    fn default() -> Self {
        Self { small: 27, large: 135, edge: 14, contrast: 14 }
    }
}

/// Two paths to each pixel, one along its row and one across rows.
#[derive(Debug, Default)]
pub struct Paths {
    levels: usize,
    /// Costs of the path along the row: of the pixel before, and of the present one.
    along: [Vec<u8>; 2],
    along_least: u8,
    /// Costs of the paths across rows: of the pixels of the row before, and of the present one.
    across: [Vec<u8>; 2],
    across_least: Vec<u8>,
}

/// What lies on both sides of a pixel's costs: neighbours of the first and of the last level, which cost more than all.
const GUARD: usize = LANES;

impl Paths {
    /// Before the first row: nothing was paid yet, whatever comes.
    #[inline(always)]
    pub fn begin(&mut self, width: usize, levels: usize) {
        self.levels = levels;
        let guarded = levels + 2 * GUARD;
        for (path, pixels) in [(&mut self.along, 1), (&mut self.across, width)] {
            for costs in path.iter_mut() {
                costs.clear();
                costs.resize(pixels * guarded, u8::MAX);
            }
            path[1].chunks_exact_mut(guarded).for_each(|pixel| pixel[GUARD..][..levels].fill(0));
        }
        self.across_least.clear();
        self.across_least.resize(width, 0);
    }

    /// Before the first pixel of a row.
    #[inline(always)]
    pub fn begin_row(&mut self) {
        self.across.swap(0, 1);
        self.along[1][GUARD..][..self.levels].fill(0);
        self.along_least = 0;
    }

    /// On to the pixel at `x`, which differs by so many grey levels from those before it, along and across: what both paths have
    /// come to there.
    #[inline(always)]
    pub fn step(&mut self, x: usize, differs: [u8; 2], penalties: Penalties, costs: &[u8], sums: &mut [u16]) {
        let guarded = self.levels + 2 * GUARD;
        self.along.swap(0, 1);
        let [before, along] = &mut self.along;
        self.along_least = step(before, self.along_least, costs, penalties, differs[0], along);
        let [before, across] = &mut self.across;
        let (before, across) = (&before[x * guarded..][..guarded], &mut across[x * guarded..][..guarded]);
        self.across_least[x] = step(before, self.across_least[x], costs, penalties, differs[1], across);
        let both = blocks(&along[GUARD..]).iter().zip(blocks(&across[GUARD..]));
        for (sum, (&along, &across)) in blocks_mut(sums).iter_mut().zip(both) {
            *sum = plus(words(along), words(across));
        }
    }
}

/// One step of a path,
///
///   L(p, d) = C(p, d) + min(L(p − r, d), L(p − r, d ± 1) + P₁, min L(p − r, ·) + P₂) − min L(p − r, ·)
///
/// (Hirschmüller 2008, eq. 13), and the least that came of it. C is at most `cost::MAX` and L at most P₂ more, so that bytes
/// hold them.
#[inline(always)]
fn step(before: &[u8], least: u8, costs: &[u8], penalties: Penalties, differs: u8, path: &mut [u8]) -> u8 {
    let jump = if differs >= penalties.contrast { penalties.edge } else { penalties.large };
    let jump = u8x16::splat(least.saturating_add(jump));
    let (small, least) = (u8x16::splat(penalties.small), u8x16::splat(least));
    let neighbours = blocks(&before[GUARD - 1..]).iter().zip(blocks(&before[GUARD + 1..]));
    let before = blocks(&before[GUARD..]).iter().zip(neighbours);
    let mut least_of_all = u8x16::splat(u8::MAX);
    for ((path, &cost), (&same, (&below, &above))) in
        blocks_mut(&mut path[GUARD..]).iter_mut().zip(blocks(costs)).zip(before)
    {
        let beside = u8x16::new(below).min(u8x16::new(above)).saturating_add(small);
        let paid = u8x16::new(same).min(beside).min(jump).saturating_sub(least);
        let here = paid.saturating_add(u8x16::new(cost));
        *path = here.to_array();
        least_of_all = least_of_all.min(here);
    }
    least_of_all.reduce_min()
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    proptest! {
        #[test]
        fn a_step_is_the_equation(
            before in proptest::collection::vec(0u8..190, 32),
            costs in proptest::collection::vec(0u8..55, 32),
            differs in 0u8..20,
        ) {
            let penalties = Penalties { small: 27, large: 135, edge: 14, contrast: 10 };
            let mut guarded = vec![u8::MAX; 32 + 2 * GUARD];
            guarded[GUARD..][..32].copy_from_slice(&before);
            let least = *before.iter().min().unwrap();
            let mut path = vec![u8::MAX; 32 + 2 * GUARD];
            let came = step(&guarded, least, &costs, penalties, differs, &mut path);
            let jump = if differs >= 10 { 14 } else { 135 };
            let before: Vec<i32> = before.into_iter().map(i32::from).collect();
            for d in 0..32 {
                let ways = [Some(before[d]), d.checked_sub(1).map(|d| before[d] + 27), before.get(d + 1).map(|l| l + 27),
                    Some(i32::from(least) + jump)];
                let right = i32::from(costs[d]) + ways.into_iter().flatten().min().unwrap() - i32::from(least);
                prop_assert_eq!(i32::from(path[GUARD + d]), right, "level {}", d);
            }
            prop_assert_eq!(came, *path[GUARD..][..32].iter().min().unwrap());
            prop_assert!(path[..GUARD].iter().chain(&path[GUARD + 32..]).all(|&guard| guard == u8::MAX));
        }
    }
}
