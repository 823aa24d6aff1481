//! A pair, and whether there is anything to be seen in it.

use elk_spatial::pixels::PixelTally;
use elk_stereo::{Disparity, Image, MatchError, Matcher, Rectification, RectificationError, StereoCalibration};

use super::outcome::Outcome;
use super::seen::pixel_runs;

/// Where more pixels than this are matched, nobody asks whether the cameras are swapped.
const ENOUGH: f64 = 0.4;
/// With fewer pixels matched than this, a pair is none.
const LEAST: f64 = 0.01;
/// Of the pixels with a texture whose match is in range, nine of ten are matched in a pair, and at most one of eight with the right
/// image turned, mirrored or inverted, by either matcher. With a smaller share than this a pair is none.
const ALIKE: f64 = 0.15;
/// Fewer such pixels than this, as a share of all, show nothing.
const SHOWING: f64 = 0.05;
/// Swapped cameras match the other way round, and that by so much more,
const SWAPPED: f64 = 2.0;
/// and as a pair does: of the pixels that show something more than this share.
const ALIKE_SWAPPED: f64 = 0.4;

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
    /// There is hardly anything to be matched.
    #[error(
        "of {} (grey levels {} to {}) and {} ({} to {}) only {:.2} % of all pixels match ({reasons}): right are two images that were taken \
         at once, of something with a texture and in light, by the cameras of the calibration", .names[0], .levels[0][0], .levels[0][1],
        .names[1], .levels[1][0], .levels[1][1], .share * 100.0
    )]
    Nothing {
        /// The images' names.
        names: [String; 2],
        /// Their least and greatest grey levels (0 to 255).
        levels: [[u8; 2]; 2],
        /// Share of pixels that match (0 to 1).
        share: f64,
        /// Why the others do not.
        reasons: PixelTally,
    },
    /// There is much to be matched, and it does not match.
    #[error(
        "of {} and {} only {:.2} % of all pixels match, {:.1} % of those that have a texture and a match in range ({reasons}): \
         right are two images that were taken at once by the cameras of the calibration, both as they were taken (not turned, mirrored or \
         inverted), of what is not nearer than Disparities let be seen", .names[0], .names[1], .share * 100.0, .alike * 100.0
    )]
    Unlike {
        /// The images' names.
        names: [String; 2],
        /// Share of those with a texture and a match in range that match (0 to 1).
        alike: f64,
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
            let turned = seen([right, left])?.1;
            let [_, alike] = shown(&PixelTally::of(&pixel_runs(&turned)));
            if turned.density() > SWAPPED * share.max(LEAST) && alike > ALIKE_SWAPPED {
                return Err(PairError::Swapped { names: self.names.clone(), shares: [share, turned.density()] });
            }
        }
        let reasons = PixelTally::of(&pixel_runs(&disparity));
        let (names, [showing, alike]) = (self.names.clone(), shown(&reasons));
        if showing >= SHOWING && alike < ALIKE {
            return Err(PairError::Unlike { names, alike, share, reasons });
        }
        if share < LEAST {
            return Err(PairError::Nothing { names, levels: self.images.each_ref().map(levels), share, reasons });
        }
        Ok(Outcome::new(rectification, rectified, disparity))
    }
}

/// The share of pixels that have a texture and a match in range, and that of those among them that are matched (0 to 1).
fn shown(pixels: &PixelTally) -> [f64; 2] {
    let all = pixels.total();
    let showing = all - pixels.textureless - pixels.out_of_range;
    [showing as f64 / all.max(1) as f64, pixels.matched as f64 / showing.max(1) as f64]
}

/// The least and the greatest grey level of an image.
fn levels(image: &Image) -> [u8; 2] {
    image.pixels().iter().fold([u8::MAX, 0], |[least, greatest], &grey| [least.min(grey), greatest.max(grey)])
}
