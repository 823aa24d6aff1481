//! Two cameras that go sideways along a wall, and what they know of it.

use elk_geometry::Pose;
use elk_odometry::{Odometry, OdometryConfig, Tracked};
use elk_stereo::{Image, ImageError, Rig};
use nalgebra::Isometry3;

/// What a camera sees of a wall 2 m ahead, which stands so many metres right of where it began.
fn view(rig: &Rig, right: f64) -> Result<Image, ImageError> {
    let waves = |x: f64, y: f64| (31.0 * x + 9.0 * (7.0 * y).sin()).sin() + (23.0 * y + 8.0 * (9.0 * x).sin()).sin();
    let [center_row, center_column] = rig.center();
    Image::from_fn(320, 240, |row, column| {
        let (x, y) =
            (2.0 * (column as f64 - center_column) / rig.focal(), 2.0 * (row as f64 - center_row) / rig.focal());
        (128.0 + 50.0 * waves(x + right, y)) as u8
    })
}

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let rig = Rig::new(200.0, [119.5, 159.5], 0.12)?; // pixels, row and column, metres
    let mut odometry = Odometry::new(rig, [320, 240], OdometryConfig::default(), Pose(Isometry3::identity()))?;
    for step in 0..10 {
        let right = f64::from(step) * 0.04;
        match odometry.track(&view(&rig, right)?, &view(&rig, right + rig.baseline())?)? {
            Tracked::Started => assert_eq!(step, 0),
            Tracked::Found(estimate) => {
                let at = estimate.pose.position();
                println!("{right:.2} m: {:.4} m, from {} points", at.x, estimate.health.inliers);
                assert!((at.x - right).abs() < 0.005 && at.y.abs() < 0.005 && at.z.abs() < 0.005, "{at}");
            }
            Tracked::Lost(why) => return Err(why.into()),
        }
    }
    Ok(())
}
