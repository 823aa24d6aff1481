//! What is done to both images before they are matched, so that two cameras see one point alike (thesis 3.2.4).

mod bilateral;
mod difference_of_gaussians;
mod sobel;

use crate::image::Image;
use crate::matcher::{ConfigError, number};

pub use bilateral::{background_subtracted, bilateral};
pub use difference_of_gaussians::difference_of_gaussians;
pub use sobel::sobel;

/// A filter of both images.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Preprocessing {
    /// Grey levels as they are.
    None,
    /// [`sobel`]: the change along rows, up to `cap` either way.
    Sobel {
        /// The largest change that is told from larger ones, in grey levels; 1 to 127.
        cap: u8,
    },
    /// [`difference_of_gaussians`] (thesis 3.25).
    DifferenceOfGaussians {
        /// σ of the smaller Gaussian, in pixels; up to 8.
        sigma: f32,
        /// By how much the difference is multiplied.
        gain: f32,
    },
    /// [`background_subtracted`]: what the bilateral filter (thesis 3.17) takes away.
    Bilateral {
        /// Half the side of the patch, in pixels.
        radius: usize,
        /// σ_d, in pixels.
        sigma_domain: f32,
        /// σ_r, in grey levels.
        sigma_range: f32,
        /// By how much the difference is multiplied.
        gain: f32,
    },
}

/// The change along rows, which of all four matches best on the pairs of `cargo bench`.
impl Default for Preprocessing {
    fn default() -> Self {
        Self::Sobel { cap: 31 }
    }
}

impl Preprocessing {
    /// The difference of Gaussians as [`Sad5`](crate::Sad5) matches best with it.
    pub const DIFFERENCE_OF_GAUSSIANS: Self = Self::DifferenceOfGaussians { sigma: 0.7, gain: 8.0 };

    /// The bilateral filter with the thesis' σ_d = 10, σ_r = 5.
    pub const BILATERAL: Self = Self::Bilateral { radius: 5, sigma_domain: 10.0, sigma_range: 5.0, gain: 4.0 };

    /// The image, filtered.
    pub fn apply(&self, image: &Image) -> Image {
        match *self {
            Self::None => image.clone(),
            Self::Sobel { cap } => sobel(image, cap),
            Self::DifferenceOfGaussians { sigma, gain } => difference_of_gaussians(image, sigma, gain),
            Self::Bilateral { radius, sigma_domain, sigma_range, gain } => {
                background_subtracted(image, radius, sigma_domain, sigma_range, gain)
            }
        }
    }

    /// That the filter's numbers are numbers that it can work with.
    pub(crate) fn check(&self) -> Result<(), ConfigError> {
        let in_range = |name, found: f32, least: f32, most: f32| match (least..=most).contains(&found) {
            true => Ok(()),
            false => Err(ConfigError::Range { name, found, least, most }),
        };
        match *self {
            Self::None => Ok(()),
            Self::Sobel { cap } => in_range("cap", f32::from(cap), 1.0, 127.0),
            Self::DifferenceOfGaussians { sigma, gain } => {
                in_range("sigma", sigma, 0.1, 8.0)?;
                number("gain", gain)
            }
            Self::Bilateral { radius, sigma_domain, sigma_range, gain } => {
                number("gain", gain)?;
                in_range("radius", radius as f32, 1.0, 64.0)?;
                in_range("sigma_domain", sigma_domain, 0.1, 1e6)?;
                in_range("sigma_range", sigma_range, 0.1, 1e6)
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_that_no_filter_can_work_with_are_said() {
        let said = |filter: Preprocessing| filter.check().unwrap_err().to_string();
        assert_eq!(said(Preprocessing::Sobel { cap: 200 }), "cap of 200: 1 to 127 would be right");
        let nan = Preprocessing::DifferenceOfGaussians { sigma: f32::NAN, gain: 1.0 };
        assert_eq!(said(nan), "sigma of NaN: 0.1 to 8 would be right");
        let wide = Preprocessing::Bilateral { radius: 1000, sigma_domain: 1.0, sigma_range: 1.0, gain: 1.0 };
        assert_eq!(said(wide), "radius of 1000: 1 to 64 would be right");
        for filter in [Preprocessing::default(), Preprocessing::DIFFERENCE_OF_GAUSSIANS, Preprocessing::BILATERAL] {
            assert_eq!(filter.check(), Ok(()));
        }
    }
}
