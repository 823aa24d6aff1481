//! A pair, and whether there is anything to be seen in it.

use elk_spatial::pixels::PixelTally;
use elk_stereo::{Disparity, Image, MatchError, Matcher, Rectification, RectificationError, StereoCalibration};

use super::outcome::Outcome;
use super::seen::pixel_runs;

/// Where more pixels than this are matched, nobody asks whether the cameras are swapped.
const ENOUGH: f64 = 0.4;
/// With fewer pixels matched than this, a pair is none.
const LEAST: f64 = 0.01;
/// Swapped cameras match the other way round, and that by so much more.
const SWAPPED: f64 = 2.0;

/// Why there is nothing to be seen in a pair. Images and calibration are called by the names that they were given.
#[derive(Debug, thiserror::Error)]
pub enum PairError {
    /// The images differ in size.
    #[error(
        "{} is of {} × {} pixels and {} of {} × {}: both images of a pair have one size", .names[0], .sizes[0][0], .sizes[0][1],
        .names[1], .sizes[1][0], .sizes[1][1]
    )]
    Sizes {
        /// The images' names.
        names: [String; 2],
        /// Their columns and rows.
        sizes: [[usize; 2]; 2],
    },
    /// The calibration is of no stereo camera, or not of the one that took the images.
    #[error("{calibration}: {source}")]
    Rectification {
        /// The calibration's name.
        calibration: String,
        /// Why not.
        source: RectificationError,
    },
    /// The matcher does not take them.
    #[error(transparent)]
    Match(#[from] MatchError),
    /// The other way round they match.
    #[error(
        "{} as the left image and {} as the right one match in {:.1} % of all pixels, the other way round in {:.1} %: are they \
         swapped?", .names[0], .names[1], .shares[0] * 100.0, .shares[1] * 100.0
    )]
    Swapped {
        /// The images' names.
        names: [String; 2],
        /// Shares of pixels that match (0 to 1), as given and the other way round.
        shares: [f64; 2],
    },
    /// Hardly anything matches.
    #[error(
        "of {} and {} only {:.2} % of all pixels match ({reasons}): right are two images that were taken at once, of something \
         with a texture and in light, by the cameras of the calibration", .names[0], .names[1], .share * 100.0
    )]
    Nothing {
        /// The images' names.
        names: [String; 2],
        /// Share of pixels that match (0 to 1).
        share: f64,
        /// Why the others do not.
        reasons: PixelTally,
    },
}

/// How the pairs of two cameras are rectified.
#[derive(Debug, Clone)]
pub struct Rectified {
    /// How.
    pub rectification: Rectification,
    /// What the cameras' calibration is called.
    pub calibration_name: String,
}

impl Rectified {
    /// By a calibration of this name.
    ///
    /// # Errors
    /// It is of no stereo camera.
    pub fn new(calibration: &StereoCalibration, calibration_name: String) -> Result<Self, PairError> {
        match Rectification::new(calibration) {
            Ok(rectification) => Ok(Self { rectification, calibration_name }),
            Err(source) => Err(PairError::Rectification { calibration: calibration_name, source }),
        }
    }
}

/// What is asked for, and what all of it is called.
pub struct Pair<'a> {
    /// The left and the right image.
    pub images: [Image; 2],
    /// What they are called.
    pub names: [String; 2],
    /// How they are rectified.
    pub rectified: &'a Rectified,
}

impl Pair<'_> {
    /// Rectifies and matches it.
    ///
    /// # Errors
    /// Nothing can be seen in it; why not.
    pub fn matched(&self, matcher: &mut dyn Matcher) -> Result<Outcome, PairError> {
        let sizes = self.images.each_ref().map(|image| [image.width(), image.height()]);
        if sizes[0] != sizes[1] {
            return Err(PairError::Sizes { names: self.names.clone(), sizes });
        }
        let Rectified { rectification, calibration_name } = self.rectified;
        let unfit = |source| PairError::Rectification { calibration: calibration_name.clone(), source };
        let mut seen = |[left, right]: [&Image; 2]| -> Result<([Image; 2], Disparity), PairError> {
            let rectified = rectification.rectify(left, right).map_err(unfit)?;
            let disparity = matcher.disparity(&rectified[0], &rectified[1])?;
            Ok((rectified, disparity))
        };
        let [left, right] = &self.images;
        let (rectified, disparity) = seen([left, right])?;
        let share = disparity.density();
        if share < ENOUGH {
            let turned = seen([right, left])?.1.density();
            if turned > SWAPPED * share.max(LEAST) {
                return Err(PairError::Swapped { names: self.names.clone(), shares: [share, turned] });
            }
        }
        if share < LEAST {
            let (names, reasons) = (self.names.clone(), PixelTally::of(&pixel_runs(&disparity)));
            return Err(PairError::Nothing { names, share, reasons });
        }
        Ok(Outcome::new(rectification, rectified, disparity))
    }
}
