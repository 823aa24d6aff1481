//! Patterns of names as people give them.

use std::fmt;
use std::str::FromStr;

use elk_bus::pattern;

/// A name, or a pattern of names: `*` is any run of characters, `?` a single one.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Pattern(String);

/// A text that cannot be a pattern.
#[derive(Debug, thiserror::Error)]
#[error(
    "{0:?} is no name and no pattern: right is, for example, SCAN, NAV_* or *_STATUS ('*': any characters, '?': one)"
)]
pub struct PatternError(String);

impl Pattern {
    /// Matches everything.
    pub fn any() -> Self {
        Self("*".into())
    }

    /// Whether a name fits.
    pub fn matches(&self, name: &str) -> bool {
        pattern::matches(&self.0, name)
    }

    /// The name, if only one fits.
    pub fn literal(&self) -> Option<&str> {
        pattern::is_literal(&self.0).then_some(&self.0)
    }

    /// The pattern as the bus takes it.
    pub fn as_str(&self) -> &str {
        &self.0
    }
}

impl FromStr for Pattern {
    type Err = PatternError;
    fn from_str(text: &str) -> Result<Self, PatternError> {
        match text.trim().is_empty() || text.chars().any(char::is_control) {
            true => Err(PatternError(text.into())),
            false => Ok(Self(text.into())),
        }
    }
}

impl fmt::Display for Pattern {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(&self.0)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_and_patterns_are_told_from_nonsense() {
        for bad in ["", " ", "A\n"] {
            assert!(bad.parse::<Pattern>().is_err(), "{bad:?}");
        }
        let nav: Pattern = "NAV_*".parse().unwrap();
        assert!(nav.matches("NAV_X") && !nav.matches("X") && nav.literal().is_none());
        assert_eq!("SCAN".parse::<Pattern>().unwrap().literal(), Some("SCAN"));
    }
}
