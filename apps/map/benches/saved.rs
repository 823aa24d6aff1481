//! A map of a million voxels into the bytes of a file and back: its own format beside OctoMap's.
//!
//! `cargo bench -p elk-map --bench saved`

use elk_map::{Format, MapConfig, OccupancyMap, Saved};
use nalgebra::{Point3, Vector3};

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

/// Rooms in a row, 5 × 4 × 3 m each with a door, seen from the middle of each all around, until this many voxels are known.
fn building(voxels: usize) -> OccupancyMap {
    let config = MapConfig { resolution: 0.05, ..MapConfig::default() };
    let mut map = OccupancyMap::new(config).expect("the settings make sense");
    let half = Vector3::new(2.5, 2.0, 1.5);
    for room in 0.. {
        if map.grid().free() + map.grid().occupied() >= voxels {
            break;
        }
        let middle = Point3::new(5.0 * f64::from(room) + 0.013, 0.021, 0.017);
        let points = (0..160_000).map(|i| {
            // Evenly over the sphere, by Fibonacci's spiral.
            let z = 1.0 - (2.0 * f64::from(i) + 1.0) / 160_000.0;
            let (sin, cos) = (2.399_963_229_728_653 * f64::from(i)).sin_cos();
            let direction = Vector3::new((1.0 - z * z).sqrt() * cos, (1.0 - z * z).sqrt() * sin, z);
            let range = (0..3).map(|axis| half[axis] / direction[axis].abs()).fold(f64::INFINITY, f64::min);
            middle + direction * range
        });
        let changed = map.insert(middle, points).changed;
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
}
