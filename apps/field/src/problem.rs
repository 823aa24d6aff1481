//! What is to be solved: a box of voxels, each with what it is to the equation.

use elk_geometry::{Component, Region, Voxel, VoxelSet};

/// What a voxel is to the equation.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
#[repr(u8)]
pub enum Cell {
    /// Not in the domain: no flux passes.
    #[default]
    Outside,
    /// ψ is to be found.
    Inside,
    /// ψ = 1: the robot.
    Source,
    /// ψ = 0: a goal.
    Sink,
}

impl Cell {
    /// The value that is given, if one is.
    pub fn fixed(self) -> Option<f32> {
        match self {
            Cell::Source => Some(1.0),
            Cell::Sink => Some(0.0),
            Cell::Inside | Cell::Outside => None,
        }
    }
}

/// A domain with its boundary values: what each voxel of a region is.
#[derive(Debug, Clone)]
pub struct Problem {
    region: Region,
    cells: Vec<Cell>,
}

/// Why cells are no problem.
#[derive(Debug, Clone, Copy, PartialEq, Eq, thiserror::Error)]
pub enum ProblemError {
    /// There is not one cell for each voxel.
    #[error("the region has {voxels} voxels and there are {cells} cells: give one for each, by its index")]
    Count {
        /// Voxels of the region.
        voxels: usize,
        /// Cells given.
        cells: usize,
    },
    /// The region is too thin to have a voxel that is not on its faces, or has more voxels than can be numbered.
    #[error("a region of {0:?} voxels: right are at least 3 along each axis, and fewer than 2^32 in all")]
    Size([usize; 3]),
    /// The domain reaches the region's own faces.
    #[error(
        "the voxel at {0:?} is in the domain and on the region's face: leave a margin of one voxel that is outside"
    )]
    Margin(Voxel),
}

impl Problem {
    /// The problem in which the voxels of `region` are these, by index. Those on the region's own faces are outside.
    ///
    /// # Errors
    /// There is not one cell a voxel, the region is too thin, or a voxel on its faces is in the domain.
    pub fn new(region: Region, cells: Vec<Cell>) -> Result<Self, ProblemError> {
        let dim = region.dim();
        if cells.len() != region.len() {
            return Err(ProblemError::Count { voxels: region.len(), cells: cells.len() });
        }
        if dim.iter().any(|n| *n < 3) || u32::try_from(cells.len()).is_err() {
            return Err(ProblemError::Size(dim));
        }
        match faces(dim).find(|i| cells[*i] != Cell::Outside) {
            Some(i) => Err(ProblemError::Margin(region.voxel(i))),
            None => Ok(Self { region, cells }),
        }
    }

    /// Of this problem what is connected with a source over faces: elsewhere no value is determined.
    #[must_use]
    pub fn connected(mut self) -> Self {
        let those = |is: fn(Cell) -> bool| {
            let cells = self.cells.iter().enumerate().filter(move |(_, cell)| is(**cell));
            cells.map(|(i, _)| self.region.voxel(i))
        };
        let open: VoxelSet = those(|cell| cell != Cell::Outside).collect();
        let sources: Vec<Voxel> = those(|cell| cell == Cell::Source).collect();
        let mut reached = VoxelSet::new();
        for source in sources {
            if !reached.contains(source) {
                Component::of(&open, source).iter().for_each(|voxel| {
                    reached.insert(voxel);
                });
            }
        }
        for (i, cell) in self.cells.iter_mut().enumerate() {
            if !reached.contains(self.region.voxel(i)) {
                *cell = Cell::Outside;
            }
        }
        self
    }

    /// The voxels.
    pub fn region(&self) -> &Region {
        &self.region
    }

    /// What each is, by index.
    pub fn cells(&self) -> &[Cell] {
        &self.cells
    }

    /// Voxels along x, y and z.
    pub fn dim(&self) -> [usize; 3] {
        self.region.dim()
    }
}

/// The indices of the cells on the faces of a box.
fn faces([nx, ny, nz]: [usize; 3]) -> impl Iterator<Item = usize> {
    (0..ny * nz).flat_map(move |row| {
        let (y, z) = (row % ny, row / ny);
        let is_on_face = y == 0 || y == ny - 1 || z == 0 || z == nz - 1;
        let step = if is_on_face { 1 } else { nx - 1 };
        (0..nx).step_by(step).map(move |x| row * nx + x)
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    fn of(dim: [usize; 3], inside: &[usize]) -> Result<Problem, ProblemError> {
        let region = Region::new(Voxel::new(0, 0, 0), dim, 0.1);
        let cell = |i| if inside.contains(&i) { Cell::Inside } else { Cell::Outside };
        let cells = (0..region.len()).map(cell).collect();
        Problem::new(region, cells)
    }

    #[test]
    fn what_cannot_be_solved_is_refused() {
        assert_eq!(of([3, 3, 3], &[13]).unwrap().cells()[13], Cell::Inside);
        let on_face = (0..27).filter(|i| *i != 13);
        assert_eq!(on_face.filter(|i| matches!(of([3, 3, 3], &[*i]), Err(ProblemError::Margin(_)))).count(), 26);
        assert_eq!(of([9, 2, 3], &[]).unwrap_err(), ProblemError::Size([9, 2, 3]));
        assert_eq!(of([0, 3, 3], &[]).unwrap_err(), ProblemError::Size([0, 3, 3]));
        let region = Region::new(Voxel::new(0, 0, 0), [3, 3, 3], 0.1);
        let few = Problem::new(region, vec![Cell::Outside; 9]).unwrap_err();
        assert_eq!(few, ProblemError::Count { voxels: 27, cells: 9 });
    }
}
