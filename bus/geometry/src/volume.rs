//! A dense copy of the known part of a map, for passes that touch every voxel.

use elk_spatial::bricks::{BRICK, voxel_at};
use elk_spatial::{OccupancyGrid, State, Voxel};
use nalgebra::Point3;

use crate::extent::corners;

/// Steps between voxels: the 26 neighbours, with what a move may not cut.
#[derive(Debug, Clone)]
pub struct Move {
    /// Added to a voxel's index, gives its neighbour's.
    pub offset: isize,
    /// Distance between the centres, in voxels: 1, √2 or √3.
    pub length: f64,
    /// Offsets of the other voxels that the move passes between: all must be passable (no corner is cut).
    pub between: Vec<isize>,
}

/// A box of voxel states, x fastest, z slowest. Around what is known lies a margin of unknown voxels, so that the index
/// of a known voxel's neighbour always is in the box.
#[derive(Debug, Clone)]
pub struct Volume {
    origin: Voxel,
    dim: [usize; 3],
    resolution: f64,
    states: Vec<State>,
    moves: Vec<Move>,
}

impl Volume {
    /// The known part of `grid` and `include`, with `margin` (at least one voxel) around.
    pub fn of(grid: &OccupancyGrid, include: Voxel, margin: i32) -> Self {
        let corners = corners(include, grid.bricks().iter().map(|(brick, _)| brick));
        Self::between(grid, corners, margin)
    }

    /// The part of `grid` from a smallest corner up to the one beyond the largest, with `margin` (at least one voxel) around
    /// of which nothing is known.
    pub fn between(grid: &OccupancyGrid, (min, max): (Voxel, Voxel), margin: i32) -> Self {
        let margin = margin.max(1);
        let origin = min - Voxel::new(margin, margin, margin);
        let size = max - origin + Voxel::new(margin, margin, margin);
        let dim = size.to_array().map(|n| n as usize);
        let mut volume = Self {
            origin,
            dim,
            resolution: grid.resolution(),
            states: vec![State::Unknown; dim[0] * dim[1] * dim[2]],
            moves: moves(dim),
        };
        volume.copy(grid, min, max);
        volume
    }

    /// Copies what lies between two corners, row by row.
    fn copy(&mut self, grid: &OccupancyGrid, min: Voxel, max: Voxel) {
        for (brick, cells) in grid.bricks().iter() {
            let first = voxel_at(brick, 0);
            let (from, to) = (first.x.max(min.x), (first.x + BRICK).min(max.x));
            for (n, line) in cells.chunks_exact(BRICK as usize).enumerate() {
                let (y, z) = (first.y + n as i32 % BRICK, first.z + n as i32 / BRICK);
                if from < to && (min.y..max.y).contains(&y) && (min.z..max.z).contains(&z) {
                    let line = &line[(from - first.x) as usize..(to - first.x) as usize];
                    if let Some(i) = self.index(Voxel::new(from, y, z)) {
                        self.states[i..i + line.len()].copy_from_slice(line);
                    }
                }
            }
        }
    }

    /// The index of a voxel, if it lies in the box.
    pub fn index(&self, voxel: Voxel) -> Option<usize> {
        let d = (voxel - self.origin).to_array();
        let inside = (0..3).all(|a| d[a] >= 0 && (d[a] as usize) < self.dim[a]);
        inside.then(|| (d[2] as usize * self.dim[1] + d[1] as usize) * self.dim[0] + d[0] as usize)
    }

    /// The voxel at an index.
    pub fn voxel(&self, index: usize) -> Voxel {
        let [nx, ny, _] = self.dim;
        self.origin + Voxel::new((index % nx) as i32, (index / nx % ny) as i32, (index / (nx * ny)) as i32)
    }

    /// The centre of the voxel at an index (m, world).
    pub fn center(&self, index: usize) -> Point3<f64> {
        self.voxel(index).center(self.resolution)
    }

    /// The index of the voxel that holds a point (m, world).
    pub fn index_at(&self, point: Point3<f64>) -> Option<usize> {
        self.index(Voxel::containing(point, self.resolution))
    }

    /// The state of a voxel; unknown outside the box.
    pub fn state(&self, voxel: Voxel) -> State {
        self.index(voxel).map_or(State::Unknown, |i| self.states[i])
    }

    /// All states, by index.
    pub fn states(&self) -> &[State] {
        &self.states
    }

    /// Voxels along x, y and z.
    pub fn dim(&self) -> [usize; 3] {
        self.dim
    }

    /// The voxel at index 0.
    pub fn origin(&self) -> Voxel {
        self.origin
    }

    /// Number of voxels in the box.
    pub fn len(&self) -> usize {
        self.states.len()
    }

    /// Whether the box is empty (it never is: it has a margin).
    pub fn is_empty(&self) -> bool {
        self.states.is_empty()
    }

    /// Edge of a voxel (m).
    pub fn resolution(&self) -> f64 {
        self.resolution
    }

    /// Index offset of a voxel offset.
    pub fn offset(&self, d: Voxel) -> isize {
        offset(self.dim, d)
    }

    /// Index offsets of the six face neighbours, −x +x −y +y −z +z.
    pub fn faces(&self) -> [isize; 6] {
        elk_spatial::voxel::FACES.map(|d| self.offset(d))
    }

    /// The moves to the 26 neighbours, in a fixed order.
    pub fn moves(&self) -> &[Move] {
        &self.moves
    }
}

fn offset(dim: [usize; 3], d: Voxel) -> isize {
    let (nx, ny) = (dim[0] as isize, dim[1] as isize);
    d.x as isize + nx * (d.y as isize + ny * d.z as isize)
}

fn moves(dim: [usize; 3]) -> Vec<Move> {
    let zero = Voxel::new(0, 0, 0);
    zero.neighbours()
        .map(|d| Move {
            offset: offset(dim, d),
            length: d.distance(zero),
            between: between(d).map(|b| offset(dim, b)).collect(),
        })
        .collect()
}

/// The voxels that a move by `d` passes between: `d` with some of its components, but not all, set to zero.
fn between(d: Voxel) -> impl Iterator<Item = Voxel> {
    let zero = Voxel::new(0, 0, 0);
    let mut seen: Vec<Voxel> = (1..7)
        .map(|keep| {
            let part = |bit: i32, c: i32| if keep & bit != 0 { c } else { 0 };
            Voxel::new(part(1, d.x), part(2, d.y), part(4, d.z))
        })
        .filter(|b| *b != zero && *b != d)
        .collect();
    seen.sort_unstable();
    seen.dedup();
    seen.into_iter()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_copy_is_the_map() {
        let mut grid = OccupancyGrid::new(0.1);
        let cells = [(Voxel::new(-9, 3, 0), State::Free), (Voxel::new(17, 3, 5), State::Occupied)];
        for (v, s) in cells {
            grid.set(v, s);
        }
        let volume = Volume::of(&grid, Voxel::new(40, 0, 0), 2);
        let known = (0..volume.len()).filter(|&i| volume.states()[i] != State::Unknown);
        assert_eq!(known.map(|i| (volume.voxel(i), volume.states()[i])).collect::<Vec<_>>(), cells);
        assert!(volume.index(Voxel::new(42, 0, 0)).is_some(), "the margin");
        assert_eq!(volume.index(Voxel::new(43, 0, 0)), None);
        for i in 0..volume.len() {
            assert_eq!(volume.index(volume.voxel(i)), Some(i));
        }
    }

    #[test]
    fn a_diagonal_move_passes_between_others() {
        let count = |d: Voxel| between(d).count();
        assert_eq!(count(Voxel::new(1, 0, 0)), 0);
        assert_eq!(count(Voxel::new(1, -1, 0)), 2);
        assert_eq!(count(Voxel::new(1, 1, -1)), 6);
    }
}
