//! Where there is nothing to match.

use crate::disparity::Unmatched;
use crate::image::Image;

/// Rejects pixels in whose window, of (2 `radius` + 1)² pixels, horizontal neighbours differ by less than `least` grey levels in
/// the mean: what is searched along rows has to change along rows.
pub(crate) fn reject(image: &Image, radius: usize, least: f32, values: &mut [f32]) {
    let window = 2 * radius + 1;
    let limit = (least * (window * window) as f32).ceil() as u32;
    let mut columns = vec![0u16; image.width()];
    let r = radius as isize;
    for y in -r..=r {
        change(&mut columns, image.nearest_row(y), u16::wrapping_add);
    }
    for (y, values) in values.chunks_exact_mut(image.width()).enumerate() {
        let y = y as isize;
        if y > 0 {
            change(&mut columns, image.nearest_row(y + r), u16::wrapping_add);
            change(&mut columns, image.nearest_row(y - r - 1), u16::wrapping_sub);
        }
        reject_row(&columns, radius, limit, values);
    }
}

/// Adds to sums, or takes off them, by how much the pixels of a row differ from those on their right; the last one has none.
fn change(columns: &mut [u16], row: &[u8], by: impl Fn(u16, u16) -> u16) {
    for (sum, (&here, &next)) in columns.iter_mut().zip(row.iter().zip(&row[1..])) {
        *sum = by(*sum, u16::from(here.abs_diff(next)));
    }
}

fn reject_row(columns: &[u16], radius: usize, limit: u32, values: &mut [f32]) {
    let last = columns.len() - 1;
    let column = |x: usize| u32::from(columns[x.min(last)]);
    let mut sum: u32 = (0..=2 * radius).map(|x| column(x.saturating_sub(radius))).sum();
    for (x, value) in values.iter_mut().enumerate() {
        if sum < limit {
            *value = Unmatched::Textureless.code();
        }
        sum = sum + column(x + radius + 1) - column(x.saturating_sub(radius));
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_window_is_textureless_where_its_rows_do_not_change() {
        // Stripes down to column 20, along rows to 40; then nothing.
        let image = Image::from_fn(60, 30, |row, column| match column {
            0..20 => (column % 2 * 10) as u8,
            20..40 => (row % 2 * 10) as u8,
            _ => 5,
        });
        let mut values = vec![7.0; 60 * 30];
        reject(&image.unwrap(), 2, 1.0, &mut values);
        let textureless = Unmatched::Textureless.code();
        for (i, &value) in values.iter().enumerate() {
            match i % 60 {
                0..20 => assert_eq!(value, 7.0, "at {i}"),
                // A window with a part of one of the borders sees a step there.
                25..35 | 45.. => assert_eq!(value, textureless, "at {i}"),
                _ => {}
            }
        }
    }

    #[test]
    fn the_sums_are_those_of_each_window() {
        let image = Image::from_fn(23, 17, |row, column| (row * 37 + column * column * 11) as u8).unwrap();
        let (radius, least) = (3isize, 60.0);
        let mut values = vec![1.0; 23 * 17];
        reject(&image, 3, least, &mut values);
        let step = |y: isize, x: isize| {
            let (y, x) = (y.clamp(0, 16) as usize, x.clamp(0, 22) as usize);
            let row = image.row(y);
            if x < 22 { u32::from(row[x].abs_diff(row[x + 1])) } else { 0 }
        };
        let mut rejected = 0;
        for y in 0..17 {
            for x in 0..23 {
                let around = (y - radius..=y + radius).flat_map(|y| (x - radius..=x + radius).map(move |x| (y, x)));
                let sum: u32 = around.map(|(y, x)| step(y, x)).sum();
                let is_rejected = values[(y * 23 + x) as usize] < 0.0;
                assert_eq!(is_rejected, (sum as f32) < least * 49.0, "row {y}, column {x}");
                rejected += usize::from(is_rejected);
            }
        }
        assert!(rejected > 20 && rejected < 23 * 17 - 20, "{rejected} of {}", 23 * 17);
    }
}
