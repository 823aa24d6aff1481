//! A world of two rooms, in which tests look for ways.

use elk_geometry::{Clearance, OccupancyGrid, State, Voxel};

use crate::space::Space;

/// Two rooms of 40 × 20 × 10 voxels, with a door 8 wide at one end of the wall between them.
pub fn rooms() -> Space {
    let mut grid = OccupancyGrid::new(0.1);
    for x in -1..41 {
        for y in -1..42 {
            for z in -1..11 {
                let wall = y == 20 && !(2..10).contains(&x);
                let shell = [x, y, z].contains(&-1) || x == 40 || y == 41 || z == 10;
                grid.set(Voxel::new(x, y, z), if wall || shell { State::Occupied } else { State::Free });
            }
        }
    }
    Space::around(&grid, Voxel::new(35, 5, 5), &Clearance::new(0.1, 0.1).unwrap(), (&[], &[]))
}
