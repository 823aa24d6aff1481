//! Where the bricks of a map are: a hash of positions for strangers, direct links for neighbours.
//!
//! A ray enters a brick through a face of the one before, so after the first time it finds it without hashing.

use std::collections::HashMap;
use std::hash::BuildHasherDefault;

use elk_geometry::Voxel;
use elk_geometry::bricks::BrickHasher;
use elk_geometry::voxel::FACES;

/// A link that was never followed.
const UNLINKED: u32 = u32::MAX;

/// Numbers bricks in the order in which they were first asked for, up to a limit.
#[derive(Debug, Clone)]
pub struct BrickTable {
    index: HashMap<Voxel, u32, BuildHasherDefault<BrickHasher>>,
    positions: Vec<Voxel>,
    links: Vec<[u32; 6]>,
    most: usize,
}

impl BrickTable {
    /// A table of at most `most` bricks.
    pub fn new(most: usize) -> Self {
        Self { index: HashMap::default(), positions: Vec::new(), links: Vec::new(), most }
    }

    /// The number of the brick at `position` (in bricks), if it has one.
    pub fn find(&self, position: Voxel) -> Option<usize> {
        self.index.get(&position).map(|&i| i as usize)
    }

    /// The number of the brick at `position`; a new one if it had none, `None` if there is no room for it.
    pub fn find_or_add(&mut self, position: Voxel) -> Option<usize> {
        if let Some(i) = self.find(position) {
            return Some(i);
        }
        if self.is_full() {
            return None;
        }
        let next = self.positions.len();
        self.index.insert(position, next as u32);
        self.positions.push(position);
        self.links.push([UNLINKED; 6]);
        Some(next)
    }

    /// The number of the brick beyond `face` (an index into [`FACES`]) of brick `i`; a new one if it had none, `None` if
    /// there is no room for it.
    #[inline]
    pub fn beyond(&mut self, i: usize, face: usize) -> Option<usize> {
        match self.links[i][face] {
            UNLINKED => self.link(i, face),
            linked => Some(linked as usize),
        }
    }

    #[cold]
    fn link(&mut self, i: usize, face: usize) -> Option<usize> {
        let other = self.find_or_add(self.positions[i] + FACES[face])?;
        self.links[i][face] = other as u32;
        // Faces come in pairs of opposites.
        self.links[other][face ^ 1] = i as u32;
        Some(other)
    }

    /// The position of brick `i`, in bricks.
    pub fn position(&self, i: usize) -> Voxel {
        self.positions[i]
    }

    /// Whether there is no room for a further brick.
    pub fn is_full(&self) -> bool {
        self.positions.len() >= self.most
    }

    /// Number of bricks.
    pub fn len(&self) -> usize {
        self.positions.len()
    }
}
