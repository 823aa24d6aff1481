//! The median of 3 × 3 disparities.

use crate::lanes::wide;

/// Each disparity replaced by the median of the nine around it, of which those that there are not count as the pixel itself.
pub(crate) fn smoothed(width: usize, values: &[f32]) -> Vec<f32> {
    let mut smoothed = values.to_vec();
    smooth(width, values, &mut smoothed);
    smoothed
}

wide! {
    fn smooth(width: usize, values: &[f32], smoothed: &mut [f32]) {
        let height = values.len() / width;
        if width < 3 {
            return;
        }
        for y in 0..height {
            let rows = [y.saturating_sub(1), y, (y + 1).min(height - 1)].map(|y| &values[y * width..][..width]);
            let inside = &mut smoothed[y * width + 1..][..width - 2];
            for (x, value) in inside.iter_mut().enumerate() {
                *value = median_around([&rows[0][x..x + 3], &rows[1][x..x + 3], &rows[2][x..x + 3]]);
            }
        }
    }
}

/// The median of three rows of three, by sorting columns first: the least of the largest, the middle of the middle ones and the
/// largest of the least.
#[inline(always)]
fn median_around([above, row, below]: [&[f32]; 3]) -> f32 {
    let center = row[1];
    let known = |value: f32| if value < 0.0 { center } else { value };
    let column = |x: usize| sorted([known(above[x]), known(row[x]), known(below[x])]);
    let [a, b, c] = [column(0), column(1), column(2)];
    let largest_least = a[0].max(b[0]).max(c[0]);
    let middle = sorted([a[1], b[1], c[1]])[1];
    let least_largest = a[2].min(b[2]).min(c[2]);
    let median = sorted([largest_least, middle, least_largest])[1];
    if center < 0.0 { center } else { median }
}

#[inline(always)]
fn sorted([a, b, c]: [f32; 3]) -> [f32; 3] {
    let (low, high) = (a.min(b), a.max(b));
    [low.min(c), low.max(high.min(c)), high.max(c)]
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    proptest! {
        #[test]
        fn it_is_the_median(values in proptest::collection::vec(prop_oneof![Just(-1.0f32), 0.0f32..9.0], 9)) {
            let mut around: Vec<f32> = values.iter().map(|&v| if v < 0.0 { values[4] } else { v }).collect();
            around.sort_by(f32::total_cmp);
            let right = if values[4] < 0.0 { values[4] } else { around[4] };
            prop_assert_eq!(smoothed(3, &values)[4], right);
        }
    }
}
