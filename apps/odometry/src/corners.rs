//! Corners, spread evenly over an image.

use elk_stereo::Image;

/// Pixels about a corner that say how much of one it is: 7 × 7.
const RADIUS: usize = 3;
/// How far from the border corners are, pixels: what they look like is seen whole.
pub(crate) const MARGIN: usize = 16;
/// How far two corners are apart along an axis at least, pixels: no two of them show the same.
const APART: f64 = 6.0;

/// An image in square cells.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Cells {
    size: usize,
    columns: usize,
    rows: usize,
}

impl Cells {
    pub fn new(size: usize, [width, height]: [usize; 2]) -> Self {
        Self { size, columns: width.div_ceil(size), rows: height.div_ceil(size) }
    }

    /// Which cell a column and row is in.
    fn index(&self, [column, row]: [f64; 2]) -> usize {
        let along = |x: f64, count: usize| ((x.max(0.0) as usize) / self.size).min(count - 1);
        along(row, self.rows) * self.columns + along(column, self.columns)
    }

    /// Which cells have a point.
    pub fn taken(&self, points: impl Iterator<Item = [f64; 2]>) -> Vec<bool> {
        let mut taken = vec![false; self.columns * self.rows];
        points.for_each(|at| taken[self.index(at)] = true);
        taken
    }

    /// The best corner of each cell that has no point yet, where that has at least `texture` (mean squared slope along the direction in which
    /// the image changes least, grey² per pixel²; Shi and Tomasi, CVPR 1994), as column and row.
    pub fn corners(&self, image: &Image, points: &[[f64; 2]], texture: f64) -> Vec<[f64; 2]> {
        let taken = self.taken(points.iter().copied());
        let mut corners: Vec<[f64; 2]> = Vec::new();
        let mut scratch = Scratch::default();
        for (cell, _) in taken.iter().enumerate().filter(|(_, taken)| !**taken) {
            let along = |i: usize, side: usize| {
                (i * self.size).max(MARGIN)..((i + 1) * self.size).min(side.saturating_sub(MARGIN))
            };
            let columns = along(cell % self.columns, image.width());
            let rows = along(cell / self.columns, image.height());
            if columns.is_empty() || rows.is_empty() {
                continue;
            }
            let Some((best, at)) = scratch.best(image, columns, rows) else { continue };
            let is_near = |other: &[f64; 2]| (0..2).all(|axis| (other[axis] - at[axis]).abs() < APART);
            if f64::from(best) >= texture && !corners.iter().chain(points).any(is_near) {
                corners.push(at);
            }
        }
        corners
    }
}

/// Products of slopes, and their sums down columns.
#[derive(Default)]
struct Scratch {
    products: Vec<[f32; 3]>,
    sums: Vec<[f32; 3]>,
}

impl Scratch {
    /// The pixel about which the image changes most along the direction in which it changes least, and how much.
    fn best(
        &mut self,
        image: &Image,
        columns: std::ops::Range<usize>,
        rows: std::ops::Range<usize>,
    ) -> Option<(f32, [f64; 2])> {
        let width = columns.len() + 2 * RADIUS;
        let left = columns.start - RADIUS;
        self.products.clear();
        for row in rows.start - RADIUS..rows.end + RADIUS {
            let [above, here, below] = [row - 1, row, row + 1].map(|row| &image.row(row)[left - 1..left + width + 1]);
            let slope = |a: u8, b: u8| (f32::from(b) - f32::from(a)) / 2.0;
            self.products.extend((1..=width).map(|x| {
                let (dx, dy) = (slope(here[x - 1], here[x + 1]), slope(above[x], below[x]));
                [dx * dx, dx * dy, dy * dy]
            }));
        }
        let mut best: Option<(f32, [f64; 2])> = None;
        for (i, row) in rows.enumerate() {
            let window = &self.products[i * width..(i + 2 * RADIUS + 1) * width];
            self.sums.clear();
            self.sums.resize(width, [0.0; 3]);
            for line in window.chunks_exact(width) {
                self.sums.iter_mut().zip(line).for_each(|(sum, one)| (0..3).for_each(|k| sum[k] += one[k]));
            }
            for (column, sums) in columns.clone().zip(self.sums.windows(2 * RADIUS + 1)) {
                let [xx, xy, yy] = sums.iter().fold([0.0; 3], |all, one| [0, 1, 2].map(|k| all[k] + one[k]));
                let least = (xx + yy - ((xx - yy) * (xx - yy) + 4.0 * xy * xy).sqrt()) / 2.0;
                if best.is_none_or(|(most, _)| least > most) {
                    best = Some((least, [column as f64, row as f64]));
                }
            }
        }
        let pixels = (2 * RADIUS + 1).pow(2) as f32;
        best.map(|(sum, at)| (sum / pixels, at))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Bright squares of 12 × 12 pixels, 40 apart, which have corners and edges.
    fn squares() -> Image {
        let is_inside = |x: usize| (14..26).contains(&(x % 40));
        Image::from_fn(200, 160, |row, column| if is_inside(row) && is_inside(column) { 200 } else { 20 }).unwrap()
    }

    #[test]
    fn corners_are_at_corners_and_no_edges_among_them() {
        let cells = Cells::new(40, [200, 160]);
        let corners = cells.corners(&squares(), &[], 100.0);
        assert_eq!(corners.len(), 20, "{corners:?}");
        for at in &corners {
            let off = at.map(|x| [13.5, 25.5].map(|edge| (x % 40.0 - edge).abs()).into_iter().fold(f64::MAX, f64::min));
            assert!(off.iter().all(|&off| off <= 3.0), "{at:?}");
        }
    }

    #[test]
    fn a_cell_that_has_a_point_gets_no_other_and_a_blank_image_none() {
        let cells = Cells::new(40, [200, 160]);
        let corners = cells.corners(&squares(), &[[45.0, 50.0], [199.0, 159.0]], 100.0);
        assert_eq!(corners.len(), 18);
        assert!(!corners.iter().any(|at| (40.0..80.0).contains(&at[0]) && (40.0..80.0).contains(&at[1])));
        let blank = Image::from_fn(200, 160, |_, column| column as u8).unwrap();
        assert!(cells.corners(&blank, &[], 1.0).is_empty(), "it changes along one direction alone");
    }
}
