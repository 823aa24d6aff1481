//! A community's name: what keeps two missions on one machine apart.

use std::fmt;

/// The name of a community: 1 to 48 letters, digits, `-`, `_` or `.`, the first a letter or a digit.
///
/// Such a name is one step of a path and no other (neither `.` nor `..`, no hidden file), no option of a command, and
/// no pattern. This is the only way to a community, so whatever is made of a name need not look at it again.
#[derive(Debug, Clone, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub struct Community(String);

/// A name that no community can have.
#[derive(Debug, thiserror::Error)]
#[error(
    "{0:?} is no name for a community: 1 to 48 letters, digits, '-', '_' or '.', beginning with a letter or a digit"
)]
pub struct CommunityNameError(String);

impl Community {
    /// The longest name (bytes).
    pub const LONGEST: usize = 48;

    /// Checks a name.
    pub fn new(name: impl Into<String>) -> Result<Self, CommunityNameError> {
        let name = name.into();
        let good = |c: char| c.is_ascii_alphanumeric() || "-_.".contains(c);
        let begins_well = name.starts_with(|c: char| c.is_ascii_alphanumeric());
        match begins_well && name.len() <= Self::LONGEST && name.chars().all(good) {
            true => Ok(Self(name)),
            false => Err(CommunityNameError(name)),
        }
    }

    /// The name.
    pub fn as_str(&self) -> &str {
        &self.0
    }
}

impl fmt::Display for Community {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(&self.0)
    }
}

impl std::str::FromStr for Community {
    type Err = CommunityNameError;
    fn from_str(name: &str) -> Result<Self, CommunityNameError> {
        Self::new(name)
    }
}

#[cfg(test)]
mod tests {
    use std::path::{Component, Path};

    use proptest::prelude::*;

    use super::*;

    #[test]
    fn names_that_would_be_paths_options_or_patterns_are_refused() {
        let long = "x".repeat(Community::LONGEST + 1);
        let bad = [
            "", ".", "..", "...", ".x", "-x", "--help", "_x", "a/b", "/", "../x", "a b", "a*", "a\0b", "a=b", "ä",
            &long,
        ];
        for name in bad {
            let error = Community::new(name).unwrap_err().to_string();
            assert!(error.starts_with(&format!("{name:?} is no name for a community")), "{error}");
        }
        for name in ["elk", "7", "a..b", "lab-1", "advp_q", &long[1..]] {
            assert_eq!(Community::new(name).unwrap().as_str(), name);
        }
    }

    proptest! {
        #![proptest_config(ProptestConfig::with_cases(10_000))]
        #[test]
        fn whatever_passes_is_one_step_of_a_path(name in prop_oneof!["[a-c./_*=-]{0,6}", ".{0,60}", "[A-Za-z0-9._-]{1,52}"]) {
            if let Ok(community) = Community::new(name) {
                let name = community.as_str();
                let steps: Vec<_> = Path::new(name).components().collect();
                prop_assert_eq!(steps, [Component::Normal(name.as_ref())]);
                prop_assert!(!name.starts_with(['.', '-']) && name.len() <= Community::LONGEST);
            }
        }
    }
}
