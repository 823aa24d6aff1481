//! The baseline: an odometry of the plain kind by OpenCV, of the same rectified pairs.

use std::path::Path;
use std::process::Command;

use elk_stereo::{Image, Rig};
use nalgebra::{Isometry3, Quaternion, UnitQuaternion};

/// What came of it.
pub struct Baseline {
    pub version: String,
    pub poses: Vec<Isometry3<f64>>,
    pub lost: usize,
    /// CPU time a pair, milliseconds.
    pub ms: f64,
}

/// Runs it; none where the Python that `ELK_PYTHON` names (`python3`) does not have OpenCV.
pub fn odometry(rig: &Rig, pairs: &[[Image; 2]]) -> Option<Baseline> {
    let folder = tempfile::tempdir().unwrap();
    let ([row, column], image) = (rig.center(), &pairs[0][0]);
    let (width, height, focal, baseline) = (image.width(), image.height(), rig.focal(), rig.baseline());
    let line = format!("{width} {height} {focal} {row} {column} {baseline} {}", pairs.len());
    std::fs::write(folder.path().join("pairs.txt"), line).unwrap();
    for (i, pair) in pairs.iter().enumerate() {
        for (side, image) in ["left", "right"].iter().zip(pair) {
            std::fs::write(folder.path().join(format!("{i}.{side}")), image.pixels()).unwrap();
        }
    }
    let python = std::env::var("ELK_PYTHON").unwrap_or_else(|_| "python3".into());
    let script = Path::new(env!("CARGO_MANIFEST_DIR")).join("benches/opencv.py");
    let output = Command::new(python).arg(script).arg(folder.path()).output().ok()?;
    if !output.status.success() {
        return None;
    }
    let said = String::from_utf8_lossy(&output.stdout).into_owned();
    let word = |name: &str| said.lines().find_map(|line| line.strip_prefix(name)).map(str::trim);
    let pose = |line: &str| {
        let numbers: Vec<f64> = line.split(' ').map(|number| number.parse().ok()).collect::<Option<_>>()?;
        let [x, y, z, i, j, k, w] = numbers[..] else { return None };
        let rotation = UnitQuaternion::from_quaternion(Quaternion::new(w, i, j, k));
        Some(Isometry3::from_parts([x, y, z].into(), rotation))
    };
    Some(Baseline {
        version: word("version ")?.to_owned(),
        poses: said.lines().filter_map(pose).collect(),
        lost: word("lost ")?.parse().ok()?,
        ms: word("milliseconds ")?.parse::<f64>().ok()? / pairs.len() as f64,
    })
}
