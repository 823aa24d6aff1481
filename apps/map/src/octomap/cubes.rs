//! The cubes of a tree in a file, one after another, without the tree: what is kept of it is the way from the root to where one
//! is.

use std::marker::PhantomData;

use elk_geometry::bricks::{BRICK, brick_of};

use crate::bytes::Bytes;
use crate::octomap::TreeFileError;
use crate::octree::{Cube, DEPTH, ROOT, half};

/// The two bits of a child whose own bytes say what it is.
pub(super) const INNER: u32 = 3;

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
    pub(super) fn of(data: Bytes<'a>, nodes: usize, beside: usize) -> Result<(Self, usize), TreeFileError> {
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
