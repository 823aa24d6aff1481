//! `elk mapfile`: the files of maps, looked into and made of one another.

mod common;

use common::Elk;
use elk_geometry::Voxel;
use elk_map::{Format, MapConfig, OccupancyMap, Saved};
use nalgebra::Point3;

/// The output of a command that succeeds, or the words of one that does not.
fn mapfile(elk: &Elk, arguments: &[&str]) -> Result<String, String> {
    let out = elk.command(&[&["mapfile"], arguments].concat()).output().unwrap();
    let [told, apart] = [out.stdout, out.stderr].map(|bytes| String::from_utf8(bytes).unwrap());
    if out.status.success() { Ok(told) } else { Err(apart) }
}

/// A map of ten free voxels and an occupied one along `axis`, as a file.
fn ray(elk: &Elk, name: &str, axis: usize, resolution: f64) {
    let mut map = OccupancyMap::new(MapConfig { resolution, ..MapConfig::default() }).unwrap();
    let start = Point3::new(0.5, 0.5, 0.5);
    let mut end = start;
    end[axis] += 10.0;
    map.insert(start * resolution, [end * resolution]);
    let file = elk.folder().join(name);
    std::fs::write(&file, Format::of(&file).unwrap().write(&map)).unwrap();
}

fn log_odds(elk: &Elk, name: &str, voxel: [i32; 3]) -> f32 {
    let bytes = std::fs::read(elk.folder().join(name)).unwrap();
    OccupancyMap::from_saved(MapConfig::default(), &Saved::read(&bytes).unwrap())
        .unwrap()
        .log_odds(Voxel::from(voxel))
        .unwrap()
}

#[test]
fn a_map_is_converted_and_several_become_one() {
    let elk = Elk::new("mapfile");
    ray(&elk, "x.elkmap", 0, 0.1);
    ray(&elk, "y.ot", 1, 0.1);
    let told = mapfile(&elk, &["convert", "x.elkmap", "-o", "x.bt"]).unwrap();
    assert!(told.contains("voxels   11 of 0.1 m: 10 free, 1 occupied"), "{told}");
    let told = mapfile(&elk, &["info", "x.bt"]).unwrap();
    assert!(told.contains("OctoMap's .bt") && told.contains("from (0; 0; 0) to (1.1; 0.1; 0.1) m"), "{told}");
    mapfile(&elk, &["convert", "x.elkmap", "y.ot", "-o", "both.ot"]).unwrap();
    let told = mapfile(&elk, &["info", "both.ot"]).unwrap();
    assert!(told.contains("voxels   21 of 0.1 m: 19 free, 2 occupied"), "{told}");
    let sums = [[0, 0, 0], [1, 0, 0], [0, 10, 0]].map(|voxel| log_odds(&elk, "both.ot", voxel));
    assert_eq!(sums, [-0.8, -0.4, 0.85], "what both have seen adds up");
}

#[test]
fn two_maps_are_held_against_each_other() {
    let elk = Elk::new("mapfile-diff");
    ray(&elk, "x.elkmap", 0, 0.1);
    ray(&elk, "y.ot", 1, 0.1);
    ray(&elk, "coarse.ot", 1, 0.2);
    let told = mapfile(&elk, &["diff", "x.elkmap", "y.ot"]).unwrap();
    // Both begin in one voxel, and the next of each is beside the other's.
    assert!(
        told.contains("x.elkmap: of 11 known voxels 9.09 % are the same in the other, 18.18 % to 1 voxels"),
        "{told}"
    );
    let told = mapfile(&elk, &["diff", "x.elkmap", "x.elkmap", "--within", "0"]).unwrap();
    assert!(told.contains("100.00 % are the same"), "{told}");
    let refused = mapfile(&elk, &["diff", "x.elkmap", "coarse.ot"]).unwrap_err();
    assert!(refused.contains("has voxels of 0.1 m and coarse.ot of 0.2 m; right is the same"), "{refused}");
}

/// A scan of one point, a metre before the sensor; no edges.
#[test]
fn the_scans_of_a_graph_become_a_map_of_the_voxels_that_are_asked_for() {
    let elk = Elk::new("mapfile-graph");
    let numbers = |numbers: &[f64]| -> Vec<u8> {
        let all = numbers.iter().flat_map(|number| number.to_le_bytes());
        (numbers.len() as u32).to_le_bytes().into_iter().chain(all).collect()
    };
    let (point, place, turn) = (numbers(&[1.0, 0.0, 0.0]), numbers(&[0.1; 3]), numbers(&[1.0, 0.0, 0.0, 0.0]));
    let [one, none] = [1u32, 0].map(u32::to_le_bytes);
    let bytes = [&one[..], &one, &point, &place, &turn, &none, &none].concat();
    std::fs::write(elk.folder().join("scan.graph"), &bytes).unwrap();
    let told = mapfile(&elk, &["info", "scan.graph"]).unwrap();
    assert!(told.contains("a .graph of 1 scans, 1 points"), "{told}");
    let told = mapfile(&elk, &["convert", "scan.graph", "-o", "scan.elkmap", "--res", "0.2"]).unwrap();
    assert!(told.contains("voxels   6 of 0.2 m: 5 free, 1 occupied"), "{told}");
    std::fs::write(elk.folder().join("cut.graph"), &bytes[..50]).unwrap();
    let said = mapfile(&elk, &["info", "cut.graph"]).unwrap_err();
    assert!(said.contains("cut.graph: the file ends at byte 50 in the middle of"), "{said}");
}

#[test]
fn what_cannot_be_made_is_refused_in_words() {
    let elk = Elk::new("mapfile-refused");
    ray(&elk, "fine.elkmap", 0, 0.1);
    ray(&elk, "coarse.ot", 0, 0.2);
    std::fs::write(elk.folder().join("none.bt"), "no map").unwrap();
    let cases: [(&[&str], &str); 5] = [
        (&["info", "none.bt"], "it is no map"),
        (&["info", "nowhere.bt"], "No such file"),
        (&["convert", "fine.elkmap", "-o", "fine.ply"], "right is such an ending"),
        (&["convert", "fine.elkmap", "-o", "coarse.ot"], "it is there already"),
        (&["convert", "fine.elkmap", "coarse.ot", "-o", "both.bt"], "coarse.ot does not fit fine.elkmap"),
    ];
    for (arguments, words) in cases {
        let said = mapfile(&elk, arguments).unwrap_err();
        assert!(said.contains(words), "{arguments:?}: {said}");
    }
    assert!(!elk.folder().join("both.bt").exists());
}
