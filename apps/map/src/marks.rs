//! What the rays of a scan pass and hit, until the map takes it.
//!
//! In a window of blocks of 8³ voxels around the sensor a voxel is found by address alone: the sum of what each of its
//! coordinates gives. There what is passed is a byte a voxel, because a byte is written without being read, and most voxels are
//! passed many times. What lies beyond is found by hashing; of blocks there that the map does not have only so many are kept, the
//! nearest to the sensor, as it has room for, in whatever order they come.

use std::collections::binary_heap::PeekMut;
use std::collections::{BinaryHeap, HashMap};
use std::hash::BuildHasherDefault;

use elk_geometry::Voxel;
use elk_geometry::bricks::{BrickHasher, brick_of, cell_of};
use elk_geometry::mask::{self, Mask};

use crate::table::BrickTable;

/// Blocks of the largest window: half a kilobyte each.
const MOST_BLOCKS: u64 = 1 << 16;
/// Blocks from the sensor to the end of the largest window along an axis, before it has to be cut down.
const FARTHEST: i32 = 4096;
/// Bits of an address that tell the voxel in its block.
const CELL_BITS: u32 = 9;

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
        Self { low: ends.map(|[low, _]| low), blocks }
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
    /// Of the window, by address: 1 where a voxel is passed.
    passed: Vec<u8>,
    /// Of its blocks: 1 where anything is marked; and what is hit.
    entered: Vec<u8>,
    hit: Vec<Mask>,
    /// Blocks elsewhere.
    far: HashMap<Voxel, Marks, BuildHasherDefault<BrickHasher>>,
    /// Those of them that the map does not have: how far from the sensor's (the bits of a distance, which are in the order of
    /// distances), and where. As many as it has room for.
    new: BinaryHeap<(u64, Voxel)>,
    room: usize,
    /// The sensor's block.
    home: [i32; 3],
}

impl Scratch {
    /// No marks, and a window for rays from `center` to between `low` and `high` (voxels), in a map that has room for so many
    /// more bricks.
    pub fn clear(&mut self, center: Voxel, low: Voxel, high: Voxel, room: usize) {
        self.window = Window::around(brick_of(center), brick_of(low), brick_of(high));
        let blocks = self.window.blocks.iter().map(|n| *n as usize).product();
        // All of it is 0: see `take`.
        self.passed.resize(blocks << CELL_BITS, 0);
        self.entered.resize(blocks, 0);
        self.hit.clear();
        self.hit.resize(blocks, mask::NONE);
        self.far.clear();
        self.new.clear();
        (self.room, self.home) = (room, brick_of(center).to_array());
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

    /// What a step to the next block along each axis adds to an address: see [`Scratch::pass`]. A step within a block adds
    /// `8^axis`.
    pub fn strides(&self) -> [i32; 3] {
        let [x, y, _] = self.window.blocks;
        [1, x, x * y].map(|blocks| blocks << CELL_BITS)
    }

    /// Marks the voxel of an address in the window as passed.
    #[inline(always)]
    pub fn pass(&mut self, address: u32) {
        self.passed[address as usize] = 1;
        self.entered[(address >> CELL_BITS) as usize] = 1;
    }

    /// Marks voxels, wherever they are, as passed; `map` has the bricks that there are already.
    pub fn pass_all(&mut self, voxels: impl Iterator<Item = Voxel>, map: &BrickTable) {
        for voxel in voxels {
            match self.window.number(brick_of(voxel)) {
                Some(number) => self.pass((number << CELL_BITS | cell_of(voxel)) as u32),
                None => {
                    let marks = self.beyond(brick_of(voxel), map);
                    marks.into_iter().for_each(|marks| mask::set(&mut marks.passed, cell_of(voxel)));
                }
            }
        }
    }

    /// Marks a voxel, wherever it is, as hit.
    #[inline]
    pub fn hit(&mut self, voxel: Voxel, map: &BrickTable) {
        match self.window.number(brick_of(voxel)) {
            Some(number) => {
                self.entered[number] = 1;
                mask::set(&mut self.hit[number], cell_of(voxel));
            }
            None => {
                let marks = self.beyond(brick_of(voxel), map);
                marks.into_iter().for_each(|marks| mask::set(&mut marks.hit, cell_of(voxel)));
            }
        }
    }

    /// A block beyond the window; `None` if the map has no room for it, as others are nearer.
    fn beyond(&mut self, block: Voxel, map: &BrickTable) -> Option<&mut Marks> {
        if !self.far.contains_key(&block) && map.find(block).is_none() {
            let place = (block.distance(self.home.into()).to_bits(), block);
            if self.new.len() < self.room {
                self.new.push(place);
            } else {
                // Whichever is farthest goes, and does not come back: so the nearest of all are left, with all their marks.
                let farthest = self.new.peek_mut().filter(|farthest| place < **farthest)?;
                self.far.remove(&PeekMut::pop(farthest).1);
                self.new.push(place);
            }
        }
        Some(self.far.entry(block).or_default())
    }

    /// Whether a voxel was hit.
    #[inline]
    pub fn is_hit(&self, voxel: Voxel) -> bool {
        mask::has(self.hits(brick_of(voxel)), cell_of(voxel))
    }

    /// The cells of a block that were hit.
    pub fn hits(&self, block: Voxel) -> &Mask {
        match self.window.number(block) {
            Some(number) => &self.hit[number],
            None => self.far.get(&block).map_or(&mask::NONE, |marks| &marks.hit),
        }
    }

    /// Takes the blocks in which anything is marked, in lexicographic order, and what is; only what is hit is still known
    /// afterwards.
    pub fn take(&mut self) -> Vec<(Voxel, Marks)> {
        let mut taken: Vec<(Voxel, Marks)> = self.far.iter().map(|(block, marks)| (*block, *marks)).collect();
        for number in 0..self.entered.len() {
            if std::mem::take(&mut self.entered[number]) != 0 {
                let cells = &mut self.passed[number << CELL_BITS..(number + 1) << CELL_BITS];
                taken.push((self.window.block(number), Marks { passed: packed(cells), hit: self.hit[number] }));
                cells.fill(0);
            }
        }
        taken.sort_unstable_by_key(|(block, _)| *block);
        taken
    }
}

/// The bytes of a block, 0 or 1, as bits.
fn packed(cells: &[u8]) -> Mask {
    let mut mask = mask::NONE;
    for (row, bytes) in cells.as_chunks::<8>().0.iter().enumerate() {
        // Byte `i` comes to stand at bit `56 + i`, and nothing else there.
        let bits = u64::from_le_bytes(*bytes).wrapping_mul(0x0102_0408_1020_4080) >> 56;
        mask[row >> 3] |= bits << (8 * (row & 7));
    }
    mask
}
