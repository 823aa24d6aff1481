//! A block of a domain with the layer of voxels around it, from which gradients are computed without looking for blocks.

use elk_geometry::Voxel;
use elk_geometry::bricks::{brick_of, cell_of};

use crate::domain::Domain;
use crate::problem::Cell;

/// Voxels along an edge: a block's, and one on either side.
pub const EDGE: usize = 10;

/// What the voxels of a block and around it are, and their ψ, x fastest.
#[derive(Debug, Clone)]
pub struct Patch {
    cells: [Cell; EDGE * EDGE * EDGE],
    psi: [f32; EDGE * EDGE * EDGE],
}

/// Index offsets of the six neighbours, −x +x −y +y −z +z, for voxels of the block itself.
pub const FACES: [isize; 6] = [-1, 1, -10, 10, -100, 100];

impl Patch {
    /// That of the block at a position.
    pub fn of(domain: &Domain, position: Voxel) -> Self {
        let mut patch = Self { cells: [Cell::Outside; 1000], psi: [0.0; 1000] };
        for at in (0..27).map(|i| [i % 3 - 1, i / 3 % 3 - 1, i / 9 - 1]) {
            let (cells, psi) = domain.block(position + Voxel::from(at));
            let [xs, ys, zs] = at.map(|side| match side {
                -1 => 0..1,
                0 => 1..9,
                _ => 9..10,
            });
            for (y, z) in zs.flat_map(|z| ys.clone().map(move |y| (y, z))) {
                // What is at 1 is the block's own first cell, what is at 0 the last one of the block before.
                let row = (z + 7) % 8 * 8 + (y + 7) % 8;
                let from = (xs.start + 7) % 8..(xs.start + 7) % 8 + xs.len();
                let to = (z * EDGE + y) * EDGE + xs.start;
                patch.cells[to..to + xs.len()].copy_from_slice(&cells[row][from.clone()]);
                patch.psi[to..to + xs.len()].copy_from_slice(&psi[row][from]);
            }
        }
        patch
    }

    /// What the voxel at an index is.
    pub fn cell(&self, index: usize) -> Cell {
        self.cells[index]
    }

    /// How much higher ψ is in the neighbour at `offset`; 0 if that is outside.
    pub fn rise(&self, index: usize, offset: isize) -> f64 {
        let n = index.wrapping_add_signed(offset);
        if self.cells[n] == Cell::Outside { 0.0 } else { f64::from(self.psi[n] - self.psi[index]) }
    }
}

/// The position of the block of a voxel, and the voxel's index in its patch.
pub fn place(voxel: Voxel) -> (Voxel, usize) {
    let cell = cell_of(voxel);
    (brick_of(voxel), ((cell / 64 + 1) * EDGE + cell / 8 % 8 + 1) * EDGE + cell % 8 + 1)
}
