//! Which records of a log are meant.

use elk_bus::pattern::matches;

/// A part of a log: by variable, source, and time.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Selection {
    /// Patterns of the variables wanted (`*`, `?`); none: all.
    pub keys: Vec<String>,
    /// Patterns of the sources wanted; none: all.
    pub sources: Vec<String>,
    /// Patterns of variables to leave out.
    pub exclude: Vec<String>,
    /// Seconds after the log's first message at which to begin.
    pub from_secs: Option<f64>,
    /// Seconds after the log's first message at which to end.
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

    /// Where a time lies (s after the log's first message).
    pub fn place(&self, secs: f64) -> Place {
        if self.from_secs.is_some_and(|from| secs < from) {
            Place::Before
        } else if self.to_secs.is_some_and(|to| secs > to) {
            Place::After
        } else {
            Place::Within
        }
    }
}

/// Where a time lies.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Place {
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
            [0.5, 1.0, 2.0, 2.1].map(|secs| some.place(secs)),
            [Place::Before, Place::Within, Place::Within, Place::After]
        );
    }
}
