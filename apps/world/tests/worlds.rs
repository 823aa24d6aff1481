//! The worlds that come with elk: closed, clean, and the same as their files.

use std::collections::BTreeMap;
use std::path::PathBuf;

use elk_geometry::{Bounds, Voxel};
use elk_world::scenery::{Building, OF_SUITES, SITES, Site, Solid};
use elk_world::suitability::{Wanted, suitability};
use elk_world::{CAR_INTERIOR, Placement, World};
use nalgebra::{Point3, Vector3};

/// Closer than this (m), two solids have to touch.
const LEAST_GAP: f64 = 0.28;

/// How far the files' coordinates are from the generator's (m).
const OFFSET: Vector3<f64> = Vector3::new(0.037, 0.031, 0.023);

fn file(site: &Site) -> PathBuf {
    PathBuf::from(env!("CARGO_MANIFEST_DIR")).join("../../mission-files/worlds").join(format!("{}.obj", site.name))
}

fn load(site: &Site) -> World {
    World::load(file(site).to_str().unwrap(), &Placement::default()).unwrap()
}

#[test]
fn the_files_are_what_the_generator_writes() {
    for site in &SITES {
        let written = std::fs::read_to_string(file(site)).unwrap();
        assert!(
            written == (site.build)().to_obj("cargo run -p elk-world --example worlds"),
            "{} is out of date: cargo run -p elk-world --example worlds",
            site.name
        );
    }
}

/// The cube is of 51³ voxels of 0.2 m.
#[test]
fn the_worlds_of_suites_are_what_the_generator_writes_closed_and_of_their_sizes() {
    let sizes = [[10.0, 10.0, 10.0], [16.2, 9.0, 2.4]];
    for ((name, build), size) in OF_SUITES.into_iter().zip(sizes) {
        let path = format!("{}/../../mission-files/suites/worlds/{name}.obj", env!("CARGO_MANIFEST_DIR"));
        let (scenery, written) = (build(), std::fs::read_to_string(&path).unwrap());
        assert!(written == scenery.to_obj("cargo run -p elk-world --example worlds"), "{name} is out of date");
        let world = World::load(&path, &Placement::default()).unwrap();
        let extents = world.extents();
        let dim = extents.dim();
        assert!((0..3).all(|i| (dim[i] - size[i]).abs() < 1e-4), "{name}: {dim:?}");
        let wanted = Wanted { resolution: 0.1, start: None, range_m: 10.0, volume: Some(extents) };
        let found = suitability(&world, &wanted);
        assert!(found.faults.is_empty() && found.warnings.is_empty(), "{name}: {found:?}");
        let (shell, things) = scenery.solids().split_first().unwrap();
        assert_closed(shell, -1.0);
        things.iter().for_each(|solid| assert_closed(solid, 1.0));
        if name == "cube" {
            let [low, high] = [extents.min, extents.max].map(|corner| Voxel::containing(corner, 0.2));
            assert_eq!((high - low).to_array(), [50; 3]);
        }
    }
}

#[test]
fn the_built_in_world_is_the_car() {
    let built_in = World::load(CAR_INTERIOR, &Placement::default()).unwrap();
    assert_eq!(built_in.surfaces().triangles(), load(&SITES[0]).surfaces().triangles());
}

#[test]
fn the_sizes_are_the_thesis() {
    let sizes =
        [[7.0, 4.0, 4.0], [10.0, 10.0, 5.0], [8.0, 8.0, 3.0], [8.0, 18.0, 5.0], [6.0, 8.0, 2.0], [7.0, 9.0, 2.0]];
    for (site, size) in SITES.iter().zip(sizes) {
        let dim = load(site).extents().dim();
        assert!((0..3).all(|i| (dim[i] - size[i]).abs() < 1e-4), "{}: {dim:?}", site.name);
    }
}

/// Each edge is run through once in each direction, and the volume has the sign of the side that the faces look to.
fn assert_closed(solid: &Solid, sign: f64) {
    let mut edges = BTreeMap::new();
    let mut volume = 0.0;
    for &[a, b, c] in &solid.faces {
        for (from, to) in [(a, b), (b, c), (c, a)] {
            *edges.entry((from, to)).or_insert(0) += 1;
        }
        let [p, q, r] = [a, b, c].map(|i| solid.vertices[i] - solid.vertices[0]);
        volume += p.cross(&q).dot(&r) / 6.0;
    }
    for (&(from, to), &times) in &edges {
        assert!(times == 1 && edges.contains_key(&(to, from)), "{}: edge {from}–{to}", solid.name);
    }
    assert!(volume * sign > 1e-6, "{}: volume {volume}", solid.name);
}

#[test]
fn every_solid_is_closed_and_looks_to_the_free_side() {
    for site in &SITES {
        let scenery = (site.build)();
        let (shell, things) = scenery.solids().split_first().unwrap();
        assert_closed(shell, -1.0);
        things.iter().for_each(|s| assert_closed(s, 1.0));
        assert!(things.len() > 25, "{} is furnished", site.name);
    }
}

fn extent(solid: &Solid, axis: usize) -> (f64, f64) {
    let along = solid.vertices.iter().map(|p| p[axis]);
    along.fold((f64::INFINITY, f64::NEG_INFINITY), |(low, high), c| (low.min(c), high.max(c)))
}

/// Where a solid's box ends along each axis.
fn box_of(solid: &Solid) -> Bounds {
    let along = [0, 1, 2].map(|axis| extent(solid, axis));
    Bounds { min: along.map(|(low, _)| low).into(), max: along.map(|(_, high)| high).into() }
}

/// The space between two things that face each other along `axis`.
#[derive(Debug)]
struct Slot {
    axis: usize,
    space: Bounds,
}

/// The slot between two boxes: they overlap on two axes and not on the third.
fn slot(a: &Bounds, b: &Bounds) -> Option<Slot> {
    let (low, high) = (a.min.sup(&b.min), a.max.inf(&b.max));
    let deep = (0..3).filter(|&i| high[i] - low[i] > 0.06).count() == 2;
    let axis = (0..3).find(|&i| low[i] - high[i] > 1e-9)?;
    let space = Bounds { min: low.inf(&high), max: low.sup(&high) };
    deep.then_some(Slot { axis, space })
}

/// The slots between a box-shaped shell and what it holds, one towards each side.
fn slots_to_shell(shell: Bounds, thing: Bounds) -> impl Iterator<Item = Slot> {
    (0..3).flat_map(move |axis| {
        let (mut below, mut above) = (thing, thing);
        (below.min[axis], below.max[axis]) = (shell.min[axis], thing.min[axis]);
        (above.min[axis], above.max[axis]) = (thing.max[axis], shell.max[axis]);
        [below, above].map(|space| Slot { axis, space })
    })
}

/// Whether a slot is too narrow, and not filled by something else: tried at nine points across its middle.
fn is_narrow(world: &World, Slot { axis, space }: &Slot) -> bool {
    let width = space.dim()[*axis];
    let mut tried = (0..9).map(|i| {
        let mut share = Vector3::repeat(0.5);
        share[(axis + 1) % 3] = [0.1, 0.5, 0.9][i % 3];
        share[(axis + 2) % 3] = [0.1, 0.5, 0.9][i / 3];
        space.min + space.dim().component_mul(&share) + OFFSET
    });
    width > 1e-9 && width < LEAST_GAP && tried.any(|p| world.is_free(p))
}

#[test]
fn nothing_leaves_a_slot_too_narrow_to_explore() {
    let mut narrow = Vec::new();
    for site in &SITES {
        let (world, scenery) = (load(site), (site.build)());
        let (shell, things) = scenery.solids().split_first().unwrap();
        let shell_is_a_box = shell.vertices.len() == 8;
        for (i, a) in things.iter().enumerate() {
            let others = things[i + 1..].iter().filter_map(|b| Some((b, slot(&box_of(a), &box_of(b))?)));
            let to_shell = slots_to_shell(box_of(shell), box_of(a)).filter(|_| shell_is_a_box).map(|s| (shell, s));
            let found = others.chain(to_shell).filter(|(_, slot)| is_narrow(&world, slot));
            narrow.extend(found.map(|(b, slot)| format!("{}: {} and {}: {slot:?}", site.name, a.name, b.name)));
        }
    }
    assert!(narrow.is_empty(), "{narrow:#?}");
}

#[test]
fn starts_are_free_and_everything_lies_in_the_volume_to_explore() {
    for site in &SITES {
        let (world, start) = (load(site), site.start().position());
        assert!(world.is_free(start), "{}", site.name);
        assert!(!world.touches(start, start, 0.3), "{} starts too near to something", site.name);
        assert!(site.bounds().contains(start));
        let (bounds, extents) = (site.bounds(), world.extents());
        // The thesis' volume cuts off nose and tail of the car.
        let cut = usize::from(site.name == "car");
        assert!((cut..3).all(|i| bounds.min[i] < extents.min[i] && extents.max[i] < bounds.max[i]), "{}", site.name);
    }
}

#[test]
fn solids_and_the_outside_are_not_free() {
    for site in &SITES {
        let (world, scenery) = (load(site), (site.build)());
        for solid in &scenery.solids()[1..] {
            let n = solid.vertices.len() as f64;
            let sum = solid.vertices.iter().fold(Vector3::zeros(), |s, p| s + p.coords);
            let middle = Point3::from(sum / n) + OFFSET;
            assert!(!world.is_free(middle), "{}: {}", site.name, solid.name);
        }
        let outside = world.extents().max + Vector3::repeat(0.01);
        assert!(!world.is_free(outside));
    }
}

#[test]
fn what_is_no_file_is_no_world_and_nobody_waits_for_it() {
    let folder = tempfile::tempdir().unwrap();
    let fifo = folder.path().join("fifo.obj");
    assert!(std::process::Command::new("mkfifo").arg(&fifo).status().unwrap().success());
    let hole = folder.path().join("hole.obj");
    std::fs::File::create(&hole).unwrap().set_len(1 << 40).unwrap();
    let said =
        |path: &std::path::Path| World::load(path.to_str().unwrap(), &Placement::default()).unwrap_err().to_string();
    for (path, words) in [
        (fifo.as_path(), "it is a FIFO; right is an ordinary file"),
        (folder.path(), "it is a folder; right is a file"),
        (std::path::Path::new("/dev/zero"), "it is a device; right is an ordinary file"),
        (hole.as_path(), "it is longer than 268 MB"),
        (std::path::Path::new("kitchn"), "or built in: car-interior, apartment, car, garage, hall, hall-long, kitchen"),
    ] {
        assert!(said(path).contains(words), "{}", said(path));
    }
}

#[test]
fn a_building_has_its_rooms_and_is_a_world_to_explore() {
    for rooms in [1, 5, 20, 27] {
        let building = Building::new(rooms, 7);
        let rooms = (rooms..rooms + 4).find(|all| building.rooms() == *all).unwrap();
        let obj = building.scenery().to_obj("cargo run -p elk-world --example building");
        let world = World::from_bytes("building.obj", obj.as_bytes(), &Placement::default()).unwrap();
        let extents = building.extents();
        let start = building.before(0).position();
        let wanted = Wanted { resolution: 0.1, start: Some(start), range_m: 10.0, volume: Some(extents) };
        let found = suitability(&world, &wanted);
        assert!(found.faults.is_empty() && found.warnings.is_empty(), "{rooms}: {found:?}");
        for room in 0..rooms {
            let place = building.before(room).position();
            assert!(world.is_free(place) && !world.touches(place, place, 0.3), "{rooms}, {room}");
            // What is beside the corridor there is the room itself.
            let mut beside = place;
            beside.y += if room % 2 == 0 { -2.0 } else { 2.0 };
            assert_eq!(building.room_at(beside), room);
        }
        for block in building.blocks() {
            assert!(!world.is_free(block.mid()), "{rooms}: {block:?}");
        }
    }
}

#[test]
fn a_seed_says_how_a_building_is_furnished() {
    let obj = |seed| Building::new(4, seed).scenery().to_obj("the test");
    assert!(obj(1) == obj(1) && obj(1) != obj(2));
}
