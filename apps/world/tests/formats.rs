//! The same world as STL, PLY and glTF.

use std::fmt::Write;
use std::path::PathBuf;

use elk_world::triangle::Triangle;
use elk_world::{Format, Placement, World};
use nalgebra::{Point3, Vector3};
use serde_json::{Value, json};

fn base() -> World {
    let path = PathBuf::from(env!("CARGO_MANIFEST_DIR")).join("../../tests/cases/obj/rooms-quads.obj");
    World::load(path.to_str().unwrap(), &Placement::default()).unwrap()
}

fn of(name: &str, bytes: &[u8]) -> World {
    World::from_bytes(name, bytes, &Placement::default()).unwrap_or_else(|error| panic!("{error}"))
}

fn said(name: &str, bytes: &[u8]) -> String {
    World::from_bytes(name, bytes, &Placement::default()).unwrap_err().to_string()
}

/// The base world's triangles; in 32 bits and in any order.
fn assert_is_base(world: &World, format: Format, name: &str) {
    let sorted = |world: &World| {
        let rounded = |t: &Triangle| t.0.map(|p| [p.x as f32, p.y as f32, p.z as f32].map(|c| c + 0.0));
        let mut all: Vec<_> = world.surfaces().triangles().iter().map(rounded).collect();
        all.sort_by(|a, b| a.partial_cmp(b).unwrap());
        all
    };
    assert_eq!(world.reading().format, Some(format), "{name}");
    assert_eq!(sorted(world), sorted(&base()), "{name}");
    assert!(world.reading().remarks().is_empty(), "{name}");
}

fn corners() -> Vec<Point3<f64>> {
    base().surfaces().triangles().iter().flat_map(|t| t.0).collect()
}

fn binary_stl(header: &str) -> Vec<u8> {
    let mut bytes = format!("{header:80}").into_bytes();
    bytes.extend((corners().len() as u32 / 3).to_le_bytes());
    for triangle in corners().chunks(3) {
        bytes.extend([0; 12]);
        bytes.extend(triangle.iter().flat_map(|p| [p.x, p.y, p.z]).flat_map(|c| (c as f32).to_le_bytes()));
        bytes.extend([0; 2]);
    }
    bytes
}

fn text_stl() -> String {
    let mut text = "solid rooms\n".to_owned();
    for triangle in corners().chunks(3) {
        text += " facet normal 0 0 0\n  outer loop\n";
        triangle.iter().for_each(|p| writeln!(text, "   vertex {} {} {:e}", p.x, p.y, p.z).unwrap());
        text += "  endloop\n endfacet\n";
    }
    text + "endsolid rooms\n"
}

#[test]
fn stl_is_read_as_text_and_as_bytes() {
    for (name, bytes) in [
        ("rooms.stl", binary_stl("made by nobody")),
        ("rooms.stl", binary_stl("solid that is none facet")),
        ("no ending", text_stl().into_bytes()),
        ("rooms.obj", text_stl().replace('\n', "\r\n").to_uppercase().into_bytes()),
    ] {
        assert_is_base(&of(name, &bytes), Format::Stl, name);
    }
    let whole = binary_stl("");
    let cut = said("rooms.stl", &whole[..whole.len() - 60]);
    assert!(cut.contains("says that it has 30 triangles, and has bytes for 28"), "{cut}");
    let not_finite = [&whole[..84 + 50 + 12], &f32::NAN.to_le_bytes(), &whole[84 + 50 + 16..]].concat();
    assert!(said("rooms.stl", &not_finite).starts_with("rooms.stl at byte 134: a face has the corner (NaN;"));
    let text = text_stl();
    assert!(
        said("r.stl", text.replacen("vertex", "vortex", 1).as_bytes())
            .starts_with("r.stl:4: \"vortex\" is no word of STL")
    );
    let cut = &text[..text.rfind("endloop").unwrap()];
    assert!(said("r.stl", cut.as_bytes()).contains("ends in the midst of a facet"));
    assert!(said("r.stl", b"solid x\nfacet\nouter loop\nvertex 1 2\n").starts_with("r.stl:4: a vertex has fewer"));
}

/// With properties of others before, between and behind, and faces before vertices if wanted.
fn ply(encoding: &str, faces_first: bool) -> Vec<u8> {
    let count = corners().len();
    let elements = [
        format!("element vertex {count}\nproperty uchar red\nproperty float x\nproperty double y\nproperty float z\n"),
        format!(
            "element face {}\nproperty list uchar float quality\nproperty list uchar int vertex_indices\n",
            count / 3
        ),
    ];
    let [first, second] = if faces_first { [&elements[1], &elements[0]] } else { [&elements[0], &elements[1]] };
    let more = "element edge 1\nproperty short a\n";
    let header = format!("ply\nformat {encoding} 1.0\ncomment Grüße\nobj_info x\n{first}{second}{more}end_header\n");
    let number = |value: f64, kind: char| -> Vec<u8> {
        let big = encoding.contains("big");
        let ordered = |mut bytes: Vec<u8>| {
            if big {
                bytes.reverse();
            }
            bytes
        };
        match kind {
            _ if encoding == "ascii" => format!("{value} ").into_bytes(),
            'f' => ordered((value as f32).to_le_bytes().to_vec()),
            'd' => ordered(value.to_le_bytes().to_vec()),
            'i' => ordered((value as i32).to_le_bytes().to_vec()),
            's' => ordered((value as i16).to_le_bytes().to_vec()),
            _ => vec![value as u8],
        }
    };
    let vertex = |p: &Point3<f64>| [number(7.0, 'u'), number(p.x, 'f'), number(p.y, 'd'), number(p.z, 'f')].concat();
    let vertices: Vec<u8> = corners().iter().flat_map(vertex).collect();
    let face = |i: usize| {
        let mut bytes = [number(1.0, 'u'), number(0.5, 'f'), number(3.0, 'u')].concat();
        (0..3).for_each(|k| bytes.extend(number((3 * i + k) as f64, 'i')));
        bytes
    };
    let faces: Vec<u8> = (0..count / 3).flat_map(face).collect();
    let [first, second] = if faces_first { [faces, vertices] } else { [vertices, faces] };
    [header.into_bytes(), first, second, number(1.0, 's')].concat()
}

#[test]
fn ply_is_read_as_text_and_in_both_orders_of_bytes() {
    for encoding in ["ascii", "binary_little_endian", "binary_big_endian"] {
        for faces_first in [false, true] {
            assert_is_base(&of("rooms.ply", &ply(encoding, faces_first)), Format::Ply, encoding);
        }
    }
    let whole = ply("binary_little_endian", false);
    assert!(said("r.ply", &whole[..whole.len() - 20]).contains("the PLY ends before all of its elements"));
    let text = String::from_utf8(ply("ascii", false)).unwrap();
    assert!(
        said("r.ply", text.replace("int vertex", "integer vertex").as_bytes()).starts_with("r.ply:12: \"integer\"")
    );
    assert!(said("r.ply", text.replace("ascii", "utf8").as_bytes()).starts_with("r.ply:2: \"utf8\" is no format"));
    assert!(said("r.ply", text.replace("end_header", "").as_bytes()).contains("header does not end"));
    assert!(said("r.ply", text.replace("element vertex 90", "element vertex 99").as_bytes()).contains("r.ply"));
    let endless = "ply\nformat ascii 1.0\nelement void 99999999999999\nelement face 1\nproperty list uchar int vertex_index\nend_header\n3 0 1 2\n";
    assert!(said("r.ply", endless.as_bytes()).starts_with("r.ply:7: a face has the vertex 0, and the file has 0"));
}

fn base64(bytes: &[u8]) -> String {
    const LETTERS: &[u8; 64] = b"ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz0123456789+/";
    let mut text = String::new();
    for three in bytes.chunks(3) {
        let bits = three.iter().fold(0_u32, |bits, byte| bits << 8 | u32::from(*byte)) << (8 * (3 - three.len()));
        for i in 0..4 {
            let letter = char::from(LETTERS[(bits >> (18 - 6 * i)) as usize & 63]);
            text.push(if i <= three.len() { letter } else { '=' });
        }
    }
    text
}

/// The base world, y up as glTF wants it, one half of it mirrored by its node: two meshes, below a node that shifts.
fn gltf(uri: Option<&str>) -> (Value, Vec<u8>) {
    let shift = Vector3::new(1.0, 2.0, 3.0);
    // z up to y up, and back where the node above brings it.
    let local = |p: &Point3<f64>| Point3::new(p.x, p.z, -p.y) - shift;
    let all = corners();
    let half = all.len() / 6 * 3;
    let positions = all.iter().enumerate().flat_map(|(i, p)| {
        let p = local(p);
        // The second mesh is stored mirrored, and its triangles, in other hands, with it.
        if i < half { [p.x, p.y, p.z] } else { [-p.x / 2.0, p.y / 2.0, p.z / 2.0] }
    });
    let mut bytes: Vec<u8> = positions.flat_map(|c| (c as f32).to_le_bytes()).collect();
    let indices = bytes.len();
    for i in 0..(all.len() - half) as u16 {
        let turned = [0, 2, 1][usize::from(i) % 3] + i / 3 * 3;
        bytes.extend(turned.to_le_bytes());
    }
    let buffer = match uri {
        Some(uri) => json!({ "byteLength": bytes.len(), "uri": uri }),
        None => json!({ "byteLength": bytes.len() }),
    };
    let document = json!({
        "asset": { "version": "2.0" },
        "extensionsRequired": ["KHR_materials_unlit"],
        "scene": 0,
        "scenes": [{ "nodes": [0] }],
        "nodes": [
            { "translation": [1.0, 2.0, 3.0], "children": [1, 2], "camera": 7 },
            { "mesh": 0, "matrix": [1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1] },
            { "mesh": 1, "scale": [-2.0, 2.0, 2.0] },
            { "mesh": 0, "translation": [100, 0, 0] },
        ],
        "meshes": [
            { "primitives": [{ "attributes": { "POSITION": 0, "NORMAL": 9 } }] },
            { "name": "Wände", "primitives": [{ "attributes": { "POSITION": 1 }, "indices": 2, "mode": 4, "material": 3 },
                                             { "attributes": { "POSITION": 1 }, "mode": 1 }] },
        ],
        "accessors": [
            { "bufferView": 0, "componentType": 5126, "count": half, "type": "VEC3" },
            { "bufferView": 0, "byteOffset": half * 12, "componentType": 5126, "count": all.len() - half, "type": "VEC3" },
            { "bufferView": 1, "componentType": 5123, "count": all.len() - half, "type": "SCALAR" },
        ],
        "bufferViews": [
            { "buffer": 0, "byteOffset": 0, "byteLength": indices, "byteStride": 12 },
            { "buffer": 0, "byteOffset": indices, "byteLength": bytes.len() - indices },
        ],
        "buffers": [buffer],
    });
    (document, bytes)
}

fn glb(document: &Value, blob: &[u8]) -> Vec<u8> {
    let mut json = document.to_string().into_bytes();
    json.resize(json.len().next_multiple_of(4), b' ');
    let mut blob = blob.to_vec();
    blob.resize(blob.len().next_multiple_of(4), 0);
    let mut bytes = b"glTF\x02\0\0\0".to_vec();
    bytes.extend((12 + 16 + json.len() as u32 + blob.len() as u32).to_le_bytes());
    for (kind, chunk) in [(b"JSON", &json), (b"BIN\0", &blob)] {
        bytes.extend((chunk.len() as u32).to_le_bytes());
        bytes.extend(kind);
        bytes.extend(chunk);
    }
    bytes
}

#[test]
fn gltf_is_read_with_its_bytes_in_it_beside_it_and_as_glb() {
    let (document, bytes) = gltf(None);
    assert_is_base(&of("rooms.glb", &glb(&document, &bytes)), Format::Gltf, "glb");
    let (document, _) = gltf(Some(&format!("data:application/octet-stream;base64,{}", base64(&bytes))));
    assert_is_base(&of("rooms.gltf", document.to_string().as_bytes()), Format::Gltf, "in it");
    let folder = tempfile::tempdir().unwrap();
    std::fs::write(folder.path().join("my rooms.bin"), &bytes).unwrap();
    let file = folder.path().join("rooms.gltf");
    std::fs::write(&file, gltf(Some("my%20rooms.bin")).0.to_string()).unwrap();
    let world = World::load(file.to_str().unwrap(), &Placement::default()).unwrap();
    assert_is_base(&world, Format::Gltf, "beside it");
}

#[test]
fn what_is_wrong_with_a_gltf_is_said_with_its_part() {
    let (document, bytes) = gltf(None);
    let says = |pointer: &str, value: Value| {
        let mut wrong = document.clone();
        *wrong.pointer_mut(pointer).unwrap() = value;
        said("r.glb", &glb(&wrong, &bytes))
    };
    assert!(
        says("/accessors/2/count", json!(999)).starts_with("r.glb in mesh 1 (Wände), primitive 0: bufferView 1 has")
    );
    assert!(says("/accessors/2/count", json!(usize::MAX)).contains("too few for the"));
    assert!(says("/bufferViews/0/byteLength", json!(1_u64 << 40)).contains("beyond the end of buffer 0"));
    assert!(says("/bufferViews/0/byteOffset", json!(usize::MAX)).contains("beyond the end of buffer 0"));
    assert!(says("/accessors/0/bufferView", json!(9)).contains("there is no bufferView 9"));
    assert!(says("/accessors/1/count", json!(3)).contains("a face has the vertex"));
    assert!(says("/nodes/1", json!({ "mesh": 0, "children": [0] })).contains("in node 0: it is below two nodes"));
    assert!(says("/nodes/1", json!({ "mesh": 7 })).contains("in mesh 7: there is no such mesh"));
    assert!(says("/nodes/1", json!({ "children": [9] })).contains("in node 9: there is no such node"));
    let instances = json!({ "mesh": 0, "extensions": { "EXT_mesh_gpu_instancing": {} } });
    assert!(says("/nodes/1", instances).contains("in node 1: it is drawn many times"));
    assert!(says("/scene", json!(3)).contains("there is no scene 3"));
    assert!(says("/asset/version", json!("1.0")).contains("this is glTF 1.0; right is 2.0"));
    let draco = json!({ "attributes": { "POSITION": 0 }, "extensions": { "KHR_draco_mesh_compression": {} } });
    assert!(says("/meshes/0/primitives/0", draco).contains("it is compressed"));
    assert!(says("/buffers/0", json!({ "uri": "https://example.org/a.bin" })).contains("no file beside this one"));
    for outside in
        ["/etc/hostname", "%2Fetc/hostname", "../r.bin", "%2e%2e/r.bin", "a/%2e%2E%2f..%2Fr.bin", "..%2Fr.bin", ""]
    {
        let found = says("/buffers/0", json!({ "uri": outside }));
        assert!(found.contains("is no file beside this one") || outside.is_empty(), "{found}");
    }
    assert!(says("/buffers/0", json!({ "uri": "none.bin" })).contains("cannot read none.bin"));
    assert!(said("r.gltf", b"{\n\"asset\": {\n\"version\": \"2.0\",\n}}").starts_with("r.gltf:4: this is no glTF"));
    let whole = glb(&document, &bytes);
    assert!(said("r.glb", &whole[..whole.len() / 2]).contains("cut off"));
}

/// Regression: a few bytes named a mesh again and again, and what they came to was bounded by no length of the file.
#[test]
fn what_a_file_comes_to_is_bounded() {
    const TOO_MANY: &str = "more than 8388608 triangles";
    let header = "ply\nformat binary_little_endian 1.0\nelement face 9000000\nproperty list uchar uchar vertex_indices\nend_header\n";
    let found = said("r.ply", &[header.as_bytes(), &vec![0; 9_000_000]].concat());
    assert!(found.contains(TOO_MANY), "{found}");
    let header = "ply\nformat binary_little_endian 1.0\nelement vertex 26000000\nproperty char x\nelement face 0\nproperty list uchar uchar vertex_indices\nend_header\n";
    let found = said("r.ply", &[header.as_bytes(), &vec![0; 26_000_000]].concat());
    assert!(found.contains("more than 25165824 vertices"), "{found}");
    let found = said("r.obj", &[b"v 0 0 0\n", "f 1\n".repeat(9_000_000).as_bytes()].concat());
    assert!(found.contains(TOO_MANY), "{found}");
    // Faces that are large, and few.
    let star: String = (0..30_000).map(|i| format!("v {} {} 0\n", i % 2, i)).collect();
    let face = format!("f{}\n", (1..=30_000).map(|i| format!(" {i}")).collect::<String>());
    assert!(said("r.obj", format!("{star}{}", face.repeat(10)).as_bytes()).contains("its large faces come to more"));
    // A mesh in many nodes: of triangles, or of primitives that have none.
    let (mut document, bytes) = gltf(None);
    let nodes = |count: usize, mesh: &Value| json!(vec![json!({ "mesh": mesh }); count]);
    let all_nodes = |count: usize| json!({ "nodes": (0..count).collect::<Vec<_>>() });
    document["nodes"] = nodes(3000, &json!(0));
    document["scenes"][0] = all_nodes(3000);
    document["meshes"][0]["primitives"] = json!(vec![json!({ "mode": 0 }); 3000]);
    assert!(said("r.glb", &glb(&document, &bytes)).contains(TOO_MANY));
    document["meshes"][0]["primitives"] = json!(vec![json!({ "attributes": { "POSITION": 0 }, "indices": 2 }); 200]);
    document["bufferViews"][0] = json!({ "buffer": 0, "byteLength": bytes.len() });
    document["accessors"][2] =
        json!({ "bufferView": 0, "componentType": 5121, "count": bytes.len(), "type": "SCALAR" });
    let mut zeros = bytes;
    zeros.fill(0);
    let found = said("r.glb", &glb(&document, &zeros));
    assert!(found.contains(TOO_MANY), "{found}");
    document["nodes"] = json!(vec![json!({}); 3_000_000]);
    assert!(said("r.glb", &glb(&document, &[])).contains("at most 2097152 are read"));
}

/// Regression: each buffer was bounded, and not what all of them come to; whose roots nobody names took time with the
/// square of the nodes.
#[test]
fn buffers_and_nodes_of_a_gltf_are_bounded_together() {
    let folder = tempfile::tempdir().unwrap();
    let sparse = std::fs::File::create(folder.path().join("zeros.bin")).unwrap();
    sparse.set_len(200 << 20).unwrap();
    let (mut document, _) = gltf(None);
    document["buffers"] = json!(vec![json!({ "uri": "zeros.bin" }); 2]);
    document["bufferViews"][1]["buffer"] = json!(1);
    let file = folder.path().join("rooms.gltf");
    std::fs::write(&file, document.to_string()).unwrap();
    let found = World::load(file.to_str().unwrap(), &Placement::default()).unwrap_err().to_string();
    assert!(found.contains("zeros.bin its buffers come to more than 256 MiB"), "{found}");
    // In the order of a hundred thousand million looks, if each node is looked for in all others.
    let (mut document, bytes) = gltf(None);
    document["nodes"].as_array_mut().unwrap().truncate(3);
    let bare = json!(vec![json!({ "children": [] }); 400_000]);
    document["nodes"].as_array_mut().unwrap().extend(bare.as_array().unwrap().clone());
    document.as_object_mut().unwrap().retain(|key, _| !key.starts_with("scene"));
    assert_is_base(&of("rooms.glb", &glb(&document, &bytes)), Format::Gltf, "no scene");
}

/// A flip of any byte, or the end at any place: a world or an error, and no panic.
#[test]
fn damaged_files_are_worlds_or_errors() {
    let (document, bytes) = gltf(None);
    let files = [
        ("r.stl", binary_stl("")),
        ("r.stl", text_stl().into_bytes()),
        ("r.ply", ply("ascii", true)),
        ("r.ply", ply("binary_big_endian", false)),
        ("r.glb", glb(&document, &bytes)),
        ("r.obj", include_bytes!("../../../tests/cases/obj/rooms-ngon.obj").to_vec()),
        ("r.obj", include_bytes!("../../../tests/cases/obj/continuation.obj").to_vec()),
    ];
    for (name, whole) in files {
        for i in (0..whole.len()).step_by(whole.len() / 150) {
            let mut flipped = whole.clone();
            flipped[i] ^= 1 << (i % 8);
            let _ = World::from_bytes(name, &flipped, &Placement::default());
            let _ = World::from_bytes(name, &whole[..i], &Placement::default());
        }
    }
}

fn notes(name: &str, bytes: &[u8]) -> String {
    of(name, bytes).reading().remarks().join("\n")
}

/// Regression: all of it was left out without a word.
#[test]
fn what_is_left_out_is_said_with_its_number_and_place() {
    let obj = include_str!("../../../tests/cases/obj/rooms-quads.obj");
    let lines = obj.lines().count();
    let more =
        "vt 0 0\nl 1 2\ncstype bezier\nsurf 0 1 0 1 1 2 3 4\nend\ncurv 0 1 1 2\ncall b.obj 1\nface 1 2 3\nF 1 2 3\n";
    let found = notes("r.obj", format!("{obj}{more}").as_bytes());
    for (what, line) in [
        ("2 free-form curves or surfaces are left out (the first: \"surf\" in line", 4),
        ("1 statements that fetch another file or run a program are left out (the first: \"call\" in line", 7),
        ("2 statements that OBJ does not know are left out (the first: \"face\" in line", 8),
    ] {
        assert!(found.contains(&format!("{what} {})", lines + line)), "{found}");
    }
    assert_eq!(found.lines().count(), 3, "{found}");
    let only = said("r.obj", b"v 0 0 0\nv 1 0 0\nv 0 1 0\nsurf 0 1 0 1 1 2 3\n");
    assert!(only.contains("has no faces; 1 free-form curves or surfaces are left out"), "{only}");

    for header in ["made by nobody", "solid rooms", "solid facet"] {
        let stl = binary_stl(header);
        let [less, more, none] = [28_u32, 32, 0].map(|count| [&stl[..80], &count.to_le_bytes(), &stl[84..]].concat());
        let found = notes("r.stl", &less);
        assert!(found.contains("2 triangles behind those that the STL says it has are left out"), "{found}");
        assert!(found.contains("(the first at byte 1484)"), "{found}");
        assert!(said("r.stl", &more).contains("says that it has 32 triangles, and has bytes for 30"));
        assert!(said("r.stl", &none).contains("has no faces; 30 triangles behind those"));
        let found = notes("r.stl", &[&stl[..], b"hello"].concat());
        assert!(found.contains("5 bytes behind the last triangle are left out (the first at byte 1584)"), "{found}");
    }
    let text = text_stl();
    let quad = text.replacen("  endloop", "   vertex 2 2 0\n  endloop", 1);
    let found = notes("r.stl", quad.as_bytes());
    assert!(found.contains("1 facets have more than three corners: they are read as polygons (the first in line 3)"));

    let ascii = ply("ascii", false);
    let found = notes("r.ply", &[&ascii[..], b"\n3 0 1 2\n"].concat());
    assert!(found.contains("4 numbers or words behind the PLY's last element are left out (the first in line"));
    let little = ply("binary_little_endian", false);
    let found = notes("r.ply", &[&little[..], b"\n123456789\n"].concat());
    assert!(found.contains("9 bytes behind the PLY's last element are left out (the first at byte"), "{found}");
    assert_eq!(notes("r.ply", &[&little[..], b"\r\n"].concat()), "");
    let other = String::from_utf8(ascii).unwrap().replace("vertex_indices", "vertex_indexes");
    let found = said("r.ply", other.as_bytes());
    assert!(
        found.contains("faces have the lists \"quality, vertex_indexes\" and no list vertex_indices or vertex_index"),
        "{found}"
    );
}

/// Regression: meshes were read as if nothing bent them.
#[test]
fn what_changes_the_shape_of_a_gltf_and_is_not_read_is_said() {
    let (mut document, bytes) = gltf(None);
    document["extensionsRequired"] = json!(["KHR_texture_basisu", "ACME_holes", "KHR_draco_mesh_compression"]);
    document["nodes"][1]["skin"] = json!(0);
    document["nodes"][1]["weights"] = json!([0.0, 0.0]);
    document["meshes"][0]["weights"] = json!([0.0, 1.0]);
    document["meshes"][1]["weights"] = json!([0.5]);
    let found = notes("r.glb", &glb(&document, &bytes));
    for what in [
        "1 extensions that the file requires are not known: what they change is not read (the first: ACME_holes)",
        "1 meshes that joints bend (skins) are read straight, as their nodes place them (the first in node 1)",
        "1 meshes that are morphed (weights) are read as they are without it (the first in node 2)",
    ] {
        assert!(found.contains(what), "{found}");
    }
    assert_eq!(found.lines().count(), 3, "{found}");
}
