//! What is taken of the heap, at most: by files that are read, and by a map that has forgotten.

use std::alloc::{GlobalAlloc, Layout, System};
use std::cell::Cell;

use elk_geometry::Bounds;
use elk_map::{Format, MapConfig, OccupancyMap, Saved};
use nalgebra::Point3;

#[path = "scans/mod.rs"]
mod scans;

thread_local! {
    /// Bytes that this thread has now, and the most that it had since that was asked for.
    static NOW: Cell<usize> = const { Cell::new(0) };
    static MOST: Cell<usize> = const { Cell::new(0) };
}

/// Counts what each thread allocates.
struct Counting;

// SAFETY: the system's allocator, and beside it numbers.
unsafe impl GlobalAlloc for Counting {
    unsafe fn alloc(&self, layout: Layout) -> *mut u8 {
        NOW.set(NOW.get() + layout.size());
        MOST.set(MOST.get().max(NOW.get()));
        unsafe { System.alloc(layout) }
    }
    unsafe fn dealloc(&self, at: *mut u8, layout: Layout) {
        // What another thread allocated was not counted here.
        NOW.set(NOW.get().saturating_sub(layout.size()));
        unsafe { System.dealloc(at, layout) }
    }
}

#[global_allocator]
static COUNTING: Counting = Counting;

/// What `work` comes to, the most bytes that it takes, and what is left of them.
fn taken<T>(work: impl FnOnce() -> T) -> (T, usize, usize) {
    let before = NOW.get();
    MOST.set(before);
    let done = work();
    (done, MOST.get() - before, NOW.get().saturating_sub(before))
}

fn building() -> OccupancyMap {
    let mut map = OccupancyMap::new(MapConfig { resolution: 0.05, ..MapConfig::default() }).unwrap();
    for scan in scans::building().take(6) {
        let changed = map.insert(scan.origin(), scan.points()).changed;
        map.advance(&changed);
    }
    map
}

/// Inner nodes over inner nodes, down to `level`, in which nothing is known: a `.bt` says two bytes of each, an `.ot` five.
fn inner_nodes(level: u32, inner: &[u8], last: &[u8], bytes: &mut Vec<u8>) -> usize {
    if level == 0 {
        bytes.extend(last);
        return 1;
    }
    bytes.extend(inner);
    1 + (0..8).map(|_| inner_nodes(level - 1, inner, last, bytes)).sum::<usize>()
}

/// A tree whose nodes are inner ones but for the last, which say as little as may be.
fn hostile(magic: &str, inner: &[u8], last: &[u8]) -> Vec<u8> {
    let mut data = Vec::new();
    let nodes = inner_nodes(6, inner, last, &mut data);
    let header = format!("{magic}\nid OcTree\nsize {nodes}\nres 0.05\ndata\n");
    [header.as_bytes(), &data].concat()
}

/// However a file is made, its tree takes nothing, and its map what a map may.
#[test]
fn a_file_of_octomap_s_is_read_in_place() {
    let map = building();
    let files = [
        ("honest .bt", Format::Bt.write(&map)),
        ("honest .ot", Format::Ot.write(&map)),
        ("hostile .bt", hostile("# Octomap OcTree binary file", &[255, 255], &[0, 0])),
        ("hostile .ot", hostile("# Octomap OcTree file", &[0, 0, 0, 0, 255], &[0, 0, 0, 0, 0])),
    ];
    for (name, bytes) in &files {
        let (saved, to_read, _) = taken(|| Saved::read(bytes).unwrap());
        assert!(to_read < 1 << 14, "{name} of {} bytes: {to_read}", bytes.len());
        let config = MapConfig { resolution: 0.05, ..MapConfig::default() };
        let (map, most, kept) = taken(|| OccupancyMap::from_saved(config, &saved));
        let bricks = map.as_ref().map_or(0, |map| map.grid().bricks().len());
        println!(
            "{name}, {} bytes: {to_read} to read, at most {most} for {bricks} bricks, {kept} in the end",
            bytes.len()
        );
        assert!(bricks > 0 || name.starts_with("hostile"), "{name}");
        assert!(most < 2048 * bricks + (1 << 16), "{name}: {most} for {bricks} bricks");
    }
}

#[test]
fn what_is_forgotten_takes_no_memory() {
    let snapshot = building().snapshot();
    let ((mut map, mut copy), _, whole) = taken(|| {
        // Without what is kept of a scan for the next one.
        let map = OccupancyMap::restore(MapConfig { resolution: 0.05, ..MapConfig::default() }, &snapshot).unwrap();
        let copy = map.grid().clone();
        (map, copy)
    });
    let mut middles: Vec<i32> = map.grid().bricks().iter().map(|(brick, _)| brick.x).collect();
    middles.sort_unstable();
    let middle = f64::from(middles[middles.len() / 2]) * 8.0 * 0.05;
    let far = [f64::MIN, f64::MAX].map(|c| Point3::new(c, c, c));
    let bricks = map.grid().bricks().len();
    let now = NOW.get();
    let [half, all] = [middle, f64::MAX].map(|end| {
        let changed = map.clear_box(Bounds { min: far[0], max: Point3::new(end, f64::MAX, f64::MAX) });
        copy.apply(&map.advance(&changed)).unwrap();
        drop(changed);
        (map.grid().bricks().len() as f64 / bricks as f64, (now - NOW.get()) as f64 / whole as f64)
    });
    println!("{bricks} bricks, {whole} bytes with a copy: (left, given back) {half:?}, {all:?}");
    assert!(half.0 < 0.8 && half.1 > 0.8 * (1.0 - half.0), "{half:?}");
    assert!(all.0 == 0.0 && all.1 > 0.99, "{all:?}");
}
