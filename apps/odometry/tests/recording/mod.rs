//! A recording of a pair of cameras, with poses by motion capture: a part of EuRoC's.

#[path = "../../../stereo/tests/picture/mod.rs"]
mod picture;

use std::path::Path;

use elk_stereo::{Image, Rectification, StereoCalibration, calibration};
use nalgebra::{Isometry3, Quaternion, UnitQuaternion};

/// Pairs as the cameras took them, and where they were taken: the rectified left camera's frame → that of the motion capture.
pub struct Recording {
    pub calibration: StereoCalibration,
    pub pairs: Vec<[Image; 2]>,
    pub truth: Vec<Isometry3<f64>>,
}

/// Seconds and poses of the body, a line each.
fn truth(path: &Path) -> Vec<(f64, Isometry3<f64>)> {
    let text = std::fs::read_to_string(path).unwrap_or_else(|error| panic!("{}: {error}", path.display()));
    let pose = |line: &str| {
        let numbers: Vec<f64> = line.split_whitespace().map(|number| number.parse().unwrap()).collect();
        let [seconds, x, y, z, i, j, k, w] = numbers[..] else { panic!("{line}: eight numbers would be right") };
        let rotation = UnitQuaternion::from_quaternion(Quaternion::new(w, i, j, k));
        (seconds, Isometry3::from_parts([x, y, z].into(), rotation))
    };
    text.lines().filter(|line| !line.starts_with('#')).map(pose).collect()
}

/// Reads the folder of a recording.
pub fn read(folder: &Path) -> Recording {
    let [left, right] = ["cam0.yaml", "cam1.yaml"].map(|name| std::fs::read_to_string(folder.join(name)).unwrap());
    let calibration = calibration::euroc(&left, &right).unwrap();
    let turn = Rectification::new(&calibration).unwrap().left_from_rectified();
    let body_from_rectified = calibration::euroc_body_from_camera(&left).unwrap() * turn;
    let files = std::fs::read_dir(folder.join("cam0")).unwrap();
    let mut names: Vec<String> = files.map(|entry| entry.unwrap().file_name().into_string().unwrap()).collect();
    names.sort();
    let bodies = truth(&folder.join("groundtruth.txt"));
    let at = |name: &String| {
        let seconds = name.trim_end_matches(".png").parse::<f64>().unwrap() * 1e-9;
        let nearest = bodies.iter().min_by(|a, b| (a.0 - seconds).abs().total_cmp(&(b.0 - seconds).abs())).unwrap();
        assert!((nearest.0 - seconds).abs() < 0.01, "there is no truth at {seconds}");
        nearest.1 * body_from_rectified
    };
    let pair = |name: &String| ["cam0", "cam1"].map(|side| picture::read(&folder.join(side).join(name)));
    Recording { calibration, pairs: names.iter().map(pair).collect(), truth: names.iter().map(at).collect() }
}
