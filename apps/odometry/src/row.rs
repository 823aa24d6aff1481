//! Where the right image shows what the left one shows: along a row.

use elk_stereo::Image;
use nalgebra::Matrix2;

use crate::patch::{Patch, Template};
use crate::pyramid::{Pyramid, from_level, to_level};
use crate::reprojection::Observation;

/// The level at which a row is searched; finer ones make the match better.
const LEVEL: usize = 1;
/// A second match that is as alike as the best but for this makes both of no use.
const UNIQUE: f32 = 0.03;
/// How far a second match is away, pixels of the level: what is nearer is the same one.
const SAME: usize = 3;
/// How many rows a match may lie beside its own, pixels: images are rectified no better.
pub(crate) const ROWS: f64 = 1.5;
/// The least disparity of which a distance can be told, pixels.
pub(crate) const LEAST_DISPARITY: f64 = 0.5;

/// Looks for a point of the left image, at a column and row, in the right one: over so many disparities for the window that is most alike
/// (normalised correlation), then to a part of a pixel. None where no window is so alike as `similarity`, or two are.
pub(crate) fn match_along(
    patch: &Patch,
    at: [f64; 2],
    right: &Pyramid,
    disparities: usize,
    similarity: f32,
) -> Option<Observation> {
    let same = Matrix2::identity();
    let coarse = to_level(at, LEVEL);
    let column = best(&patch.template(LEVEL, &same)?, right.level(LEVEL), coarse, disparities >> LEVEL, similarity)?;
    let start = from_level([column as f64 + coarse[0] - coarse[0].round(), coarse[1]], LEVEL);
    let right = refine(patch, &same, right, at, start[0], similarity)?;
    Some(Observation { left: at, right: Some(right) })
}

/// The column of the right image in which it shows what the left one shows at a place, from a column on that is nearly right. None where it is
/// on another row, or no point that is farther than a camera sees.
pub(crate) fn refine(
    patch: &Patch,
    warp: &Matrix2<f64>,
    right: &Pyramid,
    left: [f64; 2],
    column: f64,
    similarity: f32,
) -> Option<f64> {
    let mut at = [column, left[1]];
    let mut reached = 0.0;
    for level in (0..=LEVEL).rev() {
        let found = patch.template(level, warp).and_then(|window| window.find(right.level(level), to_level(at, level)));
        match found {
            Some(found) => (at, reached) = (from_level(found.at, level), found.similarity),
            None if level == 0 => return None,
            None => {}
        }
    }
    let is_match = reached >= similarity && (at[1] - left[1]).abs() <= ROWS && left[0] - at[0] >= LEAST_DISPARITY;
    is_match.then_some(at[0])
}

/// The column that is most alike, of those up to `disparities` left of a place.
fn best(template: &Template, image: &Image, at: [f64; 2], disparities: usize, similarity: f32) -> Option<usize> {
    let [column, row] = at.map(|x| x.round().max(0.0) as usize);
    let first = column.saturating_sub(disparities);
    let alike: Vec<f32> =
        (first..=column).map(|column| template.similarity(image, [column, row]).unwrap_or(-1.0)).collect();
    let (best, &most) = alike.iter().enumerate().max_by(|a, b| a.1.total_cmp(b.1))?;
    let elsewhere = alike.iter().enumerate().filter(|(i, _)| i.abs_diff(best) > SAME).map(|(_, &other)| other);
    let second = elsewhere.fold(-1.0, f32::max);
    (most >= similarity && second < most - UNIQUE).then_some(first + best)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn speckle(row: i64, column: i64) -> f64 {
        let mixed = ((row * 7919) ^ (column * 104_729) ^ (row * column * 31)) as u64;
        (mixed.wrapping_mul(0x9e37_79b9_7f4a_7c15) >> 40) as f64 / (1u64 << 24) as f64
    }

    /// Speckles of four pixels, and between them what lies between.
    fn textured(row: f64, column: f64) -> f64 {
        let (y, x) = (row / 4.0, column / 4.0);
        let part = |x: f64| x - x.floor();
        let at = |dy: i64, dx: i64| speckle(y.floor() as i64 + dy, x.floor() as i64 + dx);
        let along = |dy: i64| at(dy, 0) * (1.0 - part(x)) + at(dy, 1) * part(x);
        40.0 + 180.0 * (along(0) * (1.0 - part(y)) + along(1) * part(y))
    }

    fn image(grey: impl Fn(f64, f64) -> f64) -> Image {
        Image::from_fn(200, 120, |row, column| grey(row as f64, column as f64) as u8).unwrap()
    }

    fn matched(left: &Image, right: &Image) -> Option<Observation> {
        let (left, right) = (Pyramid::new(left), Pyramid::new(right));
        match_along(&Patch::new(&left, [120.0, 60.0]), [120.0, 60.0], &right, 64, 0.8)
    }

    #[test]
    fn a_point_is_matched_to_a_part_of_a_pixel() {
        let left = image(textured);
        for disparity in [1.0, 7.3, 20.5, 55.8] {
            let right = image(|row, column| 0.8 * textured(row, column + disparity) + 20.0);
            let found = matched(&left, &right).unwrap();
            assert!((120.0 - found.right.unwrap() - disparity).abs() < 0.1, "{disparity}: {found:?}");
        }
    }

    #[test]
    fn what_is_nowhere_on_the_left_or_twice_has_no_match() {
        let left = image(textured);
        assert_eq!(matched(&left, &image(|row, column| textured(row, column - 12.0))), None, "on the right of it");
        assert_eq!(matched(&left, &image(|row, column| textured(row + 40.0, column + 900.0))), None);
        let wallpaper = image(|row, column| textured(row, column % 24.0));
        assert_eq!(matched(&wallpaper, &wallpaper), None);
    }
}
