//! One level of the multigrid hierarchy: its equations, and what a cycle does on it and between it and the next.
//!
//! Cells are merged 2 × 2 × 2, aligned with the world's lattice, so that a level does not change where the domain grows.
//! A residual is the sum over what was merged; a correction is interpolated linearly towards the neighbours that faces are
//! open to (Kwak, *V-cycle multigrid for cell-centered finite differences*, 1999), so that nothing leaks through walls.

use elk_geometry::Voxel;

use super::block::{Block, Halo, Row, row, sum};
use super::lanes::{Lanes, wide};
use super::lattice::{Lattice, NONE};
use super::stencil::{Part, Rows, Stencil, Weighted, Weights, around};

/// Share of a cell's correction that a sweep takes. Along its rows a sweep is Jacobi's, which does not smooth undamped.
const OMEGA: f32 = 0.95;
/// Sweeps over a block while it is at hand, each over the even rows and the odd ones.
const SWEEPS: usize = 2;

/// Blocks of cells with their equations, and `Ax = b` to be solved there.
#[derive(Debug, Clone)]
pub struct Level<S> {
    /// The blocks.
    pub lattice: Lattice,
    /// `A`.
    pub stencil: S,
    /// Right-hand side, by slot.
    pub b: Vec<Block<f32>>,
    /// Solution, by slot.
    pub x: Vec<Block<f32>>,
    /// Cells that have equations, by slot.
    pub cells: Vec<u32>,
}

impl<S: Stencil + Default> Level<S> {
    /// One without cells.
    pub fn new() -> Self {
        let mut level =
            Self { lattice: Lattice::new(), stencil: S::default(), b: Vec::new(), x: Vec::new(), cells: Vec::new() };
        level.resize();
        level
    }

    /// Makes room for all slots.
    pub fn resize(&mut self) {
        let slots = self.lattice.slots();
        self.stencil.resize(slots);
        self.b.resize(slots, [[0.0; 8]; 64]);
        self.x.resize(slots, [[0.0; 8]; 64]);
        self.cells.resize(slots, 0);
    }
}

impl<S> Level<S> {
    /// Takes away those of some blocks in which there is no equation.
    pub fn prune(&mut self, slots: &[u32]) {
        for &slot in slots {
            if self.cells[slot as usize] == 0 {
                self.lattice.remove(slot);
            }
        }
        self.lattice.settle();
    }

    /// Number of cells that have equations.
    pub fn count(&self) -> usize {
        self.lattice.order().iter().map(|s| self.cells[*s as usize] as usize).sum()
    }
}

/// One sweep after the other over a block whose surroundings stay as they are: even rows first, or odd ones.
///
/// Rows of one kind have none of their own beside them: a sweep is Gauss-Seidel's across rows and Jacobi's along them.
#[inline(always)]
fn sweep<L: Lanes>(rows: impl Rows, b: &Block<f32>, x: &mut Halo<f32>, first: usize) {
    for half in 0..2 * SWEEPS {
        for z in 0..8 {
            for pair in 0..4 {
                let y = 2 * pair + (z + half + first) % 2;
                let new: L = rows.relaxed(y, z, L::of(&b[row(y, z)]), x, OMEGA);
                new.to(x.own_mut(y, z));
            }
        }
    }
}

#[inline(always)]
fn put(x: &mut Block<f32>, halo: &Halo<f32>) {
    for z in 0..8 {
        for y in 0..8 {
            x[row(y, z)] = *halo.own(y, z);
        }
    }
}

wide! {
    /// Smooths from zero, block by block, and sums residuals into the coarser right-hand side.
    ///
    /// What comes later in the order is still zero when the residual of a block is summed: a later block adds what flows out
    /// of it, so that nothing is read twice.
    pub fn descend[L, S: Stencil](fine: &mut Level<S>, coarse: &mut Level<Weighted>) {
        for &slot in fine.lattice.order() {
            let [x0, _, y0, _, z0, _] = *fine.lattice.neighbours(slot);
            let mut halo = Halo::new();
            halo.surround(&fine.x, &[x0, NONE, y0, NONE, z0, NONE]);
            let (rows, b) = (fine.stencil.rows(slot), &fine.b[slot as usize]);
            sweep::<L>(rows, b, &mut halo, 0);
            put(&mut fine.x[slot as usize], &halo);
            let position = fine.lattice.position(slot);
            let (into, octant) = (coarse.lattice.slot(parent(position)), octant(position));
            if into == NONE {
                continue;
            }
            restrict::<L>(rows, b, &halo, octant, &mut coarse.b[into as usize]);
            for (axis, before) in [x0, y0, z0].into_iter().enumerate() {
                let into = if octant[axis] == 1 { into } else { coarse.lattice.neighbours(into)[2 * axis] };
                if before != NONE && into != NONE {
                    let mut octant = octant;
                    octant[axis] ^= 1;
                    flow_back::<L>(fine.stencil.rows(before), &halo, axis, octant, &mut coarse.b[into as usize]);
                }
            }
        }
    }
}

/// Sums the residuals of a block into an octant of its parent.
#[inline(always)]
fn restrict<L: Lanes>(rows: impl Rows, b: &Block<f32>, x: &Halo<f32>, [ox, oy, oz]: [usize; 3], to: &mut Block<f32>) {
    for z in 0..4 {
        for y in 0..4 {
            let mut sums = L::splat(0.0);
            for (y, z) in [(2 * y, 2 * z), (2 * y + 1, 2 * z), (2 * y, 2 * z + 1), (2 * y + 1, 2 * z + 1)] {
                sums = sums.plus(rows.residual(y, z, L::of(&b[row(y, z)]), x));
            }
            to[row(4 * oy + y, 4 * oz + z)][4 * ox..4 * ox + 4].copy_from_slice(&pairs(sums));
        }
    }
}

/// Adds what flows out of a block into the one before it along an axis, `rows`, to that one's octant of its parent.
#[inline(always)]
fn flow_back<L: Lanes>(rows: impl Rows, x: &Halo<f32>, axis: usize, [ox, oy, oz]: [usize; 3], to: &mut Block<f32>) {
    let face = 2 * axis + 1;
    for n in 0..8 {
        match axis {
            0 => {
                for y in 0..8 {
                    let mut flow = [0.0; 8];
                    rows.flow(face, row(y, n), L::splat(x.own(y, n)[0])).to(&mut flow);
                    to[row(4 * oy + y / 2, 4 * oz + n / 2)][4 * ox + 3] += flow[7];
                }
            }
            1 => add(to, row(4 * oy + 3, 4 * oz + n / 2), 4 * ox, rows.flow(face, row(7, n), L::of(x.own(0, n)))),
            _ => add(to, row(4 * oy + n / 2, 4 * oz + 3), 4 * ox, rows.flow(face, row(n, 7), L::of(x.own(n, 0)))),
        }
    }
}

/// Adds pairs of a row to four cells of another.
#[inline(always)]
fn add<L: Lanes>(to: &mut Block<f32>, row: usize, first: usize, lanes: L) {
    for (to, pair) in to[row][first..first + 4].iter_mut().zip(pairs(lanes)) {
        *to += pair;
    }
}

wide! {
    /// Smooths from the solution that is there, in the order of [`descend`].
    pub fn smooth_forwards[L, S: Stencil](level: &mut Level<S>) {
        let mut halo = Halo::new();
        for &slot in level.lattice.order() {
            halo.gather(&level.x, slot, level.lattice.neighbours(slot));
            sweep::<L>(level.stencil.rows(slot), &level.b[slot as usize], &mut halo, 0);
            put(&mut level.x[slot as usize], &halo);
        }
    }
}

wide! {
    /// Smooths in the opposite order; answers the products of the solution with the right-hand side and with `other`, where
    /// one is asked for.
    pub fn smooth_backwards[L, S: Stencil](level: &mut Level<S>, other: Option<&[Block<f32>]>) -> (f64, f64) {
        let (mut halo, mut products) = (Halo::new(), (0.0, 0.0));
        for &slot in level.lattice.order().iter().rev() {
            halo.gather(&level.x, slot, level.lattice.neighbours(slot));
            let b = &level.b[slot as usize];
            sweep::<L>(level.stencil.rows(slot), b, &mut halo, 1);
            let x = &mut level.x[slot as usize];
            put(x, &halo);
            if let Some(other) = other {
                products.0 += dot::<L>(x, b);
                products.1 += dot::<L>(x, &other[slot as usize]);
            }
        }
        products
    }
}

/// The product of two blocks.
#[inline(always)]
fn dot<L: Lanes>(one: &Block<f32>, other: &Block<f32>) -> f64 {
    let mut sums = L::splat(0.0);
    for (one, other) in one.iter().zip(other) {
        sums = sums.plus(L::of(one).times(L::of(other)));
    }
    sum(sums)
}

/// The position of the block that a block is merged into.
pub fn parent(position: Voxel) -> Voxel {
    Voxel::new(position.x >> 1, position.y >> 1, position.z >> 1)
}

/// Which half of its parent a block is along x, y and z.
pub fn octant(position: Voxel) -> [usize; 3] {
    position.to_array().map(|c| (c & 1) as usize)
}

wide! {
    /// Adds the coarser solution, interpolated. `open` is the weight of a face that is open all over.
    pub fn prolong[L, S: Stencil](coarse: &Level<Weighted>, open: f32, fine: &mut Level<S>) {
        let mut halo = Halo::new();
        for &slot in coarse.lattice.order() {
            halo.gather(&coarse.x, slot, coarse.lattice.neighbours(slot));
            let weights = &coarse.stencil.blocks[slot as usize];
            let children = children(coarse.lattice.position(slot)).map(|child| fine.lattice.slot(child));
            for z in 0..8 {
                for y in 0..8 {
                    let corrections = corrections::<L>(weights, &halo, y, z, 0.25 / open);
                    for (side, [low, high]) in corrections.iter().enumerate() {
                        let to = row(2 * (y % 4) + side % 2, 2 * (z % 4) + side / 2);
                        for half in 0..2 {
                            let child = children[z / 4 * 4 + y / 4 * 2 + half];
                            if child != NONE {
                                let mut both = [0.0; 8];
                                for i in 0..4 {
                                    (both[2 * i], both[2 * i + 1]) = (low[4 * half + i], high[4 * half + i]);
                                }
                                let inside = fine.stencil.rows(child).inverse::<L>(to);
                                let x = &mut fine.x[child as usize][to];
                                L::of(x).plus(L::of(&both).where_positive(inside)).to(x);
                            }
                        }
                    }
                }
            }
        }
    }
}

/// The positions of the blocks that are merged into one, x fastest.
fn children(position: Voxel) -> [Voxel; 8] {
    let Voxel { x, y, z } = position;
    std::array::from_fn(|i| {
        let i = i as i32;
        Voxel::new(2 * x + (i & 1), 2 * y + (i >> 1 & 1), 2 * z + (i >> 2))
    })
}

/// What the eight children of each cell of a row take over: those at its low x and at its high x, each for low y and low
/// z, high y and low z, low y and high z, high y and high z.
#[inline(always)]
fn corrections<L: Lanes>(weights: &Weights, x: &Halo<f32>, y: usize, z: usize, share: f32) -> [[Row<f32>; 2]; 4] {
    let (own, [x0, x1, y0, y1, z0, z1]) = (L::of(x.own(y, z)), around::<L>(x, y, z));
    let mut towards = [L::splat(0.0); 6];
    for (face, beside) in [x0, x1, y0, y1, z0, z1].into_iter().enumerate() {
        let weight = L::of(&weights.to[face][row(y, z)]).times(L::splat(share));
        towards[face] = weight.times(beside.minus(own));
    }
    let [x0, x1, y0, y1, z0, z1] = towards;
    let (low, high) = (own.plus(x0), own.plus(x1));
    let mut corrections = [[[0.0; 8]; 2]; 4];
    for (side, into) in [(y0, z0), (y1, z0), (y0, z1), (y1, z1)].into_iter().zip(&mut corrections) {
        let both = side.0.plus(side.1);
        low.plus(both).to(&mut into[0]);
        high.plus(both).to(&mut into[1]);
    }
    corrections
}

/// Brings the equations of the coarser level into line with those of the blocks in `changed`; answers which of its blocks
/// that concerns. Blocks come into being there where there were none. `open` is the weight there of a face that is open all
/// over.
///
/// Weights are conductances: those of the faces between two coarse cells in parallel, and in series with them half of a
/// fine cell on either side, as wide as it is filled and at least as the face is open: what is thin behind an open face is
/// short, not narrow. What is fixed stays as near as it is, which takes fewer iterations than to move it away. So a door stays as open as it is, however coarse cells become around it,
/// and a flat domain is one in the plane as soon as its height is that of a cell.
pub fn coarsen<S: Stencil>(fine: &Level<S>, changed: &[u32], open: f32, coarse: &mut Level<Weighted>) -> Vec<u32> {
    let parents: Vec<u32> =
        changed.iter().map(|slot| coarse.lattice.insert(parent(fine.lattice.position(*slot)))).collect();
    coarse.lattice.settle();
    coarse.resize();
    let concerned = coarse.lattice.with_neighbours(&parents);
    for &slot in &concerned {
        for child in children(coarse.lattice.position(slot)).map(|child| fine.lattice.slot(child)) {
            if child != NONE {
                let Weighted { blocks, fill } = &mut coarse.stencil;
                merge(fine, child, &mut blocks[slot as usize], &mut fill[slot as usize]);
            }
        }
    }
    let mut halo = Halo::new();
    for &slot in &concerned {
        let Weighted { blocks, fill } = &mut coarse.stencil;
        halo.gather(fill, slot, coarse.lattice.neighbours(slot));
        coarse.cells[slot as usize] = connect(&mut blocks[slot as usize], &mut fill[slot as usize], &halo, open);
    }
    concerned
}

/// Puts half cells in series with the sums of the faces of a block, and answers how many cells have equations.
fn connect(weights: &mut Weights, own: &mut Block<f32>, fill: &Halo<f32>, open: f32) -> u32 {
    let mut cells = 0;
    for z in 0..8 {
        for y in 0..8 {
            let (row, around) = (row(y, z), fill.around(y, z));
            for i in 0..8 {
                let mut sum = weights.fixed[row][i];
                for (to, beside) in weights.to.iter_mut().zip(around) {
                    let half = |fill: f32| (4.0 * open * fill).max(2.0 * to[row][i]);
                    to[row][i] = in_series(to[row][i], in_series(half(own[row][i]), half(beside[i])));
                    sum += to[row][i];
                }
                if sum == 0.0 {
                    // Nothing is left of a part that ends inside of a cell.
                    own[row][i] = 0.0;
                }
                weights.diagonal[row][i] = sum;
                weights.inverse[row][i] = if sum > 0.0 { 1.0 / sum } else { 0.0 };
                cells += u32::from(sum > 0.0);
            }
        }
    }
    cells
}

/// Two conductances in series.
#[inline(always)]
fn in_series(one: f32, other: f32) -> f32 {
    if one > 0.0 && other > 0.0 { one * other / (one + other) } else { 0.0 }
}

wide! {
    /// Adds up what a block is merged into in an octant of its parent: faces, what is fixed, and what is filled.
    fn merge[L, S: Stencil](fine: &Level<S>, slot: u32, coarse: &mut Weights, fill: &mut Block<f32>) {
        let counts = fine.stencil.counts(slot, fine.lattice.neighbours(slot));
        let [ox, oy, oz] = octant(fine.lattice.position(slot));
        for z in 0..4 {
            for y in 0..4 {
                // Closures are not compiled for the registers that are here: what is merged is written out.
                let a: Part<L> = fine.stencil.part(slot, &counts, 2 * y, 2 * z);
                let b: Part<L> = fine.stencil.part(slot, &counts, 2 * y + 1, 2 * z);
                let c: Part<L> = fine.stencil.part(slot, &counts, 2 * y, 2 * z + 1);
                let d: Part<L> = fine.stencil.part(slot, &counts, 2 * y + 1, 2 * z + 1);
                let faces = [
                    every_second(four(a.to[0], b.to[0], c.to[0], d.to[0]), 0),
                    every_second(four(a.to[1], b.to[1], c.to[1], d.to[1]), 1),
                    pairs(a.to[2].plus(c.to[2])),
                    pairs(b.to[3].plus(d.to[3])),
                    pairs(a.to[4].plus(b.to[4])),
                    pairs(c.to[5].plus(d.to[5])),
                ];
                let (to, columns) = (row(4 * oy + y, 4 * oz + z), 4 * ox..4 * ox + 4);
                for (into, face) in coarse.to.iter_mut().zip(&faces) {
                    into[to][columns.clone()].copy_from_slice(face);
                }
                coarse.fixed[to][columns.clone()].copy_from_slice(&pairs(four(a.fixed, b.fixed, c.fixed, d.fixed)));
                let filled = four(a.fill, b.fill, c.fill, d.fill).times(L::splat(0.125));
                fill[to][columns].copy_from_slice(&pairs(filled));
            }
        }
    }
}

/// The sum of four rows.
#[inline(always)]
fn four<L: Lanes>(a: L, b: L, c: L, d: L) -> L {
    a.plus(b).plus(c.plus(d))
}

/// Every second number, from the first or from the second on.
#[inline(always)]
fn every_second<L: Lanes>(lanes: L, first: usize) -> [f32; 4] {
    let mut row = [0.0; 8];
    lanes.to(&mut row);
    std::array::from_fn(|i| row[2 * i + first])
}

/// The sums of pairs.
#[inline(always)]
pub fn pairs<L: Lanes>(lanes: L) -> [f32; 4] {
    let mut row = [0.0; 8];
    lanes.to(&mut row);
    std::array::from_fn(|i| row[2 * i] + row[2 * i + 1])
}
