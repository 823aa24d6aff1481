//! Scans a second into the map, beside OctoMap (Debian's liboctomap-dev, where it is installed) on the same scans.
//!
//! `cargo bench -p elk-map --bench insertion`. Scans of a generated room, and of `$ELK_DATA/scans/*.scn` where they are. All
//! run in turns (`ELK_TURNS`, 3 of them), and of the times of each scan the median counts, because machines are shared.

use std::alloc::{GlobalAlloc, Layout, System};
use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicUsize, Ordering};

use elk_map::{Grazing, Integration, MapConfig, OccupancyMap};

#[path = "../tests/octomap/mod.rs"]
mod octomap;
#[path = "../tests/scans/mod.rs"]
mod scans;

use scans::Scan;

/// Counts what is allocated.
struct Counting;

static ALLOCATED: AtomicUsize = AtomicUsize::new(0);

// SAFETY: the system's allocator, and beside it a number.
unsafe impl GlobalAlloc for Counting {
    unsafe fn alloc(&self, layout: Layout) -> *mut u8 {
        ALLOCATED.fetch_add(layout.size(), Ordering::Relaxed);
        unsafe { System.alloc(layout) }
    }
    unsafe fn dealloc(&self, at: *mut u8, layout: Layout) {
        ALLOCATED.fetch_sub(layout.size(), Ordering::Relaxed);
        unsafe { System.dealloc(at, layout) }
    }
}

#[global_allocator]
static COUNTING: Counting = Counting;

/// Who inserts scans.
#[derive(Clone, Copy)]
enum Who {
    /// OctoMap, in a mode of `octomap.cpp`.
    OctoMap(&'static str),
    /// The map, and whether what changed is kept for its readers as well, with the rules of a mission.
    Elk(Integration, Grazing),
}

const ALL: [(&str, Who); 6] = [
    ("OctoMap plain", Who::OctoMap("plain")),
    ("OctoMap discretize + lazy", Who::OctoMap("best")),
    ("elk, as OctoMap", Who::Elk(Integration::Rays, Grazing::None)),
    ("elk, as missions have it", Who::Elk(Integration::Rays, Grazing::Guard)),
    ("elk EndVoxels, as OctoMap", Who::Elk(Integration::EndVoxels, Grazing::None)),
    ("elk EndVoxels, missions", Who::Elk(Integration::EndVoxels, Grazing::Guard)),
];

/// CPU seconds of this thread.
#[allow(clippy::disallowed_methods)] // A stopwatch: no decision and no output but the table depends on it.
fn now() -> f64 {
    let time = rustix::time::clock_gettime(rustix::time::ClockId::ThreadCPUTime);
    time.tv_sec as f64 + time.tv_nsec as f64 * 1e-9
}

/// What became of it: CPU seconds a scan, and bytes.
fn elk(scans: &[Scan], config: MapConfig) -> (Vec<f64>, usize) {
    let before = ALLOCATED.load(Ordering::Relaxed);
    let mut map = OccupancyMap::new(config).expect("the settings make sense");
    let insert = |scan: &Scan| {
        let start = now();
        map.insert(scan.origin(), scan.points());
        now() - start
    };
    let seconds = scans.iter().map(insert).collect();
    (seconds, ALLOCATED.load(Ordering::Relaxed) - before)
}

fn turn(
    who: Who,
    scans: &[Scan],
    file: &Path,
    resolution: f64,
    octomap: Option<&PathBuf>,
) -> Option<(Vec<f64>, usize)> {
    match who {
        Who::OctoMap(mode) => {
            let outcome = octomap::run(octomap?, file, resolution, 0.0, mode, None);
            Some((outcome.seconds, outcome.heap))
        }
        Who::Elk(integration, Grazing::None) => {
            Some(elk(scans, MapConfig { integration, ..MapConfig::octomap(resolution) }))
        }
        Who::Elk(integration, _) => Some(elk(scans, MapConfig { integration, resolution, ..MapConfig::default() })),
    }
}

fn median(mut of: Vec<f64>) -> f64 {
    of.sort_by(f64::total_cmp);
    of[of.len() / 2]
}

/// Prints a line, and answers the scans a second.
fn summary(name: &str, turns: &[(Vec<f64>, usize)], plain: Option<f64>) -> f64 {
    let scans = turns[0].0.len();
    let mut times: Vec<f64> = (0..scans).map(|i| median(turns.iter().map(|(times, _)| times[i]).collect())).collect();
    let rate = scans as f64 / times.iter().sum::<f64>();
    times.sort_by(f64::total_cmp);
    let at = |share: f64| times[((scans - 1) as f64 * share).round() as usize] * 1e3;
    let ratio = plain.map_or(String::new(), |plain| format!("{:>6.1} x", rate / plain));
    println!(
        "  {name:<26} {rate:>8.1} scans/s {ratio:>8}   median {:>8.3} ms   p99 {:>8.3} ms   slowest {:>8.3} ms   heap {:>6.1} MB",
        at(0.5),
        at(0.99),
        at(1.0),
        turns[0].1 as f64 / 1e6
    );
    rate
}

fn compare(name: &str, scans: &[Scan], resolution: f64, octomap: Option<&PathBuf>, folder: &Path) {
    let number = |name: &str, default: usize| std::env::var(name).ok().and_then(|n| n.parse().ok()).unwrap_or(default);
    let points: usize = scans.iter().map(|scan| scan.points.len()).sum();
    println!("{name}: {} scans, {points} points, voxels of {resolution} m", scans.len());
    let file = folder.join("scans.scn");
    scans::write(&file, scans).expect("a temporary folder takes files");
    let mut turns = vec![Vec::new(); ALL.len()];
    for _ in 0..number("ELK_TURNS", 3) {
        for (who, turns) in ALL.iter().zip(&mut turns) {
            turns.extend(turn(who.1, scans, &file, resolution, octomap));
        }
    }
    let mut plain = None;
    for ((name, _), turns) in ALL.iter().zip(&turns).filter(|(_, turns)| !turns.is_empty()) {
        let rate = summary(name, turns, plain);
        plain = plain.or(octomap.map(|_| rate));
    }
}

fn main() {
    let folder = tempfile::tempdir().expect("there is a place for temporary files");
    let octomap = octomap::build(folder.path());
    if let Err(why) = &octomap {
        println!("without OctoMap: {why}");
    }
    let octomap = octomap.ok();
    let wanted = std::env::args().skip(1).find(|argument| !argument.starts_with('-')).unwrap_or_default();
    let compare = |name: &str, scans: &[Scan], sizes: &[f64]| {
        sizes.iter().for_each(|size| compare(name, scans, *size, octomap.as_ref(), folder.path()));
    };
    if "room".contains(&wanted) {
        compare("room", &scans::room(100, 100), &[0.1, 0.05]);
    }
    for (name, sizes) in [("s100.scn", [0.1, 0.05]), ("real7s.scn", [0.05, 0.02])] {
        match scans::recorded(name).filter(|_| name.contains(&wanted)) {
            Some(scans) => compare(name, &scans, &sizes),
            None => println!("{name}: skipped, no such scans (set ELK_DATA)"),
        }
    }
    if "large images".contains(&wanted) {
        compare("large images", &scans::room(512, 384)[..12], &[0.05]);
    }
}
