//! A wall as two cameras see it whose lenses bend it: rectified, matched and triangulated.

use elk_stereo::{
    Camera, Image, ImageError, Matcher, Rectification, SemiGlobal, SemiGlobalConfig, StereoCalibration, calibration,
};

/// Two cameras side by side whose lenses bend what they see.
pub const CALIBRATION: &str = "%YAML:1.0
---
image_width: 320
image_height: 240
M1: !!opencv-matrix
   data: [ 200., 0., 160., 0., 200., 120., 0., 0., 1. ]
D1: !!opencv-matrix
   data: [ -0.2, 0.03, 0., 0. ]
M2: !!opencv-matrix
   data: [ 200., 0., 158., 0., 200., 121., 0., 0., 1. ]
D2: !!opencv-matrix
   data: [ -0.2, 0.03, 0., 0. ]
R: !!opencv-matrix
   data: [ 1., 0., 0., 0., 1., 0., 0., 0., 1. ]
T: !!opencv-matrix
   data: [ -0.12, 0., 0. ]
";

/// What two such cameras see of a wall 1.5 m ahead: each pixel looks along its ray, bent by the lens.
pub fn wall(cameras: &StereoCalibration) -> Result<[Image; 2], ImageError> {
    let waves = |x: f64, y: f64| (90.0 * x + 40.0 * (7.0 * y).sin()).sin() + (70.0 * y + 50.0 * (9.0 * x).sin()).sin();
    let view = |camera: Camera, from: f64| {
        Image::from_fn(320, 240, |row, column| {
            let [x, y] = camera.ray([column as f64, row as f64]);
            (128.0 + 60.0 * waves(from + 1.5 * x, 1.5 * y)) as u8
        })
    };
    Ok([view(cameras.left, 0.0)?, view(cameras.right, 0.12)?])
}

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let calibration = calibration::opencv(CALIBRATION)?;
    let [left, right] = wall(&calibration)?;
    let rectification = Rectification::new(&calibration)?;
    let [left, right] = rectification.rectify(&left, &right)?;
    let disparity = SemiGlobal::new(SemiGlobalConfig::default())?.disparity(&left, &right)?;
    let mut depths: Vec<f64> = rectification.rig().cloud(&disparity).map(|(_, _, point)| point.z).collect();
    depths.sort_by(f64::total_cmp);
    let median = depths[depths.len() / 2];
    println!("{} points, half of them nearer than {median:.3} m", depths.len());
    assert!((median - 1.5).abs() < 0.02, "{median}");
    Ok(())
}
