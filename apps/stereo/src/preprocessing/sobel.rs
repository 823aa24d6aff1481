use crate::image::Image;
use crate::lanes::wide;

/// The horizontal derivative by Sobel's 3 × 3 kernel, limited to ±`cap`; `cap` stands for none. What differs between two cameras
/// is most often how bright they see, and that changes little from column to column.
pub fn sobel(image: &Image, cap: u8) -> Image {
    let mut pixels = Vec::with_capacity(image.pixels().len());
    filter(image, i16::from(cap), &mut pixels);
    image.with_pixels(pixels)
}

wide! {
    fn filter(image: &Image, cap: i16, pixels: &mut Vec<u8>) {
        let width = image.width();
        // A column more on each side, which is that of the border.
        let mut smooth = vec![0i16; width + 2];
        for y in 0..image.height() as isize {
            let rows = [-1, 0, 1].map(|dy| image.nearest_row(y + dy));
            for (sum, ((&above, &middle), &below)) in smooth[1..].iter_mut().zip(rows[0].iter().zip(rows[1]).zip(rows[2])) {
                *sum = i16::from(above) + 2 * i16::from(middle) + i16::from(below);
            }
            (smooth[0], smooth[width + 1]) = (smooth[1], smooth[width]);
            let change = |(&before, &after): (&i16, &i16)| ((after - before).clamp(-cap, cap) + cap) as u8;
            pixels.extend(smooth[..width].iter().zip(&smooth[2..]).map(change));
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_ramp_changes_evenly_whatever_its_brightness() {
        for bright in [0, 100] {
            let ramp = Image::from_fn(9, 5, |_, column| (bright + 3 * column) as u8).unwrap();
            let filtered = sobel(&ramp, 31);
            // 3 a column over two columns, times 1 + 2 + 1; half of it at the border, where a column stands for one outside.
            assert_eq!(filtered.row(2), [43, 55, 55, 55, 55, 55, 55, 55, 43]);
        }
        let edge = Image::from_fn(4, 4, |_, column| if column < 2 { 0 } else { 255 }).unwrap();
        assert_eq!(sobel(&edge, 31).row(1), [31, 62, 62, 31]);
    }
}
