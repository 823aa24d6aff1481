//! The way of a recorded pair of cameras from its images alone: 65 pairs of EuRoC, whose poses are not looked at until the end, beside an
//! odometry of OpenCV in the same run.
//!
//! `ELK_DATA=… cargo bench -p elk-odometry --bench euroc`; OpenCV where the Python that `ELK_PYTHON` names (`python3`) has it (`pip install
//! opencv-python-headless`). Times are CPU times of one thread for the whole way from two images as cameras take them to a pose. The robot of
//! this recording stands on the ground: what it shows is how little an odometry moves then; `--bench room` shows how right it is on its way.

#[path = "../../../tests/common/alignment.rs"]
mod alignment;
#[path = "../../../tests/common/data.rs"]
mod data;
#[path = "common/opencv.rs"]
mod opencv;
#[path = "../tests/recording/mod.rs"]
mod recording;
#[path = "../../../tests/common/stopwatch.rs"]
mod stopwatch;
#[path = "common/table.rs"]
mod table;
#[path = "common/trajectory.rs"]
mod trajectory;

use elk_odometry::OdometryConfig;
use elk_stereo::{Image, Matcher, Rectification, SemiGlobal, SemiGlobalConfig};
use nalgebra::Isometry3;

fn main() {
    let folder = data::folder().join("stereo_euroc");
    if !folder.is_dir() {
        println!("euroc: skipped, there is no {} (set ELK_DATA)", folder.display());
        return;
    }
    let recording::Recording { calibration, pairs, truth } = recording::read(&folder);
    let sequence = table::Sequence { calibration, pairs, truth };
    let poses = table::show(&sequence, 0.005, &[("elk", OdometryConfig::default())]);
    println!("| poses of | grey levels by which images differ from the first one, moved by them |");
    println!("|---|---|");
    let still = vec![Isometry3::identity(); poses.len()];
    for (name, poses) in [("elk", &poses), ("the motion capture", &sequence.truth), ("none: it stands still", &still)] {
        println!("| {name} | {:.2} |", unlike(&sequence, poses));
    }
}

/// By how much images differ from the first one, moved as poses say: the mean over all pairs and all pixels of the first one that have a disparity. It is a judge that knows neither
/// corners nor motion capture.
fn unlike(sequence: &table::Sequence, poses: &[Isometry3<f64>]) -> f64 {
    let rectification = Rectification::new(&sequence.calibration).unwrap();
    let rectified = |i: usize| rectification.rectify(&sequence.pairs[i][0], &sequence.pairs[i][1]).unwrap();
    let [first, right] = rectified(0);
    let disparity = SemiGlobal::new(SemiGlobalConfig::default()).unwrap().disparity(&first, &right).unwrap();
    let points: Vec<_> = rectification.rig().cloud(&disparity).collect();
    let (mut sum, mut count) = (0.0, 0usize);
    for (i, pose) in poses.iter().enumerate().skip(1) {
        let ([image, _], motion) = (rectified(i), pose.inverse() * poses[0]);
        for (row, column, point) in &points {
            let Some([y, x, _]) = rectification.rig().project(&(motion * point)) else { continue };
            let Some(grey) = between(&image, y, x) else { continue };
            sum += (grey - f64::from(first.row(*row)[*column])).abs();
            count += 1;
        }
    }
    sum / count as f64
}

/// An image between its pixels, bilinearly.
fn between(image: &Image, row: f64, column: f64) -> Option<f64> {
    let is_inside =
        row >= 0.0 && column >= 0.0 && row < image.height() as f64 - 1.0 && column < image.width() as f64 - 1.0;
    let along = |y: usize| {
        let (x, part) = (column as usize, column.fract());
        f64::from(image.row(y)[x]) * (1.0 - part) + f64::from(image.row(y)[x + 1]) * part
    };
    is_inside.then(|| along(row as usize) * (1.0 - row.fract()) + along(row as usize + 1) * row.fract())
}
