//! A community's name: what keeps two missions on one machine apart.

use std::fmt;

/// The name of a community: 1 to 48 letters, digits, `-`, `_` or `.`.
#[derive(Debug, Clone, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub struct Community(String);

/// A name that no community can have.
#[derive(Debug, thiserror::Error)]
#[error("{0:?} is no name for a community: 1 to 48 letters, digits, '-', '_' or '.'")]
pub struct CommunityNameError(String);

impl Community {
    /// Checks a name.
    pub fn new(name: impl Into<String>) -> Result<Self, CommunityNameError> {
        let name = name.into();
        let good = |c: char| c.is_ascii_alphanumeric() || "-_.".contains(c);
        match (1..=48).contains(&name.len()) && name.chars().all(good) {
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
