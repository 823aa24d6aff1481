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

/// How far a surface has to reach into a voxel to be in it, as a share of the voxel's edge. What comes to less is a
/// touch: a wall that lies on the faces of the lattice belongs to the voxels on both of its sides, or to either.
pub const TOUCH: f64 = 0.01;

/// What a voxel is in truth.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Truth {
    /// Free, and no surface comes near it.
    Free,
    /// A surface goes through it, by more than [`TOUCH`] from its faces, or it lies in a solid or outside a closed world.
    Occupied,
    /// It is free, and a surface touches it: a map that calls it free is right, and so is one that has the surface
    /// there.
    Touched,
}

impl Truth {
    /// Whether a map may call it so.
    fn allows(self, state: State) -> bool {
        match self {
            Self::Free => state == State::Free,
            Self::Occupied => state == State::Occupied,
            Self::Touched => state != State::Unknown,
        }
    }
}

/// How surfaces meet a voxel.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Meeting {
    None,
    Touch,
    Through,
}

/// What holds a map against the world.
struct Judge<'a> {
    world: &'a World,
    resolution: f64,
    /// A ray gets out of the world: what lies beyond the box around it is free, and can be seen.
    is_open: bool,
}

impl<'a> Judge<'a> {
    fn new(world: &'a World, resolution: f64) -> Self {
        Self { world, resolution, is_open: world.openness().is_open() }
    }

    fn meeting(&self, voxel: Voxel) -> Meeting {
        let edge = |share: f64| Vector3::repeat(self.resolution * share);
        let middle = voxel.center(self.resolution);
        let meets = |share: f64| self.world.surfaces().overlaps(&Bounds::from_mid_dim(middle, edge(share)));
        match () {
            () if !meets(1.0 + 2.0 * TOUCH) => Meeting::None,
            () if meets(1.0 - 2.0 * TOUCH) => Meeting::Through,
            () => Meeting::Touch,
        }
    }

    /// What a voxel is in truth that surfaces meet so.
    fn truth(&self, voxel: Voxel, met: Meeting) -> Truth {
        match met {
            Meeting::Through => Truth::Occupied,
            _ if !self.is_free(voxel) => Truth::Occupied,
            Meeting::Touch => Truth::Touched,
            Meeting::None => Truth::Free,
        }
    }

    fn is_free(&self, voxel: Voxel) -> bool {
        self.is_beyond(voxel) || self.world.is_free(voxel.center(self.resolution))
    }

    /// Whether it lies beyond the box around a world that is open.
    fn is_beyond(&self, voxel: Voxel) -> bool {
        self.is_open && !self.world.extents().contains(voxel.center(self.resolution))
    }
}

/// Holds every known voxel of `map` against the world.
pub fn accuracy(world: &World, map: &OccupancyGrid) -> Accuracy {
    let judge = Judge::new(world, map.resolution());
    let mut accuracy = Accuracy::default();
    for (brick, cells) in map.bricks().iter() {
        // Two neighbours that no surface touches have none between them either: what the one is, the other is, on the same
        // side of the box around the world.
        let mut untouched: Option<(usize, bool, Truth)> = None;
        for cell in (0..BRICK_CELLS).filter(|&i| cells[i] != State::Unknown) {
            let voxel = voxel_at(brick, cell);
            let (met, beyond) = (judge.meeting(voxel), judge.is_beyond(voxel));
            let follows = |last: usize| last + 1 == cell && cell % BRICK as usize != 0;
            let truth = match (met, untouched) {
                (Meeting::None, Some((last, side, truth))) if follows(last) && side == beyond => truth,
                _ => judge.truth(voxel, met),
            };
            untouched = (met == Meeting::None).then_some((cell, beyond, truth));
            accuracy.known += 1;
            accuracy.right += u64::from(truth.allows(cells[cell]));
        }
    }
    accuracy
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::scenery::{Scenery, Solid};
    use crate::triangle::Triangle;

    /// A room from (0, 0, 0) to (3, 3, 3) m with a box from (1.02, 1.02, 1.02) to (1.98, 1.98, 1.98) in it; on a
    /// lattice of 0.1 m the box touches the voxels 10 to 19 along each axis.
    fn world() -> World {
        let mut scenery = Scenery::within(Solid::block("room", [-0.02; 3], [3.02; 3]));
        scenery.block("box", [1.02; 3], [1.98; 3]);
        let centred = scenery.triangles_at(Vector3::zeros());
        World::from_triangles("room", centred).unwrap()
    }

    fn truth_of(world: &World, voxel: Voxel) -> Truth {
        let judge = Judge::new(world, 0.1);
        judge.truth(voxel, judge.meeting(voxel))
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
            let truth = truth_of(&world, voxel);
            assert!(truth.allows(true_state(voxel)) && truth != Truth::Touched, "{voxel:?}: {truth:?}");
        }
    }

    /// A map of an empty room, as exact scans make one: each wall is where it rounds to, on either side of it.
    fn judged(offset: f64, behind: bool) -> Accuracy {
        let room = Scenery::within(Solid::block("room", [0.0; 3], [4.0, 3.0, 2.0]));
        let world = World::from_triangles("room", room.triangles_at(Vector3::repeat(offset))).unwrap();
        let mut map = OccupancyGrid::new(0.1);
        let ends = [40, 30, 20];
        // A wall in the midst of a voxel is in that one; one on a face is in either of two.
        let low = if offset > 0.0 || !behind { 0 } else { -1 };
        let high = |axis: usize| if offset > 0.0 || behind { ends[axis] } else { ends[axis] - 1 };
        for voxel in all_within(Voxel::new(-1, -1, -1), Voxel::new(40, 30, 20)) {
            let index = voxel.to_array();
            let on_wall = (0..3).any(|axis| index[axis] == low || index[axis] == high(axis));
            let within = (0..3).all(|axis| (low..=high(axis)).contains(&index[axis]));
            if within {
                map.set(voxel, if on_wall { State::Occupied } else { State::Free });
            }
        }
        accuracy(&world, &map)
    }

    fn all_within(low: Voxel, high: Voxel) -> impl Iterator<Item = Voxel> {
        let span = move |axis: usize| low.to_array()[axis]..=high.to_array()[axis];
        span(0).flat_map(move |x| span(1).flat_map(move |y| span(2).map(move |z| Voxel::new(x, y, z))))
    }

    /// Regression: on the lattice's own faces both voxels beside a wall counted as occupied, and 18 % of a map as
    /// wrong.
    #[test]
    fn a_room_is_judged_the_same_wherever_it_lies_on_the_lattice() {
        for offset in [0.0, 0.03, 0.05] {
            for behind in [false, true] {
                let Accuracy { known, right } = judged(offset, behind);
                assert_eq!(known, right, "{offset} {behind}");
            }
        }
    }

    /// What is merely touched is still judged: behind a wall nothing is free, and a wall is not in the open.
    #[test]
    fn a_touched_voxel_is_free_only_before_the_wall() {
        let room = Scenery::within(Solid::block("room", [0.0; 3], [4.0, 3.0, 2.0]));
        let world = World::from_triangles("room", room.triangles_at(Vector3::zeros())).unwrap();
        let of = |x: i32| truth_of(&world, Voxel::new(x, 10, 10));
        assert_eq!([-2, -1, 0, 1].map(of), [Truth::Occupied, Truth::Occupied, Truth::Touched, Truth::Free]);
        assert_eq!([38, 39, 40].map(of), [Truth::Free, Truth::Touched, Truth::Occupied]);
    }

    /// Regression: what rays freed above a room without a ceiling was judged as if it were solid.
    #[test]
    fn beyond_an_open_world_is_free_and_beyond_a_closed_one_is_not() {
        let room = Scenery::within(Solid::block("room", [0.0; 3], [4.0, 3.0, 2.0])).triangles_at(Vector3::repeat(0.05));
        let is_ceiling = |triangle: &Triangle| triangle.0.iter().all(|corner| corner.z > 2.0);
        let open: Vec<Triangle> = room.iter().filter(|triangle| !is_ceiling(triangle)).copied().collect();
        let of = |triangles: &[Triangle]| {
            let world = World::from_triangles("room", triangles.to_vec()).unwrap();
            [19, 20, 21, 40].map(|z| truth_of(&world, Voxel::new(20, 15, z)))
        };
        assert_eq!(of(&room), [Truth::Free, Truth::Occupied, Truth::Occupied, Truth::Occupied]);
        assert_eq!(of(&open), [Truth::Free; 4]);
        let world = World::from_triangles("room", open).unwrap();
        let mut map = OccupancyGrid::new(0.1);
        (1..60).for_each(|z| assert!(map.set(Voxel::new(20, 15, z), State::Free)));
        assert_eq!(accuracy(&world, &map), Accuracy { known: 59, right: 59 });
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
