//! A recorded pair of cameras that stands on the ground; skipped where the recorded data (`ELK_DATA`) are not there.

#[path = "../../../tests/common/data.rs"]
mod data;
mod recording;
#[path = "../../../tests/common/skip.rs"]
mod skip;

use elk_geometry::Pose;
use elk_odometry::{Odometry, OdometryConfig, Tracked};
use elk_stereo::Rectification;

#[test]
fn a_recording_is_followed_from_its_first_pair_to_its_last() {
    let folder = data::folder().join("stereo_euroc");
    if !folder.is_dir() {
        let test = "a_recording_is_followed_from_its_first_pair_to_its_last";
        return skip::skip(test, "data", &format!("there is no {} (set ELK_DATA)", folder.display()));
    }
    let recording = recording::read(&folder);
    let rectification = Rectification::new(&recording.calibration).unwrap();
    let (rig, size) = (*rectification.rig(), recording.calibration.left.size);
    let mut odometry = Odometry::new(rig, size, OdometryConfig::default(), Pose(recording.truth[0])).unwrap();
    for (i, ([left, right], truth)) in recording.pairs.iter().zip(&recording.truth).enumerate() {
        let [left, right] = rectification.rectify(left, right).unwrap();
        match odometry.track(&left, &right).unwrap() {
            Tracked::Started => assert_eq!(i, 0),
            Tracked::Lost(why) => panic!("pair {i}: {why}"),
            Tracked::Found(estimate) => {
                let off = truth.inverse() * estimate.pose.0;
                // The motion capture itself is not better than 2 mm and 0.2° here.
                assert!(off.translation.vector.norm() < 4e-3 && off.rotation.angle() < 5e-3, "pair {i}: {off}");
                let health = estimate.health;
                assert!(health.inliers >= 60 && health.rms < 0.4, "pair {i}: {health:?}");
            }
        }
    }
}
