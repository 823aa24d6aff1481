//! What a point looks like, and where an image shows that.

use elk_stereo::Image;
use nalgebra::{Matrix2, Vector2};

use crate::pyramid::{Pyramid, to_level};

/// How many of the finest levels a point's look is kept of.
pub(crate) const LEVELS: usize = 3;
/// A window has 11 × 11 pixels.
const RADIUS: usize = 5;
const SIDE: usize = 2 * RADIUS + 1;
const AREA: usize = SIDE * SIDE;
/// What is kept is larger, so that windows can be cut out of it that are turned and of another scale.
const KEPT_RADIUS: usize = 12;
const KEPT_SIDE: usize = 2 * KEPT_RADIUS + 1;
/// A window is there when a step moves it by less than this, pixels of its level.
const TOLERANCE: f32 = 0.01;
const ITERATIONS: usize = 20;
/// The least standard deviation of a window's grey values in which there is anything to find.
const LEAST_CONTRAST: f32 = 1.5;

/// Grey values of a window.
type Window = [f32; AREA];

/// What a point looks like in the image in which it was first seen.
#[derive(Clone, Debug)]
pub(crate) struct Patch {
    levels: [Box<[u8; KEPT_SIDE * KEPT_SIDE]>; LEVELS],
    /// How far the point lies right of and below the middle of what is kept, pixels of the level.
    offsets: [Vector2<f32>; LEVELS],
}

impl Patch {
    /// Of what an image shows about a column and row. Beyond its border it goes on as it ends.
    pub fn new(pyramid: &Pyramid, at: [f64; 2]) -> Self {
        let kept = |level: usize| {
            let image = pyramid.level(level);
            let middle = to_level(at, level).map(f64::round);
            let inside = |x: f64, i: usize, side: usize| {
                (x as isize + i as isize - KEPT_RADIUS as isize).clamp(0, side as isize - 1) as usize
            };
            let mut pixels = Box::new([0; KEPT_SIDE * KEPT_SIDE]);
            for (i, pixel) in pixels.iter_mut().enumerate() {
                let row = image.row(inside(middle[1], i / KEPT_SIDE, image.height()));
                *pixel = row[inside(middle[0], i % KEPT_SIDE, image.width())];
            }
            pixels
        };
        let offset = |level: usize| {
            let [x, y] = to_level(at, level);
            Vector2::new((x - x.round()) as f32, (y - y.round()) as f32)
        };
        Self { levels: std::array::from_fn(kept), offsets: std::array::from_fn(offset) }
    }

    /// The window of a level, as a camera sees it for which `warp` takes steps in its image to those in the image in which the point was first
    /// seen. None where it does not lie in what is kept, or shows nothing.
    pub fn template(&self, level: usize, warp: &Matrix2<f64>) -> Option<Template> {
        let warp = warp.map(|x| x as f32);
        let reach = (RADIUS + 1) as f32 * (warp.row(0).abs().sum()).max(warp.row(1).abs().sum());
        let is_kept = reach < KEPT_RADIUS as f32 - 1.0;
        if !is_kept {
            return None;
        }
        // One pixel more on each side, for the slopes.
        const WIDE: usize = SIDE + 2;
        let mut wide = [0.0f32; WIDE * WIDE];
        let middle = self.offsets[level].add_scalar(KEPT_RADIUS as f32);
        let pixels = &self.levels[level];
        for (i, value) in wide.iter_mut().enumerate() {
            let step = Vector2::new((i % WIDE) as f32, (i / WIDE) as f32).add_scalar(-(RADIUS as f32 + 1.0));
            let at = middle + warp * step;
            let (x, y) = (at.x as usize, at.y as usize);
            let (dx, dy) = (at.x - x as f32, at.y - y as f32);
            let pixel = |i: usize| f32::from(pixels[y * KEPT_SIDE + x + i]);
            let [above, below] = [0, KEPT_SIDE].map(|row| pixel(row) * (1.0 - dx) + pixel(row + 1) * dx);
            *value = above * (1.0 - dy) + below * dy;
        }
        Template::new(
            |row, column| wide[(row + 1) * WIDE + column + 1],
            |row, column| {
                let at = (row + 1) * WIDE + column + 1;
                [(wide[at + 1] - wide[at - 1]) / 2.0, (wide[at + WIDE] - wide[at - WIDE]) / 2.0]
            },
        )
    }
}

/// A window to be found: its grey values and their slopes, each without its mean, since images differ in brightness.
#[derive(Clone, Debug)]
pub(crate) struct Template {
    grey: Window,
    slopes: [Window; 2],
    /// Of the sums of products of slopes.
    inverse: Matrix2<f32>,
    /// The root of the sum of squares of grey.
    norm: f32,
}

/// Where a window was found, and how alike it is: the normalised correlation, −1 to 1.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Found {
    pub at: [f64; 2],
    pub similarity: f32,
}

impl Template {
    fn new(grey: impl Fn(usize, usize) -> f32, slope: impl Fn(usize, usize) -> [f32; 2]) -> Option<Self> {
        let mut values = [0.0; AREA];
        let mut slopes = [[0.0; AREA]; 2];
        for i in 0..AREA {
            let (row, column) = (i / SIDE, i % SIDE);
            values[i] = grey(row, column);
            [slopes[0][i], slopes[1][i]] = slope(row, column);
        }
        let norm = centre(&mut values);
        slopes.iter_mut().for_each(|slopes| {
            centre(slopes);
        });
        let [xx, xy, yy] = [(0, 0), (0, 1), (1, 1)].map(|(a, b)| dot(&slopes[a], &slopes[b]));
        let inverse = Matrix2::new(xx, xy, xy, yy).try_inverse()?;
        let is_something = norm >= LEAST_CONTRAST * SIDE as f32 && inverse.iter().all(|x| x.is_finite());
        is_something.then_some(Self { grey: values, slopes, inverse, norm })
    }

    /// Where near `start` (column and row) an image shows the window, whatever its brightness and contrast there: steps of inverse composition
    /// (Lucas and Kanade, IJCAI 1981; Baker and Matthews, IJCV 2004, 3.2), with grey values normalised at each. None where it leaves the image,
    /// goes far, or does not settle.
    pub fn find(&self, image: &Image, start: [f64; 2]) -> Option<Found> {
        let mut at = start.map(|x| x as f32);
        for _ in 0..ITERATIONS {
            let (seen, norm) = window(image, at)?;
            let gain = self.norm / norm;
            let mut off = [0.0; AREA];
            for i in 0..AREA {
                off[i] = seen[i] * gain - self.grey[i];
            }
            let step = self.inverse * Vector2::new(dot(&self.slopes[0], &off), dot(&self.slopes[1], &off));
            at = [at[0] - step.x, at[1] - step.y];
            let is_near = (0..2).all(|axis| (at[axis] - start[axis] as f32).abs() <= SIDE as f32);
            if !is_near {
                return None;
            }
            if step.x.abs().max(step.y.abs()) < TOLERANCE {
                return Some(Found { at: at.map(f64::from), similarity: dot(&seen, &self.grey) / (norm * self.norm) });
            }
        }
        None
    }

    /// How alike an image is about a pixel; none at the border and where it shows nothing.
    pub fn similarity(&self, image: &Image, [column, row]: [usize; 2]) -> Option<f32> {
        let (seen, norm) = window(image, [column as f32, row as f32])?;
        Some(dot(&seen, &self.grey) / (norm * self.norm))
    }
}

/// What an image shows about a column and row, bilinearly, without its mean, and the root of the sum of its squares.
#[inline(always)]
fn window(image: &Image, [column, row]: [f32; 2]) -> Option<(Window, f32)> {
    let first = [column.floor() - RADIUS as f32, row.floor() - RADIUS as f32];
    let is_inside = first[0] >= 0.0
        && first[1] >= 0.0
        && first[0] + (SIDE as f32) < image.width() as f32
        && first[1] + (SIDE as f32) < image.height() as f32;
    if !is_inside {
        return None;
    }
    let (dx, dy) = (column - column.floor(), row - row.floor());
    let (left, top) = (first[0] as usize, first[1] as usize);
    let line = |y: usize| -> [f32; SIDE] {
        let row: &[u8; SIDE + 1] = image.row(top + y)[left..].first_chunk().expect("as many as are inside");
        std::array::from_fn(|x| f32::from(row[x]) * (1.0 - dx) + f32::from(row[x + 1]) * dx)
    };
    let mut window = [0.0; AREA];
    let mut above = line(0);
    for (y, values) in window.as_chunks_mut::<SIDE>().0.iter_mut().enumerate() {
        let below = line(y + 1);
        *values = std::array::from_fn(|x| above[x] * (1.0 - dy) + below[x] * dy);
        above = below;
    }
    let norm = centre(&mut window);
    (norm >= LEAST_CONTRAST * SIDE as f32).then_some((window, norm))
}

/// Takes the mean away, and gives the root of the sum of squares.
#[inline(always)]
fn centre(window: &mut Window) -> f32 {
    let mean = sum(window) / AREA as f32;
    window.iter_mut().for_each(|x| *x -= mean);
    dot(window, window).sqrt()
}

/// Sums are of eight parts, which a processor works out at a time.
#[inline(always)]
fn sum(window: &Window) -> f32 {
    let (eights, rest) = window.as_chunks::<8>();
    let sums = eights.iter().fold([0.0f32; 8], |all, eight| std::array::from_fn(|i| all[i] + eight[i]));
    sums.iter().chain(rest).sum()
}

#[inline(always)]
fn dot(a: &Window, b: &Window) -> f32 {
    let ((a, a_rest), (b, b_rest)) = (a.as_chunks::<8>(), b.as_chunks::<8>());
    let pairs = a.iter().zip(b);
    let sums = pairs.fold([0.0f32; 8], |all, (a, b)| std::array::from_fn(|i| all[i] + a[i] * b[i]));
    sums.iter().sum::<f32>() + a_rest.iter().zip(b_rest).map(|(a, b)| a * b).sum::<f32>()
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn waves(x: f64, y: f64) -> f64 {
        (0.31 * x + 0.2 * y).sin() + (0.23 * y - 0.12 * x).cos() + (0.11 * x + 0.29 * y).sin()
    }

    fn image(grey: impl Fn(f64, f64) -> f64) -> Image {
        Image::from_fn(120, 100, |row, column| grey(column as f64, row as f64).round() as u8).unwrap()
    }

    proptest! {
        #[test]
        fn a_window_is_found_where_it_went(dx in -2.0..2.0f64, dy in -2.0..2.0f64, gain in 0.6..1.4f64, bias in -15.0..15.0f64) {
            let first = image(|x, y| 120.0 + 30.0 * waves(x, y));
            let second = image(|x, y| 120.0 + bias + gain * 30.0 * waves(x - dx, y - dy));
            let patch = Patch::new(&Pyramid::new(&first), [60.0, 50.0]);
            let found = patch.template(0, &Matrix2::identity()).unwrap().find(&second, [60.0, 50.0]).unwrap();
            prop_assert!((found.at[0] - 60.0 - dx).abs() < 0.15 && (found.at[1] - 50.0 - dy).abs() < 0.15, "{found:?}");
            prop_assert!(found.similarity > 0.98, "{found:?}");
        }

        #[test]
        fn a_window_is_found_turned_and_of_another_scale(angle in -0.6..0.6f64, scale in 0.8..1.25f64) {
            let turn = Matrix2::new(angle.cos(), -angle.sin(), angle.sin(), angle.cos()) * scale;
            let first = image(|x, y| 120.0 + 30.0 * waves(x, y));
            // What the second shows at a step from the middle the first shows at that step turned.
            let second = image(|x, y| {
                let at = turn * Vector2::new(x - 61.0, y - 49.5);
                120.0 + 30.0 * waves(at.x + 60.0, at.y + 50.0)
            });
            let patch = Patch::new(&Pyramid::new(&first), [60.0, 50.0]);
            let found = patch.template(0, &turn).unwrap().find(&second, [60.0, 50.0]).unwrap();
            prop_assert!((found.at[0] - 61.0).abs() < 0.25 && (found.at[1] - 49.5).abs() < 0.25, "{found:?}");
        }
    }

    #[test]
    fn what_shows_nothing_is_not_looked_for_and_beyond_the_border_is_nothing() {
        let blank = image(|_, _| 100.0);
        assert!(Patch::new(&Pyramid::new(&blank), [60.0, 50.0]).template(0, &Matrix2::identity()).is_none());
        let textured = image(|x, y| 120.0 + 30.0 * waves(x, y));
        let patch = Patch::new(&Pyramid::new(&textured), [60.0, 50.0]);
        let template = patch.template(0, &Matrix2::identity()).unwrap();
        assert_eq!(template.find(&blank, [60.0, 50.0]), None);
        assert_eq!(template.find(&textured, [3.0, 50.0]), None);
        assert_eq!(template.find(&textured, [f64::NAN, 50.0]), None);
        assert!(patch.template(0, &(Matrix2::identity() * 3.0)).is_none(), "three times as large is more than is kept");
        assert!((template.similarity(&textured, [60, 50]).unwrap() - 1.0).abs() < 1e-4);
    }
}
