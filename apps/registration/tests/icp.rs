//! Poses of rendered scans, which are known.

mod scenes;

use elk_registration::{Cloud, Estimate, Icp, IcpConfig, Lost, Map, Resolution};
use nalgebra::{Isometry2, Isometry3, Point2, Point3, Vector2, Vector3};
use proptest::prelude::*;
use scenes::Dice;

fn resolution() -> Resolution {
    Resolution::new(0.1, 4).unwrap()
}

fn icp() -> Icp {
    Icp::new(IcpConfig::default()).unwrap()
}

fn pose(x: f64, y: f64, z: f64, yaw: f64) -> Isometry3<f64> {
    Isometry3::new(Vector3::new(x, y, z), Vector3::new(0.0, 0.0, yaw))
}

/// The map of a room from four places, with noise of 1 cm, moved by `shift`.
fn map(shift: &Isometry3<f64>, dice: &mut Dice) -> Map<3> {
    let mut map = Map::new(resolution());
    for yaw in [0.0, 1.5, 3.0, 4.5] {
        let pose = pose(0.2, -0.3, 1.2, yaw);
        let points = scenes::camera(&scenes::room(), &pose, 0.01, dice);
        map.insert(&Cloud::new(&points, resolution()).unwrap(), &(shift * pose), 100).unwrap();
    }
    map
}

/// Where the sensor is, and by how much the guess is off.
fn off(truth: &Isometry3<f64>, found: &Isometry3<f64>) -> (f64, f64) {
    let off = truth.inverse() * found;
    (off.translation.vector.norm(), off.rotation.angle().to_degrees())
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(24))]
    #[test]
    fn a_known_motion_is_found(
        moved in prop::array::uniform3(-0.25..0.25f64),
        turned in prop::array::uniform3(-0.06..0.06f64),
        seed in any::<u64>(),
    ) {
        let mut dice = Dice(seed);
        let map = map(&Isometry3::identity(), &mut dice);
        let truth = pose(-0.4, 0.1, 1.3, 0.7);
        let cloud = Cloud::new(&scenes::camera(&scenes::room(), &truth, 0.01, &mut dice), resolution()).unwrap();
        let guess = truth * Isometry3::new(moved.into(), turned.into());
        let found = icp().register(&map, &cloud, &guess).unwrap();
        let (metres, degrees) = off(&truth, &found.pose);
        prop_assert!(metres < 0.01 && degrees < 0.15, "off by {metres} m, {degrees}°");
        prop_assert!(found.health.unknown.is_empty() && found.health.overlap() > 0.8, "{:?}", found.health);
        prop_assert!(found.health.rms < 0.02, "{:?}", found.health);
        // Millimetres are what some thousand points of 1 cm give; and no better than that.
        let covariance = found.covariance().unwrap();
        let sigma = covariance.diagonal().map(f64::sqrt);
        prop_assert!(sigma.iter().all(|s| (1e-5..5e-3).contains(s)), "{sigma}");
    }
}

#[test]
fn far_from_the_origin_it_is_the_same() {
    let shift = Isometry3::new(Vector3::new(8000.0, -9000.0, 300.0), Vector3::new(0.0, 0.0, 2.0));
    let [near, far] = [Isometry3::identity(), shift].map(|shift| {
        let mut dice = Dice(3);
        let map = map(&shift, &mut dice);
        let truth = pose(-0.4, 0.1, 1.3, 0.7);
        let cloud = Cloud::new(&scenes::camera(&scenes::room(), &truth, 0.01, &mut dice), resolution()).unwrap();
        let guess = shift * truth * Isometry3::new(Vector3::new(0.1, 0.2, -0.1), Vector3::new(0.03, 0.02, 0.05));
        let found: Estimate<_, 6> = icp().register(&map, &cloud, &guess).unwrap();
        let (metres, degrees) = off(&(shift * truth), &found.pose);
        assert!(metres < 0.01 && degrees < 0.15, "off by {metres} m, {degrees}°");
        found.covariance().unwrap().determinant().log10()
    });
    assert!((near - far).abs() < 1.0, "a volume of uncertainty of 1e{near} and 1e{far}");
}

#[test]
fn points_that_belong_to_nothing_change_little() {
    let mut dice = Dice(5);
    let map = map(&Isometry3::identity(), &mut dice);
    let truth = pose(-0.4, 0.1, 1.3, 0.7);
    let mut points = scenes::camera(&scenes::room(), &truth, 0.01, &mut dice);
    // Somebody stands before the camera, and a third of the rest is anywhere.
    for (i, point) in points.iter_mut().enumerate() {
        match (i % 100, i % 3) {
            (30..45, _) => *point = Point3::from(point.coords.normalize() * 0.8),
            (_, 0) => *point = Point3::from(point.coords * dice.next() as f32),
            _ => (),
        }
    }
    let cloud = Cloud::new(&points, resolution()).unwrap();
    let guess = truth * Isometry3::new(Vector3::new(0.1, 0.15, -0.05), Vector3::new(0.03, 0.02, 0.05));
    let found = icp().register(&map, &cloud, &guess).unwrap();
    let (metres, degrees) = off(&truth, &found.pose);
    assert!(metres < 0.02 && degrees < 0.3, "off by {metres} m, {degrees}°");
    assert!(found.health.overlap() < 0.7, "{:?}", found.health);
}

#[test]
fn a_plane_says_nothing_of_ways_along_it() {
    let mut dice = Dice(7);
    let mut ground = |dx: f64| -> Vec<Point3<f32>> {
        let mut point = |i: i32| {
            Point3::new(f64::from(i / 80) * 0.05 - 2.0 + dx, f64::from(i % 80) * 0.05 - 2.0, dice.normal(0.01) - 1.0)
        };
        (0..6400).map(|i| point(i).cast()).collect()
    };
    let mut map = Map::new(resolution());
    map.insert(&Cloud::new(&ground(0.0), resolution()).unwrap(), &Isometry3::identity(), 1).unwrap();
    let cloud = Cloud::new(&ground(0.02), resolution()).unwrap();
    let guess = Isometry3::new(Vector3::new(0.1, -0.05, 0.1), Vector3::new(0.04, -0.03, 0.2));
    let found = icp().register(&map, &cloud, &guess).unwrap();
    assert_eq!(found.health.unknown.len(), 3, "{:?}", found.health);
    for direction in &found.health.unknown {
        // z, roll and pitch are known.
        assert!(direction[2].abs() < 0.1 && direction[3].abs() < 0.2 && direction[4].abs() < 0.2, "{direction}");
    }
    assert_eq!(found.covariance(), None);
    let position = found.pose.translation.vector;
    assert!((position.xy() - Vector2::new(0.1, -0.05)).norm() < 0.02, "it stays as guessed: {position}");
    let up = found.pose.rotation * Vector3::z();
    assert!(position.z.abs() < 0.005 && up.xy().norm() < 0.005, "{position} {up}");
    let yaw = found.pose.rotation.euler_angles().2;
    assert!((yaw - 0.2).abs() < 0.02, "it stays as guessed: {yaw}");
}

#[test]
fn a_corridor_says_nothing_of_the_way_along_it() {
    let mut dice = Dice(9);
    let mut corridor = |dx: f64| -> Vec<Point2<f32>> {
        let mut point = |i: i32| {
            let side = if i % 2 == 0 { 1.0 } else { -1.0 };
            Point2::new(f64::from(i) * 0.02 - 4.0 + dx, side + dice.normal(0.01))
        };
        (0..400).map(|i| point(i).cast()).collect()
    };
    let mut map = Map::new(resolution());
    map.insert(&Cloud::new(&corridor(0.0), resolution()).unwrap(), &Isometry2::identity(), 1).unwrap();
    let cloud = Cloud::new(&corridor(0.03), resolution()).unwrap();
    let found = icp().register(&map, &cloud, &Isometry2::new(Vector2::new(0.3, 0.2), 0.05)).unwrap();
    assert_eq!(found.health.unknown.len(), 1, "{:?}", found.health);
    assert!(found.health.unknown[0].x.abs() > 0.99, "{:?}", found.health);
    let position = found.pose.translation.vector;
    assert!((position.x - 0.3).abs() < 0.02 && position.y.abs() < 0.005, "{position}");
    assert!(found.pose.rotation.angle().abs() < 0.005, "{}", found.pose);
    assert_eq!(found.covariance(), None);

    // With a wall across its end, everything is known.
    let end: Vec<_> = (0..60).map(|i| Point2::new(4.0, (f64::from(i) * 0.033 - 1.0) as f32)).collect();
    let closed = [corridor(0.0), end].concat();
    let mut map = Map::new(resolution());
    map.insert(&Cloud::new(&closed, resolution()).unwrap(), &Isometry2::identity(), 1).unwrap();
    let cloud = Cloud::new(&closed, resolution()).unwrap();
    let found = icp().register(&map, &cloud, &Isometry2::new(Vector2::new(0.3, 0.2), 0.05)).unwrap();
    assert!(found.health.unknown.is_empty() && found.pose.translation.vector.norm() < 0.01, "{found:?}");
    let covariance = found.covariance().unwrap();
    assert!(covariance[(0, 0)] > 3.0 * covariance[(1, 1)], "the way along is known less: {covariance}");
}

#[test]
fn a_room_in_the_plane_is_found() {
    let mut dice = Dice(11);
    let mut map = Map::new(resolution());
    let start = Isometry2::new(Vector2::new(0.2, -0.3), 0.0);
    let scan = |pose: &Isometry2<f64>, dice: &mut Dice| {
        Cloud::new(&scenes::laser(&scenes::plan(), pose, 0.01, dice), resolution()).unwrap()
    };
    map.insert(&scan(&start, &mut dice), &start, 1).unwrap();
    let truth = Isometry2::new(Vector2::new(0.5, -0.1), 0.2);
    let found = icp().register(&map, &scan(&truth, &mut dice), &start).unwrap();
    let off = truth.inverse() * found.pose;
    assert!(off.translation.vector.norm() < 0.01 && off.rotation.angle().abs() < 0.003, "{off}");
    assert!(found.health.unknown.is_empty());
}

#[test]
fn noise_makes_poses_uncertain() {
    let sigma = |noise: f64| {
        let mut dice = Dice(13);
        let map = map(&Isometry3::identity(), &mut dice);
        let truth = pose(-0.4, 0.1, 1.3, 0.7);
        let cloud = Cloud::new(&scenes::camera(&scenes::room(), &truth, noise, &mut dice), resolution()).unwrap();
        icp().register(&map, &cloud, &truth).unwrap().covariance().unwrap()[(0, 0)].sqrt()
    };
    let (little, much) = (sigma(0.01), sigma(0.05));
    assert!(much > 1.5 * little, "{little} m and {much} m");
}

#[test]
fn another_place_is_no_pose() {
    let mut dice = Dice(15);
    let map = map(&Isometry3::identity(), &mut dice);
    let scan = scenes::camera(&scenes::room(), &pose(-0.4, 0.1, 1.3, 0.7), 0.01, &mut dice);
    let cloud = Cloud::new(&scan, resolution()).unwrap();

    let away = icp().register(&map, &cloud, &pose(40.0, 0.0, 0.0, 0.0)).unwrap_err();
    assert_eq!(away, Lost::Overlap { inliers: 0, of: cloud.level(0).len(), overlap: 0.3 });
    assert!(away.to_string().starts_with("0 of "), "{away}");
    let nothing = icp().register(&Map::new(resolution()), &cloud, &pose(0.0, 0.0, 0.0, 0.0)).unwrap_err();
    assert!(matches!(nothing, Lost::Overlap { inliers: 0, .. }), "{nothing}");

    // A cloud of leaves, which fits nowhere.
    let leaf = |_| Point3::from([(); 3].map(|()| (4.0 * dice.next() - 2.0) as f32));
    let leaves: Vec<_> = (0..6000).map(leaf).collect();
    let leaves = Cloud::new(&leaves, resolution()).unwrap();
    let lost = icp().register(&map, &leaves, &pose(0.0, 0.0, 1.3, 0.0)).unwrap_err();
    assert!(matches!(lost, Lost::Overlap { .. }), "{lost}");
}

#[test]
fn a_guess_that_is_no_pose_is_said() {
    let map = map(&Isometry3::identity(), &mut Dice(17));
    let cloud = Cloud::new(&[Point3::new(1.0, 2.0, 3.0)], resolution()).unwrap();
    let said = icp().register(&map, &cloud, &pose(f64::NAN, 0.0, 0.0, 0.0)).unwrap_err().to_string();
    let wanted = "a pose at [NaN, 0.0, 0.0]: finite numbers, and a position within ±10000 m, would be right";
    assert_eq!(said, wanted);
    let error = Map::new(resolution()).insert(&cloud, &pose(0.0, 2e4, 0.0, 0.0), 1).unwrap_err();
    assert!(error.to_string().starts_with("a pose at [0.0, 20000.0, 0.0]"), "{error}");
}

#[test]
fn one_point_is_not_enough() {
    let mut dice = Dice(19);
    let map = map(&Isometry3::identity(), &mut dice);
    let cloud = Cloud::new(&[Point3::new(1.0, 0.0, 0.0)], resolution()).unwrap();
    let lost = icp().register(&map, &cloud, &pose(0.2, -0.3, 1.2, 0.0)).unwrap_err();
    assert_eq!(lost, Lost::Overlap { inliers: 0, of: 1, overlap: 0.3 });
}
