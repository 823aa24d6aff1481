//! Where a robot with a body may be (thesis 7.2, item 4): obstacles are grown by the radius of a sphere around it.

use std::collections::BTreeMap;

use nalgebra::Point3;

use crate::bricks::BRICK;
use crate::grid::OccupancyGrid;
use crate::mask::{self, Mask};
use crate::ray::Traversal;
use crate::set::VoxelSet;
use crate::state::State;
use crate::voxel::{FACES, Voxel};

/// The voxels around a robot's own that must not be occupied, for a robot that a sphere envelops.
///
/// A sphere of the radius, its centre anywhere in a voxel, touches no occupied voxel: two voxels `d` apart leave a gap
/// of `|max(|d| − 1, 0)|` voxels between their faces, and all neighbours with a gap below the radius count. At least the
/// six face neighbours always do.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Clearance {
    offsets: Vec<Voxel>,
    /// The same, and the voxel between them, as rows along x: by y and z, how far the row goes either way.
    rows: BTreeMap<(i32, i32), i32>,
}

/// The largest radius, in voxels: 150,000 neighbours, of each voxel that a way passes.
pub const MAX_RADIUS_VOXELS: f64 = 32.0;

/// A radius with which nobody could reckon.
#[derive(Debug, Clone, Copy, PartialEq, thiserror::Error)]
#[error(
    "a clearance of {radius} m among voxels of {resolution} m cannot be looked after: right is at most {} voxels, so a \
     smaller radius or larger voxels",
    MAX_RADIUS_VOXELS
)]
pub struct TooWide {
    /// The radius (m).
    pub radius: f64,
    /// Edge of a voxel (m).
    pub resolution: f64,
}

impl Clearance {
    /// Whether a sphere of `radius` (m) among voxels of `resolution` (m) is within [`MAX_RADIUS_VOXELS`].
    pub fn affordable(radius: f64, resolution: f64) -> bool {
        // Rounding may put a quotient that people see as whole above it by a hair.
        radius / resolution <= MAX_RADIUS_VOXELS + 1e-9
    }

    /// The clearance of a sphere of `radius` (m) among voxels of `resolution` (m).
    ///
    /// # Errors
    /// The sphere is larger than [`MAX_RADIUS_VOXELS`].
    pub fn new(radius: f64, resolution: f64) -> Result<Self, TooWide> {
        if !Self::affordable(radius, resolution) {
            return Err(TooWide { radius, resolution });
        }
        let radius = (radius / resolution).max(0.0);
        let reach = radius.ceil() as i32 + 1;
        let range = || -reach..=reach;
        let all = range().flat_map(|z| range().flat_map(move |y| range().map(move |x| Voxel::new(x, y, z))));
        let zero = Voxel::new(0, 0, 0);
        let offsets: Vec<Voxel> =
            all.filter(|d| *d != zero && (FACES.contains(d) || gap(*d) < radius - 1e-9)).collect();
        Ok(Self { rows: rows(&offsets), offsets })
    }

    /// The same in the robot's own layer of voxels alone: what a sensor that sees a plane can say of it. Nothing is known above and
    /// below.
    pub fn in_layer(&self) -> Self {
        let offsets: Vec<Voxel> = self.offsets.iter().copied().filter(|d| d.z == 0).collect();
        Self { rows: rows(&offsets), offsets }
    }

    /// The neighbours that count, relative to the robot's voxel, in lexicographic order of z, y, x.
    pub fn offsets(&self) -> &[Voxel] {
        &self.offsets
    }

    /// The largest offset along an axis, in voxels.
    pub fn reach(&self) -> i32 {
        self.offsets.iter().map(|d| d.x).max().unwrap_or(0)
    }

    /// Whether the robot can be anywhere in `voxel`: it is free, and nothing occupied is near.
    pub fn allows(&self, grid: &OccupancyGrid, voxel: Voxel) -> bool {
        grid.state(voxel) == State::Free && self.offsets.iter().all(|d| grid.state(voxel + *d) != State::Occupied)
    }

    /// The voxels between two points (m, world) that the robot must not be in.
    pub fn refused<'a>(
        &'a self,
        grid: &'a OccupancyGrid,
        from: Point3<f64>,
        to: Point3<f64>,
    ) -> impl Iterator<Item = Voxel> + 'a {
        Traversal::new(from, to, grid.resolution()).filter(|v| !self.allows(grid, *v))
    }
}

/// Layers of a window of rows, a bit a voxel: the rows of a brick along x with those around it.
struct Window {
    /// How many rows, and bits of each, lie before the brick's own.
    margin: usize,
    /// By z and y.
    rows: Vec<u128>,
}

impl Window {
    /// Rows, and bits of each, that a window reaches over along an axis.
    fn edge(margin: usize) -> usize {
        BRICK as usize + 2 * margin
    }

    /// Those of a brick's surroundings, so many voxels wide.
    fn around(set: &VoxelSet, brick: Voxel, margin: usize) -> Self {
        let (edge, bricks) = (Self::edge(margin), margin.div_ceil(BRICK as usize) as i32);
        let mut window = Self { margin, rows: vec![0; edge * edge] };
        let side = || -bricks..=bricks;
        for d in side().flat_map(|z| side().flat_map(move |y| side().map(move |x| Voxel::new(x, y, z)))) {
            window.take(set.brick(brick + d), d);
        }
        window
    }

    /// Takes over what of the brick `d` bricks away lies in it.
    fn take(&mut self, cells: &Mask, d: Voxel) {
        if *cells == mask::NONE {
            return;
        }
        let (margin, edge) = (self.margin as i32, Self::edge(self.margin) as i32);
        let (x, y, z) = (8 * d.x + margin, 8 * d.y + margin, 8 * d.z + margin);
        for row in 0..64 {
            let (z, y) = (z + row / 8, y + row % 8);
            if (0..edge).contains(&z) && (0..edge).contains(&y) {
                let bits = u128::from(cells[row as usize / 8] >> (8 * (row % 8)) & 0xff);
                self.rows[(z * edge + y) as usize] |= if x < 0 { bits >> -x } else { bits << x };
            }
        }
    }

    /// The same rows with what is so near to a gap along x taken out.
    fn eroded(&self, half: usize) -> Vec<u128> {
        let row = |row: &u128| (1..=half).fold(*row, |left, k| left & row << k & row >> k);
        self.rows.iter().map(row).collect()
    }
}

impl Clearance {
    /// The voxels of a brick (in bricks) that a robot can be in which keeps clear of all that is not free: of what is occupied,
    /// and of what is unknown, where something may be.
    pub fn clear(&self, free: &VoxelSet, brick: Voxel) -> Mask {
        if *free.brick(brick) == mask::NONE {
            return mask::NONE;
        }
        let margin = self.reach() as usize;
        let (window, edge) = (Window::around(free, brick, margin), Window::edge(margin));
        let mut eroded: BTreeMap<i32, Vec<u128>> = BTreeMap::new();
        let mut clear = *free.brick(brick);
        for (&(dy, dz), &half) in &self.rows {
            let rows = eroded.entry(half).or_insert_with(|| window.eroded(half as usize));
            let (dy, dz) = (dy + margin as i32, dz + margin as i32);
            for (z, layer) in clear.iter_mut().enumerate() {
                let first = (z + dz as usize) * edge + dy as usize;
                let bits =
                    rows[first..first + 8].iter().rev().fold(0, |bits, row| bits << 8 | (row >> margin) as u64 & 0xff);
                *layer &= bits;
            }
        }
        clear
    }
}

/// Distance between the nearest faces of two voxels `d` apart, in voxels.
fn gap(d: Voxel) -> f64 {
    d.to_array().iter().map(|c| f64::from((c.abs() - 1).max(0)).powi(2)).sum::<f64>().sqrt()
}

fn rows(offsets: &[Voxel]) -> BTreeMap<(i32, i32), i32> {
    let mut rows = BTreeMap::from([((0, 0), 0)]);
    for d in offsets {
        let half = rows.entry((d.y, d.z)).or_default();
        *half = d.x.max(*half);
    }
    rows
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::bricks::{BRICK_CELLS, voxel_at};

    #[test]
    fn a_radius_up_to_a_voxel_is_the_26_neighbourhood() {
        let of = |radius| Clearance::new(radius, 0.1).unwrap();
        assert_eq!([0.0, 0.05, 0.1].map(|radius| of(radius).offsets().len()), [6, 26, 26]);
        let wider = of(0.11);
        assert!(wider.offsets().contains(&Voxel::new(2, 1, 0)));
        assert!(!wider.offsets().contains(&Voxel::new(2, 2, 0)));
        assert_eq!(wider.reach(), 2);
    }

    #[test]
    fn in_a_layer_what_is_above_and_below_does_not_count() {
        let level = Clearance::new(0.15, 0.1).unwrap().in_layer();
        assert!(level.offsets().iter().all(|d| d.z == 0) && level.offsets().len() == 24, "{:?}", level.offsets());
        let mut free = VoxelSet::new();
        (0..7).flat_map(|x| (0..7).map(move |y| Voxel::new(x, y, 3))).for_each(|voxel| {
            free.insert(voxel);
        });
        let clear = |clearance: &Clearance| mask::count(&clearance.clear(&free, Voxel::new(0, 0, 0)));
        assert_eq!((clear(&level), clear(&Clearance::new(0.15, 0.1).unwrap())), (9, 0));
    }

    /// Regression: 100 m took more than 4 GB of neighbours, 1,000 m never ended.
    #[test]
    fn a_radius_of_too_many_voxels_is_refused() {
        for radius in [3.3, 100.0, 1000.0, 1e300, f64::INFINITY, f64::NAN] {
            assert!(Clearance::new(radius, 0.1).is_err(), "{radius}");
        }
        let widest = Clearance::new(3.2, 0.1).unwrap();
        assert!((100_000..200_000).contains(&widest.offsets().len()), "{}", widest.offsets().len());
    }

    #[test]
    fn an_obstacle_refuses_what_is_near_it() {
        let mut grid = OccupancyGrid::new(1.0);
        for x in 0..10 {
            grid.set(Voxel::new(x, 0, 0), State::Free);
        }
        grid.set(Voxel::new(5, 1, 1), State::Occupied);
        let at = |x: f64| Point3::new(x, 0.5, 0.5);
        let refused = |radius: f64| {
            let clearance = Clearance::new(radius, 1.0).unwrap();
            clearance.refused(&grid, at(0.5), at(9.5)).map(|v| v.x).collect::<Vec<_>>()
        };
        assert!(refused(0.0).is_empty(), "an edge is no face");
        assert_eq!(refused(1.0), vec![4, 5, 6]);
    }

    /// A brick at a time it is what a look at all neighbours of each voxel finds.
    #[test]
    fn a_brick_is_clear_where_all_neighbours_are_free() {
        // As scattered as a hash.
        let hash = |v: Voxel| (v.x * 73 + v.y * 179 + v.z * 283).rem_euclid(4001);
        let all = (-30..40).flat_map(|x| (-30..40).flat_map(move |y| (-30..40).map(move |z| Voxel::new(x, y, z))));
        let free: VoxelSet = all.filter(|voxel| hash(*voxel) > 0).collect();
        for radius in [0.0, 0.1, 0.25, 0.4, 0.95, 1.8] {
            let clearance = Clearance::new(radius, 0.1).unwrap();
            let is_clear = |v: Voxel| free.contains(v) && clearance.offsets().iter().all(|d| free.contains(v + *d));
            for brick in [[0, 0, 0], [1, -1, 0], [-2, 1, 3], [4, 0, 0]].map(Voxel::from) {
                let mut expected = mask::NONE;
                let clear = (0..BRICK_CELLS).filter(|cell| is_clear(voxel_at(brick, *cell)));
                clear.for_each(|cell| mask::set(&mut expected, cell));
                assert_eq!(clearance.clear(&free, brick), expected, "{radius}, {brick:?}");
            }
            let origin = Voxel::new(0, 0, 0);
            assert!(radius > 0.5 || clearance.clear(&free, origin) != mask::NONE, "{radius}");
        }
    }
}
