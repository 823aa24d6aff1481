//! An image at several sizes, each half of the one before.

use elk_stereo::Image;

/// How many sizes there are, the image's own among them. The smallest are what [`crate::turn`] looks at.
pub(crate) const LEVELS: usize = 5;

/// An image, and smaller ones of it.
pub(crate) struct Pyramid<'a> {
    finest: &'a Image,
    coarser: Vec<Image>,
}

impl<'a> Pyramid<'a> {
    /// # Panics
    /// With an image that has fewer than 2^(LEVELS − 1) rows or columns.
    pub fn new(finest: &'a Image) -> Self {
        let mut coarser: Vec<Image> = Vec::with_capacity(LEVELS - 1);
        for _ in 1..LEVELS {
            let half = half(coarser.last().unwrap_or(finest));
            coarser.push(half);
        }
        Self { finest, coarser }
    }

    /// The image at a level; level 0 is the finest.
    pub fn level(&self, level: usize) -> &Image {
        level.checked_sub(1).map_or(self.finest, |i| &self.coarser[i])
    }
}

/// The image of half as many rows and columns, of which each pixel is the mean of four.
fn half(image: &Image) -> Image {
    let (width, height) = (image.width() / 2, image.height() / 2);
    let mut pixels = Vec::with_capacity(width * height);
    for row in 0..height {
        let [above, below] = [0, 1].map(|i| image.row(2 * row + i).as_chunks::<2>().0);
        pixels.extend(above.iter().zip(below).map(|(a, b)| {
            let sum = u16::from(a[0]) + u16::from(a[1]) + u16::from(b[0]) + u16::from(b[1]);
            ((sum + 2) / 4) as u8
        }));
    }
    Image::new(width, height, pixels).expect("an image that is large enough has a half")
}

/// Where a level shows what the finest one shows at a column and row.
pub(crate) fn to_level(at: [f64; 2], level: usize) -> [f64; 2] {
    at.map(|x| (x + 0.5) / (1u32 << level) as f64 - 0.5)
}

/// The inverse of [`to_level`].
pub(crate) fn from_level(at: [f64; 2], level: usize) -> [f64; 2] {
    at.map(|x| (x + 0.5) * (1u32 << level) as f64 - 0.5)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_level_shows_the_same_where_it_is_said_to() {
        // Grey is the sum of column and row, so a level shows that of where its pixels lie in the finest.
        let image = Image::from_fn(80, 64, |row, column| (row + column) as u8).unwrap();
        let pyramid = Pyramid::new(&image);
        for level in 0..LEVELS {
            let small = pyramid.level(level);
            assert_eq!((small.width(), small.height()), (80 >> level, 64 >> level));
            let [column, row] = from_level([4.0, 3.0], level);
            assert!((f64::from(small.row(3)[4]) - column - row).abs() <= 0.5, "level {level}");
            assert_eq!(to_level([column, row], level), [4.0, 3.0]);
        }
    }
}
