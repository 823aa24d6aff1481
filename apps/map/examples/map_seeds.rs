//! Small files of maps, for those who try to break their readers: `cargo run -p elk-map --example map_seeds`.

use std::path::Path;

use elk_map::{Format, MapConfig, OccupancyMap};
use nalgebra::Point3;

/// Where the seeds of fuzzing are.
const SEEDS: &str = concat!(env!("CARGO_MANIFEST_DIR"), "/../../tests/fuzz/seeds");

fn put(name: &str, bytes: &[u8]) -> std::io::Result<()> {
    let file = Path::new(SEEDS).join(name);
    std::fs::create_dir_all(file.parent().unwrap_or(Path::new(SEEDS)))?;
    std::fs::write(file, bytes)
}

/// A vector or a quaternion of a `.graph`.
fn numbers(numbers: &[f64]) -> Vec<u8> {
    let all = numbers.iter().flat_map(|number| number.to_le_bytes());
    (numbers.len() as u32).to_le_bytes().into_iter().chain(all).collect()
}

/// A `.graph` of one scan of two points.
fn graph() -> Vec<u8> {
    let word = |word: u32| word.to_le_bytes().to_vec();
    let points = [numbers(&[1.0, 0.0, 0.0]), numbers(&[0.0, -0.5, 0.25])].concat();
    let pose = [numbers(&[0.05, 0.05, 0.05]), numbers(&[1.0, 0.0, 0.0, 0.0])].concat();
    [word(1), word(2), points, pose, word(0), word(0)].concat()
}

fn main() -> std::io::Result<()> {
    let mut map = OccupancyMap::new(MapConfig::default()).expect("the settings make sense");
    map.insert(Point3::new(0.05, 0.05, 0.05), [Point3::new(1.05, 0.05, 0.05), Point3::new(0.05, -0.45, 0.25)]);
    put("elkmap/map.elkmap", &Format::ElkMap.write(&map))?;
    put("octomap/map.ot", &Format::Ot.write(&map))?;
    let bt = Format::Bt.write(&map);
    put("octomap/map.bt", &bt)?;
    // As before 2011: behind a binary header the same nodes.
    let data = bt.windows(5).position(|window| window == b"data\n").map_or(0, |at| at + 5);
    let nodes = (map.occupancy_tree().count() as u32).to_le_bytes();
    put("octomap/legacy.bt", &[&3u32.to_le_bytes()[..], &0.1f64.to_le_bytes(), &nodes, &bt[data..]].concat())?;
    put("graph/scan.graph", &graph())
}
