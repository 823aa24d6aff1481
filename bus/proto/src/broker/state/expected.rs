//! What a reader says that a variable carries.

use std::fmt;

use serde::{Deserialize, Serialize};

/// What a reader expects.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
pub enum Expected {
    /// Numbers.
    Numbers,
    /// Texts.
    Texts,
    /// Values of a type, by name and layout.
    Values(String, u64),
}

impl fmt::Display for Expected {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Expected::Numbers => f.write_str("numbers"),
            Expected::Texts => f.write_str("texts"),
            Expected::Values(name, layout) => write!(f, "{name} (layout {layout:016x})"),
        }
    }
}
