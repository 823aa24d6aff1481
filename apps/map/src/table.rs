//! Where the bricks of a map are: a hash of positions for strangers, direct links for neighbours.

use elk_geometry::Voxel;
use elk_geometry::bricks::{BrickIndex, push, swap_remove};
use elk_geometry::voxel::FACES;

/// A neighbour that there is not.
const UNLINKED: u32 = u32::MAX;

/// Numbers bricks in the order in which they were added, up to a limit; the last one gets the number of one that is taken out.
#[derive(Debug, Clone)]
pub struct BrickTable {
    index: BrickIndex,
    positions: Vec<Voxel>,
    /// The bricks beyond each face.
    links: Vec<[u32; 6]>,
    most: usize,
}

impl BrickTable {
    /// A table of at most `most` bricks.
    pub fn new(most: usize) -> Self {
        Self { index: BrickIndex::default(), positions: Vec::new(), links: Vec::new(), most }
    }

    /// The number of the brick at `position` (in bricks), if it has one.
    pub fn find(&self, position: Voxel) -> Option<usize> {
        self.index.find(position, |i| self.positions[i])
    }

    /// The number of the brick at `position`; a new one if it had none, `None` if there is no room for it.
    pub fn find_or_add(&mut self, position: Voxel) -> Option<usize> {
        if let Some(i) = self.find(position) {
            return Some(i);
        }
        if self.room() == 0 {
            return None;
        }
        let next = self.positions.len();
        push(&mut self.positions, position);
        self.index.insert(next, |i| self.positions[i]);
        push(&mut self.links, [UNLINKED; 6]);
        for (face, offset) in FACES.into_iter().enumerate() {
            if let Some(other) = self.find(position + offset) {
                self.links[next][face] = other as u32;
                // Faces come in pairs of opposites.
                self.links[other][face ^ 1] = next as u32;
            }
        }
        Some(next)
    }

    /// Takes a brick out; answers the number that it had, which is the last one's now.
    pub fn remove(&mut self, position: Voxel) -> Option<usize> {
        let (i, last) = (self.find(position)?, self.len() - 1);
        self.link_neighbours(i, UNLINKED);
        self.index.swap_remove(i, last, |i| self.positions[i]);
        swap_remove(&mut self.positions, i);
        swap_remove(&mut self.links, i);
        if i != last {
            self.link_neighbours(i, i as u32);
        }
        Some(i)
    }

    /// Tells the bricks beyond the faces of brick `i` what there is on their side of it.
    fn link_neighbours(&mut self, i: usize, link: u32) {
        for (face, other) in self.links[i].into_iter().enumerate().filter(|(_, other)| *other != UNLINKED) {
            self.links[other as usize][face ^ 1] = link;
        }
    }

    /// The number of the brick beyond `face` (an index into [`FACES`]) of brick `i`, if there is one.
    #[inline]
    pub fn beyond(&self, i: usize, face: usize) -> Option<usize> {
        let other = self.links[i][face];
        (other != UNLINKED).then_some(other as usize)
    }

    /// The position of brick `i`, in bricks.
    pub fn position(&self, i: usize) -> Voxel {
        self.positions[i]
    }

    /// How many further bricks there is room for.
    pub fn room(&self) -> usize {
        self.most - self.positions.len()
    }

    /// Number of bricks.
    pub fn len(&self) -> usize {
        self.positions.len()
    }
}
