//! From costs to disparities: the least cost wins, if it stands out and if the right image agrees (thesis 3.2.5.2 to 3.2.5.4).

use crate::disparity::Unmatched;
use crate::lanes::{LANES, blocks, blocks_mut, differs, least, less, min, minus, or, pick, plus};

/// The winners of a row, pixel by pixel from the left.
///
/// Costs are given for each pixel of the left image in the order of disparities. Those of one pixel of the right image lie on a
/// diagonal, x − d = constant; in a mirrored right row its place is that of d = 0 plus d, so that one pixel's costs are held against
/// their rivals of the right image in one sweep.
#[derive(Debug, Default)]
pub(crate) struct Winners {
    /// 0, 1, 2, …: the disparities.
    levels: Vec<u16>,
    /// The least cost of each pixel of the mirrored right row, and at which disparity.
    right_cost: Vec<u16>,
    right_level: Vec<u16>,
    /// The winning disparity of each pixel of the left row, and what is said of it so far.
    left_level: Vec<u16>,
    said: Vec<f32>,
}

impl Winners {
    /// Ready for rows of a width.
    pub fn prepare(&mut self, width: usize, levels: usize) {
        self.levels = (0..levels as u16).collect();
        self.right_cost.resize(width + levels, u16::MAX);
        self.right_level.resize(width + levels, 0);
        self.left_level.resize(width, 0);
        self.said.resize(width, 0.0);
        self.right_cost.fill(u16::MAX);
    }

    /// Takes the costs of the pixel at column `x`. Those of disparities that lead out of the right image are overwritten.
    #[inline(always)]
    pub fn take(&mut self, x: usize, costs: &mut [u16], uniqueness: u16) {
        let (width, levels) = (self.left_level.len(), self.levels.len());
        if x + 1 < levels {
            costs[x + 1..].fill(u16::MAX);
        }
        let cost = least_of(costs);
        let level = first(costs, cost, &self.levels);
        let mirrored = width - 1 - x..width - 1 - x + levels;
        beat(&mut self.right_cost[mirrored.clone()], &mut self.right_level[mirrored], costs, &self.levels);
        self.left_level[x] = level;
        self.said[x] = match usize::from(level) {
            0 => Unmatched::OutOfRange.code(),
            border if border + 1 >= levels || border >= x => Unmatched::OutOfRange.code(),
            _ if uniqueness > 0 && !is_unique(cost, least_but_around(costs, level, &self.levels), uniqueness) => {
                Unmatched::Ambiguous.code()
            }
            inside => inside as f32 + vertex([costs[inside - 1], cost, costs[inside + 1]]),
        };
    }

    /// What is said of the row's pixels, after all of them were taken. The next row may begin.
    #[inline(always)]
    pub fn finish(&mut self, consistency: u16, row: &mut [f32]) {
        let width = self.left_level.len();
        for (x, (value, (&said, &level))) in row.iter_mut().zip(self.said.iter().zip(&self.left_level)).enumerate() {
            let back = self.right_level[width - 1 - x + usize::from(level)];
            let is_consistent = said < 0.0 || level.abs_diff(back) <= consistency;
            *value = if is_consistent { said } else { Unmatched::Inconsistent.code() };
        }
        self.right_cost.fill(u16::MAX);
    }
}

/// Whether the relative difference (thesis 3.29) of the second cost and the least is at least so many per cent.
#[inline(always)]
fn is_unique(least: u16, second: u16, percent: u16) -> bool {
    u32::from(second) * 100 >= u32::from(least) * (100 + u32::from(percent))
}

/// Where the parabola through three costs, of which that in the middle is the least, has its vertex: −0.5 to 0.5.
#[inline(always)]
fn vertex([before, least, after]: [u16; 3]) -> f32 {
    let [before, least, after] = [before, least, after].map(i32::from);
    (before - after) as f32 / (2 * (before + after - 2 * least)).max(1) as f32
}

#[inline(always)]
fn least_of(costs: &[u16]) -> u16 {
    let mut least_of_all = [u16::MAX; LANES];
    for &costs in blocks(costs) {
        least_of_all = min(least_of_all, costs);
    }
    least(least_of_all)
}

/// The first level that costs so much.
#[inline(always)]
fn first(costs: &[u16], cost: u16, levels: &[u16]) -> u16 {
    let mut least_of_all = [u16::MAX; LANES];
    for (&costs, &levels) in blocks(costs).iter().zip(blocks(levels)) {
        least_of_all = min(least_of_all, or(levels, differs(costs, [cost; LANES])));
    }
    least(least_of_all)
}

/// The least cost of levels that are no direct neighbours of `level`, and not it.
#[inline(always)]
fn least_but_around(costs: &[u16], level: u16, levels: &[u16]) -> u16 {
    let mut least_of_all = [u16::MAX; LANES];
    for (&costs, &levels) in blocks(costs).iter().zip(blocks(levels)) {
        let from_the_one_below = minus(plus(levels, [1; LANES]), [level; LANES]);
        least_of_all = min(least_of_all, or(costs, less(from_the_one_below, [3; LANES])));
    }
    least(least_of_all)
}

/// Puts costs, and their levels, in the place of rivals that cost more.
#[inline(always)]
fn beat(rivals: &mut [u16], rival_levels: &mut [u16], costs: &[u16], levels: &[u16]) {
    let rivals = blocks_mut(rivals).iter_mut().zip(blocks_mut(rival_levels));
    for ((rival, rival_level), (&cost, &level)) in rivals.zip(blocks(costs).iter().zip(blocks(levels))) {
        let (before, level_before) = (*rival, *rival_level);
        *rival_level = pick(less(cost, before), level, level_before);
        *rival = min(before, cost);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const LEVELS: usize = 16;

    /// What is said of a row of 40 pixels whose costs are `cost(x, d)`.
    fn said(uniqueness: u16, consistency: u16, cost: impl Fn(usize, usize) -> u16) -> Vec<f32> {
        let mut winners = Winners::default();
        winners.prepare(40, LEVELS);
        for x in 0..40 {
            let mut costs: Vec<u16> = (0..LEVELS).map(|d| cost(x, d)).collect();
            winners.take(x, &mut costs, uniqueness);
        }
        let mut row = vec![0.0; 40];
        winners.finish(consistency, &mut row);
        row
    }

    #[test]
    fn the_winner_is_the_vertex_of_a_parabola() {
        // Costs of which the vertex lies at 6.25.
        let row = said(0, 1, |_, d| (16.0 * (d as f32 - 6.25).powi(2)) as u16 + 100);
        assert!(row[20..].iter().all(|&d| (d - 6.25).abs() < 0.01), "{row:?}");
        assert!(row[..7].iter().all(|&d| d == Unmatched::OutOfRange.code()), "six columns see past the right image");
    }

    #[test]
    fn a_minimum_at_the_border_of_the_search_is_out_of_range() {
        for falling in [false, true] {
            let row = said(0, 1, |_, d| 100 + if falling { 20 - d as u16 } else { d as u16 });
            assert!(row[20..].iter().all(|&d| d == Unmatched::OutOfRange.code()), "{row:?}");
        }
    }

    #[test]
    fn a_second_minimum_that_costs_little_more_is_ambiguous() {
        let cost = |_: usize, d: usize| match d {
            5 => 1000,
            6 => 1010, // A direct neighbour is no rival.
            11 => 1100,
            _ => 3000,
        };
        assert!(said(10, 16, cost)[20..].iter().all(|&d| (5.0..6.0).contains(&d)));
        assert!(said(11, 16, cost)[20..].iter().all(|&d| d == Unmatched::Ambiguous.code()));
    }

    #[test]
    fn what_the_right_image_sees_otherwise_is_inconsistent() {
        // All lie at 4; but a pixel at 25 would rather have 9, whose match at 16 is that of the pixel at 20, and surer of it.
        let cost = |x: usize, d: usize| match (x, d) {
            (25, 9) => 50,
            (25, 4) => 60,
            (_, 4) => 10,
            _ => 500,
        };
        let row = said(0, 1, cost);
        assert_eq!(row[25], Unmatched::Inconsistent.code());
        assert!((row[24] - 4.0).abs() < 0.01 && (row[26] - 4.0).abs() < 0.01, "{row:?}");
        assert!(said(0, 5, cost)[25] >= 0.0, "it is, where five levels are granted");
    }
}
