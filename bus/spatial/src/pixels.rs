//! What became of the pixels of a camera that matches images: which saw nothing because nothing could be matched, and why.

use std::fmt;

use elk_bus::payload;

use crate::checks::MAX_COUNT;

/// What became of a pixel, in the order of the numbers that travel ([`PixelRun::outcome`]).
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub enum PixelOutcome {
    /// It was matched: its point is in the scan, or the direction without a return.
    Matched,
    /// There is too little texture around it for anything to be matched: what stands there was not seen.
    Textureless,
    /// The best match lies at the border of what was searched, or of the other image, so that a better one may lie beyond.
    OutOfRange,
    /// Another match is nearly as good (uniqueness, thesis 3.2.5.3).
    Ambiguous,
    /// The other image matches it otherwise: most often the one camera sees what is hidden from the other (left-right consistency,
    /// thesis 3.2.5.2).
    Inconsistent,
    /// Too few neighbours have a similar match (thesis 3.2.5.4).
    SmallComponent,
}

impl PixelOutcome {
    /// All of them, in the order of their numbers.
    pub const ALL: [Self; 6] =
        [Self::Matched, Self::Textureless, Self::OutOfRange, Self::Ambiguous, Self::Inconsistent, Self::SmallComponent];

    /// In a few words, for people.
    pub fn words(self) -> &'static str {
        match self {
            Self::Matched => "matched",
            Self::Textureless => "too little texture",
            Self::OutOfRange => "out of range",
            Self::Ambiguous => "ambiguous",
            Self::Inconsistent => "seen otherwise from the right",
            Self::SmallComponent => "too few neighbours",
        }
    }
}

/// Pixels one after another, row by row from the top left, of which the same became. All runs of an image are three bytes each.
#[payload]
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct PixelRun {
    /// What became of them. 0: matched; of all others nothing is known, for 1: too little texture, 2: out of the range of what is
    /// searched, 3: ambiguous, 4: seen otherwise from the other camera, 5: too few neighbours that are alike.
    #[describe(range = 0..=5)]
    pub outcome: u8,
    /// How many they are.
    #[describe(unit = "px", range = 1..=65_535)]
    pub pixels: u16,
}

impl PixelRun {
    /// The runs of an image of these pixels, row by row from the top left.
    pub fn all(pixels: impl IntoIterator<Item = PixelOutcome>) -> Vec<Self> {
        let mut runs: Vec<Self> = Vec::new();
        for outcome in pixels {
            let outcome = outcome as u8;
            match runs.last_mut().filter(|run| run.outcome == outcome && run.pixels < u16::MAX) {
                Some(run) => run.pixels += 1,
                None => runs.push(Self { outcome, pixels: 1 }),
            }
        }
        runs
    }
}

/// How many pixels of which became what.
#[payload]
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct PixelTally {
    /// Pixels that were matched.
    #[describe(count)]
    pub matched: u64,
    /// Pixels with too little texture around them for anything to be matched.
    #[describe(count)]
    pub textureless: u64,
    /// Pixels whose match may lie beyond what was searched.
    #[describe(count)]
    pub out_of_range: u64,
    /// Pixels of which another match is nearly as good.
    #[describe(count)]
    pub ambiguous: u64,
    /// Pixels that the other camera sees otherwise.
    #[describe(count)]
    pub inconsistent: u64,
    /// Pixels with too few neighbours that are matched alike.
    #[describe(count)]
    pub small_component: u64,
}

impl PixelTally {
    /// Those of an image.
    pub fn of(runs: &[PixelRun]) -> Self {
        let mut tally = Self::default();
        tally.add(runs);
        tally
    }

    /// Counts another image's, up to what a count may be.
    pub fn add(&mut self, runs: &[PixelRun]) {
        let Self { matched, textureless, out_of_range, ambiguous, inconsistent, small_component } = self;
        let mut counts = [matched, textureless, out_of_range, ambiguous, inconsistent, small_component];
        for run in runs {
            // What is none of them no reader believes.
            if let Some(count) = counts.get_mut(usize::from(run.outcome)) {
                **count = (**count + u64::from(run.pixels)).min(MAX_COUNT);
            }
        }
    }

    fn counts(&self) -> [u64; 6] {
        let Self { matched, textureless, out_of_range, ambiguous, inconsistent, small_component } = *self;
        [matched, textureless, out_of_range, ambiguous, inconsistent, small_component]
    }

    /// How many pixels there are; 0: the sensor is none that matches.
    pub fn total(&self) -> u64 {
        self.counts().iter().sum()
    }
}

/// The shares of those that were not matched, of all, by why not.
impl fmt::Display for PixelTally {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let percent = 100.0 / self.total().max(1) as f64;
        let share =
            |(outcome, count): (&PixelOutcome, u64)| format!("{} {:.1} %", outcome.words(), count as f64 * percent);
        let shares: Vec<String> = PixelOutcome::ALL.iter().zip(self.counts()).skip(1).map(share).collect();
        f.write_str(&shares.join(", "))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn runs_go_over_the_ends_of_rows_and_are_no_longer_than_they_can_say() {
        let pixels = [(PixelOutcome::Matched, 3), (PixelOutcome::Textureless, 70_000), (PixelOutcome::Ambiguous, 1)];
        let runs = PixelRun::all(pixels.iter().flat_map(|(outcome, count)| std::iter::repeat_n(*outcome, *count)));
        let said: Vec<(u8, u16)> = runs.iter().map(|run| (run.outcome, run.pixels)).collect();
        assert_eq!(said, [(0, 3), (1, 65_535), (1, 4465), (3, 1)]);
        let tally = PixelTally::of(&runs);
        assert_eq!(tally, PixelTally { matched: 3, textureless: 70_000, ambiguous: 1, ..PixelTally::default() });
        assert_eq!(tally.total(), 70_004);
        assert_eq!(PixelRun::all([]), []);
    }

    #[test]
    fn a_tally_says_shares_by_reason() {
        let mut tally = PixelTally { matched: 60, textureless: 20, inconsistent: 20, ..PixelTally::default() };
        let said = "too little texture 20.0 %, out of range 0.0 %, ambiguous 0.0 %, seen otherwise from the right 20.0 %, \
                    too few neighbours 0.0 %";
        assert_eq!(tally.to_string(), said);
        tally.add(&[PixelRun { outcome: 5, pixels: 100 }, PixelRun { outcome: 9, pixels: 7 }]);
        assert_eq!((tally.small_component, tally.total()), (100, 200));
    }
}
