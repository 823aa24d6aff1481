//! Grey images.

/// A grey image of 8 bits a pixel, row by row from the top left. Rows are counted downwards and columns to the right, from 0;
/// the centre of a pixel has whole coordinates (thesis fig. 3.6).
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Image {
    width: usize,
    pixels: Vec<u8>,
}

/// Why something is no image.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
pub enum ImageError {
    /// One of the sides has no pixel, or more than [`Image::MAX_SIDE`].
    #[error("an image of {width} × {height} pixels: each side has to be of 1 to {max}", max = Image::MAX_SIDE)]
    Side {
        /// Columns.
        width: usize,
        /// Rows.
        height: usize,
    },
    /// There are more or fewer pixels than width × height.
    #[error("{found} bytes for {width} × {height} grey pixels: one byte a pixel, {} in all, would be right", width * height)]
    Length {
        /// Columns.
        width: usize,
        /// Rows.
        height: usize,
        /// How many bytes there are.
        found: usize,
    },
}

impl Image {
    /// The most pixels that a side may have.
    pub const MAX_SIDE: usize = 16384;

    /// An image of `width` columns and `height` rows, whose pixels come row by row.
    ///
    /// # Errors
    /// A side of no pixel or of too many, and pixels that do not fill the image.
    pub fn new(width: usize, height: usize, pixels: Vec<u8>) -> Result<Self, ImageError> {
        let is_side = |side| (1..=Self::MAX_SIDE).contains(&side);
        match (is_side(width) && is_side(height), pixels.len()) {
            (false, _) => Err(ImageError::Side { width, height }),
            (true, found) if found != width * height => Err(ImageError::Length { width, height, found }),
            (true, _) => Ok(Self { width, pixels }),
        }
    }

    /// The image whose pixel at row `r` and column `c` is `grey(r, c)`.
    ///
    /// # Errors
    /// A side of no pixel or of too many.
    pub fn from_fn(width: usize, height: usize, mut grey: impl FnMut(usize, usize) -> u8) -> Result<Self, ImageError> {
        if width.max(height) > Self::MAX_SIDE {
            return Err(ImageError::Side { width, height });
        }
        let pixels = (0..width * height).map(|i| grey(i / width, i % width)).collect();
        Self::new(width, height, pixels)
    }

    /// An image of the same size with these pixels.
    pub(crate) fn with_pixels(&self, pixels: Vec<u8>) -> Self {
        debug_assert_eq!(pixels.len(), self.pixels.len());
        Self { width: self.width, pixels }
    }

    /// The number of columns.
    pub fn width(&self) -> usize {
        self.width
    }

    /// The number of rows.
    pub fn height(&self) -> usize {
        self.pixels.len() / self.width
    }

    /// All pixels, row by row.
    pub fn pixels(&self) -> &[u8] {
        &self.pixels
    }

    /// The pixels of one row.
    ///
    /// # Panics
    /// Where the image has no such row.
    #[inline(always)]
    pub fn row(&self, row: usize) -> &[u8] {
        &self.pixels[row * self.width..][..self.width]
    }

    /// The row of the image that is nearest to `row`, which may lie above or below it: how windows see past the border.
    #[inline(always)]
    pub(crate) fn nearest_row(&self, row: isize) -> &[u8] {
        self.row(row.clamp(0, self.height() as isize - 1) as usize)
    }

    /// The image with each row in reverse order.
    pub(crate) fn mirrored(&self) -> Self {
        let mut mirrored = self.clone();
        mirrored.pixels.chunks_exact_mut(self.width).for_each(<[u8]>::reverse);
        mirrored
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_is_no_image_is_said() {
        let error = Image::new(4, 3, vec![0; 10]).unwrap_err();
        assert_eq!(error.to_string(), "10 bytes for 4 × 3 grey pixels: one byte a pixel, 12 in all, would be right");
        assert_eq!(Image::new(0, 3, vec![]).unwrap_err(), ImageError::Side { width: 0, height: 3 });
        assert_eq!(Image::from_fn(1, 1 << 40, |_, _| 0).unwrap_err(), ImageError::Side { width: 1, height: 1 << 40 });
    }

    #[test]
    fn rows_are_rows_and_beyond_the_border_the_nearest() {
        let image = Image::from_fn(3, 2, |row, column| (10 * row + column) as u8).unwrap();
        assert_eq!((image.width(), image.height()), (3, 2));
        assert_eq!(image.row(1), [10, 11, 12]);
        assert_eq!(image.nearest_row(-5), [0, 1, 2]);
        assert_eq!(image.nearest_row(9), [10, 11, 12]);
        assert_eq!(image.mirrored().pixels(), [2, 1, 0, 12, 11, 10]);
    }
}
