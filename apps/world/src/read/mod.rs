//! Files of worlds: one reader a format, behind one interface.
//!
//! A reader goes through the bytes and hands each polygon to the [`Soup`], with its location. What is the
//! same in all formats is done there: corners that are no numbers, polygons with more than three corners, faces without
//! area, more of them than there may be.

mod budget;
mod format;
mod gltf;
mod mesh;
mod obj;
mod ply;
mod soup;
mod stl;
mod text;

use std::fmt;
use std::path::Path;

pub use format::Format;
pub use soup::{Notice, Soup};

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

/// Reads a file whose bytes are these. Its name tells the format only where the bytes do not; `folder` is where a glTF
/// file's buffers lie.
///
/// # Errors
/// It is of no format that is read here, or what is wrong with it.
pub fn read(name: &str, bytes: &[u8], folder: &Path) -> Result<(Format, Soup), Fault> {
    let format = Format::of(name, bytes)?;
    let mut soup = Soup::default();
    match format {
        Format::Obj => obj::read(bytes, &mut soup),
        Format::Stl => stl::read(bytes, &mut soup),
        Format::Ply => ply::read(bytes, &mut soup),
        Format::Gltf => gltf::read(bytes, folder, &mut soup),
    }?;
    Ok((format, soup))
}
