//! Files as people have them: the cases of public bug reports, each the world that it should be, or an error with its
//! place.

use std::path::PathBuf;

use elk_world::inspection::inspect;
use elk_world::scenery::Solid;
use elk_world::triangle::Triangle;
use elk_world::{CAR_INTERIOR, Placement, World, WorldError};
use nalgebra::{Point3, Vector3};

fn case(name: &str) -> String {
    let folder = PathBuf::from(env!("CARGO_MANIFEST_DIR")).join("../../tests/cases/obj");
    folder.join(format!("{name}.obj")).to_str().unwrap().to_owned()
}

fn load(name: &str) -> World {
    World::load(&case(name), &Placement::default()).unwrap()
}

fn of(name: &str, bytes: impl AsRef<[u8]>) -> Result<World, WorldError> {
    World::from_bytes(name, bytes.as_ref(), &Placement::default())
}

fn said(name: &str, bytes: impl AsRef<[u8]>) -> String {
    of(name, bytes).unwrap_err().to_string()
}

fn area(world: &World) -> f64 {
    let twice = |Triangle([a, b, c]): &Triangle| (b - a).cross(&(c - a)).norm();
    world.surfaces().triangles().iter().map(twice).sum::<f64>() / 2.0
}

/// Case 1. Regression: the wall with the doorway became a fan, 69.3 m² in all, and the door was closed.
#[test]
fn a_doorway_in_a_concave_polygon_is_open() {
    let (ngon, quads) = (load("rooms-ngon"), load("rooms-quads"));
    assert!((area(&ngon) - 61.8).abs() < 1e-9 && (area(&quads) - 61.8).abs() < 1e-9);
    let (from, along) = (Point3::new(1.0, 1.5, 1.0), Vector3::x());
    assert_eq!(ngon.cast(from, along), Some(3.0), "through the door to the wall of the other room");
    for x in 0..40 {
        for y in 0..30 {
            let from = Point3::new(f64::from(x) * 0.1 + 0.05, f64::from(y) * 0.1 + 0.05, 0.95);
            assert_eq!(ngon.is_free(from), quads.is_free(from), "{from}");
            for direction in [Vector3::new(1.0, 0.13, 0.21), Vector3::new(-1.0, 0.31, -0.17)] {
                let [a, b] = [&ngon, &quads].map(|world| world.cast(from, direction).unwrap());
                assert!((a - b).abs() < 1e-9, "{from}: {a} {b}");
            }
        }
    }
}

/// Cases 8 to 11.
#[test]
fn all_ways_to_write_the_same_world_are_the_same_world() {
    let base = load("rooms-quads");
    for name in [
        "bom-comment",
        "bom-v",
        "colours",
        "continuation",
        "cp1252",
        "crlf-noeol",
        "degenerate",
        "faces-first",
        "mtl-uv",
        "negative",
        "tabs",
        "unused-nan",
        "w",
    ] {
        let world = load(name);
        assert_eq!(world.surfaces().triangles(), base.surfaces().triangles(), "{name}");
    }
    let text = std::fs::read_to_string(case("rooms-quads")).unwrap();
    let utf_16: Vec<u8> = format!("\u{feff}# Grüße\n{text}").encode_utf16().flat_map(u16::to_le_bytes).collect();
    for (name, bytes) in
        [("utf-16", utf_16), ("in the middle", text.replace("f 1 2", "\u{feff}f 1 \u{feff}2").into_bytes())]
    {
        assert_eq!(of("w.obj", bytes).unwrap().surfaces().triangles(), base.surfaces().triangles(), "{name}");
    }
}

#[test]
fn worlds_that_cannot_be_used_say_why_and_where() {
    let empty = World::load(&case("empty"), &Placement::default()).unwrap_err();
    assert!(matches!(empty, WorldError::Empty { .. }), "{empty}");
    assert!(said("w.obj", "").contains("no faces"));
    assert!(said("w.obj", "v 0 0 0\nv 1 0 0\nl 1 2\n").contains("no faces"));
    assert!(said("w.obj", "v 0 0 0\nv 1 0 0\nv 2 0 0\nf 1 2 3\n").contains("no faces but 1 without area"));
    assert!(
        said("w.obj", "v 0 0 nan\nv 1 0 0\nv 0 1 0\nf 1 2 3\n")
            .starts_with("w.obj:4: a face has the corner (0.0; 0.0; NaN)")
    );
    assert!(said("w.obj", "v 0 0 0\nv 1 0 0\nf 1 2 7\n").starts_with("w.obj:3: a face has the vertex 7"));
    assert!(said("w.obj", "v 1e300 0 0\nv -1e300 0 0\nv 0 1e300 0\nf 1 2 3").contains("beyond all worlds"));
    let missing = World::load("no/such/world.obj", &Placement::default()).unwrap_err().to_string();
    assert!(missing.contains("no/such/world.obj") && missing.contains(CAR_INTERIOR), "{missing}");
}

#[test]
fn files_of_other_kinds_are_told_by_what_is_in_them() {
    for (bytes, what) in [
        (&b"Kaydara FBX Binary  \0"[..], "an FBX file"),
        (b"<?xml version=\"1.0\"?>\n<COLLADA xmlns", "a COLLADA file"),
        (b"<Scenario name=\"x\">", "XML"),
        (b"PK\x03\x04....", "a ZIP archive"),
        (b"OFF\n8 6 0\n", "an OFF file"),
        (b"\x1f\x8b\x08", "compressed (gzip)"),
        (b"{\"a\": 1}", "this is JSON but no glTF"),
        (b"ply\nformat ascii 1.0\nelement vertex 1\nproperty float x\nend_header\n1\n", "a cloud of points"),
    ] {
        let said = said("world.obj", bytes);
        assert!(said.contains(what) && said.starts_with("world.obj"), "{said}");
    }
    assert!(said("notes.txt", "hello").contains("right is an OBJ, STL, PLY or glTF"));
}

/// Bytes that are no text, indices that no vertex has, numbers that are none, files that are cut off.
#[test]
fn whatever_a_file_holds_is_a_world_or_an_error() {
    let vertices = "v 0 0 0\nv 1 0 0\nv 0 1 0\n";
    for wrong in [
        "f 1 2 9",
        "f -9 -8 -7",
        "f 0 0 0",
        "f",
        "f 1",
        "f 1 2",
        "v 1 2",
        "v nan 1e39 -inf\nf 1 2 4",
        "f 99999999999999999999 1 2",
        "f -9223372036854775808 1 2",
    ] {
        assert!(of("wrong.obj", format!("{vertices}{wrong}\n")).is_err(), "{wrong}");
    }
    let many: String = (1..40_000).map(|i| format!(" {}", i % 3 + 1)).collect();
    assert!(
        said("many.obj", format!("{vertices}f{many}")).starts_with("many.obj:4: a face has more than 32768 corners")
    );
    for name in ["bytes.obj", "bytes.stl", "bytes.ply", "bytes.glb"] {
        assert!(of(name, [0xff; 1000]).is_err(), "{name}");
    }
}

/// Case 5, the world's side, and a room without a ceiling.
#[test]
fn an_open_world_is_noticed_and_where_it_is_open() {
    for closed in ["rooms-quads", "rooms-ngon", "shaft-lid", "fence", "far-500k"] {
        let world = load(closed);
        let openness = world.openness();
        assert!(!openness.is_open() && openness.places == 64, "{closed}: {openness:?}");
        assert_eq!(openness.words(), None);
    }
    let car = World::load(CAR_INTERIOR, &Placement::default()).unwrap();
    assert!(!car.openness().is_open());
    for (open, middle, size) in
        [("shaft-open", [2.0, 1.5, 50.0], [4.0, 3.0, 0.0]), ("noceiling", [2.0, 1.5, 2.0], [4.0, 3.0, 0.0])]
    {
        let world = load(open);
        let openness = world.openness();
        let hole = &openness.holes[0];
        assert!(openness.escaping > 0.0 && hole.leads_out, "{open}: {openness:?}");
        assert!(
            (hole.middle - Point3::from(middle)).norm() < 1e-9 && hole.size == Vector3::from(size),
            "{open}: {hole:?}"
        );
        assert!(openness.words().unwrap().contains("a hole of 4.00 × 3.00 × 0.00 m around (2.00; 1.50;"));
        assert!(world.is_free(Point3::new(1.0, 1.0, 1.0)), "it can be used all the same");
    }
}

/// A hole that random rays seldom find is looked through.
#[test]
fn a_small_hole_is_found() {
    let text = std::fs::read_to_string(case("rooms-quads")).unwrap();
    let hole =
        text.replacen("f 1 2 3 4", "v 1 1 0\nv 1 1.01 0\nv 1.01 1.01 0\nv 1.01 1 0\nf 1 2 3 4 1 -4 -3 -2 -1 -4", 1);
    let world = of("w.obj", &hole).unwrap();
    let openness = world.openness();
    assert_eq!((openness.is_open(), openness.holes.len()), (true, 1), "{openness:?}");
    assert!((openness.holes[0].middle - Point3::new(1.005, 1.005, 0.0)).norm() < 1e-6);
}

/// Faces that look the wrong way are turned over, and that is said.
#[test]
fn a_world_turned_inside_out_is_mended() {
    let base = load("rooms-quads");
    let text = std::fs::read_to_string(case("rooms-quads")).unwrap();
    let reversed = |line: &str| {
        let corners: Vec<&str> = line[2..].split(' ').rev().collect();
        format!("f {}", corners.join(" "))
    };
    let turned = |which: &dyn Fn(usize) -> bool| {
        let lines = text.lines().enumerate();
        let lines: Vec<String> = lines
            .map(|(i, line)| if line.starts_with("f ") && which(i) { reversed(line) } else { line.to_owned() })
            .collect();
        of("w.obj", lines.join("\n")).unwrap()
    };
    assert!(base.reading().remarks().is_empty());
    for (name, which, inside_out) in [
        ("all", &(|_| true) as &dyn Fn(usize) -> bool, true),
        ("the floor", &|i| text.lines().nth(i) == Some("f 1 2 3 4"), false),
        ("every other", &|i| i % 2 == 0, false),
    ] {
        let world = turned(which);
        let remarks = world.reading().remarks();
        assert_eq!(remarks.len(), 1, "{name}: {remarks:?}");
        assert!(remarks[0].ends_with("they were turned over"), "{name}: {remarks:?}");
        assert!(!inside_out || world.reading().winding.inside_out, "{name}");
        for x in 0..40 {
            for y in 0..30 {
                let point = Point3::new(f64::from(x) * 0.1 + 0.05, f64::from(y) * 0.1 + 0.05, 1.0);
                assert_eq!(world.is_free(point), base.is_free(point), "{name}: {point}");
            }
        }
    }
}

/// Rooms that paper walls divide: one polygon without thickness, whose two sides are both free.
#[test]
fn a_wall_without_thickness_has_free_space_on_both_sides() {
    let text = "v 0 0 0\nv 4 0 0\nv 4 3 0\nv 0 3 0\nv 0 0 2\nv 4 0 2\nv 4 3 2\nv 0 3 2\n\
                f 1 2 3 4\nf 5 8 7 6\nf 1 5 6 2\nf 2 6 7 3\nf 3 7 8 4\nf 4 8 5 1\n\
                v 2 0 0\nv 2 3 0\nv 2 3 2\nv 2 0 2\nf 9 10 11 12\n";
    let world = of("paper.obj", text).unwrap();
    assert_eq!(world.reading().winding.sheets, 1);
    for x in [0.2, 1.9, 1.99, 2.01, 2.1, 3.8] {
        assert!(world.is_free(Point3::new(x, 1.4, 0.9)), "{x}");
    }
    assert_eq!(world.cast(Point3::new(1.0, 1.5, 1.0), Vector3::x()), Some(1.0));
}

#[test]
fn units_and_axes_are_placed() {
    let text = std::fs::read_to_string(case("rooms-quads")).unwrap();
    let base = load("rooms-quads");
    let drawn = |point: &dyn Fn([f64; 3]) -> [f64; 3]| {
        let line = |line: &str| match line.strip_prefix("v ") {
            Some(numbers) => {
                let numbers: Vec<f64> = numbers.split(' ').map(|n| n.parse().unwrap()).collect();
                let [x, y, z] = point([numbers[0], numbers[1], numbers[2]]);
                format!("v {x} {y} {z}")
            }
            None => line.to_owned(),
        };
        text.lines().map(line).collect::<Vec<_>>().join("\n")
    };
    // Millimetres, y up: what exporters write by default.
    let millimetres = drawn(&|[x, y, z]| [x * 1000.0, z * 1000.0, -y * 1000.0]);
    let placed = World::from_bytes("mm.obj", millimetres.as_bytes(), &Placement::new(0.001, "y").unwrap()).unwrap();
    assert!((placed.extents().min - base.extents().min).norm() < 1e-9);
    assert!((placed.extents().max - base.extents().max).norm() < 1e-9);
    assert!(placed.reading().remarks().is_empty(), "it was not mirrored");
    let guess = inspect("mm.obj", &of("mm.obj", millimetres).unwrap());
    assert_eq!(guess.unit.unwrap().name, "millimetres");
}

#[test]
fn an_inspection_says_what_a_person_wants_to_know() {
    let found = inspect("rooms", &load("rooms-ngon"));
    assert_eq!((found.faces, found.closed, found.unit.unwrap().metres), (11, true, 1.0));
    assert!((found.surface_m2 - 61.8).abs() < 1e-9);
    assert!((found.free_volume_m3 - 23.1).abs() < 1.2, "{}", found.free_volume_m3);
    assert_eq!(found.starts.len(), 2, "one in each room: {:?}", found.starts);
    let world = load("rooms-ngon");
    for start in &found.starts {
        assert!(world.is_free(start.place) && start.clearance_m > 0.7, "{start:?}");
        let touches = |share: f64| world.touches(start.place, start.place, start.clearance_m * share);
        assert!(touches(1.001) && !touches(0.999), "{start:?}");
    }
    let words = found.to_string();
    for word in ["4.00 × 3.00 × 2.00 m", "metres", "closed   yes", "61.80 m²", "<Start>"] {
        assert!(words.contains(word), "{word}: {words}");
    }
    // Regression: places were rounded to the centimetre, whatever the world's size.
    let bytes = std::fs::read(case("rooms-ngon")).unwrap();
    let small = World::from_bytes("r.obj", &bytes, &Placement { scale: 0.001, up: None }).unwrap();
    let found = inspect("in kilometres", &small);
    assert_eq!((found.starts.len(), found.unit.unwrap().metres), (2, 1000.0), "{found}");
    assert!(found.starts.iter().all(|start| small.is_free(start.place) && start.clearance_m > 0.0007), "{found}");
    assert!(found.to_string().contains("0.00400 × 0.00300 × 0.00200 m"), "{found}");
    let open = inspect("open", &load("noceiling")).to_string();
    assert!(open.contains("closed   no: ") && open.contains("a hole of"), "{open}");
}

fn drawn(scenery: &[Solid]) -> String {
    let mut text = String::new();
    let mut first = 1;
    for solid in scenery {
        solid.vertices.iter().for_each(|p| text += &format!("v {} {} {}\n", p.x, p.y, p.z));
        solid.faces.iter().for_each(|f| text += &format!("f {} {} {}\n", f[0] + first, f[1] + first, f[2] + first));
        first += solid.vertices.len();
    }
    text
}

/// A building as architects' programs write it: walls, floor and ceiling are boxes, and nothing is around them.
#[test]
fn a_building_of_solid_walls_is_free_between_them() {
    let walls = [
        Solid::block("floor", [0.0, 0.0, -0.3], [8.0, 5.0, 0.0]),
        Solid::block("ceiling", [0.0, 0.0, 2.5], [8.0, 5.0, 2.8]),
        Solid::block("west", [0.0, 0.0, 0.0], [0.3, 5.0, 2.5]),
        Solid::block("east", [7.7, 0.0, 0.0], [8.0, 5.0, 2.5]),
        Solid::block("south", [0.3, 0.0, 0.0], [7.7, 0.3, 2.5]),
        Solid::block("north", [0.3, 4.7, 0.0], [7.7, 5.0, 2.5]),
        Solid::block("inner", [4.0, 0.3, 0.0], [4.2, 3.5, 2.5]),
        Solid::block("table", [1.0, 1.0, 0.0], [2.0, 2.0, 0.8]),
    ];
    let house = [
        Solid::block("outside", [0.0, 0.0, -0.3], [8.0, 5.0, 2.8]),
        Solid::block("inside", [0.3, 0.3, 0.0], [7.7, 4.7, 2.5]).inside_out(),
        Solid::block("inner", [4.0, 0.3, 0.0], [4.2, 3.5, 2.5]),
        Solid::block("table", [1.0, 1.0, 0.0], [2.0, 2.0, 0.8]),
    ];
    for (name, text) in [("of boxes", drawn(&walls)), ("with an inside and an outside", drawn(&house))] {
        let world = of("house.obj", text).unwrap();
        assert!(world.reading().winding.solids && world.reading().winding.turned == 0, "{name}: {:?}", world.reading());
        for (place, is_free) in [
            ([2.0, 3.0, 1.0], true),
            ([6.0, 2.0, 2.0], true),
            ([1.5, 1.5, 0.4], false),
            ([4.1, 1.0, 1.0], false),
            ([0.15, 2.0, 1.0], false),
            ([5.0, 2.0, 2.6], false),
        ] {
            assert_eq!(world.is_free(place.into()), is_free, "{name}: {place:?}");
        }
        let found = inspect("house", &world);
        assert!(found.closed && found.starts[0].clearance_m > 1.0, "{name}: {found}");
    }
}

/// Ground under the open sky, turned either way.
#[test]
fn open_ground_is_free_above() {
    for face in ["f 1 2 5\nf 2 3 5\nf 3 4 5\nf 4 1 5\n", "f 2 1 5\nf 3 2 5\nf 4 3 5\nf 1 4 5\n"] {
        let text = format!("v -50 -50 3\nv 50 -50 3\nv 50 50 3\nv -50 50 3\nv 0 0 0\n{face}");
        let world = of("ground.obj", text).unwrap();
        assert!(world.is_free(Point3::new(3.0, 2.0, 1.0)) && !world.is_free(Point3::new(40.0, 2.0, 1.0)), "{face}");
        assert_eq!(world.reading().remarks().len(), usize::from(face.starts_with("f 2 1")), "{face}");
        assert!(world.openness().is_open());
    }
}

/// Regression: of two faces of a screw of 2 cm it could not be told which is right, and so a conference room was refused.
#[test]
fn a_small_thing_whose_faces_are_turned_against_each_other_is_a_sheet() {
    let ground = "v -50 -50 3\nv 50 -50 3\nv 50 50 3\nv -50 50 3\nv 0 0 0\nf 1 2 5\nf 2 3 5\nf 3 4 5\nf 4 1 5\n";
    let flap =
        "v 1 1 5\nv 1.02 1 5\nv 1.02 1.02 5\nv 1 1.02 5\nv 1.04 1 5.01\nv 1.04 1.02 5.01\nf 6 7 8 9\nf 7 8 11 10\n";
    let world = of("ground.obj", format!("{ground}{flap}")).unwrap();
    assert_eq!(world.reading().winding.sheets, 1);
    assert!(world.is_free(Point3::new(1.01, 1.01, 1.0)));
    assert!(
        world.cast(Point3::new(1.01, 1.01, 5.5), -Vector3::z()).is_some_and(|t| (t - 0.5).abs() < 1e-9),
        "it is there"
    );
}

/// A room as models of buildings have it: each wall a face by itself, beside others but not joined to them, here all turned
/// outwards; in it a block without an underside, and a floor above that of the box around all.
///
/// Regression: in such a house a robot was refused to go where nothing was, as rays downwards crossed two floors.
#[test]
fn what_walls_enclose_together_is_free_however_they_are_turned() {
    let quad = |corners: [[f64; 3]; 4]| {
        let points: String = corners.iter().map(|[x, y, z]| format!("v {x} {y} {z}\n")).collect();
        points + "f -4 -3 -2 -1\n"
    };
    // The lower and the upper corner of a block, its faces apart by 2 mm at their edges, looking outwards.
    let faces = |[x0, y0, z0]: [f64; 3], [x1, y1, z1]: [f64; 3]| {
        let g = 0.002;
        [
            quad([[x0 + g, y0 + g, z1], [x1 - g, y0 + g, z1], [x1 - g, y1 - g, z1], [x0 + g, y1 - g, z1]]),
            quad([[x0 + g, y0, z0 + g], [x1 - g, y0, z0 + g], [x1 - g, y0, z1 - g], [x0 + g, y0, z1 - g]]),
            quad([[x1, y0 + g, z0 + g], [x1, y1 - g, z0 + g], [x1, y1 - g, z1 - g], [x1, y0 + g, z1 - g]]),
            quad([[x1 - g, y1, z0 + g], [x0 + g, y1, z0 + g], [x0 + g, y1, z1 - g], [x1 - g, y1, z1 - g]]),
            quad([[x0, y1 - g, z0 + g], [x0, y0 + g, z0 + g], [x0, y0 + g, z1 - g], [x0, y1 - g, z1 - g]]),
            quad([[x0 + g, y1 - g, z0], [x1 - g, y1 - g, z0], [x1 - g, y0 + g, z0], [x0 + g, y0 + g, z0]]),
        ]
    };
    let room = faces([0.0; 3], [6.0, 4.0, 3.0]).concat();
    let block = faces([2.0, 1.0, 0.01], [3.0, 2.0, 1.0])[..5].concat();
    let floor = quad([[0.0, 0.0, 0.01], [6.0, 0.0, 0.01], [6.0, 4.0, 0.01], [0.0, 4.0, 0.01]]);
    let world = of("room.obj", format!("{room}{block}{floor}")).unwrap();
    for x in 1..12 {
        for y in 1..8 {
            for z in 1..6 {
                let place = Point3::new(f64::from(x) * 0.5 - 0.2, f64::from(y) * 0.5 - 0.2, f64::from(z) * 0.5 + 0.01);
                let in_block = (2.0..=3.0).contains(&place.x) && (1.0..=2.0).contains(&place.y) && place.z < 1.0;
                assert_eq!(world.is_free(place), !in_block, "{place:?}");
            }
        }
    }
}

/// Two faces under the open sky, one turned over: nothing says which is right.
#[test]
fn faces_turned_against_each_other_are_refused_where_nothing_decides() {
    let said = said("ground.obj", "v 0 0 0\nv 9 0 0\nv 9 9 0\nv 0 9 0\nv 18 0 1\nv 18 9 1\nf 1 2 3 4\nf 2 3 6 5\n");
    assert!(said.contains("turned against each other, for example at the edge from (9.00;"), "{said}");
    // Regression: an edge of a small world was shown as a point.
    let small = Placement { scale: 1e-4, up: None };
    let text = "v 0 0 0\nv 9 0 0\nv 9 9 0\nv 0 9 0\nv 18 0 1\nv 18 9 1\nf 1 2 3 4\nf 2 3 6 5\n";
    let said = World::from_bytes("ground.obj", text.as_bytes(), &small).unwrap_err().to_string();
    assert!(said.contains("from (0.00090; 0.00000; 0.00000) to (0.00090; 0.00090; 0.00000)"), "{said}");
}
