//! The discrete Laplacian on blocks: `(Aψ)ᵢ = dᵢψᵢ − Σ wᵢⱼψⱼ` over the six neighbours of each cell inside.
//!
//! Cells that are not inside hold 0 in every vector, so that sums run over all neighbours without asking.

use super::block::{Block, Halo, row};
use super::lanes::Lanes;

/// 60 divided by how many neighbours a cell has is a whole number for each of 1 to 6.
const SIXTY: f32 = 60.0;
/// `60 / n`; 0 for a cell without neighbours, which no equation says anything about.
pub const SIXTIETHS: [u8; 7] = [0, 60, 30, 20, 15, 12, 10];

/// The equations of the cells of a level.
pub trait Stencil {
    /// Those of one block.
    type Rows<'a>: Rows
    where
        Self: 'a;

    /// Those of the block in a slot.
    fn rows(&self, slot: u32) -> Self::Rows<'_>;

    /// The weights of the block in a slot, to other cells and to fixed values.
    fn weights(&self, slot: u32, neighbours: &[u32; 6]) -> Weights;

    /// Makes room for as many slots, in all.
    fn resize(&mut self, slots: usize);
}

/// The equations of the cells of a block, row by row.
pub trait Rows: Copy {
    /// `d`; 0 for cells that are not inside.
    fn diagonal<L: Lanes>(self, row: usize) -> L;

    /// `1/d`; 0 for cells that are not inside.
    fn inverse<L: Lanes>(self, row: usize) -> L;

    /// `Σ wx` over the neighbours, whether a cell is inside or not.
    fn inflow<L: Lanes>(self, row: usize, around: [L; 6]) -> L;

    /// `b − Ax` of row `y`, `z`; 0 for cells that are not inside.
    #[inline(always)]
    fn residual<L: Lanes>(self, y: usize, z: usize, b: L, x: &Halo<f32>) -> L {
        let row = row(y, z);
        let d = self.diagonal::<L>(row);
        let outflow = d.times(L::of(x.own(y, z)));
        b.minus(outflow.minus(self.inflow(row, around(x, y, z)))).where_positive(d)
    }

    /// Row `y`, `z` of `x + ω D⁻¹ (b − Ax)`; 0 for cells that are not inside.
    #[inline(always)]
    fn relaxed<L: Lanes>(self, y: usize, z: usize, b: L, x: &Halo<f32>, omega: f32) -> L {
        let row = row(y, z);
        let own = L::of(x.own(y, z)).times(L::splat(1.0 - omega));
        let new = b.plus(self.inflow(row, around(x, y, z))).times(self.inverse(row));
        own.plus(new.times(L::splat(omega)))
    }
}

/// The six rows around a row.
#[inline(always)]
pub fn around<L: Lanes>(x: &Halo<f32>, y: usize, z: usize) -> [L; 6] {
    let [x0, x1, y0, y1, z0, z1] = x.around(y, z);
    [L::of(x0), L::of(x1), L::of(y0), L::of(y1), L::of(z0), L::of(z1)]
}

/// The finest level: all weights are 1 between cells inside, and a diagonal is a number of neighbours.
#[derive(Debug, Clone, Default)]
pub struct Counted {
    /// Neighbours in the domain, those with fixed values included; 0 for cells that are not inside.
    pub neighbours: Vec<Block<u8>>,
    /// [`SIXTIETHS`] of that.
    pub sixtieths: Vec<Block<u8>>,
}

impl Stencil for Counted {
    type Rows<'a> = (&'a Block<u8>, &'a Block<u8>);

    #[inline(always)]
    fn rows(&self, slot: u32) -> Self::Rows<'_> {
        (&self.neighbours[slot as usize], &self.sixtieths[slot as usize])
    }

    #[inline(always)]
    fn weights(&self, slot: u32, neighbours: &[u32; 6]) -> Weights {
        let mut weights = Weights::NONE;
        let mut halo = Halo::new();
        halo.gather(&self.neighbours, slot, neighbours);
        for z in 0..8 {
            for y in 0..8 {
                let (row, own) = (row(y, z), halo.own(y, z));
                weights.fixed[row] = own.map(f32::from);
                weights.fill[row] = own.map(|n| f32::from(u8::from(n > 0)));
                for (to, beside) in weights.to.iter_mut().zip(halo.around(y, z)) {
                    for i in 0..8 {
                        let weight = f32::from(u8::from(own[i] > 0) & u8::from(beside[i] > 0));
                        to[row][i] = weight;
                        weights.fixed[row][i] -= weight;
                    }
                }
            }
        }
        weights
    }

    fn resize(&mut self, slots: usize) {
        self.neighbours.resize(slots, [[0; 8]; 64]);
        self.sixtieths.resize(slots, [[0; 8]; 64]);
    }
}

impl Rows for (&Block<u8>, &Block<u8>) {
    #[inline(always)]
    fn diagonal<L: Lanes>(self, row: usize) -> L {
        L::of_bytes(&self.0[row])
    }

    #[inline(always)]
    fn inverse<L: Lanes>(self, row: usize) -> L {
        L::of_bytes(&self.1[row]).times(L::splat(1.0 / SIXTY))
    }

    #[inline(always)]
    fn inflow<L: Lanes>(self, _: usize, [x0, x1, y0, y1, z0, z1]: [L; 6]) -> L {
        x0.plus(x1).plus(y0.plus(y1)).plus(z0.plus(z1))
    }
}

/// What a block of a coarser level has for each cell.
#[derive(Debug, Clone)]
pub struct Weights {
    /// To the neighbours, −x +x −y +y −z +z.
    pub to: [Block<f32>; 6],
    /// Share of the cell that is inside.
    pub fill: Block<f32>,
    /// To fixed values.
    pub fixed: Block<f32>,
    /// Sum of the weights; 0 for cells that are not inside.
    pub diagonal: Block<f32>,
    /// Its inverse; 0 for cells that are not inside.
    pub inverse: Block<f32>,
}

impl Weights {
    /// Those of no cell.
    pub const NONE: Self = Self {
        to: [[[0.0; 8]; 64]; 6],
        fixed: [[0.0; 8]; 64],
        fill: [[0.0; 8]; 64],
        diagonal: [[0.0; 8]; 64],
        inverse: [[0.0; 8]; 64],
    };
}

/// A coarser level.
#[derive(Debug, Clone, Default)]
pub struct Weighted(pub Vec<Weights>);

impl Stencil for Weighted {
    type Rows<'a> = &'a Weights;

    #[inline(always)]
    fn rows(&self, slot: u32) -> &Weights {
        &self.0[slot as usize]
    }

    #[inline(always)]
    fn weights(&self, slot: u32, _: &[u32; 6]) -> Weights {
        self.0[slot as usize].clone()
    }

    fn resize(&mut self, slots: usize) {
        self.0.resize(slots, Weights::NONE);
    }
}

impl Rows for &Weights {
    #[inline(always)]
    fn diagonal<L: Lanes>(self, row: usize) -> L {
        L::of(&self.diagonal[row])
    }

    #[inline(always)]
    fn inverse<L: Lanes>(self, row: usize) -> L {
        L::of(&self.inverse[row])
    }

    #[inline(always)]
    fn inflow<L: Lanes>(self, row: usize, [x0, x1, y0, y1, z0, z1]: [L; 6]) -> L {
        let flow = |face: usize, x: L| L::of(&self.to[face][row]).times(x);
        let (x, y) = (flow(0, x0).plus(flow(1, x1)), flow(2, y0).plus(flow(3, y1)));
        x.plus(y).plus(flow(4, z0).plus(flow(5, z1)))
    }
}
