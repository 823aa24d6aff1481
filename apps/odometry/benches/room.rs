//! The way of two cameras through a rendered room: 752 × 480 pixels with the lenses of EuRoC's cameras, noise and unlike exposure, a known way;
//! beside an odometry of OpenCV in the same run.
//!
//! `cargo bench -p elk-odometry --bench room`; OpenCV where the Python that `ELK_PYTHON` names (`python3`) has it (`pip install
//! opencv-python-headless`). Times are CPU times of one thread for the whole way from two images as cameras take them to a pose. `ELK_PAIRS`
//! (160) are rendered.

#[path = "../../../tests/common/alignment.rs"]
mod alignment;
#[path = "common/opencv.rs"]
mod opencv;
#[path = "../tests/scenes/mod.rs"]
mod scenes;
#[path = "../../../tests/common/stopwatch.rs"]
mod stopwatch;
#[path = "common/table.rs"]
mod table;
#[path = "common/trajectory.rs"]
mod trajectory;

use elk_odometry::OdometryConfig;
use elk_stereo::{Camera, Distortion, Rectification, StereoCalibration};
use nalgebra::{Isometry3, Translation3, UnitQuaternion, Vector3};

/// Two cameras that are like EuRoC's: lenses that bend, axes that are not parallel, and centres beside the middle.
fn calibration() -> StereoCalibration {
    let lens = |k1: f64, k2: f64, p1: f64, p2: f64| Distortion { radial: [k1, k2, 0.0], tangential: [p1, p2] };
    let left = Camera {
        size: [752, 480],
        focal: [458.7, 457.3],
        center: [367.2, 248.4],
        distortion: lens(-0.283, 0.074, 2e-4, 2e-5),
    };
    let right = Camera {
        size: [752, 480],
        focal: [457.6, 456.1],
        center: [380.0, 255.2],
        distortion: lens(-0.284, 0.0745, -1e-4, -4e-5),
    };
    let turn = UnitQuaternion::from_euler_angles(0.014, 0.001, -0.002);
    let right_from_left = Isometry3::from_parts(Translation3::new(-0.11, 0.0005, 0.001), turn);
    StereoCalibration { left, right, right_from_left }
}

/// Where the left camera is at a part of its way: round a loop, looking to and fro, up and down.
fn pose(part: f64) -> Isometry3<f64> {
    let angle = std::f64::consts::TAU * part;
    let position = Vector3::new(1.1 * angle.sin(), 0.15 * (2.0 * angle).sin(), -0.9 + 0.8 * (1.0 - angle.cos()) * 0.7);
    let turn = UnitQuaternion::from_euler_angles(
        0.12 * (3.0 * angle).sin(),
        0.6 * (angle + 0.4).sin() - 0.6 * 0.4f64.sin(),
        0.1 * (2.0 * angle).sin(),
    );
    Isometry3::from_parts(position.into(), turn)
}

fn main() {
    let count: usize = std::env::var("ELK_PAIRS").ok().and_then(|count| count.parse().ok()).unwrap_or(160);
    let calibration = calibration();
    let turn = Rectification::new(&calibration).unwrap().left_from_rectified();
    let cameras = scenes::Cameras::new(calibration);
    let poses: Vec<_> = (0..count).map(|i| pose(i as f64 / (count - 1) as f64)).collect();
    let sequence = table::Sequence {
        calibration,
        pairs: poses.iter().enumerate().map(|(i, pose)| cameras.view(pose, i as u64)).collect(),
        truth: poses.iter().map(|pose| pose * turn).collect(),
    };
    let of = |window| OdometryConfig { window, ..OdometryConfig::default() };
    let settings = [("elk", OdometryConfig::default()), ("elk, 2 keyframes", of(2)), ("elk, 16 keyframes", of(16))];
    table::show(&sequence, 1.0, &settings);
    println!("\nEvery third pair alone:");
    table::show(&sequence.every(3), 1.0, &settings);
}
