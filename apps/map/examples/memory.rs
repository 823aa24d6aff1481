//! What a map takes of memory, and a copy of it, a voxel: `cargo run --release -p elk-map --example memory`.
//!
//! A building of rooms in a row, voxels of 0.05 m, one scan a room; what is allocated, by what it is for.

use std::alloc::{GlobalAlloc, Layout, System};
use std::sync::atomic::{AtomicUsize, Ordering::Relaxed};

use elk_geometry::OccupancyGrid;
use elk_map::{MapConfig, OccupancyMap};

#[path = "../tests/scans/mod.rs"]
mod scans;

/// Counts what is allocated: bytes in all, and those of bricks' log-odds, which have a size of their own.
struct Counting;

static ALL: AtomicUsize = AtomicUsize::new(0);
static LOG_ODDS: [AtomicUsize; 2] = [AtomicUsize::new(0), AtomicUsize::new(0)];

/// Bytes of a brick's log-odds, in a byte each and in full.
const SIZES: [usize; 2] = [512, 2048];

fn count(layout: Layout, add: impl Fn(&AtomicUsize, usize)) {
    add(&ALL, layout.size());
    for (size, sum) in SIZES.into_iter().zip(&LOG_ODDS).filter(|(size, _)| *size == layout.size()) {
        add(sum, size);
    }
}

// SAFETY: the system's allocator, and beside it numbers.
unsafe impl GlobalAlloc for Counting {
    unsafe fn alloc(&self, layout: Layout) -> *mut u8 {
        count(layout, |sum, size| {
            sum.fetch_add(size, Relaxed);
        });
        unsafe { System.alloc(layout) }
    }
    unsafe fn dealloc(&self, at: *mut u8, layout: Layout) {
        count(layout, |sum, size| {
            sum.fetch_sub(size, Relaxed);
        });
        unsafe { System.dealloc(at, layout) }
    }
}

#[global_allocator]
static COUNTING: Counting = Counting;

fn main() {
    println!(
        "| known voxels | bricks | log-odds, a byte each | log-odds in full | sets, table, grid, one scan | map | copy | both |"
    );
    println!("|---|---|---|---|---|---|---|---|");
    for wanted in [1_000_000, 10_000_000] {
        let now = || [ALL.load(Relaxed), LOG_ODDS[0].load(Relaxed), LOG_ODDS[1].load(Relaxed)];
        let before = now();
        let config = MapConfig { resolution: 0.05, ..MapConfig::default() };
        let mut map = OccupancyMap::new(config).expect("the settings make sense");
        let mut copy = OccupancyGrid::new(config.resolution);
        let (mut known, mut of_copy) = (0, 0);
        for scan in scans::building() {
            if known >= wanted {
                break;
            }
            let changed = map.insert(scan.origin(), scan.points()).changed;
            let delta = map.advance(&changed);
            let without = ALL.load(Relaxed);
            copy.apply(&delta).expect("it follows the one before");
            of_copy += ALL.load(Relaxed) - without;
            known = map.grid().free() + map.grid().occupied();
        }
        let [all, coded, full] = std::array::from_fn(|i| now()[i] - before[i]);
        let each = |bytes: usize| bytes as f64 / known as f64;
        println!(
            "| {known} | {} | {:.2} | {:.2} | {:.2} | {:.2} | {:.2} | {:.2} B |",
            map.grid().bricks().len(),
            each(coded),
            each(full),
            each(all - coded - full - of_copy),
            each(all - of_copy),
            each(of_copy),
            each(all)
        );
    }
}
