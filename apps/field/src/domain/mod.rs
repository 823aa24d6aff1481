//! A domain that is kept: what its cells are, and the equations of all levels that follow from them, block by block.
//!
//! [`Domain::set`] and [`Domain::update`] say what has changed; equations are made anew for the blocks that this concerns
//! and for those they are merged into. A solution starts from the one before; after [`Domain::forget`] it is the same to the
//! bit as that of a domain made anew, and [`Domain::cascade`] always is. Blocks are aligned with the world's lattice,
//! so that a domain may grow to any side; where nothing is inside there is no block.

mod block;
mod cascade;
mod conjugate_gradients;
mod direct;
mod lanes;
mod lattice;
mod level;
mod stencil;

use elk_geometry::bricks::{BRICK, BRICK_CELLS, brick_of, cell_of};
use elk_geometry::{Region, Voxel};

use crate::problem::{Cell, Problem};
use block::{Block, Halo, row};
use conjugate_gradients::{System, Vectors, residual};
use direct::{Direct, MOST_CELLS};
use lattice::NONE;
use level::Level;
use stencil::{Counted, SIXTIETHS, Weighted};

/// What it took to solve.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Convergence {
    /// Iterations of conjugate gradients.
    pub iterations: usize,
    /// ‖b − Aψ‖ / ‖b‖, computed from the field as it is; ‖b − Aψ‖ where b is zero.
    pub residual: f64,
}

/// A domain with its boundary values, and ψ.
///
/// ```
/// use elk_field::{Cell, Domain};
/// use elk_geometry::Voxel;
///
/// // A channel along x, source at one end, sink at the other.
/// let mut domain = Domain::new();
/// for x in 0..9 {
///     let cell = match x {
///         0 => Cell::Source,
///         8 => Cell::Sink,
///         _ => Cell::Inside,
///     };
///     domain.set(Voxel::new(x, 0, 0), cell);
/// }
/// domain.solve(1e-6, || false);
/// assert!((domain.psi(Voxel::new(4, 0, 0)) - 0.5).abs() < 1e-5);
///
/// // It turns out to be longer.
/// domain.set(Voxel::new(8, 0, 0), Cell::Inside);
/// domain.set(Voxel::new(16, 0, 0), Cell::Sink);
/// (9..16).for_each(|x| domain.set(Voxel::new(x, 0, 0), Cell::Inside));
/// domain.solve(1e-6, || false);
/// assert!((domain.psi(Voxel::new(4, 0, 0)) - 0.75).abs() < 1e-5);
/// ```
#[derive(Debug, Clone)]
pub struct Domain {
    cells: Vec<Block<Cell>>,
    /// Sums of squares of the right-hand side.
    squares: Vec<f32>,
    /// The finest level: its right-hand side is the residual, its solution the preconditioned one.
    fine: Level<Counted>,
    coarse: Vec<Level<Weighted>>,
    direct: Direct,
    /// ψ, and what else a solution keeps of the finest level.
    vectors: Vectors,
    /// The same of the next level.
    coarse_vectors: Vectors,
    /// Blocks of which cells have changed.
    changed: Vec<u32>,
}

impl Default for Domain {
    fn default() -> Self {
        Self::new()
    }
}

impl Domain {
    /// One in which all is outside.
    pub fn new() -> Self {
        let mut domain = Self {
            cells: Vec::new(),
            squares: Vec::new(),
            fine: Level::new(),
            coarse: Vec::new(),
            direct: Direct::default(),
            vectors: Vectors::default(),
            coarse_vectors: Vectors::default(),
            changed: Vec::new(),
        };
        domain.resize();
        domain
    }

    /// That of a problem.
    pub fn of(problem: &Problem) -> Self {
        let mut domain = Self::new();
        domain.update(problem);
        domain
    }

    /// What a voxel is.
    pub fn cell(&self, voxel: Voxel) -> Cell {
        let cell = cell_of(voxel);
        self.cells[self.fine.lattice.slot(brick_of(voxel)) as usize][cell / 8][cell % 8]
    }

    /// ψ of a voxel, as the last solution has it; 0 outside.
    pub fn psi(&self, voxel: Voxel) -> f32 {
        let cell = cell_of(voxel);
        self.vectors.psi[self.fine.lattice.slot(brick_of(voxel)) as usize][cell / 8][cell % 8]
    }

    /// Says what a voxel is from now on.
    pub fn set(&mut self, voxel: Voxel, cell: Cell) {
        if self.cell(voxel) == cell {
            return;
        }
        let slot = self.slot(brick_of(voxel));
        self.resize();
        let at = cell_of(voxel);
        self.cells[slot as usize][at / 8][at % 8] = cell;
        self.changed.push(slot);
    }

    /// Says what the voxels of a block are from now on, in the order of [`cell_of`]; `position` is that of [`brick_of`].
    pub fn set_block(&mut self, position: Voxel, cells: &[Cell; BRICK_CELLS]) {
        let cells = std::array::from_fn(|row| std::array::from_fn(|i| cells[8 * row + i]));
        self.put(position, cells);
        self.resize();
    }

    /// As [`Domain::set_block`]; ψ is `psi` in what was outside.
    pub(crate) fn open_block(&mut self, position: Voxel, cells: &[Cell; BRICK_CELLS], psi: f32) {
        let before = *self.block(position).0;
        self.set_block(position, cells);
        let slot = self.fine.lattice.slot(position) as usize;
        for (cell, n) in before.as_flattened().iter().zip(0..).filter(|_| slot != NONE as usize) {
            if *cell == Cell::Outside && cells[n] != Cell::Outside {
                self.vectors.psi[slot][n / 8][n % 8] = psi;
            }
        }
    }

    /// Makes the cells of a block these.
    fn put(&mut self, position: Voxel, cells: Block<Cell>) {
        if cells != self.cells[self.fine.lattice.slot(position) as usize] {
            let slot = self.slot(position);
            self.cells[slot as usize] = cells;
            self.changed.push(slot);
        }
    }

    /// The positions of all blocks in which a voxel is not outside, and of some in which all are.
    pub fn blocks(&self) -> impl Iterator<Item = Voxel> {
        self.fine.lattice.positions()
    }

    /// What the voxels of the block at a position are, and their ψ.
    pub(crate) fn block(&self, position: Voxel) -> (&Block<Cell>, &Block<f32>) {
        let slot = self.fine.lattice.slot(position) as usize;
        (&self.cells[slot], &self.vectors.psi[slot])
    }

    /// Makes it the domain of a problem. Only blocks that differ are touched.
    pub fn update(&mut self, problem: &Problem) {
        let region = problem.region();
        let last = region.voxel(region.len() - 1);
        let (first, last) = (brick_of(region.origin()).to_array(), brick_of(last).to_array());
        self.fine.lattice.settle();
        for &slot in self.fine.lattice.order() {
            let position = self.fine.lattice.position(slot).to_array();
            if (0..3).any(|a| !(first[a]..=last[a]).contains(&position[a])) {
                self.cells[slot as usize] = [[Cell::Outside; 8]; 64];
                self.changed.push(slot);
            }
        }
        for z in first[2]..=last[2] {
            for y in first[1]..=last[1] {
                for x in first[0]..=last[0] {
                    let position = Voxel::new(x, y, z);
                    self.put(position, cells_of(problem, position));
                }
            }
        }
        self.resize();
    }

    /// ψ of each voxel of a region, by index; 0 outside the domain.
    pub fn psi_of(&self, region: &Region) -> Vec<f32> {
        let mut psi = vec![0.0; region.len()];
        for (i, voxel, length) in runs(region) {
            let at = cell_of(voxel);
            let from = &self.block(brick_of(voxel)).1[at / 8][at % 8..];
            psi[i..i + length].copy_from_slice(&from[..length]);
        }
        psi
    }

    /// Takes over ψ of each voxel of a region, by index, as another solver has found it for the same domain.
    pub fn take_psi(&mut self, region: &Region, psi: &[f32]) {
        self.settle();
        for (i, voxel, length) in runs(region) {
            let (at, slot) = (cell_of(voxel), self.fine.lattice.slot(brick_of(voxel)));
            if let Some(psi) = psi.get(i..i + length).filter(|_| slot != NONE) {
                self.vectors.psi[slot as usize][at / 8][at % 8..][..length].copy_from_slice(psi);
            }
        }
    }

    /// As [`Domain::psi_of`], from a domain that is not needed any more: two of its vectors are given back before ψ's memory is
    /// taken.
    pub(crate) fn into_psi_of(mut self, region: &Region) -> Vec<f32> {
        self.vectors.give_back();
        self.psi_of(region)
    }

    /// Forgets ψ: the next solution starts from nothing.
    pub fn forget(&mut self) {
        self.settle();
        for &slot in self.fine.lattice.order() {
            let cells = self.cells[slot as usize].iter().flatten();
            for (psi, cell) in self.vectors.psi[slot as usize].iter_mut().flatten().zip(cells) {
                *psi = cell.fixed().unwrap_or(0.0);
            }
        }
    }

    /// Number of unknowns.
    #[cfg(test)]
    pub fn unknowns(&mut self) -> usize {
        self.settle();
        self.fine.count()
    }

    /// Solves for ψ (thesis 6.2.5), from the ψ before, until the residual is at most `tolerance` of the right-hand side, or
    /// somebody is `stopping`.
    pub fn solve(&mut self, tolerance: f64, stopping: impl Fn() -> bool) -> Convergence {
        self.settle();
        let scale = self.scale();
        let Self { fine, coarse, direct, vectors, .. } = self;
        let square = residual(fine, &vectors.psi);
        let mut system = System { fine, coarse, open: 2.0, direct };
        let iterations = system.solve(vectors, square, (tolerance * scale).powi(2), stopping);
        Convergence { iterations, residual: self.residual() }
    }

    /// Nearly solves for ψ, from nothing: in full on cells of twice the edge, until the residual there is at most `tolerance` of
    /// the right-hand side, or somebody is `stopping`; then interpolated, and smoothed (Bornemann and Deuflhard, 1996). Answers
    /// the iterations on those cells. Within 0.03 of a solution on the scale 0 to 1 in furnished rooms, for 0.16 to 0.4 of its cost;
    /// [`Domain::solve`] goes on from there.
    pub fn cascade(&mut self, tolerance: f64, stopping: impl Fn() -> bool) -> usize {
        self.settle();
        let slots = self.fine.lattice.order().iter().copied();
        let given: Vec<u32> = slots.filter(|slot| self.squares[*slot as usize] > 0.0).collect();
        self.fine.b.fill([[0.0; 8]; 64]);
        for &slot in &given {
            self.fine.b[slot as usize] = self.sources_beside(slot);
        }
        let Self { fine, coarse, direct, vectors, coarse_vectors, .. } = self;
        let iterations = cascade::solve(fine, &given, (coarse, &*direct), coarse_vectors, tolerance, stopping);
        std::mem::swap(&mut fine.x, &mut vectors.psi);
        for &slot in fine.lattice.order() {
            let cells =
                self.cells[slot as usize].as_flattened().iter().zip(vectors.psi[slot as usize].as_flattened_mut());
            cells.filter(|(cell, _)| **cell == Cell::Source).for_each(|(_, psi)| *psi = 1.0);
        }
        iterations
    }

    /// ‖b − Aψ‖ / ‖b‖, of ψ as it is; ‖b − Aψ‖ where b is zero.
    pub fn residual(&mut self) -> f64 {
        self.settle();
        residual(&mut self.fine, &self.vectors.psi).sqrt() / self.scale()
    }

    /// The right-hand side of a block: how many sources each cell has beside it.
    fn sources_beside(&self, slot: u32) -> Block<f32> {
        let mut halo = Halo::new();
        halo.gather(&self.cells, slot, self.fine.lattice.neighbours(slot));
        let sources =
            |y, z, i: usize| halo.around(y, z).iter().filter(|beside| beside[i] == Cell::Source).count() as f32;
        let number = |y, z, i| if halo.own(y, z)[i] == Cell::Inside { sources(y, z, i) } else { 0.0 };
        std::array::from_fn(|row| std::array::from_fn(|i| number(row % 8, row / 8, i)))
    }

    /// ‖b‖, or 1 where that is zero.
    fn scale(&self) -> f64 {
        let squares = self.fine.lattice.order().iter().map(|slot| f64::from(self.squares[*slot as usize]));
        let scale = squares.sum::<f64>().sqrt();
        if scale > 0.0 { scale } else { 1.0 }
    }

    /// The slot of the block at a position; a new one if there is none.
    fn slot(&mut self, position: Voxel) -> u32 {
        let slot = self.fine.lattice.insert(position);
        self.cells.resize(self.fine.lattice.slots(), [[Cell::Outside; 8]; 64]);
        slot
    }

    /// Makes the equations those of the cells.
    fn settle(&mut self) {
        if self.changed.is_empty() && !self.coarse.is_empty() {
            return;
        }
        self.fine.lattice.settle();
        let concerned = self.fine.lattice.with_neighbours(&std::mem::take(&mut self.changed));
        for slot in &concerned {
            self.count(*slot);
        }
        self.coarsen(&concerned);
        for slot in concerned {
            if self.cells[slot as usize] == [[Cell::Outside; 8]; 64] {
                self.fine.lattice.remove(slot);
            }
        }
        self.fine.lattice.settle();
    }

    /// Counts the neighbours of the cells of a block, and gives the cells that are not inside their values.
    fn count(&mut self, slot: u32) {
        let mut halo = Halo::new();
        halo.gather(&self.cells, slot, self.fine.lattice.neighbours(slot));
        let slot = slot as usize;
        let (mut cells, mut square) = (0, 0);
        for z in 0..8 {
            for y in 0..8 {
                let (row, own, around) = (row(y, z), halo.own(y, z), halo.around(y, z));
                for i in 0..8 {
                    let inside = own[i] == Cell::Inside;
                    let beside = |is: fn(Cell) -> bool| around.iter().map(|a| u8::from(is(a[i]))).sum::<u8>();
                    let neighbours = u8::from(inside) * beside(|c| c != Cell::Outside);
                    let sources = u32::from(u8::from(inside) * beside(|c| c == Cell::Source));
                    self.fine.stencil.neighbours[slot][row][i] = neighbours;
                    self.fine.stencil.sixtieths[slot][row][i] = SIXTIETHS[usize::from(neighbours)];
                    cells += u32::from(neighbours > 0);
                    square += sources * sources;
                    if !inside {
                        self.vectors.psi[slot][row][i] = own[i].fixed().unwrap_or(0.0);
                    }
                }
            }
        }
        self.fine.cells[slot] = cells;
        self.squares[slot] = square as f32;
    }

    /// Brings the coarser levels into line with the blocks of the finest that are `concerned`.
    fn coarsen(&mut self, concerned: &[u32]) {
        if self.coarse.is_empty() {
            self.coarse.push(Level::new());
        }
        let mut concerned = level::coarsen(&self.fine, concerned, 2.0, &mut self.coarse[0]);
        let (mut last, mut open) = (0, 2.0);
        while self.coarse[last].count() > MOST_CELLS {
            if self.coarse.len() == last + 1 {
                self.coarse.push(Level::new());
                concerned = self.coarse[last].lattice.order().to_vec();
            }
            open *= 2.0;
            let (fine, coarse) = self.coarse.split_at_mut(last + 1);
            let next = level::coarsen(&fine[last], &concerned, open, &mut coarse[0]);
            fine[last].prune(&concerned);
            (concerned, last) = (next, last + 1);
        }
        self.coarse.truncate(last + 1);
        self.coarse[last].prune(&concerned);
        self.direct = Direct::of(&self.coarse[last]);
    }

    fn resize(&mut self) {
        self.fine.resize();
        let slots = self.fine.lattice.slots();
        self.cells.resize(slots, [[Cell::Outside; 8]; 64]);
        self.squares.resize(slots, 0.0);
        self.vectors.psi.resize(slots, [[0.0; 8]; 64]);
    }
}

/// The voxels of a region by what of a row of a block each run of them is: the index of the first, the voxel, and how many.
fn runs(region: &Region) -> impl Iterator<Item = (usize, Voxel, usize)> {
    let ([nx, ny, nz], origin) = (region.dim(), region.origin());
    let first = (origin.x & 7) as usize;
    (0..ny * nz).flat_map(move |row| {
        let starts = std::iter::once(0).chain((8 - first..nx).step_by(8));
        starts.map(move |x| {
            let voxel = origin + Voxel::new(x as i32, (row % ny) as i32, (row / ny) as i32);
            (row * nx + x, voxel, (8 - (first + x) % 8).min(nx - x))
        })
    })
}

/// What a problem has for the cells of the block at a position; outside of its region all is outside.
fn cells_of(problem: &Problem, position: Voxel) -> Block<Cell> {
    let mut cells = [[Cell::Outside; 8]; 64];
    let region = problem.region();
    let [nx, ny, nz] = region.dim().map(|n| n as i32);
    let corner = Voxel::new(position.x * BRICK, position.y * BRICK, position.z * BRICK) - region.origin();
    let along = |from: i32, n: i32| (-from).max(0)..(n - from).min(BRICK);
    let x = along(corner.x, nx);
    for z in along(corner.z, nz) {
        for y in along(corner.y, ny) {
            let start = ((corner.z + z) as usize * ny as usize + (corner.y + y) as usize) * nx as usize;
            let from = start + (corner.x + x.start) as usize;
            let row = &mut cells[row(y as usize, z as usize)][x.start as usize..x.end as usize];
            row.copy_from_slice(&problem.cells()[from..from + row.len()]);
        }
    }
    cells
}

#[cfg(test)]
mod tests;
