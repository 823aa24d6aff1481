//! Semi-global matching: costs of a pixel, and of how its neighbours lie, summed along paths (Hirschmüller, *Stereo Processing by
//! Semiglobal Matching and Mutual Information*, PAMI 2008; the energy is that of thesis 3.10 to 3.12).

mod cost;
mod path;

use crate::components;
use crate::disparity::{Disparity, Unmatched};
use crate::image::Image;
use crate::lanes::{blocks, blocks_mut, plus, wide};
use crate::matcher::{Checks, ConfigError, MatchError, Matcher, common_size};
use crate::median;
use crate::preprocessing::Preprocessing;
use crate::texture;
use crate::winner::Winners;
use path::Paths;
pub use path::Penalties;

/// How semi-global matching matches.
#[derive(Clone, Debug, PartialEq)]
pub struct SemiGlobalConfig {
    /// What is done to both images before costs are measured (thesis 3.2.4).
    pub preprocessing: Preprocessing,
    /// What steps of disparity cost.
    pub penalties: Penalties,
    /// What is asked of a match.
    pub checks: Checks,
}

impl Default for SemiGlobalConfig {
    fn default() -> Self {
        let checks = Checks { uniqueness: 0, similarity: 2.0, ..Checks::default() };
        Self { preprocessing: Preprocessing::None, penalties: Penalties::default(), checks }
    }
}

/// Semi-global matching over four paths. The cost of a pixel is the Hamming distance of census transforms of 3 × 5 pixels and,
/// beside it, the difference of changes along rows without regard to sampling, of the 3 × 3 pixels around it.
///
/// Working memory is three bytes for each pixel and level, and is kept from pair to pair; pairs that would take more than
/// [`MAX_COSTS`](Self::MAX_COSTS) of them are refused.
#[derive(Debug)]
pub struct SemiGlobal {
    config: SemiGlobalConfig,
    scratch: Scratch,
}

#[derive(Debug, Default)]
struct Scratch {
    costs: cost::Volume,
    /// Of each pixel and level what paths from the left and from above have come to.
    sums: Vec<u16>,
    paths: Paths,
    winners: Winners,
}

impl SemiGlobal {
    /// The most pixels × levels that are matched: 3 GiB of working memory.
    pub const MAX_COSTS: usize = 1 << 30;

    /// A matcher.
    ///
    /// # Errors
    /// Penalties or a search that costs cannot be summed for.
    pub fn new(config: SemiGlobalConfig) -> Result<Self, ConfigError> {
        config.checks.check()?;
        config.preprocessing.check()?;
        let Penalties { small, large, edge, .. } = config.penalties;
        let max = u8::MAX - cost::MAX;
        match small.max(edge) <= large && large <= max {
            true => Ok(Self { config, scratch: Scratch::default() }),
            false => Err(ConfigError::Penalties { small, edge, large, max }),
        }
    }
}

impl Matcher for SemiGlobal {
    fn disparity(&mut self, left: &Image, right: &Image) -> Result<Disparity, MatchError> {
        let (width, height) = common_size(left, right)?;
        let checks = &self.config.checks;
        let costs = width * height * checks.levels;
        if costs > Self::MAX_COSTS {
            return Err(MatchError::Memory { size: (width, height), levels: checks.levels, most: Self::MAX_COSTS });
        }
        let mut values = vec![Unmatched::OutOfRange.code(); width * height];
        match self.config.preprocessing {
            Preprocessing::None => self.scratch.costs.measure(left, right, checks.levels),
            filter => self.scratch.costs.measure(&filter.apply(left), &filter.apply(right), checks.levels),
        }
        forwards(left, &self.config, &mut self.scratch);
        backwards(left, &self.config, &mut self.scratch, &mut values);
        texture::reject(left, TEXTURE_RADIUS, checks.texture, &mut values);
        let mut disparity = Disparity::new(width, median::smoothed(width, &values));
        components::reject_small(&mut disparity, checks.component, checks.similarity);
        Ok(disparity)
    }
}

/// Half the side of the window whose texture is looked at: what SAD5's default windows see.
const TEXTURE_RADIUS: usize = 6;

wide! {
    /// Sums what paths from the left and from above come to.
    fn forwards(left: &Image, config: &SemiGlobalConfig, scratch: &mut Scratch) {
        let (width, height, levels) = (left.width(), left.height(), config.checks.levels);
        let Scratch { costs, sums, paths, .. } = scratch;
        sums.resize(width * height * levels, 0);
        paths.begin(width, levels);
        for y in 0..height {
            let (row, before) = (left.row(y), left.nearest_row(y as isize - 1));
            paths.begin_row();
            for x in 0..width {
                let differs = [row[x].abs_diff(row[x.saturating_sub(1)]), row[x].abs_diff(before[x])];
                let at = (y * width + x) * levels;
                paths.step(x, differs, config.penalties, costs.of(at, levels), &mut sums[at..][..levels]);
            }
        }
    }
}

wide! {
    /// Adds to them what paths from the right and from below come to; of each row, done, the winners are taken.
    fn backwards(left: &Image, config: &SemiGlobalConfig, scratch: &mut Scratch, values: &mut [f32]) {
        let (width, height, checks) = (left.width(), left.height(), &config.checks);
        let levels = checks.levels;
        let Scratch { costs, sums, paths, winners } = scratch;
        paths.begin(width, levels);
        winners.prepare(width, levels);
        let mut total = vec![0; levels];
        for y in (0..height).rev() {
            let (row, before) = (left.row(y), left.nearest_row(y as isize + 1));
            paths.begin_row();
            for x in (0..width).rev() {
                let differs = [row[x].abs_diff(row[(x + 1).min(width - 1)]), row[x].abs_diff(before[x])];
                let at = (y * width + x) * levels;
                paths.step(x, differs, config.penalties, costs.of(at, levels), &mut total);
                for (total, &forwards) in blocks_mut(&mut total).iter_mut().zip(blocks(&sums[at..][..levels])) {
                    *total = plus(*total, forwards);
                }
                winners.take(x, &mut total, checks.uniqueness);
            }
            winners.finish(checks.consistency, &mut values[y * width..][..width]);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_pair_that_would_take_too_much_memory_is_refused() {
        let image = Image::from_fn(8192, 8192, |_, _| 0).unwrap();
        let error = SemiGlobal::new(SemiGlobalConfig::default()).unwrap().disparity(&image, &image).unwrap_err();
        let said = "8192 × 8192 pixels and 64 levels of disparity: a product of at most 1073741824 would be right";
        assert_eq!(error.to_string(), said);
    }

    #[test]
    fn penalties_that_do_not_fit_are_said() {
        let with = |penalties| SemiGlobal::new(SemiGlobalConfig { penalties, ..Default::default() });
        let error = with(Penalties { large: 220, ..Default::default() }).unwrap_err();
        let said = "penalties of 27 for a step of one level and 14 to 220 for more: both at most the largest, and that at most \
                    212, would be right";
        assert_eq!(error.to_string(), said);
        assert!(with(Penalties { small: 140, ..Default::default() }).is_err());
        let checks = Checks { levels: 20, ..Checks::default() };
        assert_eq!(
            SemiGlobal::new(SemiGlobalConfig { checks, ..Default::default() }).unwrap_err(),
            ConfigError::Levels { found: 20 }
        );
    }
}
