//! Blocks of 8 × 8 × 8 cells as 64 rows of 8, and one of them with the cells around it.
//!
//! A row is what a vector register holds, so that everything here is written for whole rows.

use super::lanes::Lanes;

/// Eight cells along x.
pub type Row<T> = [T; 8];
/// The rows of a block: along y, then along z.
pub type Block<T> = [Row<T>; 64];

/// The row at `y`, `z` of a block.
pub fn row(y: usize, z: usize) -> usize {
    z * 8 + y
}

/// Adds up the cells of a row, in pairs.
#[inline(always)]
pub fn sum<L: Lanes>(lanes: L) -> f64 {
    let mut row = [0.0; 8];
    lanes.to(&mut row);
    row.iter().map(|number| f64::from(*number)).sum()
}

/// A block in the middle of a layer of cells, one thick, of the six blocks around it. Edges and corners are not there.
#[repr(align(64))]
pub struct Halo<T>([[T; 16]; 100]);

/// Where a block's own cells begin in a row of a [`Halo`].
const OWN: usize = 4;

impl<T: Copy + Default> Halo<T> {
    /// All cells as they are by default.
    pub fn new() -> Self {
        Self([[T::default(); 16]; 100])
    }

    /// The eight cells from `x` on of row `y`, `z`, each of these 0 to 9 with 1 where the block begins.
    #[inline(always)]
    fn at(&self, x: usize, y: usize, z: usize) -> &Row<T> {
        let [row] = self.0[z * 10 + y][x..x + 8].as_chunks().0 else { unreachable!("eight cells are a row") };
        row
    }

    /// A row of the block.
    #[inline(always)]
    pub fn own(&self, y: usize, z: usize) -> &Row<T> {
        self.at(OWN, y + 1, z + 1)
    }

    /// A row of the block, for writing.
    #[inline(always)]
    pub fn own_mut(&mut self, y: usize, z: usize) -> &mut Row<T> {
        let row = &mut self.0[(z + 1) * 10 + y + 1];
        let [row] = row[OWN..OWN + 8].as_chunks_mut().0 else { unreachable!("eight cells are a row") };
        row
    }

    /// The six rows around a row of the block: −x +x −y +y −z +z.
    #[inline(always)]
    pub fn around(&self, y: usize, z: usize) -> [&Row<T>; 6] {
        let (x, y, z) = (OWN, y + 1, z + 1);
        [
            self.at(x - 1, y, z),
            self.at(x + 1, y, z),
            self.at(x, y - 1, z),
            self.at(x, y + 1, z),
            self.at(x, y, z - 1),
            self.at(x, y, z + 1),
        ]
    }

    /// Takes the cells of block `own`, and those around it of its `neighbours`, −x +x −y +y −z +z.
    #[inline(always)]
    pub fn gather(&mut self, blocks: &[Block<T>], own: u32, neighbours: &[u32; 6]) {
        let own = &blocks[own as usize];
        for z in 0..8 {
            for y in 0..8 {
                *self.own_mut(y, z) = own[row(y, z)];
            }
        }
        self.surround(blocks, neighbours);
    }

    /// Takes the cells around a block.
    #[inline(always)]
    pub fn surround(&mut self, blocks: &[Block<T>], neighbours: &[u32; 6]) {
        let [x0, x1, y0, y1, z0, z1] = *neighbours;
        let [x0, x1] = [&blocks[x0 as usize], &blocks[x1 as usize]];
        let [y0, y1] = [&blocks[y0 as usize], &blocks[y1 as usize]];
        let [z0, z1] = [&blocks[z0 as usize], &blocks[z1 as usize]];
        for z in 0..8 {
            for y in 0..8 {
                let around = &mut self.0[(z + 1) * 10 + y + 1];
                (around[OWN - 1], around[OWN + 8]) = (x0[row(y, z)][7], x1[row(y, z)][0]);
            }
            self.0[(z + 1) * 10][OWN..OWN + 8].copy_from_slice(&y0[row(7, z)]);
            self.0[(z + 1) * 10 + 9][OWN..OWN + 8].copy_from_slice(&y1[row(0, z)]);
        }
        for y in 0..8 {
            self.0[y + 1][OWN..OWN + 8].copy_from_slice(&z0[row(y, 7)]);
            self.0[90 + y + 1][OWN..OWN + 8].copy_from_slice(&z1[row(y, 0)]);
        }
    }
}
