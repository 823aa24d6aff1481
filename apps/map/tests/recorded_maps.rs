//! Maps that OctoMap wrote, read by us; skipped where the recorded data (`ELK_DATA`) are not there.

#[path = "../../../tests/common/data.rs"]
mod data;
#[path = "../../../tests/common/skip.rs"]
mod skip;

use elk_map::octomap::bt::read_bt;
use elk_map::octomap::graph::read_graph;
use elk_map::{Format, MapConfig, OccupancyMap, Saved};

/// A recorded file; `None`, and said, where it is not there.
fn recorded(test: &str, name: &str) -> Option<Vec<u8>> {
    let data = data::folder();
    let bytes = std::fs::read(data.join(name)).ok();
    if bytes.is_none() {
        skip::skip(test, "data", &format!("there is no {name} in {} (set ELK_DATA)", data.display()));
    }
    bytes
}

/// The map of a file, as sure of its voxels as the file.
fn again(bytes: &[u8]) -> OccupancyMap {
    let saved = Saved::read(bytes).unwrap();
    let (clamp_min, clamp_max) = (-100.0, 100.0);
    let config = MapConfig { resolution: saved.resolution(), clamp_min, clamp_max, ..MapConfig::default() };
    OccupancyMap::from_saved(config, &saved).unwrap()
}

#[test]
fn log_odds_that_octomap_wrote_are_read_and_written_to_the_byte() {
    let test = "log_odds_that_octomap_wrote_are_read_and_written_to_the_byte";
    let Some(bytes) = recorded(test, "scans/s100_r010.ot") else { return };
    assert!(Format::Ot.write(&again(&bytes)) == bytes, "the same tree has the same bytes");
}

#[test]
fn a_graph_that_octomap_comes_with_is_read_and_makes_a_map() {
    let test = "a_graph_that_octomap_comes_with_is_read_and_makes_a_map";
    let Some(bytes) = recorded(test, "octomap/spherical_scan.graph") else { return };
    let graph = read_graph(&bytes).unwrap();
    let scan = &graph.scans[0];
    assert_eq!((graph.scans.len(), scan.points.len(), scan.origin()), (1, 10_201, [1.0, 0.0, -0.5].into()));
    let map = OccupancyMap::from_graph(MapConfig::default(), &graph).unwrap();
    assert!(map.grid().occupied() > 1000 && map.grid().free() > 10_000, "{}", map.grid().occupied());
}

#[test]
fn maps_that_octomap_wrote_are_read_and_written_alike() {
    let test = "maps_that_octomap_wrote_are_read_and_written_alike";
    // (file, nodes): the counts are those of the files' own headers.
    for (name, nodes) in [("octomap/geb079.bt", 532_566), ("scans/s100_r010.bt", 0)] {
        let Some(bytes) = recorded(test, name) else { continue };
        let file = read_bt(&bytes).unwrap();
        if nodes != 0 {
            assert_eq!(file.nodes, nodes, "{name}");
        }
        let ours = Format::Bt.write(&again(&bytes));
        assert!(read_bt(&ours).unwrap().cubes().eq(file.cubes()), "{name}");
        let tail = |bytes: &[u8]| bytes[bytes.windows(5).position(|w| w == b"data\n").unwrap()..].to_vec();
        assert_eq!(tail(&ours), tail(&bytes), "{name}: the same tree has the same bytes");
        if name.starts_with("scans") {
            let count = |value| -> u64 {
                let cubes = file.cubes().filter(|c| c.value == value);
                cubes.map(|c| u64::from(c.edge).pow(3)).sum()
            };
            assert_eq!((count(true), count(false)), (44_016, 265_650), "what OctoMap's iterators count");
        }
    }
}
