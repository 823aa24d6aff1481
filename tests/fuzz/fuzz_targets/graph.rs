//! Any bytes as scans that are perhaps those of a .graph, and as the map of them.
#![no_main]

use elk_map::octomap::graph::read_graph;
use elk_map::{MapConfig, OccupancyMap};
use libfuzzer_sys::fuzz_target;

fuzz_target!(|bytes: &[u8]| {
    let Ok(graph) = read_graph(bytes) else { return };
    let points: usize = graph.scans.iter().map(|scan| scan.points.len()).sum();
    assert!(28 * points + 72 * graph.scans.len() <= bytes.len());
    let map = OccupancyMap::from_graph(MapConfig { max_bricks: 64, ..MapConfig::default() }, &graph).unwrap();
    assert!(map.grid().bricks().len() <= 64);
});
