//! Ways of a sensor through a rendered room, scan by scan.

mod scenes;

use elk_registration::{CloudError, IcpConfig, Resolution, Tracked, Tracker, TrackerConfig, TrackerError};
use nalgebra::{Isometry2, Isometry3, Point2, Point3, Vector2, Vector3};
use scenes::Dice;

fn config() -> TrackerConfig {
    let resolution = Resolution::new(0.1, 4).unwrap();
    TrackerConfig { resolution, icp: IcpConfig::default(), step: 0.3, turn: 0.2, window: 30, patience: Some(10) }
}

/// Along a circle of radius 1 m, looking ahead.
fn circle(i: usize) -> Isometry2<f64> {
    let angle = i as f64 * 0.06;
    Isometry2::new(Vector2::new(angle.sin(), -angle.cos() * 0.6 - 0.3), angle)
}

fn circle_in_space(i: usize) -> Isometry3<f64> {
    let plan = circle(i);
    let position = plan.translation.vector.push(1.3 + 0.1 * (i as f64 * 0.2).sin());
    Isometry3::new(position, Vector3::new(0.0, 0.0, plan.rotation.angle()))
}

/// The poses of a laser that goes once around the room, by its scans alone.
fn around(dice: &mut Dice) -> Vec<Isometry2<f64>> {
    let mut tracker = Tracker::new(config(), circle(0)).unwrap();
    let pose = |i: usize| {
        let points = scenes::laser(&scenes::plan(), &circle(i), 0.01, dice);
        match tracker.track(&points, None).unwrap() {
            Tracked::Started => circle(0),
            Tracked::Found(estimate) => estimate.pose,
            Tracked::Lost(lost) => panic!("scan {i}: {lost}"),
        }
    };
    (0..110).map(pose).collect()
}

#[test]
fn a_laser_knows_where_it_is_all_around_a_room() {
    let poses = around(&mut Dice(1));
    for (i, pose) in poses.iter().enumerate() {
        let off = circle(i).inverse() * pose;
        let metres = off.translation.vector.norm();
        assert!(metres < 0.03 && off.rotation.angle().abs() < 0.02, "scan {i} is off by {metres} m, {off}");
    }
    assert_eq!(poses, around(&mut Dice(1)), "the same scans, the same poses");
}

#[test]
fn a_camera_knows_where_it_is_all_around_a_room() {
    let mut dice = Dice(2);
    let mut tracker = Tracker::new(config(), circle_in_space(0)).unwrap();
    for i in 0..40 {
        let truth = circle_in_space(i);
        let tracked = tracker.track(&scenes::camera(&scenes::room(), &truth, 0.01, &mut dice), None).unwrap();
        let Tracked::Found(estimate) = tracked else {
            assert_eq!((i, tracked), (0, Tracked::Started));
            continue;
        };
        let off = truth.inverse() * estimate.pose;
        let metres = off.translation.vector.norm();
        assert!(metres < 0.05 && off.rotation.angle() < 0.02, "scan {i} is off by {metres} m, {off}");
    }
}

#[test]
fn who_is_lost_says_so_and_finds_back() {
    let mut dice = Dice(3);
    let mut tracker = Tracker::new(config(), circle(0)).unwrap();
    let mut lost = Vec::new();
    for i in 0..40 {
        // Somebody holds a hand before the laser.
        let covered: Vec<_> = (0..360).map(|i: i32| Point2::new((f64::from(i) * 0.01) as f32 % 0.3, 0.1)).collect();
        let points = match i {
            12..16 => covered,
            _ => scenes::laser(&scenes::plan(), &circle(i), 0.01, &mut dice),
        };
        let motion = circle(i.saturating_sub(1)).inverse() * circle(i);
        let voxels = tracker.map().len();
        match tracker.track(&points, Some(motion)).unwrap() {
            Tracked::Lost(_) => {
                lost.push(i);
                assert_eq!(tracker.map().len(), voxels, "nothing is added of a scan that is nowhere");
            }
            Tracked::Found(estimate) => {
                let off = circle(i).inverse() * estimate.pose;
                assert!(off.translation.vector.norm() < 0.03, "scan {i}: {off}");
            }
            Tracked::Started => assert_eq!(i, 0),
        }
    }
    assert_eq!(lost, [12, 13, 14, 15]);
}

/// What becomes of scans of a room, and from the fifth on of another one, of which the odometry says nothing: S started, F found, L lost.
fn of_another_room(patience: Option<u64>) -> String {
    let mut dice = Dice(4);
    let mut tracker = Tracker::new(TrackerConfig { patience, ..config() }, circle(0)).unwrap();
    let mut outcomes = String::new();
    for i in 0..10 {
        let pose = if i < 5 { circle(i) } else { Isometry2::new(Vector2::new(0.9, 1.6), 2.3) };
        let room =
            if i < 5 { scenes::plan() } else { scenes::Room { walls: [[-0.2, -9.0], [1.4, 9.0]], blocks: vec![] } };
        let points = scenes::laser(&room, &pose, 0.01, &mut dice);
        outcomes.push(match tracker.track(&points, Some(Isometry2::identity())).unwrap() {
            Tracked::Started => 'S',
            Tracked::Found(_) => 'F',
            Tracked::Lost(_) => 'L',
        });
    }
    outcomes
}

#[test]
fn who_stays_lost_begins_anew_if_there_is_an_end_to_patience() {
    assert_eq!(of_another_room(Some(2)), "SFFFFLLSFF");
    assert_eq!(of_another_room(None), "SFFFFLLLLL");
    let none = Tracker::<Isometry2<f64>, 2, 3>::new(TrackerConfig { patience: Some(0), ..config() }, circle(0));
    assert_eq!(none.unwrap_err().to_string(), "patience of 0: 1 to 1000000000 would be right");
}

#[test]
fn a_scan_that_is_none_is_as_if_it_had_not_been() {
    let mut tracker = Tracker::new(config(), Isometry3::identity()).unwrap();
    let nan = [Point3::new(1.0, 2.0, 3.0), Point3::new(0.0, f32::INFINITY, 0.0)];
    assert_eq!(tracker.track(&[], None), Err(CloudError::Empty));
    assert!(matches!(tracker.track(&nan, None), Err(CloudError::NotFinite { index: 1, .. })));
    assert_eq!(tracker.track(&nan[..1], None), Ok(Tracked::Started));
}

#[test]
fn the_map_goes_as_far_back_as_its_window() {
    let config = TrackerConfig { window: 3, step: 0.0, ..config() };
    let mut tracker = Tracker::new(config, Isometry2::identity()).unwrap();
    let mut sizes = Vec::new();
    // An endless wall with a pillar each metre, along which the sensor goes: it sees 4 m.
    for i in 0..60 {
        let x = f64::from(i) * 0.1;
        let point = |j: i32| {
            let at = (x * 50.0).floor() / 50.0 + f64::from(j) * 0.02 - 2.0;
            let depth = if at.rem_euclid(1.0) < 0.25 { 0.8 } else { 1.0 };
            Point2::new((at - x) as f32, depth as f32)
        };
        let points: Vec<_> = (0..200).map(point).collect();
        let motion = Isometry2::translation(if i == 0 { 0.0 } else { 0.1 }, 0.0);
        let tracked = tracker.track(&points, Some(motion)).unwrap();
        assert!(!matches!(tracked, Tracked::Lost(_)), "{tracked:?}");
        sizes.push(tracker.map().len());
    }
    assert!(sizes.iter().all(|&size| size < 90), "{sizes:?}");
}

#[test]
fn a_tracker_that_cannot_be_is_said() {
    let said = |config, start| Tracker::<Isometry2<f64>, 2, 3>::new(config, start).unwrap_err();
    let window = TrackerConfig { window: 0, ..config() };
    assert_eq!(said(window, Isometry2::identity()).to_string(), "window of 0: 1 to 1000000000 would be right");
    let nowhere = Isometry2::translation(f64::NAN, 0.0);
    assert!(matches!(said(config(), nowhere), TrackerError::Start(_)));
}
