//! What we write, OctoMap's own tools read: Debian's `octomap-tools`, skipped where they are not installed.

#[path = "../../../tests/common/skip.rs"]
mod skip;

use std::path::Path;
use std::process::Command;

use elk_map::octomap::bt::{read_bt, write_bt};
use elk_map::octomap::ot::{read_ot, write_ot};
use elk_map::{MapConfig, OccupancyMap};
use nalgebra::Point3;

/// A map of a few hundred voxels, some of them in cubes that are pruned.
fn map() -> OccupancyMap {
    let mut map = OccupancyMap::new(MapConfig::default()).unwrap();
    let points = (0..900).map(|i| {
        let (u, v) = (f64::from(i % 30) / 15.0 - 1.0, f64::from(i / 30) / 15.0 - 1.0);
        Point3::new(2.0, 1.5 * u, 1.5 * v)
    });
    for _ in 0..12 {
        map.insert(Point3::new(-0.3, 0.1, 0.2), points.clone());
    }
    map
}

/// Runs `convert_octree`; `None` where it is not installed.
fn convert(from: &Path, to: &Path) -> Option<String> {
    let output = match Command::new("convert_octree").arg(from).arg(to).output() {
        Ok(output) => output,
        Err(error) if error.kind() == std::io::ErrorKind::NotFound => {
            skip::skip("octomap_tools", "octomap-tools", "convert_octree is not installed (Debian: octomap-tools)");
            return None;
        }
        Err(error) => panic!("convert_octree: {error}"),
    };
    assert!(output.status.success(), "convert_octree {from:?} {to:?}: {output:?}");
    Some(String::from_utf8_lossy(&[output.stdout, output.stderr].concat()).into_owned())
}

/// Everything of a file: a tree has one header and one order of nodes.
#[test]
fn octomap_reads_our_files_and_writes_the_same_bytes() {
    let folder = tempfile::tempdir().unwrap();
    let path = |name: &str| folder.path().join(name);
    let read = |name: &str| std::fs::read(path(name)).unwrap();
    let map = map();
    let (occupancy, log_odds) = (map.occupancy_tree(), map.log_odds_tree());
    let create = |name| std::fs::File::create(path(name)).unwrap();
    write_bt(&mut create("ours.bt"), &occupancy, 0.1).unwrap();
    write_ot(&mut create("ours.ot"), &log_odds, 0.1).unwrap();
    for (from, to, same) in [
        ("ours.ot", "a.ot", "ours.ot"),
        ("ours.ot", "a.bt", "ours.bt"),
        ("ours.bt", "b.ot", ""),
        ("b.ot", "b.bt", "ours.bt"),
    ] {
        let Some(said) = convert(&path(from), &path(to)) else {
            return;
        };
        assert!(!said.contains("ERROR") && !said.contains("WARNING"), "{from}: {said}");
        assert!(same.is_empty() || read(to) == read(same), "{from} to {to}");
    }
    // As OctoMap reads a .bt, every voxel is at its clamp.
    let (theirs, ours) = (read("b.ot"), read("ours.bt"));
    let (theirs, ours) = (read_ot(&theirs).unwrap(), read_bt(&ours).unwrap());
    let states = theirs.cubes().map(|cube| (cube.min, cube.edge, cube.value > 0.0));
    assert!(states.eq(ours.cubes().map(|c| (c.min, c.edge, c.value))));
    assert!(theirs.cubes().all(|cube| cube.value < -1.9 || cube.value > 3.4));
}
