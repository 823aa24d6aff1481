//! Which records of a log are meant.

use std::ops::RangeInclusive;
use std::path::Path;

use elk_bus::pattern::matches;

use crate::encoding::nanoseconds;
use crate::error::LogError;
use crate::index::Index;

/// A part of a log: by variable, source, and time.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Selection {
    /// Patterns of the variables wanted (`*`, `?`); none: all.
    pub keys: Vec<String>,
    /// Patterns of the sources wanted; none: all.
    pub sources: Vec<String>,
    /// Patterns of variables to leave out.
    pub exclude: Vec<String>,
    /// Seconds after the log's earliest message at which to begin.
    pub from_secs: Option<f64>,
    /// Seconds after the log's earliest message at which to end.
    pub to_secs: Option<f64>,
}

impl Selection {
    /// Whether what `source` says on `key` is wanted.
    pub fn takes(&self, key: &str, source: &str) -> bool {
        let any = |patterns: &[String], text: &str| patterns.iter().any(|pattern| matches(pattern, text));
        (self.keys.is_empty() || any(&self.keys, key))
            && (self.sources.is_empty() || any(&self.sources, source))
            && !any(&self.exclude, key)
    }

    /// The part of the log at `log` that this is.
    ///
    /// # Errors
    /// The log cannot be read.
    pub fn window(&self, log: &Path) -> Result<Window<'_>, LogError> {
        // Without bounds in time nobody asks when it begins, and a log without an index is not read for it.
        let origin = match (self.from_secs, self.to_secs) {
            (None, None) => 0.0,
            _ => Index::read(log, &mut |_, _| {})?.span().map_or(0.0, |(start, _)| start),
        };
        Ok(Window { selection: self, origin })
    }

    /// Where a time lies (s after the log's first message).
    pub fn position(&self, secs: f64) -> Position {
        if self.from_secs.is_some_and(|from| secs < from) {
            Position::Before
        } else if self.to_secs.is_some_and(|to| secs > to) {
            Position::After
        } else {
            Position::Within
        }
    }
}

/// A part of a log that begins at a known time. Messages need not lie in the order of their times: whatever is behind the
/// part's end may be followed by what is in it.
#[derive(Debug, Clone, Copy)]
pub struct Window<'a> {
    /// What is wanted.
    pub selection: &'a Selection,
    /// When the log's earliest message was recorded (s).
    pub origin: f64,
}

/// Times in a file are rounded: what is so near to a bound (ns) is looked at.
const ROUNDING_NS: u64 = 1000;

impl Window<'_> {
    /// The times of recording (ns) outside of which nothing lies within; nothing: they are not bounded.
    pub(crate) fn bounds(&self) -> Option<RangeInclusive<u64>> {
        let Selection { from_secs, to_secs, .. } = self.selection;
        let at = |secs: f64| nanoseconds(self.origin + secs);
        let first = from_secs.map_or(0, |from| at(from).saturating_sub(ROUNDING_NS));
        let last = to_secs.map_or(u64::MAX, |to| at(to).saturating_add(ROUNDING_NS));
        (from_secs.is_some() || to_secs.is_some()).then_some(first..=last)
    }

    /// Where what was recorded at `received` (s) lies.
    pub fn position(&self, received: f64) -> Position {
        self.selection.position(received - self.origin)
    }
}

/// Where a time lies, before, in or behind the part of a log that is meant.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Position {
    /// Before the part that is meant.
    Before,
    /// In it.
    Within,
    /// Behind it.
    After,
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_part_of_a_log_is_looked_for_between_its_bounds_only() {
        let bounds = |from_secs, to_secs| {
            let selection = Selection { from_secs, to_secs, ..Selection::default() };
            Window { selection: &selection, origin: 2.0 }.bounds()
        };
        assert_eq!(bounds(None, None), None);
        assert_eq!(bounds(Some(1.0), None), Some(2_999_999_000..=u64::MAX));
        assert_eq!(bounds(None, Some(1.0)), Some(0..=3_000_001_000));
    }

    #[test]
    fn patterns_choose_variables_and_sources_and_leave_out_others() {
        let all = Selection::default();
        assert!(all.takes("SCAN", "Sensor"));
        let some = Selection {
            keys: vec!["SCAN*".into(), "MAP".into()],
            sources: vec!["[Sensor]".into(), "Sen*".into()],
            exclude: vec!["SCAN_2".into()],
            from_secs: Some(1.0),
            to_secs: Some(2.0),
        };
        let taken = |key, source| some.takes(key, source);
        assert_eq!(
            [taken("SCAN_1", "Sensor"), taken("SCAN_2", "Sensor"), taken("MAP", "Map"), taken("MAP_KNOWN", "Sensor")],
            [true, false, false, false]
        );
        assert_eq!(
            [0.5, 1.0, 2.0, 2.1].map(|secs| some.position(secs)),
            [Position::Before, Position::Within, Position::Within, Position::After]
        );
    }
}
