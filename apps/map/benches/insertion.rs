//! Scans a second into the map, beside a straightforward map (a std hash of voxels, updated voxel by voxel).
//!
//! `cargo bench -p elk-map`. Scans of a generated room, and of `$ELK_DATA/scans/*.scn` where they are.

use std::collections::{HashMap, HashSet};

use elk_geometry::Voxel;
use elk_geometry::ray::Traversal;
use elk_map::{MapConfig, OccupancyMap};
use nalgebra::{Point3, Vector3};

type RecordedScan = (Point3<f64>, Vec<Point3<f64>>);

/// Seconds that `work` takes.
#[allow(clippy::disallowed_methods)] // A stopwatch: no decision and no output but the table depends on it.
fn seconds(work: impl FnOnce()) -> f64 {
    let start = std::time::Instant::now();
    work();
    start.elapsed().as_secs_f64()
}

/// 60 scans of 100×100 rays, 75° wide, on a circle in a closed room of 10×10×3 m with two pillars.
fn room() -> Vec<RecordedScan> {
    (0..60)
        .map(|i| {
            let angle = f64::from(i) * 0.61;
            let origin = Point3::new(2.2 * angle.cos() + 0.037, 2.2 * angle.sin() + 0.031, 1.37);
            let yaw = angle * 2.3;
            (origin, (0..10_000).map(|p| cast(origin, direction(yaw, p % 100, p / 100))).collect())
        })
        .collect()
}

fn direction(yaw: f64, column: i32, row: i32) -> Vector3<f64> {
    let pixel = |i: i32| (f64::from(i) - 49.5) / 50.0 * 37.5_f64.to_radians().tan();
    let (right, down) = (pixel(column), pixel(row));
    Vector3::new(yaw.cos() + right * yaw.sin(), yaw.sin() - right * yaw.cos(), -down).normalize()
}

/// Where a ray ends: on the room's walls from inside, or on a pillar from outside.
fn cast(origin: Point3<f64>, direction: Vector3<f64>) -> Point3<f64> {
    let slab = |min: [f64; 3], max: [f64; 3]| {
        (0..3).fold((0.0_f64, f64::INFINITY), |(near, far), axis| {
            let to = |wall: f64| (wall - origin[axis]) / direction[axis];
            let (a, b) = (to(min[axis]), to(max[axis]));
            (near.max(a.min(b)), far.min(a.max(b)))
        })
    };
    let (_, wall) = slab([-5.0, -5.0, 0.0], [5.0, 5.0, 3.0]);
    let pillars = [[-0.6, -0.4], [3.1, 2.6]].map(|[x, y]| slab([x, y, 0.0], [x + 0.8, y + 0.8, 2.2]));
    let range = pillars
        .into_iter()
        .filter(|(near, far)| *near > 0.0 && near < far)
        .fold(wall, |range, (near, _)| range.min(near));
    origin + direction * range
}

/// A `SCN1` file: per scan the origin and the points, all f32 in the world frame.
fn recorded(name: &str) -> Option<Vec<RecordedScan>> {
    let beside = concat!(env!("CARGO_MANIFEST_DIR"), "/../../../shared/data");
    let folder = std::env::var_os("ELK_DATA").unwrap_or_else(|| beside.into());
    let bytes = std::fs::read(std::path::Path::new(&folder).join("scans").join(name)).ok()?;
    let mut words = bytes[4..].chunks_exact(4).map(|w| [w[0], w[1], w[2], w[3]]);
    let scans = u32::from_le_bytes(words.next()?);
    let point = |words: &mut dyn Iterator<Item = [u8; 4]>| {
        let mut next = || Some(f64::from(f32::from_le_bytes(words.next()?)));
        Some(Point3::new(next()?, next()?, next()?))
    };
    (0..scans)
        .map(|_| {
            let origin = point(&mut words)?;
            let points = u32::from_le_bytes(words.next()?);
            Some((origin, (0..points).map(|_| point(&mut words)).collect::<Option<_>>()?))
        })
        .collect()
}

/// The baseline: hits and misses of a scan in std hash sets, the map a std hash map.
fn insert_naively(map: &mut HashMap<Voxel, f32>, (origin, points): &RecordedScan, config: &MapConfig) {
    let (mut hits, mut misses) = (HashSet::new(), HashSet::new());
    for point in points {
        let end = point + (point - origin).normalize() * 1e-4;
        let last = Voxel::containing(end, config.resolution);
        misses.extend(Traversal::new(*origin, end, config.resolution).take_while(|v| *v != last));
        hits.insert(last);
    }
    let mut update = |voxel: &Voxel, step: f32| {
        let log_odds = map.entry(*voxel).or_insert(0.0);
        *log_odds = (*log_odds + step).clamp(config.clamp_min, config.clamp_max);
    };
    misses.difference(&hits).for_each(|v| update(v, config.miss));
    hits.iter().for_each(|v| update(v, config.hit));
}

fn summary(name: &str, mut times: Vec<f64>) -> f64 {
    let rate = times.len() as f64 / times.iter().sum::<f64>();
    times.sort_by(f64::total_cmp);
    let at = |share: f64| times[((times.len() - 1) as f64 * share) as usize] * 1e3;
    println!("  {name:<28} {rate:>8.1} scans/s   median {:>8.3} ms   p99 {:>8.3} ms", at(0.5), at(0.99));
    rate
}

fn compare(name: &str, scans: &[RecordedScan], resolution: f64) {
    let config = MapConfig { resolution, ..MapConfig::default() };
    let rays: usize = scans.iter().map(|(_, points)| points.len()).sum();
    println!("{name}: {} scans, {rays} rays, voxels of {resolution} m", scans.len());
    let mut map = OccupancyMap::new(config);
    let insert = |scan: &RecordedScan| seconds(|| drop(map.insert(scan.0, scan.1.iter().copied())));
    let ours = summary("elk (frontier, grid, guard)", scans.iter().map(insert).collect());
    let mut hashed = HashMap::new();
    let naive = |scan: &RecordedScan| seconds(|| insert_naively(&mut hashed, scan, &config));
    let baseline = summary("hash map, voxel by voxel", scans.iter().map(naive).collect());
    println!("  ratio {:.1}; occupied {}, free {}", ours / baseline, map.grid().occupied(), map.grid().free());
}

fn main() {
    let room = room();
    compare("room", &room, 0.1);
    compare("room", &room, 0.05);
    for (name, resolutions) in [("s100.scn", [0.1, 0.05]), ("real7s.scn", [0.05, 0.02])] {
        match recorded(name) {
            Some(scans) => resolutions.iter().for_each(|r| compare(name, &scans, *r)),
            None => println!("{name}: skipped, no such scans (set ELK_DATA)"),
        }
    }
}
