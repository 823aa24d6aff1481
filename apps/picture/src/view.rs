//! A cut through the map and the view behind it.

use std::collections::BTreeMap;

use elk_geometry::{OccupancyGrid, State, Voxel};
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

/// The most cells that a view has, and the most voxels that it looks through.
const MOST_CELLS: i64 = 1 << 22;
const DEEPEST: i64 = 4096;
/// Share of the known voxels that a map too large to be drawn loses at each end of each axis, and how much of it is drawn
/// at most (voxels), around the middle of what is known.
const STRAY_SHARE: f64 = 0.005;
const MOST_DRAWN: i32 = 2000;

/// First and last index along each axis of the world.
pub(crate) type Ranges = [[i32; 2]; 3];

/// What is shown of a map: all that is known, or, if outliers make that too large to be drawn, where nearly all of it
/// is.
pub(crate) fn shown(grid: &OccupancyGrid) -> Ranges {
    let known = || grid.bricks().voxels().filter(|(_, state)| *state != State::Unknown).map(|(voxel, _)| voxel);
    let mut all: [Option<[i32; 2]>; 3] = [None; 3];
    for voxel in known() {
        for (ends, index) in all.iter_mut().zip(voxel.to_array()) {
            *ends = Some(ends.map_or([index; 2], |[first, last]| [first.min(index), last.max(index)]));
        }
    }
    let all = all.map(Option::unwrap_or_default);
    let mut sizes = all.map(|[first, last]| i64::from(last) - i64::from(first) + 1);
    sizes.sort_unstable();
    if sizes[1] * sizes[2] <= MOST_CELLS && sizes[2] <= DEEPEST {
        return all;
    }
    let mut counts: [BTreeMap<i32, u64>; 3] = Default::default();
    for voxel in known() {
        for (counts, index) in counts.iter_mut().zip(voxel.to_array()) {
            *counts.entry(index).or_default() += 1;
        }
    }
    counts.each_ref().map(without_strays)
}

/// First and last index of what is left without the outliers at both ends, around the middle.
fn without_strays(counts: &BTreeMap<i32, u64>) -> [i32; 2] {
    let total: u64 = counts.values().sum();
    let after = |share: f64| {
        let mut passed = 0;
        let there = counts.iter().find(|(_, count)| {
            passed += **count;
            passed as f64 > share * total as f64
        });
        there.map_or(0, |(index, _)| *index)
    };
    let middle = after(0.5);
    let (first, last) = (after(STRAY_SHARE), after(1.0 - STRAY_SHARE));
    [first.max(middle - MOST_DRAWN / 2), last.min(middle + MOST_DRAWN / 2)]
}

impl Frame {
    /// The frame that holds these voxels, and `margin` voxels around them to the sides.
    pub fn around(ranges: &Ranges, right: Axis, up: Axis, away: Axis, margin: i32) -> Self {
        let margins = [margin, margin, 0];
        let axes = [right, up, away];
        let ends = axes.map(|axis| ranges[axis.world].map(|index| axis.cell(index)));
        let min = std::array::from_fn(|i| ends[i][0].min(ends[i][1]) - margins[i]);
        let size = std::array::from_fn(|i| (ends[i][0] - ends[i][1]).abs() + 1 + 2 * margins[i]);
        Self { right, up, away, min, size }
    }

    /// Whether a cell along right and up is in the frame.
    pub fn holds(&self, cells: [i32; 2]) -> bool {
        (0..2).all(|i| (self.min[i]..self.min[i] + self.size[i]).contains(&cells[i]))
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
        // Of equals `max_by_key` takes the last one.
        let most_open = (0..free.len()).rev().max_by_key(|&cell| free[cell]);
        self.min[2] + most_open.map_or(0, |cell| cell as i32)
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

    /// Regression: an outlier at 3 km made a picture of 30,000 by 30,000 cells.
    #[test]
    fn a_stray_voxel_does_not_make_the_view() {
        let mut grid = OccupancyGrid::new(0.1);
        for x in 0..40 {
            (0..40).for_each(|y| assert!(grid.set(Voxel::new(x, y, 0), State::Free)));
        }
        assert_eq!(shown(&grid), [[0, 39], [0, 39], [0, 0]]);
        grid.set(Voxel::new(3000, -20, 0), State::Free);
        assert_eq!(shown(&grid), [[0, 3000], [-20, 39], [0, 0]], "large, but it can be drawn");
        grid.set(Voxel::new(30_000, -30_000, 30_000), State::Occupied);
        assert_eq!(shown(&grid), [[0, 39], [0, 39], [0, 0]]);
        (0..30_000).for_each(|x| {
            grid.set(Voxel::new(x, 0, 0), State::Free);
        });
        let [x, _, _] = shown(&grid);
        assert!(x[1] - x[0] <= MOST_DRAWN, "{x:?}");
    }

    #[test]
    fn looking_down_sees_the_cut_then_the_table_then_the_floor() {
        let mut grid = OccupancyGrid::new(0.1);
        for (x, top) in [(0, 5), (1, 2), (2, 0)] {
            (0..6).for_each(|z| {
                grid.set(Voxel::new(x, 0, z), if z <= top { State::Occupied } else { State::Free });
            });
        }
        let frame = Frame::around(&shown(&grid), Axis::along(0), Axis::along(1), Axis::against(2), 1);
        assert_eq!((frame.min[0], frame.size[0]), (-1, 5));
        let cut = frame.away.cell(4);
        let seen: Vec<Sight> = (-1..4).map(|x| frame.look(&grid, [x, 0], cut)).collect();
        assert_eq!(seen, [Sight::Unknown, Sight::Cut, Sight::Surface(2), Sight::Surface(4), Sight::Unknown]);
    }
}
