//! OctoMap's files (Hornung et al., *OctoMap*, 2013; the library of version 1.9): [`bt`] (occupied, free or unknown, two bits a
//! child) and [`ot`] (log-odds) both ways, and [`graph`] (scans and the poses that they were taken from) for reading.
//!
//! The first two are a text header, its last line `data`, then the nodes of an [octree](crate::octree), depth first.

pub mod bt;
mod cubes;
pub mod graph;
mod header;
pub mod ot;

use crate::bytes::CutOff;
use crate::octree::DEPTH;
pub use cubes::Cubes;

/// A tree as a file has it, looked through to its end: it is kept as those bytes, and takes no memory besides.
#[derive(Debug, Clone, PartialEq)]
pub struct TreeFile<'a, V> {
    /// Edge of a voxel (m).
    pub resolution: f64,
    /// Nodes as OctoMap counts them: leaves and inner nodes, the root included.
    pub nodes: usize,
    /// Bricks that a map of it has, of 8³ voxels each: a single cube may stand for more than any memory holds.
    pub bricks: usize,
    cubes: Cubes<'a, V>,
}

impl<'a, V: Clone> TreeFile<'a, V> {
    /// The known cubes with their values, depth first, children by index: pruned or not, as they are in the file.
    pub fn cubes(&self) -> Cubes<'a, V> {
        self.cubes.clone()
    }
}

/// Why bytes are no `.bt` or `.ot` file.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum TreeFileError {
    /// The first line is another one.
    #[error("it does not begin with `{0}`: it is another kind of file")]
    Magic(&'static str),
    /// The header has no `data` line.
    #[error("the header has no `data` line: the file is cut off")]
    HeaderEnd,
    /// A header line lacks its value, or has one that makes no sense.
    #[error("header line {line}: `{text}`; expected `{expected}`")]
    Header {
        /// The line, from 1.
        line: usize,
        /// What stands there (its first 60 characters).
        text: String,
        /// What would be right.
        expected: &'static str,
    },
    /// A header line is missing.
    #[error("the header has no line `{0}`")]
    Missing(&'static str),
    /// The edge of a voxel in the header of a file of before 2011.
    #[error("at byte 4: voxels of {0} m; expected a length above 0")]
    Resolution(f64),
    /// The file holds a tree of another kind.
    #[error("the file holds a `{found}`; right is {right}")]
    Kind {
        /// What it holds (its first 60 characters).
        found: String,
        /// What would be right.
        right: &'static str,
    },
    /// The file ends within the tree.
    #[error("the data end at byte {0} in the middle of the tree: the file is cut off")]
    Truncated(usize),
    /// Something follows the tree.
    #[error("{0} bytes follow the end of the tree: the file is damaged")]
    Trailing(usize),
    /// An inner node where only leaves can be.
    #[error("an inner node at byte {0} lies deeper than the {DEPTH} levels of an OctoMap: the file is damaged")]
    TooDeep(usize),
    /// Log-odds that are no number.
    #[error("the log-odds at byte {at} are {found}; expected a finite number: the file is damaged")]
    LogOdds {
        /// Where they stand in the file.
        at: usize,
        /// What stands there.
        found: f32,
    },
    /// The header's count is not the tree's.
    #[error("the header announces {announced} nodes, the tree has {found}: the file is damaged")]
    Count {
        /// The header's `size`.
        announced: usize,
        /// Nodes in the data.
        found: usize,
    },
}

impl From<CutOff> for TreeFileError {
    fn from(CutOff { end }: CutOff) -> Self {
        Self::Truncated(end)
    }
}
