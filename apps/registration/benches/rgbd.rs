//! A depth camera's way from its images alone: 50 frames of 7-Scenes, whose poses are not looked at until the end.
//!
//! `ELK_DATA=… cargo bench -p elk-registration --bench rgbd`. The trajectory error is the root mean square of positions' differences, once as both ways
//! begin at the same pose, once after the rigid motion that makes it least (Horn, JOSA A 1987; Sturm et al., IROS 2012).

#[path = "../../../tests/common/alignment.rs"]
mod alignment;
#[path = "../../../tests/common/data.rs"]
mod data;
#[path = "common/pose.rs"]
mod pose;
#[path = "../../../tests/common/stopwatch.rs"]
mod stopwatch;

use std::path::Path;

use alignment::{alignment, rms};
use elk_registration::{DepthCamera, IcpConfig, Resolution, Tracked, Tracker, TrackerConfig};
use nalgebra::{Isometry3, Point3};
use pose::pose;

const CAMERA: DepthCamera =
    DepthCamera { focal: [585.0, 585.0], centre: [320.0, 240.0], unit: 0.001, range: [0.3, 4.5] };

/// The counts of a 16-bit PNG, and its width.
fn png(path: &Path) -> (Vec<u16>, usize) {
    let bytes = std::fs::read(path).unwrap_or_else(|error| panic!("{}: {error}", path.display()));
    let mut reader = png::Decoder::new(bytes.as_slice()).read_info().unwrap();
    let mut buffer = vec![0; reader.output_buffer_size()];
    let info = reader.next_frame(&mut buffer).unwrap();
    assert_eq!((info.bit_depth, info.color_type), (png::BitDepth::Sixteen, png::ColorType::Grayscale));
    let counts = buffer[..info.buffer_size()].as_chunks::<2>().0.iter().map(|&bytes| u16::from_be_bytes(bytes));
    (counts.collect(), info.width as usize)
}

/// Camera → world.
fn camera_pose(path: &Path) -> Isometry3<f64> {
    let text = std::fs::read_to_string(path).unwrap_or_else(|error| panic!("{}: {error}", path.display()));
    pose(text.split_whitespace())
}

/// Where each frame is found, and how many are lost.
fn track(frames: &[Vec<Point3<f32>>], voxel: f64) -> (Vec<Isometry3<f64>>, usize) {
    let resolution = Resolution::new(voxel, 3).unwrap();
    let icp = IcpConfig::default();
    let config = TrackerConfig { resolution, icp, step: 0.05, turn: 0.05, window: 100, patience: Some(10) };
    let mut tracker = Tracker::new(config, Isometry3::identity()).unwrap();
    let mut lost = 0;
    let mut pose = |points: &Vec<Point3<f32>>| {
        lost += usize::from(matches!(tracker.track(points, None).unwrap(), Tracked::Lost(_)));
        *tracker.supposed()
    };
    let poses = frames.iter().map(&mut pose).collect();
    (poses, lost)
}

fn main() {
    let folder = data::folder().join("rgbd/7scenes/data/rgbd-frames");
    if !folder.is_dir() {
        println!("rgbd: skipped, there is no {} (set ELK_DATA)", folder.display());
        return;
    }
    let frame = |i: usize, kind: &str| folder.join(format!("frame-{i:06}.{kind}"));
    let numbers: Vec<usize> = (0..1000).filter(|&i| frame(i, "depth.png").is_file()).collect();
    let truth: Vec<_> = numbers.iter().map(|&i| camera_pose(&frame(i, "pose.txt"))).collect();
    let way: f64 = truth.windows(2).map(|pair| (pair[1].translation.vector - pair[0].translation.vector).norm()).sum();
    println!("{} frames, {way:.3} m of way", numbers.len());
    println!("| voxel, every so many pixels | lost | off, begun alike | off, aligned | at the end | ms a frame |");
    println!("|---|---|---|---|---|---|");
    for (voxel, stride) in [(0.05, 4), (0.05, 2), (0.03, 4), (0.08, 4)] {
        let points = |&i: &usize| {
            let (depths, width) = png(&frame(i, "depth.png"));
            CAMERA.points(&depths, width, stride).unwrap()
        };
        let frames: Vec<_> = numbers.iter().map(points).collect();
        let (ms, (poses, lost)) = stopwatch::least(1, || track(&frames, voxel));
        let [begun, aligned] = [truth[0], alignment(&poses, &truth)].map(|moved| rms(&poses, &truth, &moved));
        let last = poses.len() - 1;
        let end = truth[last].inverse() * truth[0] * poses[last];
        let end = format!("{:.4} m, {:.2}°", end.translation.vector.norm(), end.rotation.angle().to_degrees());
        let ms = ms / frames.len() as f64;
        println!("| {voxel} m, {stride} | {lost} | {begun:.4} m | {aligned:.4} m | {end} | {ms:.1} |");
    }
}
