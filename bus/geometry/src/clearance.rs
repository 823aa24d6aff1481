//! Where a robot with a body may be (thesis 7.2, item 4): obstacles are grown by the radius of a sphere around it.

use nalgebra::Point3;

use crate::grid::OccupancyGrid;
use crate::ray::Traversal;
use crate::region::Region;
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
        let offsets = all.filter(|d| *d != zero && (FACES.contains(d) || gap(*d) < radius - 1e-9)).collect();
        Ok(Self { offsets })
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

/// How many obstacles are too near each voxel of a [`Region`], kept up to date as voxels come free or cease to be.
///
/// An obstacle is what is not free: occupied, or unknown, where something may be. Only those beside what is free are counted:
/// those behind them are no nearer along any axis. A robot of 2 m among voxels of 0.1 m has 40,000 neighbours, and a box
/// millions of voxels that are not free.
#[derive(Debug, Clone)]
pub struct Obstacles {
    /// The neighbours that count, and the voxel between them, as rows along x: the offset of the first, and how many.
    rows: Vec<(isize, usize)>,
    /// Number of obstacles too near a voxel, by index.
    near: Vec<u32>,
    /// Whether a voxel is one of them.
    counted: Vec<bool>,
}

impl Obstacles {
    /// Those of a region in which nothing is free. As many voxels along its faces as the clearance reaches, and at least two, have
    /// to stay so.
    pub fn new(region: &Region, clearance: &Clearance) -> Self {
        let own = Voxel::new(0, 0, 0);
        let mut offsets: Vec<isize> = clearance.offsets().iter().chain([&own]).map(|d| region.offset(*d)).collect();
        offsets.sort_unstable();
        let rows = offsets.chunk_by(|one, next| *next == one + 1).map(|row| (row[0], row.len())).collect();
        Self { rows, near: vec![0; region.len()], counted: vec![false; region.len()] }
    }

    /// Takes note that the voxels `turned` have come free or ceased to be; `free` is as it is now. Each voxel that obstacles
    /// come near to or leave for good is told to `changed`.
    pub fn update(
        &mut self,
        region: &Region,
        free: &impl Fn(usize) -> bool,
        turned: &[usize],
        changed: &mut impl FnMut(usize),
    ) {
        let faces = region.faces();
        let beside_free = |i: usize| faces.iter().any(|d| free(i.wrapping_add_signed(*d)));
        for i in turned.iter().flat_map(|i| faces.map(|d| i.wrapping_add_signed(d)).into_iter().chain([*i])) {
            let counts = !free(i) && beside_free(i);
            if std::mem::replace(&mut self.counted[i], counts) != counts {
                self.count(i, counts, changed);
            }
        }
    }

    /// Counts an obstacle wherever it is too near, or no longer.
    fn count(&mut self, obstacle: usize, more: bool, changed: &mut impl FnMut(usize)) {
        for (offset, length) in &self.rows {
            let first = obstacle.wrapping_add_signed(*offset);
            // Past the ends of the box there is only margin.
            let row = self.near.get_mut(first..first.saturating_add(*length)).unwrap_or_default();
            for (i, near) in row.iter_mut().enumerate() {
                *near = if more { *near + 1 } else { *near - 1 };
                if *near == u32::from(more) {
                    changed(first + i);
                }
            }
        }
    }

    /// Whether no obstacle is too near a free voxel.
    pub fn allow(&self, index: usize) -> bool {
        self.near[index] == 0
    }
}

/// Distance between the nearest faces of two voxels `d` apart, in voxels.
fn gap(d: Voxel) -> f64 {
    d.to_array().iter().map(|c| f64::from((c.abs() - 1).max(0)).powi(2)).sum::<f64>().sqrt()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_radius_up_to_a_voxel_is_the_26_neighbourhood() {
        let of = |radius| Clearance::new(radius, 0.1).unwrap();
        assert_eq!([0.0, 0.05, 0.1].map(|radius| of(radius).offsets().len()), [6, 26, 26]);
        let wider = of(0.11);
        assert!(wider.offsets().contains(&Voxel::new(2, 1, 0)));
        assert!(!wider.offsets().contains(&Voxel::new(2, 2, 0)));
        assert_eq!(wider.reach(), 2);
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
}
