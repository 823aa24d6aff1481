//! What can be wrong with the way that a strategy answers.

use elk_geometry::Voxel;
use elk_geometry::ray::led_through;
use nalgebra::Point3;

use crate::space::Space;

/// Why a strategy's way is not gone.
#[derive(Debug, Clone, Copy, PartialEq, thiserror::Error)]
pub enum RouteFault {
    /// There is none.
    #[error("it has no points")]
    Empty,
    /// A coordinate is no number, or lies where no map is.
    #[error("its point {0} is {place} m, which is no place in a map", place = shown(.1))]
    NoPlace(usize, Point3<f64>),
    /// It leads through what the robot cannot be in.
    #[error(
        "from {from} to {to} m it leads through a wall: the map does not call free what is at {at} m",
        from = shown(.from), to = shown(.to), at = shown(.at)
    )]
    Wall {
        /// Where it is straight from (m, world).
        from: Point3<f64>,
        /// … and to.
        to: Point3<f64>,
        /// The middle of the voxel that is in the way (m, world).
        at: Point3<f64>,
    },
    /// It does not lead where it says that it does.
    #[error("it ends at {end} m, and says that it leads to {goal} m, where there is no goal, or none that is seen from there",
        end = shown(.end), goal = shown(.goal))]
    NoGoal {
        /// Its end (m, world).
        end: Point3<f64>,
        /// The middle of the voxel of its goal (m, world).
        goal: Point3<f64>,
    },
}

/// Whether a robot at `from` (m, world) can go this way over free voxels; the one that it is in may be anything.
///
/// # Errors
/// It cannot.
pub(crate) fn passable(space: &Space, from: Point3<f64>, points: &[Point3<f64>]) -> Result<(), RouteFault> {
    let resolution = space.resolution();
    let robot = Voxel::containing(from, resolution);
    let is_place = |point: &Point3<f64>| {
        point.iter().all(|c| c.is_finite()) && Voxel::containing(*point, resolution).is_mappable()
    };
    if points.is_empty() {
        return Err(RouteFault::Empty);
    }
    if let Some(number) = points.iter().position(|point| !is_place(point)) {
        return Err(RouteFault::NoPlace(number + 1, points[number]));
    }
    let mut free = space.free.near();
    let mut here = from;
    for &there in points {
        let in_the_way = |voxel: &Voxel| *voxel != robot && !free.contains(*voxel);
        if let Some(wall) = led_through(here, there, resolution).find(in_the_way) {
            return Err(RouteFault::Wall { from: here, to: there, at: space.center(wall) });
        }
        here = there;
    }
    Ok(())
}

fn shown(place: &Point3<f64>) -> String {
    format!("({:.2}; {:.2}; {:.2})", place.x, place.y, place.z)
}

#[cfg(test)]
mod tests {
    use elk_geometry::{Clearance, OccupancyGrid, State};

    use super::*;

    /// A corridor of ten free voxels along x, with a wall in the sixth.
    fn space() -> Space {
        let mut grid = OccupancyGrid::new(0.1);
        (0..10).for_each(|x| {
            grid.set(Voxel::new(x, 0, 0), if x == 5 { State::Occupied } else { State::Free });
        });
        Space::around(&grid, Voxel::new(0, 0, 0), &Clearance::default(), (&[], &[]))
    }

    #[test]
    fn a_way_through_a_wall_is_none_and_neither_is_one_that_is_no_number() {
        let (space, at) = (space(), |x: f64| Point3::new(x, 0.05, 0.05));
        let fault = |points: &[Point3<f64>]| passable(&space, at(0.05), points).err().map(|fault| fault.to_string());
        assert_eq!(fault(&[at(0.05), at(0.35)]), None);
        let said = fault(&[at(0.05), at(0.25), at(0.75)]).unwrap();
        let wanted = "from (0.25; 0.05; 0.05) to (0.75; 0.05; 0.05) m it leads through a wall: the map does not call free what is at \
                      (0.55; 0.05; 0.05) m";
        assert_eq!(said, wanted);
        assert!(fault(&[at(0.75)]).unwrap().contains("a wall"), "from where the robot is");
        let said = fault(&[at(0.05), at(f64::NAN)]).unwrap();
        assert_eq!(said, "its point 2 is (NaN; 0.05; 0.05) m, which is no place in a map");
        assert!(fault(&[at(1e9)]).unwrap().contains("point 1 is (1000000000.00"));
        assert_eq!(fault(&[]).unwrap(), "it has no points");
    }
}
