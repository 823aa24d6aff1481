//! What it costs to match two pixels.

use wide::u8x16;

use crate::image::Image;
use crate::lanes::{Bytes, blocks, blocks_mut, wide};
use crate::preprocessing::sobel;

/// The most that a match costs.
pub const MAX: u8 = (9 * (BITS + (MOST_CHANGE >> CHANGE_SHIFT)) + 2) >> 2;

/// The bits of a census.
const BITS: u8 = 14;
/// The largest difference of changes that is told from larger ones; four grey levels of it count as a bit of the census.
const MOST_CHANGE: u8 = 20;
const CHANGE_SHIFT: u32 = 2;
/// The largest change along rows.
const CAP: u8 = 63;

/// What is compared of a row's pixels. Of the right image, the row is mirrored, and goes on as its last pixel as far as is searched.
#[derive(Debug, Default)]
struct Row {
    /// Which of the 14 others of 3 × 5 pixels are darker (Zabih and Woodfill, ECCV 1994), seven to a byte.
    census: [Vec<u8>; 2],
    /// The change along the row.
    change: Vec<u8>,
    /// Between what the change lies halfway to the neighbours: what a pixel may have seen of a point between two (Birchfield
    /// and Tomasi, PAMI 1998).
    low: Vec<u8>,
    high: Vec<u8>,
}

/// The cost of each level of each pixel of a left image, row by row.
#[derive(Debug, Default)]
pub struct Volume {
    costs: Vec<u8>,
    /// Costs of single pixels of three rows; row y lies at y modulo 3.
    pixels: [Vec<u8>; 3],
    /// Their sums over columns of three.
    columns: Vec<u8>,
    left: Row,
    right: Row,
}

impl Volume {
    /// The costs of a pixel whose first one is at a place.
    #[inline(always)]
    pub fn of(&self, at: usize, levels: usize) -> &[u8] {
        &self.costs[at..][..levels]
    }

    /// Compares all pixels.
    pub fn measure(&mut self, left: &Image, right: &Image, levels: usize) {
        let changes = [left, right].map(|image| sobel(image, CAP));
        fill(self, left, right, &changes, levels);
    }
}

wide! {
    fn fill(volume: &mut Volume, left: &Image, right: &Image, changes: &[Image; 2], levels: usize) {
        let (width, height) = (left.width(), left.height());
        let length = width * levels;
        volume.costs.resize(length * height, 0);
        volume.columns.resize(length, 0);
        volume.pixels.iter_mut().for_each(|row| row.resize(length, 0));
        for ahead in 0..=height {
            if ahead < height {
                volume.left.describe(left, &changes[0], ahead);
                volume.right.describe(right, &changes[1], ahead);
                volume.right.mirror(levels);
                compare(&volume.left, &volume.right, levels, &mut volume.pixels[ahead % 3]);
            }
            let Some(y) = ahead.checked_sub(1) else { continue };
            let pixels = |y: usize| blocks(&volume.pixels[y % 3]).iter();
            let rows = pixels(y.saturating_sub(1)).zip(pixels(y)).zip(pixels(ahead.min(height - 1)));
            for (total, ((&above, &middle), &below)) in blocks_mut(&mut volume.columns).iter_mut().zip(rows) {
                *total = sum([above, middle, below]).to_array();
            }
            sum_rows(&volume.columns, levels, &mut volume.costs[y * length..][..length]);
        }
    }
}

impl Row {
    /// What is compared of one row of an image, of whose changes along rows there is an image, too.
    #[inline(always)]
    fn describe(&mut self, image: &Image, changes: &Image, y: usize) {
        self.change.clear();
        self.change.extend_from_slice(changes.row(y));
        let center = image.row(y);
        let others = (-2..=2).flat_map(|dy| (-1..=1).map(move |dx| (dy, dx))).filter(|&at| at != (0, 0));
        self.census.iter_mut().for_each(|codes| {
            codes.clear();
            codes.resize(center.len(), 0);
        });
        for (i, (dy, dx)) in others.enumerate() {
            add_bit(&mut self.census[i / 7], image.nearest_row(y as isize + dy), center, dx);
        }
        self.bound();
    }

    /// The bounds of the changes.
    #[inline(always)]
    fn bound(&mut self) {
        let Self { change, low, high, .. } = self;
        low.clear();
        high.clear();
        let last = change.len() - 1;
        for x in 0..change.len() {
            let here = change[x];
            let halfway = [change[x.saturating_sub(1)], change[(x + 1).min(last)]]
                .map(|other| ((u16::from(here) + u16::from(other)) / 2) as u8);
            low.push(here.min(halfway[0]).min(halfway[1]));
            high.push(here.max(halfway[0]).max(halfway[1]));
        }
    }

    /// Turns the row round, and lengthens it by as much as is searched.
    #[inline(always)]
    fn mirror(&mut self, levels: usize) {
        let Self { census: [upper, lower], change, low, high } = self;
        for row in [upper, lower, change, low, high] {
            row.reverse();
            let last = row[row.len() - 1];
            row.resize(row.len() + levels, last);
        }
    }
}

/// Adds to each pixel's code whether another one, in a row and `dx` columns on, is darker. Beyond its border a row goes on as its
/// nearest pixel is.
#[inline(always)]
fn add_bit(codes: &mut [u8], row: &[u8], centers: &[u8], dx: isize) {
    let inside = codes.len() - 1;
    let add = |code: &mut u8, grey: u8, center: u8| *code = *code << 1 | u8::from(grey < center);
    let (codes, row, centers) = match dx {
        -1 => {
            add(&mut codes[0], row[0], centers[0]);
            (&mut codes[1..], &row[..inside], &centers[1..])
        }
        0 => (codes, row, centers),
        _ => {
            add(&mut codes[inside], row[inside], centers[inside]);
            (&mut codes[..inside], &row[1..], &centers[..inside])
        }
    };
    for ((code, &grey), &center) in codes.iter_mut().zip(row).zip(centers) {
        add(code, grey, center);
    }
}

/// What the pixels of a row cost, each by itself: the Hamming distance of the two censuses and, of the changes, the least distance
/// of one from the other's bounds.
#[inline(always)]
fn compare(left: &Row, right: &Row, levels: usize, pixels: &mut [u8]) {
    let width = left.change.len();
    let most = u8x16::splat(MOST_CHANGE);
    for (x, pixel) in pixels.chunks_exact_mut(levels).enumerate() {
        let of = |row: &[u8]| u8x16::splat(row[x]);
        let census = [of(&left.census[0]), of(&left.census[1])];
        let (change, low, high) = (of(&left.change), of(&left.low), of(&left.high));
        let from = width - 1 - x..width - 1 - x + levels;
        let censuses = blocks(&right.census[0][from.clone()]).iter().zip(blocks(&right.census[1][from.clone()]));
        let bounds = blocks(&right.low[from.clone()]).iter().zip(blocks(&right.high[from.clone()]));
        let right = censuses.zip(blocks(&right.change[from]).iter().zip(bounds));
        for (cost, ((&upper, &lower), (&other, (&other_low, &other_high)))) in blocks_mut(pixel).iter_mut().zip(right) {
            let bits = hamming([census[0] ^ u8x16::new(upper), census[1] ^ u8x16::new(lower)]);
            let (other, other_low, other_high) = (u8x16::new(other), u8x16::new(other_low), u8x16::new(other_high));
            let outside_right = change.saturating_sub(other_high).max(other_low.saturating_sub(change));
            let outside_left = other.saturating_sub(high).max(low.saturating_sub(other));
            let apart = outside_right.min(outside_left).min(most);
            *cost = (bits + (apart >> CHANGE_SHIFT)).to_array();
        }
    }
}

/// How many bits of two bytes are set, of which there are at most 14.
#[inline(always)]
fn hamming(bytes: [u8x16; 2]) -> u8x16 {
    let mask = u8x16::splat;
    let pairs = |byte: u8x16| byte - ((byte >> 1u32) & mask(0x55));
    let nibbles = |byte: u8x16| (byte & mask(0x33)) + ((byte >> 2u32) & mask(0x33));
    let both = nibbles(pairs(bytes[0])) + nibbles(pairs(bytes[1]));
    (both & mask(0x0f)) + (both >> 4u32)
}

/// A quarter of the sums of three columns each.
#[inline(always)]
fn sum_rows(columns: &[u8], levels: usize, costs: &mut [u8]) {
    let last = columns.len() / levels - 1;
    let column = |x: usize| blocks(&columns[x.min(last) * levels..][..levels]).iter();
    for (x, costs) in costs.chunks_exact_mut(levels).enumerate() {
        let around = column(x.saturating_sub(1)).zip(column(x)).zip(column(x + 1));
        for (cost, ((&before, &here), &after)) in blocks_mut(costs).iter_mut().zip(around) {
            *cost = ((sum([before, here, after]) + u8x16::splat(2)) >> 2u32).to_array();
        }
    }
}

#[inline(always)]
fn sum([a, b, c]: [Bytes; 3]) -> u8x16 {
    u8x16::new(a) + u8x16::new(b) + u8x16::new(c)
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    #[test]
    fn bits_are_counted() {
        for code in 0u16..1 << 14 {
            let bytes = [(code & 127) as u8, (code >> 7) as u8].map(u8x16::splat);
            assert_eq!(hamming(bytes).to_array(), [code.count_ones() as u8; 16], "{code:b}");
        }
    }

    /// The cost of a single pixel by itself.
    fn by_itself([left, right]: [&Image; 2], [y, x, d]: [usize; 3]) -> u16 {
        let (width, height) = (left.width() as isize, left.height() as isize);
        let at = |image: &Image, y: isize, x: isize| {
            i32::from(image.row(y.clamp(0, height - 1) as usize)[x.clamp(0, width - 1) as usize])
        };
        let (y, x, other) = (y as isize, x as isize, x.saturating_sub(d) as isize);
        let darker = |image: &Image, x: isize, dy: isize, dx: isize| at(image, y + dy, x + dx) < at(image, y, x);
        let around = (-2..=2).flat_map(|dy| (-1..=1).map(move |dx| (dy, dx)));
        let bits = around.filter(|&(dy, dx)| darker(left, x, dy, dx) != darker(right, other, dy, dx)).count();
        let changes = [sobel(left, CAP), sobel(right, CAP)];
        let bounds = |image: &Image, x: isize| {
            let here = at(image, y, x);
            let halfway = [-1, 1].map(|dx| (here + at(image, y, x + dx)) / 2);
            (here, here.min(halfway[0]).min(halfway[1]), here.max(halfway[0]).max(halfway[1]))
        };
        let ((a, a_low, a_high), (b, b_low, b_high)) = (bounds(&changes[0], x), bounds(&changes[1], other));
        let apart = (a - b_high).max(b_low - a).max(0).min((b - a_high).max(a_low - b).max(0)).min(20);
        bits as u16 + apart as u16 / 4
    }

    proptest! {
        #![proptest_config(ProptestConfig::with_cases(20))]
        #[test]
        fn costs_of_all_pixels_are_those_of_each_by_itself(width in 1usize..24, height in 1usize..8, seed in any::<[u8; 64]>()) {
            let image = |more: usize| Image::from_fn(width, height, |r, c| seed[(r * 13 + (c + more) * 7) % 64]).unwrap();
            let (left, right) = (image(0), image(3));
            let mut volume = Volume::default();
            volume.measure(&left, &right, 16);
            for (y, x, d) in (0..height).flat_map(|y| (0..width).flat_map(move |x| (0..16).map(move |d| (y, x, d)))) {
                let rows = [y.saturating_sub(1), y, (y + 1).min(height - 1)];
                let columns = [x.saturating_sub(1), x, (x + 1).min(width - 1)];
                let sum: u16 =
                    rows.iter().flat_map(|&y| columns.map(|x| by_itself([&left, &right], [y, x, d]))).sum();
                let cost = volume.of((y * width + x) * 16, 16)[d];
                prop_assert_eq!(u16::from(cost), (sum + 2) / 4, "row {}, column {}, level {}", y, x, d);
                prop_assert!(cost <= MAX);
            }
        }
    }
}
