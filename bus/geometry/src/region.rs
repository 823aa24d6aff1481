//! A box of voxels that are numbered, for passes that touch every one of them.

use nalgebra::Point3;

use crate::voxel::{FACES, Voxel};

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

/// A box of voxels with numbers, their *indices*: from 0, x fastest, z slowest.
///
/// A neighbour's index is a voxel's own and a fixed offset, so passes over all of it need no arithmetic on coordinates. That
/// holds for voxels that have neighbours on all sides: whoever works with offsets leaves the voxels on the box's own faces
/// out (they are walls, not passable, unknown).
#[derive(Debug, Clone)]
pub struct Region {
    origin: Voxel,
    dim: [usize; 3],
    resolution: f64,
    moves: Vec<Move>,
}

impl Region {
    /// The box of `dim` voxels of `resolution` (m) along x, y and z whose smallest corner is `origin`.
    pub fn new(origin: Voxel, dim: [usize; 3], resolution: f64) -> Self {
        Self { origin, dim, resolution, moves: moves(dim) }
    }

    /// The index of a voxel, if it lies in the box.
    pub fn index(&self, voxel: Voxel) -> Option<usize> {
        let (voxel, origin) = (voxel.to_array(), self.origin.to_array());
        let along = |a: usize| {
            let steps = usize::try_from(i64::from(voxel[a]) - i64::from(origin[a])).ok()?;
            (steps < self.dim[a]).then_some(steps)
        };
        Some((along(2)? * self.dim[1] + along(1)?) * self.dim[0] + along(0)?)
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

    /// Voxels along x, y and z.
    pub fn dim(&self) -> [usize; 3] {
        self.dim
    }

    /// The voxel at index 0.
    pub fn origin(&self) -> Voxel {
        self.origin
    }

    /// Number of voxels.
    pub fn len(&self) -> usize {
        self.dim.iter().product()
    }

    /// Whether there is none.
    pub fn is_empty(&self) -> bool {
        self.len() == 0
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
        FACES.map(|d| self.offset(d))
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
    fn an_index_is_where_its_voxel_says() {
        let region = Region::new(Voxel::new(-3, 2, 0), [4, 3, 2], 0.5);
        assert_eq!((region.len(), region.is_empty()), (24, false));
        assert!((0..region.len()).all(|i| region.index(region.voxel(i)) == Some(i)));
        assert!((0..region.len()).all(|i| region.index_at(region.center(i)) == Some(i)));
        assert_eq!(region.index(Voxel::new(1, 2, 0)), None);
        // However far away, and whatever it is, a point that is not in it has no index.
        for far in [1e300, f64::INFINITY, f64::NEG_INFINITY] {
            assert_eq!(region.index_at(Point3::new(far, 1.2, 0.2)), None);
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
