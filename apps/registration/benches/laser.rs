//! Scan matching of CARMEN logs: how far relative poses are off those that the logs were corrected to, beside odometry's.
//!
//! `ELK_DATA=… cargo bench -p elk-registration --bench laser`. Over each stretch of so many metres of way, from each scan on, the motion that was
//! found is compared with the corrected one; the mean of all stretches counts. A scan that is lost counts where odometry takes it. What corrected
//! these logs errs as well: the last columns compare without it, by how many cells the points of 5 m of way fill, those of the corrected poses
//! being 1.

#[path = "../../../tests/common/data.rs"]
mod data;
#[path = "../../../tests/common/stopwatch.rs"]
mod stopwatch;

use std::collections::BTreeSet;
use std::io::BufReader;
use std::path::Path;

use elk_registration::carmen::{LaserScan, Reader};
use elk_registration::{IcpConfig, Resolution, Tracked, Tracker, TrackerConfig};
use flate2::read::GzDecoder;
use nalgebra::{Isometry2, Point2};

/// What a beam reads beyond is taken for no return, metres.
const RANGE_MAX: f32 = 30.0;

const LOGS: [&str; 10] =
    ["intel", "freiburg-079", "aces", "fhw", "csail", "freiburg-101", "seattle", "belgioioso", "edmonton", "acapulco"];

/// The scans of a log, and how many lines were left out.
fn read(path: &Path) -> (Vec<LaserScan>, usize) {
    let file = std::fs::File::open(path).unwrap_or_else(|error| panic!("{}: {error}", path.display()));
    let all: Vec<_> = Reader::new(path.display().to_string(), BufReader::new(GzDecoder::new(file))).collect();
    let lines = all.len();
    let scans: Vec<_> = all.into_iter().flatten().collect();
    let left_out = lines - scans.len();
    (scans, left_out)
}

/// Where each scan is found, and how many are lost.
fn track(scans: &[LaserScan]) -> (Vec<Isometry2<f64>>, usize) {
    let resolution = Resolution::new(0.1, 3).unwrap();
    let icp = IcpConfig::default();
    let config = TrackerConfig { resolution, icp, step: 0.3, turn: 0.3, window: 30, patience: Some(5) };
    let mut tracker = Tracker::new(config, Isometry2::identity()).unwrap();
    let mut last = scans[0].odometry;
    let mut lost = 0;
    let mut step = |(i, scan): (usize, &LaserScan)| {
        let motion = last.inverse() * scan.odometry;
        last = scan.odometry;
        let tracked = tracker.track(&scan.points(RANGE_MAX), Some(motion));
        lost += usize::from(i > 0 && !matches!(tracked, Ok(Tracked::Found(_))));
        *tracker.supposed()
    };
    let poses = scans.iter().enumerate().map(&mut step).collect();
    (poses, lost)
}

/// How many cells of 2 cm the points of 5 m of way fill, seen from these poses, over all such stretches: fewer where they lie better on one
/// another.
fn filled(scans: &[LaserScan], truth: &[Isometry2<f64>], poses: &[Isometry2<f64>]) -> f64 {
    let way = |i: usize| (truth[i + 1].translation.vector - truth[i].translation.vector).norm();
    let mut stretches = vec![vec![0]];
    let mut gone = 0.0;
    for i in 0..scans.len() - 1 {
        gone += way(i);
        if gone > 5.0 {
            gone = 0.0;
            stretches.push(Vec::new());
        }
        stretches.last_mut().unwrap().push(i + 1);
    }
    let cells = |stretch: &Vec<usize>| {
        let seen = |&i: &usize| {
            let pose = poses[stretch[0]].inverse() * poses[i];
            let cell = move |point: Point2<f32>| (pose * point.cast::<f64>()).coords.map(|x| (x / 0.02).floor() as i32);
            scans[i].points(10.0).into_iter().map(cell).map(|cell| (cell.x, cell.y))
        };
        stretch.iter().flat_map(seen).collect::<BTreeSet<_>>().len()
    };
    stretches.iter().map(cells).sum::<usize>() as f64
}

/// The mean error of motions over stretches of `way` metres: metres and degrees.
fn error(truth: &[Isometry2<f64>], poses: &[Isometry2<f64>], way: f64) -> [f64; 2] {
    let mut gone = vec![0.0];
    for pair in truth.windows(2) {
        gone.push(gone[gone.len() - 1] + (pair[1].translation.vector - pair[0].translation.vector).norm());
    }
    let of = |i: usize| {
        let j = gone.partition_point(|&all| all < gone[i] + way);
        let [wanted, found] = [truth, poses].map(|poses| poses.get(j).map(|end| poses[i].inverse() * end));
        let (wanted, found) = (wanted?, found?);
        let off = found.rotation.angle_to(&wanted.rotation).abs().to_degrees();
        Some([(wanted.translation.vector - found.translation.vector).norm(), off])
    };
    let all: Vec<[f64; 2]> = (0..truth.len()).filter_map(of).collect();
    [0, 1].map(|i| all.iter().map(|one| one[i]).sum::<f64>() / all.len() as f64)
}

fn main() {
    let folder = data::folder().join("laser2d/logs/carmen");
    if !folder.is_dir() {
        println!("laser: skipped, there is no {} (set ELK_DATA)", folder.display());
        return;
    }
    println!(
        "| log | scans, left out, lost | 1 m: odometry | elk | ratio | 5 m: odometry | elk | ratio | ms a scan | cells: odometry | elk |"
    );
    println!("|---|---|---|---|---|---|---|---|---|---|---|");
    for log in LOGS {
        let (scans, left_out) = read(&folder.join(format!("{log}-corrected.log.gz")));
        let truth: Vec<_> = scans.iter().map(|scan| scan.pose).collect();
        let odometry: Vec<_> = scans.iter().map(|scan| scan.odometry).collect();
        let (ms, (poses, lost)) = stopwatch::least(1, || track(&scans));
        let cells = [1.0, 5.0].map(|way| {
            let [theirs, ours] = [&odometry, &poses].map(|poses| error(&truth, poses, way));
            let said = |[metres, degrees]: [f64; 2]| format!("{metres:.3} m, {degrees:.2}°");
            format!("{} | {} | {:.2}, {:.2}", said(theirs), said(ours), ours[0] / theirs[0], ours[1] / theirs[1])
        });
        let counts = format!("{}, {left_out}, {lost}", scans.len());
        let of_corrected = filled(&scans, &truth, &truth);
        let [theirs, ours] = [&odometry, &poses].map(|poses| filled(&scans, &truth, poses) / of_corrected);
        let ms = ms / scans.len() as f64;
        println!("| {log} | {counts} | {} | {} | {ms:.2} | {theirs:.2} | {ours:.2} |", cells[0], cells[1]);
    }
}
