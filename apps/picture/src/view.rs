//! A cut through the map and the view behind it.

use elk_spatial::{OccupancyGrid, State, Voxel};
use nalgebra::Point3;

/// A world axis, or its reverse, as a direction of the view.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Axis {
    /// 0: x, 1: y, 2: z.
    pub world: usize,
    /// Whether it runs against the world's.
    pub reversed: bool,
}

impl Axis {
    /// Along the world's axis.
    pub const fn along(world: usize) -> Self {
        Self { world, reversed: false }
    }

    /// Against the world's axis.
    pub const fn against(world: usize) -> Self {
        Self { world, reversed: true }
    }

    /// The coordinate of a point along it (m).
    pub fn of(self, point: Point3<f64>) -> f64 {
        if self.reversed { -point[self.world] } else { point[self.world] }
    }

    /// The cell of a voxel along it: cell `k` covers `[k, k + 1)` voxels of its coordinate. Its own inverse.
    pub fn cell(self, index: i32) -> i32 {
        if self.reversed { -1 - index } else { index }
    }
}

/// What is seen through one cell of the cut.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) enum Sight {
    /// The plane lies in unknown space here.
    Unknown,
    /// The plane cuts an occupied voxel.
    Cut,
    /// Free space, and then something unknown.
    Open,
    /// Free space, and then a surface so many voxels behind the plane.
    Surface(i32),
}

/// Directions of a view and the cells that it covers: right, up, and away from the viewer.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Frame {
    pub right: Axis,
    pub up: Axis,
    pub away: Axis,
    /// First cell along right, up, away.
    pub min: [i32; 3],
    /// Number of cells along right, up, away.
    pub size: [i32; 3],
}

impl Frame {
    /// The frame that holds all known voxels, and `margin` voxels around them to the sides.
    pub fn around(grid: &OccupancyGrid, right: Axis, up: Axis, away: Axis, margin: i32) -> Self {
        let (mut min, mut max) = ([i32::MAX; 3], [i32::MIN; 3]);
        for (voxel, _) in grid.bricks().voxels().filter(|(_, state)| *state != State::Unknown) {
            for (i, axis) in [right, up, away].into_iter().enumerate() {
                let cell = axis.cell(voxel.to_array()[axis.world]);
                (min[i], max[i]) = (min[i].min(cell), max[i].max(cell));
            }
        }
        let margins = [margin, margin, 0];
        let first = std::array::from_fn(|i| min[i].saturating_sub(margins[i]));
        let size = std::array::from_fn(|i| (max[i].saturating_sub(min[i])).saturating_add(1 + 2 * margins[i]).max(0));
        Self { right, up, away, min: first, size }
    }

    /// The voxel in these cells along right, up, away.
    pub fn voxel(&self, cells: [i32; 3]) -> Voxel {
        let mut index = [0; 3];
        for (axis, cell) in [self.right, self.up, self.away].into_iter().zip(cells) {
            index[axis.world] = axis.cell(cell);
        }
        index.into()
    }

    /// What is seen through the cell (`right`, `up`) of the plane at `cut` cells along away.
    pub fn look(&self, grid: &OccupancyGrid, [right, up]: [i32; 2], cut: i32) -> Sight {
        let state = |away| grid.state(self.voxel([right, up, away]));
        match state(cut) {
            State::Unknown => return Sight::Unknown,
            State::Occupied => return Sight::Cut,
            State::Free => {}
        }
        let behind = (cut + 1..self.min[2] + self.size[2]).find(|&away| state(away) != State::Free);
        match behind {
            Some(away) if state(away) == State::Occupied => Sight::Surface(away - cut),
            _ => Sight::Open,
        }
    }

    /// The plane that cuts the most free voxels; the first of equals.
    pub fn most_open_cut(&self, grid: &OccupancyGrid) -> i32 {
        let mut free = vec![0u32; self.size[2].max(1) as usize];
        for (voxel, _) in grid.bricks().voxels().filter(|(_, state)| *state == State::Free) {
            let cell = self.away.cell(voxel.to_array()[self.away.world]) - self.min[2];
            if let Some(count) = usize::try_from(cell).ok().and_then(|i| free.get_mut(i)) {
                *count += 1;
            }
        }
        let most = free.iter().max().copied().unwrap_or_default();
        self.min[2] + free.iter().position(|&count| count == most).unwrap_or_default() as i32
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_reversed_axis_mirrors_cells_and_points_alike() {
        for axis in [Axis::along(0), Axis::against(0)] {
            for index in [-3, -1, 0, 4] {
                let cell = axis.cell(index);
                assert_eq!(axis.cell(cell), index);
                let center = Voxel::new(index, 0, 0).center(1.0);
                assert_eq!(axis.of(center).floor() as i32, cell);
            }
        }
    }

    #[test]
    fn looking_down_sees_the_cut_then_the_table_then_the_floor() {
        let mut grid = OccupancyGrid::new(0.1);
        for (x, top) in [(0, 5), (1, 2), (2, 0)] {
            (0..6).for_each(|z| {
                grid.set(Voxel::new(x, 0, z), if z <= top { State::Occupied } else { State::Free });
            });
        }
        let frame = Frame::around(&grid, Axis::along(0), Axis::along(1), Axis::against(2), 1);
        assert_eq!((frame.min[0], frame.size[0]), (-1, 5));
        let cut = frame.away.cell(4);
        let seen: Vec<Sight> = (-1..4).map(|x| frame.look(&grid, [x, 0], cut)).collect();
        assert_eq!(seen, [Sight::Unknown, Sight::Cut, Sight::Surface(2), Sight::Surface(4), Sight::Unknown]);
    }
}
