//! A map of a million voxels into the bytes of a file and back: its own format beside OctoMap's; and into what a reader is sent
//! that asks for all of it.
//!
//! `cargo bench -p elk-map --bench saved`

use elk_geometry::OccupancyGrid;
use elk_map::{Format, MapConfig, OccupancyMap, Saved};

#[path = "../tests/scans/mod.rs"]
mod scans;

/// Times that each is done.
const TIMES: usize = 11;

/// The median of the seconds that `work` takes, and what it comes to.
#[allow(clippy::disallowed_methods)] // A stopwatch: no decision and no output but the table depends on it.
fn median<T>(mut work: impl FnMut() -> T) -> (f64, T) {
    let mut timed = || {
        let start = std::time::Instant::now();
        let done = work();
        (start.elapsed().as_secs_f64(), done)
    };
    let (mut all, mut last) = (Vec::new(), timed());
    for _ in 0..TIMES {
        last = timed();
        all.push(last.0);
    }
    all.sort_unstable_by(f64::total_cmp);
    (all[TIMES / 2], last.1)
}

/// The map of so many rooms that this many voxels are known.
fn building(voxels: usize) -> OccupancyMap {
    let config = MapConfig { resolution: 0.05, ..MapConfig::default() };
    let mut map = OccupancyMap::new(config).expect("the settings make sense");
    for scan in scans::building() {
        if map.grid().free() + map.grid().occupied() >= voxels {
            break;
        }
        let changed = map.insert(scan.origin(), scan.points()).changed;
        map.advance(&changed);
    }
    map
}

fn main() {
    let map = building(1_000_000);
    let known = map.grid().free() + map.grid().occupied();
    println!("{known} voxels, {} bricks; medians of {TIMES}\n", map.grid().bricks().len());
    println!("| format | save | load | bytes a voxel |\n|---|---|---|---|");
    for (name, format) in [(".elkmap", Format::ElkMap), (".ot", Format::Ot), (".bt", Format::Bt)] {
        let (save, bytes) = median(|| format.write(&map));
        let (load, again) = median(|| {
            let saved = Saved::read(&bytes).expect("what was written is read");
            OccupancyMap::from_saved(*map.config(), &saved).expect("it fits")
        });
        assert_eq!(again.frontier_len(), map.frontier_len());
        let each = bytes.len() as f64 / known as f64;
        println!("| `{name}` | {:.1} ms | {:.1} ms | {each:.2} |", save * 1e3, load * 1e3);
    }
    println!("\nthe whole map as a reader is sent it, packed and applied:");
    for voxels in [1_000_000, 10_000_000, 40_000_000] {
        let map = building(voxels);
        let (pack, whole) = median(|| map.grid().whole());
        let (apply, copy) = median(|| {
            let mut copy = OccupancyGrid::new(map.config().resolution);
            copy.apply(&whole).expect("it is the whole map");
            copy
        });
        let known = copy.free() + copy.occupied();
        println!("{known} voxels, {} bricks: {:.2} ms, {:.2} ms", whole.bricks.len(), pack * 1e3, apply * 1e3);
    }
}
