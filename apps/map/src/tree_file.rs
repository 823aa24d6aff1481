//! A tree in a file of OctoMap's, and its cubes, one after another, without the tree: what is kept of it is the way from the root
//! to where one is.

use std::marker::PhantomData;

use elk_geometry::bricks::{BRICK, brick_of};

use crate::bytes::{Bytes, CutOff};
use crate::octree::{Cube, DEPTH, ROOT, half};

/// A tree as a file has it, looked through to its end: it is kept as those bytes, and takes no memory besides.
#[derive(Debug, Clone, PartialEq)]
pub struct TreeFile<'a, V> {
    /// Edge of a voxel (m).
    pub resolution: f64,
    /// Nodes as OctoMap counts them: leaves and inner nodes, the root included.
    pub nodes: usize,
    /// Bricks that a map of it has, of 8³ voxels each: a single cube may stand for more than any memory holds.
    pub bricks: usize,
    pub(crate) cubes: Cubes<'a, V>,
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

/// The two bits of a child whose own bytes say what it is.
pub(crate) const INNER: u32 = 3;

/// A node in a file.
#[derive(Debug)]
pub enum Read<V> {
    /// All of its cube has this value.
    Leaf(V),
    /// Its children, two bits each, the first one's lowest; 0: there is none.
    Inner(u32),
}

/// The values that the nodes of a file have.
pub trait Value: Copy {
    /// Reads the node of which its parent has said these two bits; `beside` its value it has so many bytes.
    ///
    /// # Errors
    /// It is cut off or damaged.
    fn read(bits: u32, beside: usize, data: &mut Bytes<'_>) -> Result<Read<Self>, TreeFileError>;
}

/// An inner node on the way.
#[derive(Debug, Clone, Copy, PartialEq)]
struct Inner {
    cube: Cube<()>,
    /// The next child's number, and the bits of those that are left.
    next: u32,
    left: u32,
}

/// The cubes of a tree in a file, in the file's order. At most [`DEPTH`] nodes are kept at a time.
#[derive(Debug, Clone, PartialEq)]
pub struct Cubes<'a, V> {
    data: Bytes<'a>,
    beside: usize,
    way: Vec<Inner>,
    nodes: usize,
    value: PhantomData<V>,
}

impl<'a, V: Value> Cubes<'a, V> {
    /// Those of the tree that these data are, to the last byte, of so many nodes, each with so many bytes `beside` its value; and how
    /// many bricks they lie in.
    ///
    /// # Errors
    /// The data are no such tree.
    pub(crate) fn of(data: Bytes<'a>, nodes: usize, beside: usize) -> Result<(Self, usize), TreeFileError> {
        // A file that announces no node and has no data holds an unknown world.
        let is_unknown = nodes == 0 && data.left() == 0;
        let above_root = Inner { cube: Cube { min: ROOT, edge: 2 << DEPTH, value: () }, next: 0, left: INNER };
        let way = if is_unknown { Vec::new() } else { vec![above_root] };
        let cubes = Self { data, beside, way, nodes: 0, value: PhantomData };
        let (mut all, mut bricks, mut last) = (cubes.clone(), 0, None);
        while let Some(Cube { min, edge, .. }) = all.step()? {
            // Depth first, cubes of one brick follow each other.
            let brick = Some(brick_of(min));
            bricks += match edge / BRICK as u32 {
                0 => usize::from(last != brick),
                edge => (edge as usize).pow(3),
            };
            last = brick;
        }
        match (all.data.left(), all.nodes) {
            (0, found) if found == nodes => Ok((cubes, bricks)),
            (0, found) => Err(TreeFileError::Count { announced: nodes, found }),
            (more, _) => Err(TreeFileError::Trailing(more)),
        }
    }

    fn step(&mut self) -> Result<Option<Cube<V>>, TreeFileError> {
        while let Some(inner) = self.way.last_mut() {
            let unknown = inner.left.trailing_zeros() / 2;
            if inner.left == 0 {
                self.way.pop();
                continue;
            }
            let (child, bits) = (inner.next + unknown, inner.left >> (2 * unknown) & INNER);
            (inner.next, inner.left) = (child + 1, inner.left >> (2 * unknown) >> 2);
            let (cube, at) = (half(inner.cube, child), self.data.at());
            self.nodes += 1;
            match V::read(bits, self.beside, &mut self.data)? {
                Read::Leaf(value) => return Ok(Some(Cube { min: cube.min, edge: cube.edge, value })),
                Read::Inner(_) if cube.edge == 1 => return Err(TreeFileError::TooDeep(at)),
                Read::Inner(left) => self.way.push(Inner { cube, next: 0, left }),
            }
        }
        Ok(None)
    }
}

impl<V: Value> Iterator for Cubes<'_, V> {
    type Item = Cube<V>;

    fn next(&mut self) -> Option<Cube<V>> {
        // Whoever made it has seen that there is no error in it.
        self.step().ok().flatten()
    }
}
