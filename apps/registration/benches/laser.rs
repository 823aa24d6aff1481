//! Scan matching of CARMEN logs: how far relative poses are off those that the logs were corrected to, beside odometry's.
//!
//! `ELK_DATA=… cargo bench -p elk-registration --bench laser`. Over each stretch of so many metres of way, from each scan on, the motion that was
//! found is compared with the corrected one; the mean of all stretches counts. A scan that is lost counts where odometry takes it. What corrected
//! these logs errs as well: the last columns compare without it, by how many cells the points of 5 m of way fill, those of the corrected poses
//! being 1. The second table says by how much: the corrected poses are settled, each scan laid on those around it, from where it is said to be.

#[path = "../../../tests/common/data.rs"]
mod data;
#[path = "../../../tests/common/stopwatch.rs"]
mod stopwatch;

use std::collections::BTreeSet;
use std::io::BufReader;
use std::path::Path;

use elk_registration::carmen::{LaserScan, Reader};
use elk_registration::{Cloud, Icp, IcpConfig, Map, Resolution, Tracked, Tracker, TrackerConfig};
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

/// The scans with every other beam, from this one on.
fn every_other_beam(scans: &[LaserScan], first: usize) -> Vec<LaserScan> {
    let half = |scan: &LaserScan| {
        let mut half = scan.clone();
        // A range of 0 is no point.
        half.ranges.iter_mut().skip(1 - first).step_by(2).for_each(|range| *range = 0.0);
        half
    };
    scans.iter().map(half).collect()
}

/// Poses at which each scan lies on the ten before and the ten after it, where these lie: twice, one scan after the other, from where it was. One
/// that cannot be laid there stays.
fn settled(scans: &[LaserScan], poses: &[Isometry2<f64>]) -> Vec<Isometry2<f64>> {
    const AROUND: usize = 10;
    let resolution = Resolution::new(0.1, 2).unwrap();
    let icp = Icp::new(IcpConfig::default()).unwrap();
    let clouds: Vec<_> = scans.iter().map(|scan| Cloud::new(&scan.points(RANGE_MAX), resolution).ok()).collect();
    let mut settled = poses.to_vec();
    for i in (0..poses.len()).chain(0..poses.len()) {
        let Some(cloud) = &clouds[i] else { continue };
        let mut map = Map::new(resolution);
        for j in (i.saturating_sub(AROUND)..(i + AROUND + 1).min(poses.len())).filter(|&j| j != i) {
            clouds[j].iter().for_each(|cloud| map.insert(cloud, &settled[j], u64::MAX).unwrap());
        }
        settled[i] = icp.register(&map, cloud, &settled[i]).map_or(settled[i], |estimate| estimate.pose);
    }
    settled
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

/// A log, and what was found of it.
struct Found {
    scans: Vec<LaserScan>,
    left_out: usize,
    truth: Vec<Isometry2<f64>>,
    odometry: Vec<Isometry2<f64>>,
    poses: Vec<Isometry2<f64>>,
    lost: usize,
    ms: f64,
}

impl Found {
    fn of(file: &Path) -> Self {
        let (scans, left_out) = read(file);
        let truth = scans.iter().map(|scan| scan.pose).collect();
        let odometry = scans.iter().map(|scan| scan.odometry).collect();
        let (ms, (poses, lost)) = stopwatch::least(1, || track(&scans));
        Self { ms: ms / scans.len() as f64, scans, left_out, truth, odometry, poses, lost }
    }

    /// How far odometry and scan matching are off the corrected poses.
    fn beside_odometry(&self) -> String {
        let Self { scans, left_out, truth, odometry, poses, lost, ms } = self;
        let errors = [1.0, 5.0].map(|way| {
            let [theirs, ours] = [odometry, poses].map(|poses| error(truth, poses, way));
            let said = |[metres, degrees]: [f64; 2]| format!("{metres:.3} m, {degrees:.2}°");
            format!("{} | {} | {:.2}, {:.2}", said(theirs), said(ours), ours[0] / theirs[0], ours[1] / theirs[1])
        });
        let of_corrected = filled(scans, truth, truth);
        let [theirs, ours] = [odometry, poses].map(|poses| filled(scans, truth, poses) / of_corrected);
        let counts = format!("{}, {left_out}, {lost}", scans.len());
        format!("{counts} | {} | {} | {ms:.2} | {theirs:.2} | {ours:.2}", errors[0], errors[1])
    }

    /// Over 1 m of way: how far the corrected poses are off where their own scans lie on one another, and elk off that; and how far elk is off
    /// itself, if no beam is common to both, and off the corrected poses, which err together or not at all.
    fn beside_itself(&self) -> String {
        let Self { scans, truth, odometry, poses, .. } = self;
        let off = |from: &[Isometry2<f64>], poses: &[Isometry2<f64>]| error(from, poses, 1.0)[0];
        let wheels = off(truth, odometry);
        let lain = settled(scans, truth);
        let halves = [0, 1].map(|first| track(&every_other_beam(scans, first)).0);
        let [floor, ours, theirs] = [off(truth, &lain), off(&lain, poses), off(&lain, odometry)];
        let [apart, one, other] = [off(&halves[0], &halves[1]), off(truth, &halves[0]), off(truth, &halves[1])];
        format!(
            "{:.4} m | {floor:.4} m | {:.2} | {ours:.4} m | {:.2} | {apart:.4} m | {one:.4}, {other:.4} m",
            wheels / 4.0,
            floor / wheels,
            ours / theirs
        )
    }
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
    let found = LOGS.map(|log| {
        let found = Found::of(&folder.join(format!("{log}-corrected.log.gz")));
        println!("| {log} | {} |", found.beside_odometry());
        found
    });
    println!("\nOver 1 m:\n");
    println!(
        "| log | a quarter of odometry's | corrected poses off the settled ones | ratio to odometry's | elk off the settled ones | \
         ratio to odometry's | even beams off odd beams | these off the corrected poses |"
    );
    println!("|---|---|---|---|---|---|---|---|");
    for (log, found) in LOGS.iter().zip(&found) {
        println!("| {log} | {} |", found.beside_itself());
    }
}
