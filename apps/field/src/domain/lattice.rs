//! Which blocks there are, and which lie beside each other.

use std::collections::HashMap;
use std::hash::BuildHasherDefault;

use elk_geometry::Voxel;
use elk_geometry::bricks::BrickHasher;
use elk_geometry::voxel::FACES;

/// The slot of the block that is not there: everything in it is zero, always.
pub const NONE: u32 = 0;

/// Blocks by position (in blocks), each with a slot: its place in whatever is kept for each block.
#[derive(Debug, Clone)]
pub struct Lattice {
    index: HashMap<Voxel, u32, BuildHasherDefault<BrickHasher>>,
    positions: Vec<Voxel>,
    neighbours: Vec<[u32; 6]>,
    order: Vec<u32>,
    vacant: Vec<u32>,
    is_ordered: bool,
}

impl Lattice {
    /// One without blocks.
    pub fn new() -> Self {
        Self {
            index: HashMap::default(),
            positions: vec![Voxel::new(0, 0, 0)],
            neighbours: vec![[NONE; 6]],
            order: Vec::new(),
            vacant: Vec::new(),
            is_ordered: true,
        }
    }

    /// The slot of the block at a position; [`NONE`] if there is none.
    pub fn slot(&self, position: Voxel) -> u32 {
        self.index.get(&position).copied().unwrap_or(NONE)
    }

    /// Slots in use and vacant, with that of [`NONE`].
    pub fn slots(&self) -> usize {
        self.positions.len()
    }

    /// Where the block in a slot is.
    pub fn position(&self, slot: u32) -> Voxel {
        self.positions[slot as usize]
    }

    /// Where all blocks are, in the order in which they came into being, and where some were.
    pub fn positions(&self) -> impl Iterator<Item = Voxel> {
        self.positions.iter().skip(1).copied()
    }

    /// The blocks beside the one in a slot, −x +x −y +y −z +z.
    pub fn neighbours(&self, slot: u32) -> &[u32; 6] {
        &self.neighbours[slot as usize]
    }

    /// Some slots and those of the blocks beside them, each once, by number.
    pub fn with_neighbours(&self, slots: &[u32]) -> Vec<u32> {
        let beside = slots.iter().flat_map(|slot| *self.neighbours(*slot)).filter(|slot| *slot != NONE);
        let mut all: Vec<u32> = slots.iter().copied().chain(beside).collect();
        all.sort_unstable();
        all.dedup();
        all
    }

    /// The slot of the block at a position, which comes into being if it was not there.
    pub fn insert(&mut self, position: Voxel) -> u32 {
        if let Some(slot) = self.index.get(&position) {
            return *slot;
        }
        let slot = self.vacant.pop().unwrap_or_else(|| {
            self.positions.push(position);
            self.neighbours.push([NONE; 6]);
            self.positions.len() as u32 - 1
        });
        self.index.insert(position, slot);
        self.positions[slot as usize] = position;
        self.is_ordered = false;
        self.link(slot, slot);
        slot
    }

    /// Takes a block away. Its slot goes to another.
    pub fn remove(&mut self, slot: u32) {
        self.link(slot, NONE);
        self.index.remove(&self.position(slot));
        self.neighbours[slot as usize] = [NONE; 6];
        self.vacant.push(slot);
        self.is_ordered = false;
    }

    /// Tells the neighbours of the block in `slot` that `seen` is beside them.
    fn link(&mut self, slot: u32, seen: u32) {
        let position = self.position(slot);
        for (face, offset) in FACES.into_iter().enumerate() {
            let beside = self.slot(position + offset);
            self.neighbours[slot as usize][face] = beside;
            if beside != NONE {
                self.neighbours[beside as usize][face ^ 1] = seen;
            }
        }
    }

    /// The slots in use by position, x fastest; whatever is done in this order is the same on every run.
    pub fn order(&self) -> &[u32] {
        debug_assert!(self.is_ordered);
        &self.order
    }

    /// Puts [`Lattice::order`] right after blocks came or went.
    pub fn settle(&mut self) {
        if !self.is_ordered {
            let mut blocks: Vec<([i32; 3], u32)> = self.index.values().map(|s| (self.key(*s), *s)).collect();
            blocks.sort_unstable();
            self.order = blocks.into_iter().map(|(_, slot)| slot).collect();
            self.is_ordered = true;
        }
    }

    fn key(&self, slot: u32) -> [i32; 3] {
        let Voxel { x, y, z } = self.position(slot);
        [z, y, x]
    }
}
