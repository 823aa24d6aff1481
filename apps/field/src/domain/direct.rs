//! The coarsest level, solved by Cholesky's decomposition.

use nalgebra::{Cholesky, DMatrix, DVector, Dyn};

use elk_geometry::Voxel;
use elk_geometry::bricks::{brick_of, cell_of, voxel_at};
use elk_geometry::voxel::FACES;

use super::level::Level;
use super::stencil::Weighted;

/// Cells that are few enough.
pub const MOST_CELLS: usize = 64;
/// What is added to the diagonal, relative to it: parts that nothing fixes would have no solution.
const SHIFT: f64 = 1e-6;

/// The cells with equations, and the decomposition of those.
#[derive(Debug, Clone, Default)]
pub struct Direct {
    cells: Vec<(usize, usize)>,
    decomposition: Option<Cholesky<f64, Dyn>>,
}

impl Direct {
    /// Decomposes the equations of a level.
    pub fn of(level: &Level<Weighted>) -> Self {
        let mut cells = Vec::new();
        let mut voxels: Vec<Voxel> = Vec::new();
        for &slot in level.lattice.order() {
            let diagonal = &level.stencil.blocks[slot as usize].diagonal;
            for cell in (0..512).filter(|c| diagonal[c / 8][c % 8] > 0.0) {
                cells.push((slot as usize, cell));
                voxels.push(voxel_at(level.lattice.position(slot), cell));
            }
        }
        let number = |voxel: Voxel| {
            let slot = level.lattice.slot(brick_of(voxel)) as usize;
            cells.iter().position(|at| *at == (slot, cell_of(voxel)))
        };
        let mut matrix = DMatrix::zeros(cells.len(), cells.len());
        for (i, ((slot, cell), voxel)) in cells.iter().zip(&voxels).enumerate() {
            let weights = &level.stencil.blocks[*slot];
            let at = |block: &[[f32; 8]; 64]| f64::from(block[cell / 8][cell % 8]);
            matrix[(i, i)] = at(&weights.diagonal) * (1.0 + SHIFT);
            for (to, offset) in weights.to.iter().zip(FACES).filter(|(to, _)| at(to) > 0.0) {
                if let Some(j) = number(*voxel + offset) {
                    matrix[(i, j)] = -at(to);
                }
            }
        }
        Self { cells, decomposition: Cholesky::new(matrix) }
    }

    /// Solves `Ax = b`; x is zero where there are no equations.
    pub fn solve(&self, level: &mut Level<Weighted>) {
        let b = self.cells.iter().map(|(slot, cell)| f64::from(level.b[*slot][cell / 8][cell % 8]));
        let mut x = DVector::from_iterator(self.cells.len(), b);
        match &self.decomposition {
            Some(decomposition) => decomposition.solve_mut(&mut x),
            None => x.fill(0.0),
        }
        for slot in level.lattice.order() {
            level.x[*slot as usize] = [[0.0; 8]; 64];
        }
        for ((slot, cell), x) in self.cells.iter().zip(x.iter()) {
            level.x[*slot][cell / 8][cell % 8] = *x as f32;
        }
    }
}
