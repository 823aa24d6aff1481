//! Two overlapping clouds of a LiDAR registered from the identity, beside small_gicp in the same run.
//!
//! `ELK_DATA=… cargo bench -p elk-registration --bench icp`; small_gicp where the Python that `ELK_PYTHON` names (`python3`) has it (`pip install
//! small_gicp numpy`). Times are CPU times of one thread for the whole way from points to the pose, the least of `ELK_TURNS` (15).

#[path = "../../../tests/common/data.rs"]
mod data;
#[path = "common/pose.rs"]
mod pose;
#[path = "../../../tests/common/stopwatch.rs"]
mod stopwatch;

use std::path::Path;
use std::process::Command;

use elk_registration::{Cloud, Icp, IcpConfig, Map, Resolution};
use nalgebra::{Isometry3, Point3};
use pose::pose;

/// The points of a binary PLY file of 32-bit floats, the first three of each the coordinates.
fn ply(path: &Path) -> Vec<Point3<f32>> {
    let bytes = std::fs::read(path).unwrap_or_else(|error| panic!("{}: {error}", path.display()));
    const END: &[u8] = b"end_header\n";
    let end = bytes.windows(END.len()).position(|window| window == END).unwrap();
    let header = String::from_utf8_lossy(&bytes[..end]);
    let properties = header.lines().filter(|line| line.starts_with("property float")).count();
    let numbers: Vec<f32> =
        bytes[end + END.len()..].as_chunks::<4>().0.iter().map(|&bytes| f32::from_le_bytes(bytes)).collect();
    numbers.chunks_exact(properties).map(|one| Point3::new(one[0], one[1], one[2])).collect()
}

struct Clouds {
    source: Vec<Point3<f32>>,
    target: Vec<Point3<f32>>,
    truth: Isometry3<f64>,
}

fn show(name: &str, clouds: &Clouds, found: &Isometry3<f64>, ms: f64, more: &str) {
    let off = clouds.truth.inverse() * found;
    let degrees = off.rotation.angle().to_degrees();
    println!("| {name} | {:.4} | {degrees:.3} | {ms:.1} | {more} |", off.translation.vector.norm());
}

fn ours(clouds: &Clouds, turns: usize, voxel: f64, kernel: f64) {
    // The coarsest voxels have an edge of 1 to 2 m.
    let levels = (1.0 / voxel).log2().ceil() as usize + 1;
    let resolution = Resolution::new(voxel, levels).unwrap();
    let icp = Icp::new(IcpConfig { kernel, ..IcpConfig::default() }).unwrap();
    let register = || {
        let mut map = Map::new(resolution);
        map.insert(&Cloud::new(&clouds.target, resolution).unwrap(), &Isometry3::identity(), 1).unwrap();
        let source = Cloud::new(&clouds.source, resolution).unwrap();
        icp.register(&map, &source, &Isometry3::identity()).unwrap()
    };
    let (ms, found) = stopwatch::least(turns, register);
    let health = &found.health;
    let more = format!("{} of {} voxels, {} steps", health.inliers, health.of, health.iterations);
    show(&format!("elk, {voxel} m, kernel {kernel} σ"), clouds, &found.pose, ms, &more);
}

/// Whether small_gicp is there.
fn small_gicp(clouds: &Clouds, turns: usize) -> Option<()> {
    let folder = tempfile::tempdir().unwrap();
    for (name, points) in [("source", &clouds.source), ("target", &clouds.target)] {
        let bytes: Vec<u8> = points.iter().flat_map(|point| point.iter().flat_map(|x| x.to_le_bytes())).collect();
        std::fs::write(folder.path().join(format!("{name}.xyz")), bytes).unwrap();
    }
    let python = std::env::var("ELK_PYTHON").unwrap_or_else(|_| "python3".into());
    let script = Path::new(env!("CARGO_MANIFEST_DIR")).join("benches/baseline.py");
    let output = Command::new(python).arg(script).arg(folder.path()).arg(turns.to_string()).output().ok()?;
    for line in String::from_utf8_lossy(&output.stdout).lines() {
        let mut words = line.split(' ');
        let (kind, ms) = (words.next().unwrap(), words.next().unwrap().parse().unwrap());
        show(&format!("small_gicp {kind}, 0.25 m"), clouds, &pose(words), ms, "");
    }
    output.status.success().then_some(())
}

fn main() {
    let data = data::folder().join("icp");
    if !data.is_dir() {
        println!("icp: skipped, there is no {} (set ELK_DATA)", data.display());
        return;
    }
    let turns = std::env::var("ELK_TURNS").ok().and_then(|turns| turns.parse().ok()).unwrap_or(15);
    let [source, target] = ["source.ply", "target.ply"].map(|name| ply(&data.join(name)));
    let truth = std::fs::read_to_string(data.join("T_target_source.txt")).unwrap();
    let clouds = Clouds { source, target, truth: pose(truth.split_whitespace()) };
    println!("| | off by, m | off by, ° | ms | |");
    println!("|---|---|---|---|---|");
    for (voxel, kernel) in [(0.2, 6.0), (0.2, 3.0), (0.2, 10.0), (0.25, 6.0), (0.15, 6.0), (0.1, 6.0)] {
        ours(&clouds, turns, voxel, kernel);
    }
    if small_gicp(&clouds, turns).is_none() {
        println!("small_gicp: skipped, no Python has it (pip install small_gicp numpy; ELK_PYTHON names the Python)");
    }
}
