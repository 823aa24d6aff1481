//! How true a map is: its known voxels against the world.

use elk_spatial::bricks::{BRICK, BRICK_CELLS, voxel_at};
use elk_spatial::{Bounds, OccupancyGrid, State, Voxel};
use nalgebra::Vector3;

use crate::world::World;

/// How many of a map's known voxels are what they are in truth.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct Accuracy {
    /// Voxels that the map calls free or occupied.
    pub known: u64,
    /// Those of them that are so.
    pub right: u64,
}

impl Accuracy {
    /// Share of the known voxels that are right (0 to 1); of nothing known, nothing is wrong.
    pub fn share(&self) -> f64 {
        match self.known {
            0 => 1.0,
            known => self.right as f64 / known as f64,
        }
    }
}

/// What a voxel is in truth: occupied if any surface shares a point with its cube (faces included) or if it lies in a solid
/// or outside the world, else free. There is no tolerance: a voxel that a surface only grazes is occupied.
pub fn state(world: &World, voxel: Voxel, resolution: f64) -> State {
    match touched(world, voxel, resolution) {
        true => State::Occupied,
        false => state_between_surfaces(world, voxel, resolution),
    }
}

fn touched(world: &World, voxel: Voxel, resolution: f64) -> bool {
    let cube = Bounds::from_mid_dim(voxel.center(resolution), Vector3::repeat(resolution));
    world.surfaces().overlaps(&cube)
}

fn state_between_surfaces(world: &World, voxel: Voxel, resolution: f64) -> State {
    match world.is_free(voxel.center(resolution)) {
        true => State::Free,
        false => State::Occupied,
    }
}

/// Holds every known voxel of `map` against the world.
pub fn accuracy(world: &World, map: &OccupancyGrid) -> Accuracy {
    let resolution = map.resolution();
    let mut accuracy = Accuracy::default();
    for (brick, cells) in map.bricks().iter() {
        // Two neighbours that no surface touches have none between them either: what the one is, the other is.
        let mut untouched: Option<(usize, State)> = None;
        for cell in (0..BRICK_CELLS).filter(|&i| cells[i] != State::Unknown) {
            let voxel = voxel_at(brick, cell);
            untouched = match untouched {
                _ if touched(world, voxel, resolution) => None,
                Some((last, state)) if last + 1 == cell && cell % BRICK as usize != 0 => Some((cell, state)),
                _ => Some((cell, state_between_surfaces(world, voxel, resolution))),
            };
            let truth = untouched.map_or(State::Occupied, |(_, state)| state);
            accuracy.known += 1;
            accuracy.right += u64::from(truth == cells[cell]);
        }
    }
    accuracy
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::scenery::{Scenery, Solid};

    /// A room from (0, 0, 0) to (3, 3, 3) m with a box from (1.02, 1.02, 1.02) to (1.98, 1.98, 1.98) in it; on a lattice
    /// of 0.1 m the box touches the voxels 10 to 19 along each axis.
    fn world() -> World {
        let mut scenery = Scenery::within(Solid::block("room", [-0.02; 3], [3.02; 3]));
        scenery.block("box", [1.02; 3], [1.98; 3]);
        let centred = scenery.triangles_at(Vector3::zeros());
        World::from_triangles("room", centred).unwrap()
    }

    fn true_state(v: Voxel) -> State {
        let within = |low: i32, high: i32| v.to_array().iter().all(|c| (low..=high).contains(c));
        match within(10, 19) || !within(0, 29) {
            true => State::Occupied,
            false => State::Free,
        }
    }

    fn all() -> impl Iterator<Item = Voxel> {
        let range = -2..33;
        range.clone().flat_map(move |x| {
            let range = range.clone();
            range.clone().flat_map(move |y| range.clone().map(move |z| Voxel::new(x, y, z)))
        })
    }

    #[test]
    fn a_voxel_is_occupied_by_surfaces_by_solids_and_by_what_is_outside() {
        let world = world();
        for voxel in all() {
            assert_eq!(state(&world, voxel, 0.1), true_state(voxel), "{voxel:?}");
        }
    }

    #[test]
    fn accuracy_is_the_share_of_right_voxels_among_the_known() {
        let world = world();
        let mut map = OccupancyGrid::new(0.1);
        assert_eq!(accuracy(&world, &map).share(), 1.0);
        for voxel in all() {
            map.set(voxel, true_state(voxel));
        }
        let known = all().count() as u64;
        assert_eq!(accuracy(&world, &map), Accuracy { known, right: known });
        for (voxel, wrong) in [([15, 15, 15], State::Free), ([10, 12, 12], State::Free), ([5, 5, 5], State::Occupied)] {
            map.set(voxel.into(), wrong);
        }
        map.set(Voxel::new(6, 6, 6), State::Unknown);
        assert_eq!(accuracy(&world, &map), Accuracy { known: known - 1, right: known - 4 });
    }
}
