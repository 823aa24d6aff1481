//! How true a map is: its known voxels against the world.

use elk_geometry::bricks::{BRICK, voxel_at};
use elk_geometry::mask;
use elk_geometry::{Bounds, OccupancyGrid, State, Voxel};
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
    /// A surface goes through it, by more than [`TOUCH`] from its faces.
    Occupied,
    /// No surface goes through it, and it is not in the world's free space: it lies in a solid, or outside. In a closed world
    /// nobody can see into it, so it is as good as occupied; in an open one nobody can tell a solid from the open.
    Beyond,
    /// It is free, and a surface touches it: a map that has the surface there is right, and so is one that calls it free,
    /// unless it has the surface on neither side ([`lacks_wall`]).
    Touched,
}

impl Truth {
    /// Whether a map may call it so.
    fn allows(self, state: State) -> bool {
        match self {
            Self::Free => state == State::Free,
            Self::Occupied | Self::Beyond => state == State::Occupied,
            Self::Touched => state != State::Unknown,
        }
    }
}

/// How surfaces meet a voxel.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Meeting {
    /// None does.
    None,
    /// One lies on its faces, or as good as.
    Touch,
    /// One goes through it.
    Through,
}

/// How the surfaces of `world` meet a voxel of an edge of `resolution` (m).
pub fn meeting(world: &World, voxel: Voxel, resolution: f64) -> Meeting {
    let cube = |edge: f64| Bounds::from_mid_dim(voxel.center(resolution), Vector3::repeat(resolution * edge));
    let meets = |edge: f64| world.surfaces().overlaps(&cube(edge));
    match () {
        () if !meets(1.0 + 2.0 * TOUCH) => Meeting::None,
        () if meets(1.0 - 2.0 * TOUCH) => Meeting::Through,
        () => Meeting::Touch,
    }
}

/// What a voxel is in truth that surfaces meet so.
fn truth(world: &World, voxel: Voxel, resolution: f64, met: Meeting) -> Truth {
    match met {
        Meeting::Through => Truth::Occupied,
        _ if !world.is_free(voxel.center(resolution)) => Truth::Beyond,
        Meeting::Touch => Truth::Touched,
        Meeting::None => Truth::Free,
    }
}

/// Whether the map has a wall nowhere that lies on an upper face of a free voxel, and merely touches it and the next one
/// beyond the face: it may be in either, and so counts in the lower one if the upper one is free, too.
fn lacks_wall(world: &World, map: &OccupancyGrid, voxel: Voxel) -> bool {
    let resolution = map.resolution();
    [[1, 0, 0], [0, 1, 0], [0, 0, 1]].into_iter().any(|step| {
        let next = voxel + Voxel::from(step);
        let towards = Vector3::from(step.map(f64::from));
        let shape = Vector3::repeat(1.0 - 2.0 * TOUCH) - towards * (1.0 - 4.0 * TOUCH);
        let face = Bounds::from_mid_dim(voxel.center(resolution) + towards * (resolution / 2.0), shape * resolution);
        map.state(next) == State::Free
            && world.surfaces().overlaps(&face)
            && truth(world, next, resolution, meeting(world, next, resolution)) == Truth::Touched
    })
}

/// Holds every known voxel of `map` against the world; of an open world those that lie in it, as what is beyond is not known.
pub fn accuracy(world: &World, map: &OccupancyGrid) -> Accuracy {
    let resolution = map.resolution();
    let open = world.openness().is_open();
    let mut accuracy = Accuracy::default();
    for (brick, cells) in map.bricks().iter() {
        // Two neighbours that no surface touches have none between them either: what the one is, the other is.
        let mut untouched: Option<(usize, Truth)> = None;
        for cell in mask::cells(cells.known()) {
            let voxel = voxel_at(brick, cell);
            let met = meeting(world, voxel, resolution);
            let truth = match (met, untouched) {
                (Meeting::None, Some((last, truth))) if last + 1 == cell && cell % BRICK as usize != 0 => truth,
                _ => truth(world, voxel, resolution, met),
            };
            untouched = (met == Meeting::None).then_some((cell, truth));
            if open && truth == Truth::Beyond {
                continue;
            }
            accuracy.known += 1;
            let lacks_wall =
                || truth == Truth::Touched && cells.state(cell) == State::Free && lacks_wall(world, map, voxel);
            accuracy.right += u64::from(truth.allows(cells.state(cell)) && !lacks_wall());
        }
    }
    accuracy
}

#[cfg(test)]
mod tests {
    use nalgebra::Point3;

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
        truth(world, voxel, 0.1, meeting(world, voxel, 0.1))
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
    fn evaluated(offset: f64, behind: bool) -> Accuracy {
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
    fn a_room_is_evaluated_the_same_wherever_it_lies_on_the_lattice() {
        for offset in [0.0, 0.03, 0.05] {
            for behind in [false, true] {
                let Accuracy { known, right } = evaluated(offset, behind);
                assert_eq!(known, right, "{offset} {behind}");
            }
        }
    }

    /// What is merely touched is still evaluated: behind a wall nothing is free, and a wall is not in the open.
    #[test]
    fn a_touched_voxel_is_free_only_before_the_wall() {
        let room = Scenery::within(Solid::block("room", [0.0; 3], [4.0, 3.0, 2.0]));
        let world = World::from_triangles("room", room.triangles_at(Vector3::zeros())).unwrap();
        let of = |x: i32| truth_of(&world, Voxel::new(x, 10, 10));
        assert_eq!([-2, -1, 0, 1].map(of), [Truth::Beyond, Truth::Beyond, Truth::Touched, Truth::Free]);
        assert_eq!([38, 39, 40].map(of), [Truth::Free, Truth::Touched, Truth::Beyond]);
    }

    /// Regression: a thin wall on the lattice's faces was in none of the voxels, and a map without it right.
    #[test]
    fn a_thin_wall_has_to_be_on_either_side_wherever_it_lies_on_the_lattice() {
        let wall = |x: f64| {
            let (low, high) = ([-0.02, -0.02], [3.02, 2.02]);
            let corner = |y: f64, z: f64| Point3::new(x, y, z);
            let [a, b] = [corner(low[0], low[1]), corner(high[0], low[1])];
            let [c, d] = [corner(high[0], high[1]), corner(low[0], high[1])];
            [Triangle([a, b, c]), Triangle([a, c, d]), Triangle([c, b, a]), Triangle([d, c, a])]
        };
        let room = Solid::block("room", [-0.02; 3], [4.02, 3.02, 2.02]);
        let room = Scenery::within(room).triangles_at(Vector3::zeros());
        let evaluated = |x: f64, found: Option<i32>| {
            let world = World::from_triangles("room", [room.clone(), wall(x).to_vec()].concat()).unwrap();
            let mut map = OccupancyGrid::new(0.1);
            for voxel in all_within(Voxel::new(5, 5, 5), Voxel::new(35, 24, 14)) {
                let is_wall = found == Some(voxel.to_array()[0]);
                map.set(voxel, if is_wall { State::Occupied } else { State::Free });
            }
            let Accuracy { known, right } = accuracy(&world, &map);
            known - right
        };
        for on_face in [2.0, 2.0005, 1.9995] {
            assert_eq!([Some(19), Some(20)].map(|found| evaluated(on_face, found)), [0, 0], "{on_face}");
            assert_eq!(evaluated(on_face, None), 20 * 10, "{on_face}");
            assert_eq!(evaluated(on_face, Some(21)), 2 * 20 * 10, "{on_face}");
        }
        assert_eq!([Some(20), None].map(|found| evaluated(2.03, found)), [0, 20 * 10]);
    }

    /// Regression: what a map rightly called free above a room without a ceiling counted as wrong.
    #[test]
    fn above_a_room_without_a_ceiling_nothing_is_evaluated() {
        let room = Scenery::within(Solid::block("room", [0.0; 3], [4.0, 3.0, 2.0])).triangles_at(Vector3::repeat(0.05));
        let is_ceiling = |Triangle([a, b, c]): &Triangle| [a, b, c].iter().all(|corner| corner.z > 2.0);
        let roofless: Vec<Triangle> = room.iter().filter(|triangle| !is_ceiling(triangle)).cloned().collect();
        assert_eq!(roofless.len(), room.len() - 2);
        let mut map = OccupancyGrid::new(0.1);
        (0..60)
            .for_each(|z| assert!(map.set(Voxel::new(20, 15, z), if z == 0 { State::Occupied } else { State::Free })));
        let of = |triangles| accuracy(&World::from_triangles("room", triangles).unwrap(), &map);
        let closed = of(room);
        assert_eq!(closed, Accuracy { known: 60, right: 20 });
        let open = of(roofless);
        assert!(open.known == open.right && (10..=21).contains(&open.known), "{open:?}");
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
