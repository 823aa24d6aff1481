//! Where a robot with a body may be (thesis 7.2, item 4): obstacles are grown by the radius of a sphere around it.

use nalgebra::Point3;

use crate::grid::OccupancyGrid;
use crate::ray::Traversal;
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
