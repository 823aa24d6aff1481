//! Disparities, and why a pixel has none.

/// Why no disparity is known of a pixel.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum Unmatched {
    /// Around the pixel is too little texture for anything to be matched: what stands there was not seen.
    Textureless,
    /// The best match lies at the border of what was searched, or of the other image, so that a better one may lie beyond: the
    /// surface is nearer than the largest disparity, farther than the smallest, or out of the other camera's view.
    OutOfRange,
    /// Another disparity fits nearly as well (uniqueness, thesis 3.2.5.3).
    Ambiguous,
    /// The matched pixel of the right image is matched by another one of the left: most often because one of the two is
    /// hidden from the other camera (left-right consistency, thesis 3.2.5.2).
    Inconsistent,
    /// Too few neighbours have a similar disparity (thesis 3.2.5.4).
    SmallComponent,
}

impl Unmatched {
    /// All reasons.
    pub const ALL: [Self; 5] =
        [Self::Textureless, Self::OutOfRange, Self::Ambiguous, Self::Inconsistent, Self::SmallComponent];

    /// How the reason stands in a map of disparities, all of which are at least 0.
    #[inline(always)]
    pub(crate) fn code(self) -> f32 {
        -1.0 - f32::from(self as u8)
    }
}

/// The disparity of each pixel of a left image, or why it has none: a pixel of column c is seen in the right image at column
/// c − d of the same row (thesis 3.7).
#[derive(Clone, Debug, PartialEq)]
pub struct Disparity {
    width: usize,
    /// Row by row: a disparity, at least 0, or the code of a reason.
    values: Vec<f32>,
}

impl Disparity {
    /// Of values that are disparities or codes of reasons.
    pub(crate) fn new(width: usize, values: Vec<f32>) -> Self {
        debug_assert!(values.len().is_multiple_of(width));
        Self { width, values }
    }

    /// The map whose pixel at row `r` and column `c` is `pixel(r, c)`: a disparity in pixels, or why there is none. What is no
    /// finite number of at least 0 is [`Unmatched::OutOfRange`].
    pub fn from_fn(width: usize, height: usize, mut pixel: impl FnMut(usize, usize) -> Result<f32, Unmatched>) -> Self {
        let value = |i| match pixel(i / width, i % width) {
            Ok(disparity) if disparity.is_finite() && disparity >= 0.0 => disparity,
            Ok(_) => Unmatched::OutOfRange.code(),
            Err(reason) => reason.code(),
        };
        Self { width, values: (0..width * height).map(value).collect() }
    }

    /// The number of columns.
    pub fn width(&self) -> usize {
        self.width
    }

    /// The number of rows.
    pub fn height(&self) -> usize {
        self.values.len().checked_div(self.width).unwrap_or(0)
    }

    /// The disparity of a pixel, in pixels and fractions of one, or why there is none.
    ///
    /// # Panics
    /// Where there is no such pixel.
    pub fn get(&self, row: usize, column: usize) -> Result<f32, Unmatched> {
        assert!(column < self.width, "column {column} of {}", self.width);
        as_said(self.values[row * self.width + column])
    }

    /// All pixels, row by row.
    pub fn iter(&self) -> impl ExactSizeIterator<Item = Result<f32, Unmatched>> + '_ {
        self.values.iter().map(|&value| as_said(value))
    }

    /// The share of pixels that have a disparity.
    pub fn density(&self) -> f64 {
        let matched = self.values.iter().filter(|&&value| value >= 0.0).count();
        matched as f64 / self.values.len().max(1) as f64
    }

    /// How many pixels have no disparity for this reason.
    pub fn count(&self, reason: Unmatched) -> usize {
        self.values.iter().filter(|&&value| value == reason.code()).count()
    }

    pub(crate) fn values_mut(&mut self) -> &mut [f32] {
        &mut self.values
    }
}

/// What a stored value says.
fn as_said(value: f32) -> Result<f32, Unmatched> {
    match value >= 0.0 {
        true => Ok(value),
        false => Err(Unmatched::ALL[(-1.0 - value) as usize]),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_pixel_says_its_disparity_or_why_it_has_none() {
        let said = [Ok(0.0), Ok(12.5), Err(Unmatched::Textureless), Err(Unmatched::SmallComponent)];
        let map = Disparity::from_fn(2, 2, |row, column| said[2 * row + column]);
        assert_eq!(map.iter().collect::<Vec<_>>(), said);
        assert_eq!(map.get(1, 0), Err(Unmatched::Textureless));
        assert_eq!((map.density(), map.count(Unmatched::SmallComponent), map.count(Unmatched::Ambiguous)), (0.5, 1, 0));
        assert!(Unmatched::ALL.iter().all(|&reason| as_said(reason.code()) == Err(reason)));
        assert_eq!(Disparity::from_fn(1, 1, |_, _| Ok(f32::NAN)).get(0, 0), Err(Unmatched::OutOfRange));
    }
}
