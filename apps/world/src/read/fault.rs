//! What is wrong with a file, and where.

use std::fmt;

/// Where in a file something stands.
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum Location {
    /// A line, counted from 1.
    Line(usize),
    /// A byte, counted from 0.
    Byte(usize),
    /// A part that the format itself names: `mesh 3, primitive 0`.
    Part(String),
    /// The file as a whole.
    Whole,
}

impl fmt::Display for Location {
    /// As it follows a file's name: `:12`, ` at byte 84`, ` in mesh 3`.
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Line(line) => write!(f, ":{line}"),
            Self::Byte(byte) => write!(f, " at byte {byte}"),
            Self::Part(part) => write!(f, " in {part}"),
            Self::Whole => Ok(()),
        }
    }
}

/// What is wrong with a file: where, what was found, and what would be right.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Fault {
    /// Where.
    pub location: Location,
    /// What was found; what would be right.
    pub what: String,
}

impl Fault {
    pub(crate) fn at(location: Location, what: impl fmt::Display) -> Self {
        Self { location, what: what.to_string() }
    }

    pub(crate) fn line(line: usize, what: impl fmt::Display) -> Self {
        Self::at(Location::Line(line), what)
    }

    pub(crate) fn whole(what: impl fmt::Display) -> Self {
        Self::at(Location::Whole, what)
    }
}
