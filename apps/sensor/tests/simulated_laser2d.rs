//! What a simulated laser sees of a room whose distances can be told by hand, and where its robot takes itself to be.

use std::f64::consts::{FRAC_PI_2, TAU};

use elk_geometry::Pose;
use elk_sensor::localised::{Estimating, Localised, LookSpacing};
use elk_sensor::pose_estimator::{IcpSettings, LevelMatching};
use elk_sensor::simulated_laser2d::{LaserMatching, Settings, SimulatedLaser2d, TYPE};
use elk_sensor::surroundings::Body;
use elk_sensor::{Capture, DepthSource, Robot, Seen};
use elk_spatial::messages::PoseCommand;
use elk_world::World;
use elk_world::scenery::{Scenery, Solid};
use nalgebra::{Point3, Vector3};

/// 5×4×2.5 m, corner at the origin, with a cupboard from (3, 1, 0) to (4, 2, 1.5) in it, and a shelf on a wall above the laser's plane.
fn room() -> World {
    let mut scenery = Scenery::within(Solid::block("room", [0.0; 3], [5.0, 4.0, 2.5]));
    scenery.block("cupboard", [3.0, 1.0, 0.0], [4.0, 2.0, 1.5]);
    scenery.block("shelf", [0.5, 3.5, 1.0], [2.0, 4.0, 1.2]);
    World::from_triangles("room", scenery.triangles_at(Vector3::zeros())).unwrap()
}

fn start() -> Pose {
    Pose::from_yaw_pitch(Point3::new(1.0, 2.0, 0.25), 0.0, 0.0)
}

fn settings() -> Settings {
    Settings { beams: 540, fov: 1.5 * std::f64::consts::PI, range: 10.0, noise: 0.0, seed: 1 }
}

fn laser(settings: Settings) -> SimulatedLaser2d {
    SimulatedLaser2d::new(Body::new(room(), start(), 0.1), settings)
}

/// A scan from a place in the laser's plane, heading there.
fn scan(settings: Settings, number: u64, [x, y, yaw]: [f64; 3]) -> Seen {
    let pose = Pose::from_yaw_pitch(Point3::new(x, y, 0.25), yaw, 0.0);
    laser(settings).scan(&Capture { scan: number, time_secs: 0.0, pose }).unwrap()
}

/// Ranges of all points (m).
fn ranges(seen: &Seen) -> Vec<f64> {
    seen.points.iter().map(|point| f64::from(point.coords.norm())).collect()
}

#[test]
fn four_beams_all_around_see_the_four_walls_from_right_to_left() {
    let four = Settings { beams: 4, fov: TAU, ..settings() };
    assert_eq!(
        (0..4).map(|beam| (four.bearing(beam) / FRAC_PI_2 * 2.0).round() as i32).collect::<Vec<_>>(),
        [-3, -1, 1, 3]
    );
    // It is turned by 45°, so that they look along −y, x, y and −x of the world.
    let seen = scan(four, 1, [1.0, 2.5, FRAC_PI_2 / 2.0]);
    let found = ranges(&seen);
    let expected = [2.5, 4.0, 1.5, 1.0];
    assert!(found.iter().zip(expected).all(|(found, expected)| (found - expected).abs() < 1e-5), "{found:?}");
    assert!(seen.no_return.is_empty() && seen.pixel_runs.is_empty());
    // In the camera frame, x is to the right and z ahead: the second beam is 45° to the right of ahead.
    let second = seen.points.iter().nth(1).unwrap();
    assert!((second.x - second.z).abs() < 1e-5 && second.x > 0.0 && second.y == 0.0, "{second}");
}

#[test]
fn it_sees_its_own_plane_alone_and_what_is_in_it() {
    // Ahead and to the left is the wall behind the shelf, which is above the plane; the cupboard stands in it.
    let beam = |from: [f64; 3]| ranges(&scan(Settings { beams: 1, fov: 0.1, ..settings() }, 1, from));
    assert!((beam([1.0, 2.0, FRAC_PI_2])[0] - 2.0).abs() < 1e-5);
    assert!((beam([1.0, 1.5, 0.0])[0] - 2.0).abs() < 1e-5);
    let tilted = Pose::from_yaw_pitch(Point3::new(1.0, 2.0, 0.25), FRAC_PI_2, 0.5);
    let seen = laser(Settings { beams: 1, fov: 0.1, ..settings() }).look(&tilted, 1);
    let there = tilted.to_world(seen.points.iter().next().unwrap().cast());
    assert!((there - Point3::new(1.0, 3.5, 0.25 + 1.5 * 0.5_f64.tan())).norm() < 1e-5, "the shelf's front: {there}");
}

#[test]
fn what_is_farther_than_it_sees_is_a_direction_without_a_return() {
    let near = Settings { range: 2.0, ..settings() };
    let (seen, all) = (scan(near, 1, [1.0, 2.0, 0.0]), scan(settings(), 1, [1.0, 2.0, 0.0]));
    assert_eq!((seen.points.len() + seen.no_return.len(), all.points.len(), all.no_return.len()), (540, 540, 0));
    assert!(ranges(&seen).iter().all(|range| *range <= 2.0) && seen.no_return.len() > 100, "{}", seen.no_return.len());
    assert_eq!(seen.points.len(), ranges(&all).iter().filter(|range| **range <= 2.0).count());
    assert!(seen.no_return.iter().all(|way| (way.coords.norm() - 1.0).abs() < 1e-6 && way.y == 0.0));
    let camera = laser(near).camera();
    assert_eq!((camera.columns, camera.rows, camera.fov_y, camera.range_m), (540, 1, 0.0, 2.0));
    assert!((camera.fov_x.to_degrees() - 270.0).abs() < 1e-9 && camera.is_fan());
}

#[test]
fn ranges_err_by_as_much_as_is_asked_for_and_as_the_seed_and_the_scan_have_it() {
    let noisy = Settings { noise: 0.02, ..settings() };
    let from = [1.0, 2.0, 0.3];
    let exact = ranges(&scan(settings(), 1, from));
    let errors: Vec<f64> = (1..=50)
        .flat_map(|number| ranges(&scan(noisy, number, from)).into_iter().zip(exact.clone()).map(|(a, b)| a - b))
        .collect();
    let n = errors.len() as f64;
    let (mean, sigma) = (errors.iter().sum::<f64>() / n, (errors.iter().map(|e| e * e).sum::<f64>() / n).sqrt());
    assert!(mean.abs() < 5.0 * 0.02 / n.sqrt() && (sigma - 0.02).abs() < 5.0 * 0.02 / n.sqrt(), "{mean} {sigma}");
    let mut one = laser(noisy);
    let capture = |scan| Capture { scan, time_secs: 0.0, pose: start() };
    let [first, second] = [1, 2].map(|number| one.scan(&capture(number)).unwrap());
    assert_ne!(first, second, "noise is of the scan");
    assert_eq!(laser(noisy).scan(&capture(2)).unwrap(), second, "and not of its history");
    assert_ne!(laser(Settings { seed: 2, ..noisy }).scan(&capture(1)).unwrap(), first);
}

/// All around the cupboard, from the scans alone.
#[test]
fn a_robot_whose_scans_are_matched_knows_where_it_is() {
    let around = || {
        let laser = laser(Settings { noise: 0.01, ..settings() });
        let icp = IcpSettings { voxel: 0.1, step: 0.3, turn: 0.3, window: 30 };
        let matching = LaserMatching::new(laser.clone(), LevelMatching::new(&icp, 0.25).unwrap());
        let spacing = LookSpacing { way_m: 0.1, turn_rad: 10_f64.to_radians() };
        let mut robot = Robot::localised(Localised::new(Box::new(laser), Estimating::new(matching, spacing))).unwrap();
        let stops = [(2.5, 3.0, 0.0), (4.5, 3.0, -1.5), (4.5, 0.5, -3.0), (2.0, 0.5, 1.5), (1.0, 2.0, 0.0)];
        let mut worst: (f64, f64) = (0.0, 0.0);
        for (id, (x, y, yaw)) in (1..).zip(stops) {
            let sent = Pose::from_yaw_pitch(Point3::new(x, y, 0.25), yaw, 0.0);
            let (travel, advance) = robot.go(&PoseCommand { id, via: Vec::new(), pose: sent });
            assert!(advance.passed_over.is_empty() && !travel.contact, "{id}: {advance:?}");
            let estimate = &advance.estimates[0];
            let off = estimate.recorded.unwrap().0.inverse() * robot.pose().0;
            worst = (worst.0.max(off.translation.vector.norm()), worst.1.max(off.rotation.angle()));
            assert!((robot.pose().position() - sent.position()).norm() < 0.02, "it comes near to where it is sent");
            assert_eq!((estimate.scan, estimate.covariance.len()), (id, 9));
            assert_eq!(robot.scan(0.0).unwrap().points, robot.scan(1.0).unwrap().points, "the same scan again");
        }
        worst
    };
    let (way, turn) = around();
    println!("off by at most {way:.4} m, {:.3}°", turn.to_degrees());
    assert!(way > 1e-6 && way < 0.02 && turn < 0.01, "{way} m, {turn} rad");
    assert_eq!(around(), (way, turn), "and the same again");
}

/// What is said of parameters with which nothing can be seen.
#[test]
fn what_cannot_be_a_laser_is_refused_with_what_would_be_right() {
    let said = |sets: &[(&str, &str)]| {
        let sets: Vec<(String, String)> = sets.iter().map(|(name, text)| ((*name).into(), (*text).into())).collect();
        let params = TYPE.check(&sets, std::path::Path::new("")).map_err(|error| error.to_string())?;
        (TYPE.build)(&params).map(|_| ()).map_err(|error| error.to_string())
    };
    assert_eq!(said(&[]), Ok(()));
    assert_eq!(said(&[("PoseEstimator", "ICP"), ("Fov", "360"), ("RandomStart", "true")]), Ok(()));
    for (sets, words) in [
        (&[("Beams", "0")][..], "Beams"),
        (&[("Fov", "0")], "Fov"),
        (&[("Fov", "400")], "Fov"),
        (&[("Range", "0")], "Range"),
        (&[("RangeNoise", "-1")], "RangeNoise"),
        (&[("PoseEstimator", "VisualOdometry")], "ICP"),
        (&[("Start", "100; 0; 0")], "Start"),
    ] {
        let error = said(sets).unwrap_err();
        assert!(error.contains(words), "{sets:?}: {error}");
    }
}
