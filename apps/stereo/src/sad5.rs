//! The SAD5 matcher: sums of absolute differences over a window and the best two of four around it (thesis 3.2.5).

use crate::components;
use crate::disparity::{Disparity, Unmatched};
use crate::image::Image;
use crate::lanes::{LANES, apart, blocks, blocks_mut, max, min, minus, plus, wide, words};
use crate::matcher::{Checks, ConfigError, MatchError, Matcher, common_size};
use crate::preprocessing::Preprocessing;
use crate::texture;
use crate::winner::Winners;

/// How SAD5 matches.
#[derive(Clone, Debug, PartialEq)]
pub struct Sad5Config {
    /// What is done to both images first (thesis 3.2.4).
    pub preprocessing: Preprocessing,
    /// A window has (2 r + 1)² pixels; r is 1 to 4.
    pub radius: usize,
    /// What is asked of a match.
    pub checks: Checks,
}

impl Default for Sad5Config {
    fn default() -> Self {
        Self { preprocessing: Preprocessing::default(), radius: 3, checks: Checks::default() }
    }
}

/// The matcher of thesis 3.2.5: for each disparity the cost is C = C₀ + C₁ + C₂ (3.28), where C₀ is the sum of absolute
/// differences (3.27) over the window around the pixel, and C₁, C₂ are the least two of those over the windows around
/// the four corners of the first one. A window that lies across the border of an object is so left out.
#[derive(Debug)]
pub struct Sad5 {
    config: Sad5Config,
    scratch: Scratch,
}

/// What is kept from row to row.
#[derive(Debug, Default)]
struct Scratch {
    /// For each column and level, the sum of absolute differences over the 2 r + 1 rows around the present one.
    columns: Vec<u16>,
    /// The sums over whole windows of the last 2 r + 1 rows; row y lies at y modulo 2 r + 1.
    windows: Vec<u16>,
    winners: Winners,
}

impl Sad5 {
    /// The largest radius: 3 · 9² differences of up to 255 still fit 16 bits.
    pub const MAX_RADIUS: usize = 4;

    /// A matcher.
    ///
    /// # Errors
    /// A window or a search that costs cannot be summed for.
    pub fn new(config: Sad5Config) -> Result<Self, ConfigError> {
        config.checks.check()?;
        config.preprocessing.check()?;
        match config.radius {
            1..=Self::MAX_RADIUS => Ok(Self { config, scratch: Scratch::default() }),
            found => Err(ConfigError::Window { found, max: Self::MAX_RADIUS }),
        }
    }
}

impl Matcher for Sad5 {
    fn disparity(&mut self, left: &Image, right: &Image) -> Result<Disparity, MatchError> {
        let (width, height) = common_size(left, right)?;
        let Sad5Config { preprocessing, radius, checks } = &self.config;
        let mut values = vec![Unmatched::OutOfRange.code(); width * height];
        let [l, mirrored] = [preprocessing.apply(left), preprocessing.apply(right).mirrored()];
        match_rows(&l, &mirrored, *radius, checks, &mut self.scratch, &mut values);
        texture::reject(left, 2 * radius, checks.texture, &mut values);
        let mut disparity = Disparity::new(width, values);
        components::reject_small(&mut disparity, checks.component, checks.similarity);
        Ok(disparity)
    }
}

wide! {
    /// What is said of all rows. Beyond its border an image goes on as its nearest pixels are.
    fn match_rows(left: &Image, mirrored: &Image, radius: usize, checks: &Checks, scratch: &mut Scratch, values: &mut [f32]) {
        let (width, height, levels) = (left.width(), left.height(), checks.levels);
        let (row_length, ring) = (width * levels, 2 * radius + 1);
        let Scratch { columns, windows, winners } = scratch;
        columns.clear();
        columns.resize(row_length, 0);
        windows.resize(ring * row_length, 0);
        winners.prepare(width, levels);
        let mut right = vec![0; width + levels];
        let mut leaving = right.clone();
        let mut costs = vec![0; levels];
        let r = radius as isize;
        for y in -r..=r {
            candidates(mirrored.nearest_row(y), &mut right);
            enter(columns, left.nearest_row(y), &right, levels);
        }
        for ahead in 0..height + radius {
            if ahead < height {
                let y = ahead as isize;
                if ahead > 0 {
                    candidates(mirrored.nearest_row(y + r), &mut right);
                    candidates(mirrored.nearest_row(y - r - 1), &mut leaving);
                    roll(columns, [left.nearest_row(y + r), left.nearest_row(y - r - 1)], [&right, &leaving], levels);
                }
                sum_windows(columns, radius, levels, &mut windows[ahead % ring * row_length..][..row_length]);
            }
            let Some(y) = ahead.checked_sub(radius) else { continue };
            let sums = |y: usize| &windows[y % ring * row_length..][..row_length];
            let rows = [sums(y.saturating_sub(radius)), sums(y), sums((y + radius).min(height - 1))];
            for x in 0..width {
                five_windows(rows, [x.saturating_sub(radius), x, (x + radius).min(width - 1)], &mut costs);
                winners.take(x, &mut costs, checks.uniqueness);
            }
            winners.finish(checks.consistency, &mut values[y * width..][..width]);
        }
    }
}

/// A row of the mirrored right image, and as many times its last pixel as there are levels: from place width − 1 − x on come
/// the pixels that the left one of column x may match, by disparity.
#[inline(always)]
fn candidates(mirrored: &[u8], right: &mut [u8]) {
    right[..mirrored.len()].copy_from_slice(mirrored);
    right[mirrored.len()..].fill(mirrored[mirrored.len() - 1]);
}

/// Adds the absolute differences (3.27) of a row to the sums of its columns.
#[inline(always)]
fn enter(columns: &mut [u16], left: &[u8], right: &[u8], levels: usize) {
    let width = left.len();
    for (x, (column, &grey)) in columns.chunks_exact_mut(levels).zip(left).enumerate() {
        for (sum, &right) in blocks_mut(column).iter_mut().zip(blocks(&right[width - 1 - x..][..levels])) {
            *sum = plus(*sum, words(apart([grey; LANES], right)));
        }
    }
}

/// The same for a row that comes, and off them for one that goes.
#[inline(always)]
fn roll(columns: &mut [u16], left: [&[u8]; 2], right: [&[u8]; 2], levels: usize) {
    let width = left[0].len();
    for (x, column) in columns.chunks_exact_mut(levels).enumerate() {
        let candidates = |row: usize| blocks(&right[row][width - 1 - x..][..levels]);
        let grey = [[left[0][x]; LANES], [left[1][x]; LANES]];
        for ((sum, &coming), &going) in blocks_mut(column).iter_mut().zip(candidates(0)).zip(candidates(1)) {
            *sum = minus(plus(*sum, words(apart(grey[0], coming))), words(apart(grey[1], going)));
        }
    }
}

/// The sums over windows of a row, each made of the one before by the column that comes and the one that goes.
#[inline(always)]
fn sum_windows(columns: &[u16], radius: usize, levels: usize, windows: &mut [u16]) {
    let last = columns.len() / levels - 1;
    let column = |x: usize| blocks(&columns[x.min(last) * levels..][..levels]);
    let (first, _) = windows.split_at_mut(levels);
    first.fill(0);
    for x in (0..=2 * radius).map(|x| x.saturating_sub(radius)) {
        blocks_mut(first).iter_mut().zip(column(x)).for_each(|(sum, &column)| *sum = plus(*sum, column));
    }
    for x in 1..=last {
        let (before, window) = windows[(x - 1) * levels..][..2 * levels].split_at_mut(levels);
        let sums = blocks_mut(window).iter_mut().zip(blocks(before));
        let (coming, going) = (column(x + radius), column(x.saturating_sub(radius + 1)));
        for ((sum, &before), (&coming, &going)) in sums.zip(coming.iter().zip(going)) {
            *sum = minus(plus(before, coming), going);
        }
    }
}

/// C = C₀ + C₁ + C₂ (3.28), of three rows of windows at three columns.
#[inline(always)]
fn five_windows(rows: [&[u16]; 3], [left, x, right]: [usize; 3], costs: &mut [u16]) {
    let levels = costs.len();
    let windows = |row: usize, x: usize| blocks(&rows[row][x * levels..][..levels]);
    let corners = windows(0, left).iter().zip(windows(0, right)).zip(windows(2, left).iter().zip(windows(2, right)));
    for ((cost, &center), ((&a, &b), (&c, &d))) in blocks_mut(costs).iter_mut().zip(windows(1, x)).zip(corners) {
        let (less, more) = ([min(a, b), min(c, d)], [max(a, b), max(c, d)]);
        let best = min(less[0], less[1]);
        let second = min(max(less[0], less[1]), min(more[0], more[1]));
        *cost = plus(center, plus(best, second));
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    /// What is said of all rows, each cost worked out from (3.27) and (3.28) by itself.
    fn by_itself([left, right]: [&Image; 2], radius: usize, checks: &Checks) -> Vec<f32> {
        let (width, height) = (left.width(), left.height());
        let window = |y: usize, x: usize, d: usize| {
            let offsets = (0..=2 * radius).flat_map(|dy| (0..=2 * radius).map(move |dx| (dy, dx)));
            let apart = |(dy, dx): (usize, usize)| {
                let (y, x) =
                    ((y + dy).saturating_sub(radius).min(height - 1), (x + dx).saturating_sub(radius).min(width - 1));
                u16::from(left.row(y)[x].abs_diff(right.row(y)[x.saturating_sub(d)]))
            };
            offsets.map(apart).sum::<u16>()
        };
        let mut winners = Winners::default();
        winners.prepare(width, checks.levels);
        let mut values = vec![0.0; width * height];
        for (y, values) in values.chunks_exact_mut(width).enumerate() {
            for x in 0..width {
                let cost = |d: usize| {
                    let rows = [y.saturating_sub(radius), (y + radius).min(height - 1)];
                    let columns = [x.saturating_sub(radius), (x + radius).min(width - 1)];
                    let mut corners = [0, 1, 2, 3].map(|corner| window(rows[corner / 2], columns[corner % 2], d));
                    corners.sort();
                    window(y, x, d) + corners[0] + corners[1]
                };
                winners.take(x, &mut (0..checks.levels).map(cost).collect::<Vec<_>>(), checks.uniqueness);
            }
            winners.finish(checks.consistency, values);
        }
        values
    }

    proptest! {
        #![proptest_config(ProptestConfig::with_cases(40))]
        #[test]
        fn sums_kept_from_window_to_window_are_those_of_each_by_itself(
            width in 1usize..30,
            height in 1usize..12,
            radius in 1..=Sad5::MAX_RADIUS,
            seed in any::<[u8; 64]>(),
        ) {
            let image = |more: usize| Image::from_fn(width, height, |r, c| seed[(r * 13 + (c + more) * 7) % 64]).unwrap();
            let (left, right) = (image(0), image(3));
            let checks = Checks { levels: 16, uniqueness: 2, ..Checks::default() };
            let mut values = vec![0.0; width * height];
            match_rows(&left, &right.mirrored(), radius, &checks, &mut Scratch::default(), &mut values);
            prop_assert_eq!(values, by_itself([&left, &right], radius, &checks));
        }
    }
}
