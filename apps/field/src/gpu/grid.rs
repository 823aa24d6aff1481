//! How a level's cells lie in memory.
//!
//! Rows are padded to whole lines of memory, and there is at least one cell, one row and one plane too many: they stay
//! zero, and are the margin at both ends, since what follows a row's last cell comes before the next row's first.

/// Cells of a line of memory (128 bytes).
const LINE: u64 = 32;
/// A level of no more cells than this along each axis is the coarsest.
const COARSEST: u32 = 3;

/// The cells of a level along x, y and z, without a margin.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Grid(pub [u32; 3]);

impl Grid {
    /// Two cells become one, along each axis.
    pub fn coarser(self) -> Self {
        Self(self.0.map(|n| n.div_ceil(2)))
    }

    /// Whether there is nothing to gain from a coarser level.
    pub fn is_coarsest(self) -> bool {
        self.0.iter().all(|n| *n <= COARSEST)
    }

    /// This level and all coarser ones, at least one.
    pub fn levels(self) -> Vec<Self> {
        let mut levels = vec![self, self.coarser()];
        while let Some(last) = levels.last().filter(|last| !last.is_coarsest()) {
            levels.push(last.coarser());
        }
        levels
    }

    /// Cells from one row to the next.
    pub fn row(self) -> u64 {
        (u64::from(self.0[0]) + 1).next_multiple_of(LINE)
    }

    /// Cells from one plane to the next.
    pub fn plane(self) -> u64 {
        self.row() * (u64::from(self.0[1]) + 1)
    }

    /// Cells of a vector: a margin before, one behind, and one that is the second child of the last.
    pub fn len(self) -> u64 {
        self.plane() * (u64::from(self.0[2]) + 3)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn levels_halve_until_they_are_small() {
        let sizes = |grid: [u32; 3]| Grid(grid).levels().iter().map(|level| level.0).collect::<Vec<_>>();
        assert_eq!(sizes([51, 7, 1]), [[51, 7, 1], [26, 4, 1], [13, 2, 1], [7, 1, 1], [4, 1, 1], [2, 1, 1]]);
        assert_eq!(sizes([1, 1, 1]), [[1, 1, 1], [1, 1, 1]], "the finest has always a coarser one");
        assert_eq!(Grid([512; 3]).levels().len(), 9);
    }

    #[test]
    fn what_a_kernel_reads_is_in_memory() {
        let grid = Grid([31, 3, 5]);
        assert_eq!((grid.row(), grid.plane(), grid.len()), (32, 128, 1024));
        assert_eq!(Grid([32, 3, 5]).row(), 64, "a row has a cell of its margin");
        // The first cell lies a plane from the start, and its neighbours before it are the first that are read. With an odd
        // number of cells the last coarse one has a child in the margin: that one's neighbours are the last.
        let at = |x: u64, y: u64, z: u64| grid.plane() * (z + 1) + grid.row() * y + x;
        assert!(at(0, 0, 0) >= grid.plane() && at(31, 4, 5).max(at(31, 3, 6)) < grid.len());
    }
}
