//! Faces that lie exactly on others: walls that were exported with two sides, walls between rooms that are drawn by
//! either, things that stand on others.

use elk_world::{Placement, World};
use nalgebra::Point3;

type Quad = [[f64; 3]; 4];

/// The faces of a box, which look outwards.
fn block(low: [f64; 3], high: [f64; 3]) -> Vec<Quad> {
    let [x, y, z] = [0, 1, 2].map(|axis| [low[axis], high[axis]]);
    let corner = |i: usize| [x[i & 1], y[i >> 1 & 1], z[i >> 2]];
    let faces = [[0, 2, 3, 1], [4, 5, 7, 6], [0, 1, 5, 4], [1, 3, 7, 5], [3, 2, 6, 7], [2, 0, 4, 6]];
    faces.map(|face| face.map(corner)).to_vec()
}

/// The number of a box's face.
const FLOOR: usize = 0;
const CEILING: usize = 1;

fn turned(quads: &[Quad]) -> Vec<Quad> {
    quads.iter().map(|&[a, b, c, d]| [d, c, b, a]).collect()
}

fn loaded(quads: &[Quad]) -> World {
    let mut text = String::new();
    for quad in quads {
        quad.iter().for_each(|[x, y, z]| text += &format!("v {x} {y} {z}\n"));
        text += "f -4 -3 -2 -1\n";
    }
    World::from_bytes("w.obj", text.as_bytes(), &Placement::default()).unwrap()
}

/// Which of places in it are free, from 0.2 m outside on.
fn free(world: &World) -> Vec<[i32; 3]> {
    let all = (0..4096).map(|i| [i >> 8, i >> 4 & 15, i & 15]);
    all.filter(|&place| world.is_free(Point3::from(place.map(|c| f64::from(c) * 0.56 - 0.23)))).collect()
}

/// The same places, of those within boxes.
fn within(boxes: &[[[f64; 3]; 2]]) -> Vec<[i32; 3]> {
    let all = (0..4096).map(|i| [i >> 8, i >> 4 & 15, i & 15]);
    let is_in = |place: [i32; 3], [low, high]: [[f64; 3]; 2]| {
        (0..3).all(|axis| (low[axis]..high[axis]).contains(&(f64::from(place[axis]) * 0.56 - 0.23)))
    };
    all.filter(|&place| boxes.iter().any(|&one| is_in(place, one))).collect()
}

/// What is noticed of doubled faces.
fn remark(world: &World) -> String {
    let remarks = world.reading().remarks();
    remarks.into_iter().find(|remark| remark.contains("lie exactly on others")).unwrap_or_default()
}

const ROOM: [[f64; 3]; 2] = [[0.0; 3], [4.0, 3.0, 2.5]];

fn room() -> Vec<Quad> {
    block(ROOM[0], ROOM[1])
}

/// Regression: nothing was free in a room all of whose walls have two sides, half of it in one with some.
#[test]
fn a_room_is_the_same_whichever_of_its_walls_have_two_sides() {
    let lamp = block([2.0, 1.0, 1.0], [2.4, 1.4, 1.3]);
    for (around, name) in [(room(), "a room"), ([room(), lamp.clone()].concat(), "with a lamp")] {
        let right = free(&loaded(&around));
        assert!(right.len() > 100);
        for which in 1..64_usize {
            let doubled: Vec<Quad> = (0..6).filter(|i| which >> i & 1 == 1).map(|i| around[i]).collect();
            for (second, sides) in [(turned(&doubled), "turned"), (doubled.clone(), "twice")] {
                let world = loaded(&[around.clone(), second].concat());
                assert_eq!(free(&world), right, "{name}: {which:b} {sides}: {}", remark(&world));
                let said = format!("{} faces lie exactly on others", doubled.len());
                assert!(remark(&world).starts_with(&said) && world.reading().partitions == 0, "{}", remark(&world));
            }
        }
        let all = loaded(&[around.clone(), turned(&around)].concat());
        assert_eq!((free(&all), all.reading().winding.turned), (right, loaded(&around).reading().winding.turned));
    }
}

#[test]
fn an_open_room_with_two_sides_is_free_within() {
    let lamp = block([2.0, 1.0, 1.0], [2.4, 1.4, 1.3]);
    let mut open = room();
    open.remove(CEILING);
    for more in [vec![], lamp] {
        let once = [open.clone(), more.clone()].concat();
        let within = |world: &World| free(world).into_iter().filter(|place| place[2] < 5).collect::<Vec<_>>();
        let right = within(&loaded(&once));
        assert!(right.len() > 100);
        for which in [0b11111, 0b11110, 0b00001, 0b00100] {
            let doubled: Vec<Quad> = (0..5).filter(|i| which >> i & 1 == 1).map(|i| open[i]).collect();
            let world = loaded(&[once.clone(), turned(&doubled)].concat());
            assert_eq!(within(&world), right, "{which:b} {}: {}", more.len(), remark(&world));
        }
    }
}

/// Rooms side by side, each closed: what parts them is drawn by both.
#[test]
fn a_wall_that_two_rooms_share_parts_them() {
    let boxes = [[0.0, 0.0], [0.0, 2.0], [3.0, 0.0], [3.0, 2.0]]
        .map(|[x, y]| [[x, y, 0.0], [if x > 0.0 { 5.0 } else { 3.0 }, y + 2.0, 2.5]]);
    for count in [2, 3, 4] {
        let right = within(&boxes[..count]);
        assert!(right.len() > 100);
        let mut touching: Vec<_> = boxes[..count].iter().map(|&[low, high]| block(low, high)).collect();
        for some_turned in [false, true] {
            if some_turned {
                touching[1] = turned(&touching[1]);
            }
            let all = touching.concat();
            let world = loaded(&all);
            assert_eq!(free(&world), right, "{count} {some_turned}: {}", remark(&world));
            assert_eq!(world.reading().partitions, [0, 0, 1, 2, 4][count]);
            // An outer wall with two sides that meets one between rooms.
            let west = all[5];
            let world = loaded(&[all.clone(), turned(&[west])].concat());
            assert_eq!(free(&world), right, "{count} {some_turned}, and one outside: {}", remark(&world));
            let world = loaded(&[all.clone(), turned(&all)].concat());
            assert_eq!(free(&world), right, "{count} {some_turned}, four sides: {}", remark(&world));
        }
    }
}

/// A building of closed boxes: of its rooms one has no wall outside, and of its façade one part meets only walls.
#[test]
fn rooms_in_a_lattice_are_parted_by_their_walls() {
    let all = (0..27).map(|i| [i / 9, i / 3 % 3, i % 3].map(|c| f64::from(c) * 1.7));
    let boxes: Vec<_> = all.map(|low| [low, low.map(|c| c + 1.7)]).collect();
    let rooms: Vec<Quad> = boxes.iter().flat_map(|&[low, high]| block(low, high)).collect();
    let world = loaded(&rooms);
    assert_eq!((free(&world), world.reading().partitions), (within(&boxes), 54));
    assert_eq!(free(&loaded(&[rooms.clone(), turned(&rooms)].concat())), within(&boxes));
    // Its façade has two sides besides.
    let facade: Vec<Quad> = rooms.iter().filter(|quad| quad.iter().all(|corner| corner[0] == 0.0)).copied().collect();
    let world = loaded(&[rooms, turned(&facade)].concat());
    assert_eq!((free(&world), world.reading().partitions, facade.len()), (within(&boxes), 54, 9));
}

/// As STL has them: the two sides of a wall may be cut into triangles along different diagonals.
#[test]
fn two_sides_of_a_wall_that_are_cut_otherwise_are_one_wall() {
    let right = free(&loaded(&room()));
    for which in 0..6 {
        let mut text = String::from("solid w\n");
        let mut facet = |corners: [[f64; 3]; 3]| {
            let lines = corners.map(|[x, y, z]| format!("vertex {x} {y} {z}\n")).concat();
            text += &format!("facet normal 0 0 0\nouter loop\n{lines}endloop\nendfacet\n");
        };
        for (i, [a, b, c, d]) in room().into_iter().enumerate() {
            [[a, b, c], [a, c, d]].into_iter().for_each(&mut facet);
            if which == i {
                [[d, b, a], [d, c, b]].into_iter().for_each(&mut facet);
            }
        }
        let world = World::from_bytes("w.stl", text.as_bytes(), &Placement::default()).unwrap();
        assert_eq!(free(&world), right, "{which}");
    }
}

/// A wall within a room, whose floor is in one piece, or cut where the wall stands.
#[test]
fn a_wall_within_a_room_has_free_space_on_both_sides() {
    let [_, [_, y, z]] = ROOM;
    let baffle = |x: f64| [[x, 0.0, 0.0], [x, y, 0.0], [x, y, z], [x, 0.0, z]];
    let baffles = [0.7, 1.4, 2.0, 2.9, 3.5].map(baffle);
    let mut cut = room();
    cut.retain(|quad| quad.iter().all(|corner| corner[0] == quad[0][0]));
    for (from, to) in [(0.0, 0.7), (0.7, 1.4), (1.4, 2.0), (2.0, 2.9), (2.9, 3.5), (3.5, 4.0)] {
        let part = block([from, 0.0, 0.0], [to, y, z]);
        cut.extend(part.into_iter().filter(|quad| quad.iter().any(|corner| corner[0] != quad[0][0])));
    }
    let right = free(&loaded(&room()));
    for (name, around) in [("whole", room()), ("cut", cut)] {
        for (sides, wall) in [("one", baffles.to_vec()), ("two", [baffles.to_vec(), turned(&baffles)].concat())] {
            let world = loaded(&[around.clone(), wall].concat());
            assert_eq!(free(&world), right, "{name}, {sides}: {}", remark(&world));
            assert_eq!(world.cast(Point3::new(1.5, 1.0, 1.0), nalgebra::Vector3::x()), Some(0.5), "{name}, {sides}");
        }
    }
}

/// A box on a tile of the floor has the tile's face; so has one that hangs from a tile of the ceiling.
#[test]
fn a_thing_that_stands_on_a_tile_is_solid() {
    let mut tiles = room();
    tiles.remove(FLOOR);
    for (x, y) in (0..4).flat_map(|x| (0..3).map(move |y| (f64::from(x), f64::from(y)))) {
        tiles.push(block([x, y, 0.0], [x + 1.0, y + 1.0, 1.0])[FLOOR]);
    }
    let above = |gap: f64| loaded(&[tiles.clone(), block([1.0, 1.0, gap], [2.0, 2.0, 1.0])].concat());
    let (standing, hovering) = (above(0.0), above(1e-3));
    assert_eq!(free(&standing), free(&hovering), "{}", remark(&standing));
    assert!(!standing.is_free(Point3::new(1.5, 1.5, 0.5)) && standing.is_free(Point3::new(2.5, 1.5, 0.5)));
}
