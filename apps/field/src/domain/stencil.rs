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

    /// What a row of the block in a slot brings into the coarser level.
    fn part<L: Lanes>(&self, slot: u32, counts: &Halo<u8>, y: usize, z: usize) -> Part<L>;

    /// The numbers of neighbours of a block's cells and of those around, where [`Stencil::part`] asks for them.
    fn counts(&self, slot: u32, neighbours: &[u32; 6]) -> Halo<u8>;

    /// Makes room for as many slots, in all.
    fn resize(&mut self, slots: usize);
}

/// What the cells of a row bring into the coarser level.
#[derive(Debug, Clone, Copy)]
pub struct Part<L> {
    /// Weights to the neighbours, −x +x −y +y −z +z.
    pub to: [L; 6],
    /// Weights to fixed values.
    pub fixed: L,
    /// Share of each cell that is inside.
    pub fill: L,
}

/// The equations of the cells of a block, row by row.
pub trait Rows: Copy {
    /// `d`; 0 for cells that are not inside.
    fn diagonal<L: Lanes>(self, row: usize) -> L;

    /// `1/d`; 0 for cells that are not inside.
    fn inverse<L: Lanes>(self, row: usize) -> L;

    /// `Σ wx` over the neighbours, whether a cell is inside or not.
    fn inflow<L: Lanes>(self, row: usize, around: [L; 6]) -> L;

    /// `wx` over one face, for cells that are inside.
    fn flow<L: Lanes>(self, face: usize, row: usize, beside: L) -> L;

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
    fn part<L: Lanes>(&self, _: u32, counts: &Halo<u8>, y: usize, z: usize) -> Part<L> {
        let own = L::of_bytes(counts.own(y, z));
        let fill = L::splat(1.0).where_positive(own);
        let (mut to, mut fixed) = ([L::splat(0.0); 6], own);
        for (to, beside) in to.iter_mut().zip(counts.around(y, z)) {
            *to = fill.where_positive(L::of_bytes(beside));
            fixed = fixed.minus(*to);
        }
        Part { to, fixed, fill }
    }

    #[inline(always)]
    fn counts(&self, slot: u32, neighbours: &[u32; 6]) -> Halo<u8> {
        let mut counts = Halo::new();
        counts.gather(&self.neighbours, slot, neighbours);
        counts
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

    #[inline(always)]
    fn flow<L: Lanes>(self, _: usize, row: usize, beside: L) -> L {
        beside.where_positive(self.diagonal(row))
    }
}

/// What a block of a coarser level has for each cell.
#[derive(Debug, Clone)]
pub struct Weights {
    /// To the neighbours, −x +x −y +y −z +z.
    pub to: [Block<f32>; 6],
    /// To fixed values.
    pub fixed: Block<f32>,
    /// Sum of the weights; 0 for cells that are not inside.
    pub diagonal: Block<f32>,
    /// Its inverse; 0 for cells that are not inside.
    pub inverse: Block<f32>,
}

impl Weights {
    /// Those of no cell.
    pub const NONE: Self =
        Self { to: [[[0.0; 8]; 64]; 6], fixed: [[0.0; 8]; 64], diagonal: [[0.0; 8]; 64], inverse: [[0.0; 8]; 64] };
}

/// A coarser level.
#[derive(Debug, Clone, Default)]
pub struct Weighted {
    /// Weights, by slot.
    pub blocks: Vec<Weights>,
    /// Share of each cell that is inside, by slot.
    pub fill: Vec<Block<f32>>,
}

impl Stencil for Weighted {
    type Rows<'a> = &'a Weights;

    #[inline(always)]
    fn rows(&self, slot: u32) -> &Weights {
        &self.blocks[slot as usize]
    }

    #[inline(always)]
    fn part<L: Lanes>(&self, slot: u32, _: &Halo<u8>, y: usize, z: usize) -> Part<L> {
        let (weights, row) = (&self.blocks[slot as usize], row(y, z));
        let mut to = [L::splat(0.0); 6];
        for (to, from) in to.iter_mut().zip(&weights.to) {
            *to = L::of(&from[row]);
        }
        Part { to, fixed: L::of(&weights.fixed[row]), fill: L::of(&self.fill[slot as usize][row]) }
    }

    #[inline(always)]
    fn counts(&self, _: u32, _: &[u32; 6]) -> Halo<u8> {
        Halo::new()
    }

    fn resize(&mut self, slots: usize) {
        self.blocks.resize(slots, Weights::NONE);
        self.fill.resize(slots, [[0.0; 8]; 64]);
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
        let flow = |face: usize, x: L| self.flow(face, row, x);
        let (x, y) = (flow(0, x0).plus(flow(1, x1)), flow(2, y0).plus(flow(3, y1)));
        x.plus(y).plus(flow(4, z0).plus(flow(5, z1)))
    }

    #[inline(always)]
    fn flow<L: Lanes>(self, face: usize, row: usize, beside: L) -> L {
        L::of(&self.to[face][row]).times(beside)
    }
}
