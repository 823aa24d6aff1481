//! What the rays of a scan pass and hit, a bit a voxel, until the map takes it.
//!
//! A window of blocks of 8³ voxels around the sensor is found by address alone: a voxel's address is the sum of what each of
//! its coordinates gives, looked up once. What lies beyond is found by hashing.

use std::collections::HashMap;
use std::hash::BuildHasherDefault;

use elk_geometry::Voxel;
use elk_geometry::bricks::{BrickHasher, brick_of, cell_of};
use elk_geometry::mask::{self, Mask};

use crate::table::BrickTable;

/// Blocks of the largest window: four bytes each.
const MOST_BLOCKS: u64 = 1 << 20;
/// Blocks from the sensor to the end of the largest window along an axis, before it has to be cut down.
const FARTHEST: i32 = 4096;
/// Bits of an address that tell the voxel in its block.
const CELL_BITS: u32 = 9;
/// A block that no ray has come to.
const NONE: u32 = u32::MAX;
/// The block of all for which the map has no room.
const VOID: u32 = 0;

/// What a scan says of a block.
#[derive(Debug, Clone, Copy, Default)]
pub struct Marks {
    pub passed: Mask,
    pub hit: Mask,
}

/// Where the window is: whole blocks.
#[derive(Debug, Clone, Default)]
struct Window {
    /// Its lowest block, and how many it has along each axis.
    low: [i32; 3],
    blocks: [i32; 3],
    /// What a coordinate (voxels, from the window's lowest) adds to an address, by axis.
    parts: [Vec<u32>; 3],
}

impl Window {
    /// The smallest window in which all between `low` and `high` lies, and a block more each way, as rounding may lead a ray
    /// out; or as much of it around `center` as a window may have (all in blocks).
    fn around(center: Voxel, low: Voxel, high: Voxel) -> Self {
        let (center, low, high) = (center.to_array(), low.to_array(), high.to_array());
        let ends = |reach: i32| -> [[i32; 2]; 3] {
            std::array::from_fn(|i| [low[i].max(center[i] - reach) - 1, high[i].min(center[i] + reach) + 1])
        };
        let size = |ends: &[[i32; 2]; 3]| ends.iter().map(|[low, high]| (high - low + 1) as u64).product::<u64>();
        let mut reach = FARTHEST;
        while size(&ends(reach)) > MOST_BLOCKS {
            reach /= 2;
        }
        let ends = ends(reach);
        let blocks = ends.map(|[low, high]| high - low + 1);
        let strides = [1, blocks[0], blocks[0] * blocks[1]];
        let part = |axis: usize, at: i32| ((at >> 3) * strides[axis]) << CELL_BITS | (at & 7) << (3 * axis);
        let parts = std::array::from_fn(|axis| (0..8 * blocks[axis]).map(|at| part(axis, at) as u32).collect());
        Self { low: ends.map(|[low, _]| low), blocks, parts }
    }

    fn number(&self, block: Voxel) -> Option<usize> {
        let block = block.to_array();
        let at: [i32; 3] = std::array::from_fn(|i| block[i] - self.low[i]);
        let is_in = (0..3).all(|i| (0..self.blocks[i]).contains(&at[i]));
        is_in.then(|| ((at[2] * self.blocks[1] + at[1]) * self.blocks[0] + at[0]) as usize)
    }

    fn block(&self, number: usize) -> Voxel {
        let [x, y, _] = self.blocks.map(|n| n as usize);
        let at = [number % x, number / x % y, number / x / y];
        Voxel::from(std::array::from_fn::<i32, 3, _>(|i| self.low[i] + at[i] as i32))
    }
}

/// The marks of a scan, block by block.
#[derive(Debug, Clone, Default)]
pub struct Scratch {
    window: Window,
    /// The number of each block of the window.
    near: Vec<u32>,
    /// The numbers of blocks elsewhere.
    far: HashMap<Voxel, u32, BuildHasherDefault<BrickHasher>>,
    positions: Vec<Voxel>,
    marks: Vec<Marks>,
    /// Blocks that the map has no brick for yet, and how many more of those it has room for.
    room: usize,
}

impl Scratch {
    /// No marks, and a window for rays from `center` to between `low` and `high` (voxels).
    pub fn clear(&mut self, table: &BrickTable, center: Voxel, low: Voxel, high: Voxel) {
        self.window = Window::around(brick_of(center), brick_of(low), brick_of(high));
        self.near.clear();
        self.near.resize(self.window.blocks.iter().map(|n| *n as usize).product(), NONE);
        self.far.clear();
        self.positions.clear();
        self.positions.push(Voxel::new(0, 0, 0));
        self.marks.clear();
        self.marks.push(Marks::default());
        self.room = table.room();
    }

    /// Whether all rays from the window's centre to this voxel lie in the window.
    pub fn is_near(&self, voxel: Voxel) -> bool {
        let (voxel, window) = (voxel.to_array(), &self.window);
        // Without its outermost blocks.
        (0..3).all(|i| (1..window.blocks[i] - 1).contains(&((voxel[i] >> 3) - window.low[i])))
    }

    /// Where a voxel lies from the window's lowest.
    pub fn in_window(&self, voxel: Voxel) -> [i32; 3] {
        let voxel = voxel.to_array();
        std::array::from_fn(|i| voxel[i] - 8 * self.window.low[i])
    }

    /// What coordinates add to an address, by axis: see [`Scratch::pass`].
    pub fn parts(&self) -> [Vec<u32>; 3] {
        self.window.parts.clone()
    }

    /// Marks the voxel of an address in the window as passed.
    #[inline]
    pub fn pass(&mut self, address: u32, table: &BrickTable) {
        let i = self.at(address, table);
        self.marks[i].passed[(address >> 6 & 7) as usize] |= 1 << (address & 63);
    }

    #[inline]
    fn at(&mut self, address: u32, table: &BrickTable) -> usize {
        let number = (address >> CELL_BITS) as usize;
        match self.near[number] {
            NONE => self.enter(number, table),
            i => i as usize,
        }
    }

    #[cold]
    fn enter(&mut self, number: usize, table: &BrickTable) -> usize {
        let i = self.admit(self.window.block(number), table);
        self.near[number] = i;
        i as usize
    }

    /// The number of a block that no ray had come to.
    fn admit(&mut self, block: Voxel, table: &BrickTable) -> u32 {
        if table.find(block).is_none() {
            if self.room == 0 {
                return VOID;
            }
            self.room -= 1;
        }
        self.positions.push(block);
        self.marks.push(Marks::default());
        (self.marks.len() - 1) as u32
    }

    /// Marks a voxel, wherever it is, as passed.
    pub fn pass_voxel(&mut self, voxel: Voxel, table: &BrickTable) {
        let i = self.block_of(voxel, table);
        mask::set(&mut self.marks[i].passed, cell_of(voxel));
    }

    /// Marks a voxel, wherever it is, as hit; whether the map has room for it.
    #[inline]
    pub fn hit(&mut self, voxel: Voxel, table: &BrickTable) -> bool {
        let i = self.block_of(voxel, table);
        mask::set(&mut self.marks[i].hit, cell_of(voxel));
        i != VOID as usize
    }

    /// Whether a voxel was hit.
    pub fn is_hit(&self, voxel: Voxel) -> bool {
        mask::has(&self.hits(brick_of(voxel)), cell_of(voxel))
    }

    #[inline]
    fn block_of(&mut self, voxel: Voxel, table: &BrickTable) -> usize {
        let block = brick_of(voxel);
        match self.window.number(block) {
            Some(number) => match self.near[number] {
                NONE => self.enter(number, table),
                i => i as usize,
            },
            None => self.block_beyond(block, table),
        }
    }

    fn block_beyond(&mut self, block: Voxel, table: &BrickTable) -> usize {
        if let Some(i) = self.far.get(&block) {
            return *i as usize;
        }
        let i = self.admit(block, table);
        self.far.insert(block, i);
        i as usize
    }

    /// The blocks that rays came to, in lexicographic order, and what they left there.
    pub fn touched(&self) -> Vec<(Voxel, Marks)> {
        let mut touched: Vec<(Voxel, Marks)> =
            self.positions[1..].iter().copied().zip(self.marks[1..].iter().copied()).collect();
        touched.sort_unstable_by_key(|(block, _)| *block);
        touched
    }

    /// The cells of a block that were hit.
    pub fn hits(&self, block: Voxel) -> Mask {
        let i = match self.window.number(block) {
            Some(number) => self.near[number],
            None => self.far.get(&block).copied().unwrap_or(NONE),
        };
        if i == NONE || i == VOID { mask::NONE } else { self.marks[i as usize].hit }
    }
}
