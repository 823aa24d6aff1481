//! What all matchers have in common: one trait, how far they search, and what they ask of a match.

use crate::disparity::Disparity;
use crate::image::Image;
use crate::lanes::LANES;

/// Finds for each pixel of a left image the pixel of the right one that shows the same point.
///
/// A matcher keeps its working memory from pair to pair, which is why it is asked as `&mut`; what it finds depends on the pair
/// alone.
pub trait Matcher {
    /// The disparities of the left image of a rectified pair: the same row of both images shows the same points.
    ///
    /// # Errors
    /// Images of different size, and images too large.
    fn disparity(&mut self, left: &Image, right: &Image) -> Result<Disparity, MatchError>;
}

/// Why a pair cannot be matched.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
pub enum MatchError {
    /// The images are not of one size.
    #[error(
        "a left image of {} × {} pixels and a right one of {} × {}: both of a rectified pair have one size",
        left.0, left.1, right.0, right.1
    )]
    Sizes {
        /// Columns and rows of the left image.
        left: (usize, usize),
        /// Columns and rows of the right image.
        right: (usize, usize),
    },
    /// The matcher would need more memory than it may take.
    #[error("{} × {} pixels and {levels} levels of disparity: a product of at most {most} would be right", size.0, size.1)]
    Memory {
        /// Columns and rows.
        size: (usize, usize),
        /// Levels of disparity.
        levels: usize,
        /// The largest product.
        most: usize,
    },
}

/// The images' common width and height.
pub(crate) fn common_size(left: &Image, right: &Image) -> Result<(usize, usize), MatchError> {
    let [left, right] = [left, right].map(|image| (image.width(), image.height()));
    if left == right { Ok(left) } else { Err(MatchError::Sizes { left, right }) }
}

/// What is asked of a match, whichever matcher found it.
#[derive(Clone, Debug, PartialEq)]
pub struct Checks {
    /// How many disparities are searched, from 0 on: a multiple of 16, at most 256. The nearest point that can be matched is at
    /// z = f b / (levels − 2) (thesis 3.9).
    pub levels: usize,
    /// The least mean difference of horizontal neighbours around a pixel, in grey levels, below which nothing is matched. It
    /// belongs above what the camera's noise alone makes of a blank wall, 1.1 σ.
    pub texture: f32,
    /// By how many per cent the best other cost has to exceed the least (thesis 3.29: 100 C_d).
    pub uniqueness: u16,
    /// By how many levels the match from right to left may differ from that from left to right (thesis 3.2.5.2).
    pub consistency: u16,
    /// How many pixels a component has to have (thesis 3.2.5.4).
    pub component: usize,
    /// By how much neighbours of one component may differ, in pixels.
    pub similarity: f32,
}

impl Default for Checks {
    fn default() -> Self {
        Self { levels: 64, texture: 0.5, uniqueness: 15, consistency: 1, component: 100, similarity: 1.0 }
    }
}

/// Why a matcher cannot be made.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum ConfigError {
    /// The number of disparities does not fill vectors, or costs too much memory.
    #[error("{found} levels of disparity: a multiple of {LANES} from {LANES} to {max} would be right", max = Checks::MAX_LEVELS)]
    Levels {
        /// How many were asked for.
        found: usize,
    },
    /// Windows of which a sum of absolute differences does not fit 16 bits.
    #[error("windows of radius {found}: 1 to {max} would be right, as their costs have to fit 16 bits")]
    Window {
        /// The radius that was asked for.
        found: usize,
        /// The largest one.
        max: usize,
    },
    /// Penalties that do not fit the 8 bits of a path's costs, or that favour large steps over small ones.
    #[error(
        "penalties of {small} for a step of one level and {edge} to {large} for more: both at most the largest, and that at most {max}, would be right"
    )]
    Penalties {
        /// That of one level.
        small: u8,
        /// That of more, over an edge of the image.
        edge: u8,
        /// That of more, elsewhere.
        large: u8,
        /// The largest that fits.
        max: u8,
    },
    /// A number outside of its range.
    #[error("{name} of {found}: {least} to {most} would be right")]
    Range {
        /// Which setting.
        name: &'static str,
        /// Its value.
        found: f32,
        /// The least that is right.
        least: f32,
        /// The largest that is right.
        most: f32,
    },
    /// A number that has to be finite and not negative.
    #[error("{name} of {found}: a finite number of at least 0 would be right")]
    Number {
        /// Which setting.
        name: &'static str,
        /// Its value.
        found: f32,
    },
}

impl Checks {
    /// The most disparities that can be searched.
    pub const MAX_LEVELS: usize = 256;

    pub(crate) fn check(&self) -> Result<(), ConfigError> {
        let found = self.levels;
        if found == 0 || found > Self::MAX_LEVELS || !found.is_multiple_of(LANES) {
            return Err(ConfigError::Levels { found });
        }
        number("texture", self.texture)?;
        number("similarity", self.similarity)
    }
}

/// That a setting is a finite number of at least 0.
pub(crate) fn number(name: &'static str, found: f32) -> Result<(), ConfigError> {
    match found.is_finite() && found >= 0.0 {
        true => Ok(()),
        false => Err(ConfigError::Number { name, found }),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn images_of_different_size_are_no_pair() {
        let [a, b] = [(4, 3), (4, 2)].map(|(width, height)| Image::from_fn(width, height, |_, _| 0).unwrap());
        let said = "a left image of 4 × 3 pixels and a right one of 4 × 2: both of a rectified pair have one size";
        assert_eq!(common_size(&a, &b).unwrap_err().to_string(), said);
        assert_eq!(common_size(&a, &a), Ok((4, 3)));
    }

    #[test]
    fn what_cannot_be_searched_is_said() {
        let check = |checks: Checks| checks.check().map_err(|error| error.to_string());
        assert_eq!(check(Checks::default()), Ok(()));
        for levels in [0, 20, 512] {
            let said = format!("{levels} levels of disparity: a multiple of 16 from 16 to 256 would be right");
            assert_eq!(check(Checks { levels, ..Checks::default() }), Err(said));
        }
        let said = "texture of NaN: a finite number of at least 0 would be right";
        assert_eq!(check(Checks { texture: f32::NAN, ..Checks::default() }), Err(said.into()));
    }
}
