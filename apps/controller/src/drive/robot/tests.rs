use elk_geometry::{Clearance, OccupancyGrid, State, Voxel};
use proptest::prelude::*;

use super::*;
use crate::drive::body::tests::{any_way, differential};

/// A map of voxels of 0.1 m that are free where `is_free` says so, 40 × 40 × 10 of them.
fn map(is_free: impl Fn(i32, i32) -> bool) -> OccupancyGrid {
    let mut grid = OccupancyGrid::new(0.1);
    for (x, y) in (0..40).flat_map(|x| (0..40).map(move |y| (x, y))).filter(|(x, y)| is_free(*x, *y)) {
        (0..10).for_each(|z| assert!(grid.set(Voxel::new(x, y, z), State::Free)));
    }
    grid
}

fn at(x: f64, y: f64) -> Point3<f64> {
    Point3::new(x, y, 0.55)
}

fn looking(yaw_deg: f64) -> Pose {
    Pose::from_yaw_pitch(at(1.05, 1.05), yaw_deg.to_radians(), 0.0)
}

fn noise(sigma: f64) -> Noise {
    Noise { sigma, seed: 3 }
}

/// A ride to the end of a way from where the robot is.
fn to_the_end(robot: &mut Robot, grid: &OccupancyGrid, points: &[Point3<f64>], pose: Pose) -> Ride {
    let (way, clearance) = (Polyline::new(points.iter().copied()).unwrap(), Clearance::new(0.1, 0.1).unwrap());
    let errand = Errand { way: &way, from: 0.0, to: way.length(), pose, number: 1 };
    robot.ride(&errand, Corridor::along(grid, &clearance, &way, 0.0))
}

fn stands_at(robot: &Robot, place: Point3<f64>, yaw_deg: f64) {
    assert_eq!(robot.body.rates, STANDING);
    assert!((robot.body.position - place).norm() <= ARRIVED_M + 1e-3, "{:?}", robot.body);
    assert!(wrapped(robot.body.yaw - yaw_deg.to_radians()).abs() <= AIMED_RAD, "{:?}", robot.body);
}

#[test]
fn a_straight_way_takes_as_long_as_its_limits_say() {
    let grid = map(|_, _| true);
    let mut robot = Robot::new(&looking(0.0), any_way(), noise(0.0));
    let ride = to_the_end(&mut robot, &grid, &[at(1.05, 1.05), at(3.05, 1.05)], looking(0.0));
    stands_at(&robot, at(3.05, 1.05), 0.0);
    assert!(!ride.is_stopped && (ride.length_m - 2.0).abs() < 0.01, "{ride:?}");
    // 2 m at 0.5 m/s, a second to come to speed and at least as long to stop.
    assert!((5.0..6.5).contains(&robot.secs), "{}", robot.secs);
}

#[test]
fn on_two_wheels_it_faces_where_it_goes_and_turns_on_the_spot() {
    let grid = map(|_, _| true);
    let mut robot = Robot::new(&looking(90.0), differential(), noise(0.0));
    let bend = [at(1.05, 1.05), at(3.05, 1.05), at(3.05, 3.05)];
    to_the_end(&mut robot, &grid, &bend, looking(-90.0));
    stands_at(&robot, at(3.05, 3.05), -90.0);
    let before = robot;
    let ride = to_the_end(&mut robot, &grid, &[at(3.05, 3.05)], looking(45.0));
    stands_at(&robot, at(3.05, 3.05), 45.0);
    assert!(ride.length_m == 0.0 && ride.done_m == 0.0, "a way of no length is a turn");
    // 135 deg at 90 deg/s, and half a second to come to speed.
    assert!((1.5..3.5).contains(&(robot.secs - before.secs)), "{}", robot.secs - before.secs);
}

#[test]
fn sent_back_at_full_speed_it_brakes_before_it_turns_round() {
    let grid = map(|_, _| true);
    for limits in [any_way(), differential()] {
        let mut robot = Robot::new(&looking(0.0), limits, noise(0.02));
        robot.body.rates[0] = 0.5;
        let ride = to_the_end(&mut robot, &grid, &[at(1.05, 1.05), at(0.25, 1.05)], looking(180.0));
        stands_at(&robot, at(0.25, 1.05), 180.0);
        let farthest = ride.trace.iter().map(|p| p.x).fold(0.0, f64::max);
        assert!((1.2..1.4).contains(&farthest), "{farthest}");
        assert!(!ride.is_stopped && (ride.length_m - 0.8 - 2.0 * (farthest - 1.05)).abs() < 0.2, "{}", ride.length_m);
    }
}

#[test]
fn a_way_of_no_length_at_full_speed_leads_back_to_it() {
    let grid = map(|_, _| true);
    for limits in [any_way(), differential()] {
        let mut robot = Robot::new(&looking(0.0), limits, noise(0.02));
        robot.body.rates[0] = 0.5;
        to_the_end(&mut robot, &grid, &[at(1.05, 1.05)], looking(90.0));
        stands_at(&robot, at(1.05, 1.05), 90.0);
    }
}

#[test]
fn it_passes_the_places_before_the_ways_end_without_a_stop() {
    let grid = map(|_, _| true);
    let mut robot = Robot::new(&looking(0.0), any_way(), noise(0.0));
    let (way, clearance) =
        (Polyline::new([at(1.05, 1.05), at(3.05, 1.05)]).unwrap(), Clearance::new(0.1, 0.1).unwrap());
    let mut done = 0.0;
    for number in 1..=5 {
        let to = 0.4 * number as f64;
        let errand = Errand { way: &way, from: done, to, pose: looking(0.0), number };
        let ride = robot.ride(&errand, Corridor::along(&grid, &clearance, &way, done));
        done = ride.done_m;
        assert!(done >= to - 1e-9 && done < to + 0.03 && robot.moves() == (number < 5), "{number}: {ride:?}");
    }
    // As in one go.
    assert!((5.0..6.5).contains(&robot.secs), "{}", robot.secs);
}

#[test]
fn where_its_corridor_is_shut_it_stops_and_says_so() {
    let grid = map(|_, _| true);
    let mut robot = Robot::new(&looking(0.0), any_way(), noise(0.05));
    let way = Polyline::new([at(1.05, 1.05), at(1.45, 1.05)]).unwrap();
    let clearance = Clearance::new(0.1, 0.1).unwrap();
    // It passes a place at speed, and is sent round a corner that the map has shut meanwhile.
    let errand = Errand { way: &way, from: 0.0, to: 0.3, pose: looking(0.0), number: 1 };
    robot.ride(&errand, Corridor::along(&grid, &clearance, &way, 0.0));
    let ahead = Polyline::new([at(1.45, 1.05), at(1.45, 1.95)]).unwrap();
    let narrow = map(|x, y| x < 16 && (8..13).contains(&y));
    let errand = Errand { way: &ahead, from: 0.0, to: ahead.length(), pose: looking(0.0), number: 2 };
    let short = Polyline::new([at(1.45, 1.05)]).unwrap();
    let ride = robot.ride(&errand, Corridor::along(&narrow, &clearance, &short, 0.0));
    assert!(ride.is_stopped && robot.stops == 1 && !robot.moves(), "{ride:?}");
    assert!(robot.body.position.y < 1.2 + 1e-9, "{:?}", robot.body.position);
}

#[test]
fn who_cannot_climb_stops_at_once() {
    let grid = map(|_, _| true);
    let flat = Limits { vertical: Axis { speed: 0.0, acceleration: 0.0 }, ..any_way() };
    let mut robot = Robot::new(&looking(0.0), flat, noise(0.0));
    let up = Point3::new(1.05, 1.05, 0.75);
    let ride = to_the_end(&mut robot, &grid, &[at(1.05, 1.05), up], looking(0.0));
    assert!(ride.is_stopped && ride.length_m == 0.0 && robot.secs < 1.0, "{ride:?} {}", robot.secs);
}

/// Whether every tick of a ride keeps to the corridor.
fn keeps_to(corridor: &Corridor<'_>, ride: &Ride) -> bool {
    ride.trace.windows(2).all(|ends| corridor.has(ends[0], ends[1]))
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(96))]
    /// On whatever way through an L-shaped passage a little wider than the robot, with noise and on two wheels or not: it arrives, or
    /// says that it stopped; it never leaves the corridor, its limits hold, and the same comes to the same.
    #[test]
    fn it_arrives_within_its_corridor_or_stops(
        corners in prop::collection::vec((0.0..1.0f64, any::<bool>()), 1..5),
        width in 3..7i32,
        is_differential in any::<bool>(),
        sigma in prop_oneof![Just(0.0), 0.0..0.05],
        speed in 0.1..2.0f64,
        yaw_deg in -180.0..180.0f64,
    ) {
        let grid = map(|x, y| (10..10 + width).contains(&x) && y >= 10 || (10..10 + width).contains(&y) && x >= 10);
        let mut limits = if is_differential { differential() } else { any_way() };
        limits.forward.speed = speed;
        if !is_differential {
            limits.lateral.speed = speed;
        }
        // Corners in the cross' middle lines, as a planner has them: by way of the passages' crossing where they change.
        let middle = 1.0 + f64::from(width) * 0.05;
        let mut points = vec![at(middle, middle)];
        for (share, along_x) in &corners {
            let far = middle + share * 2.4;
            points.extend([at(middle, middle), if *along_x { at(far, middle) } else { at(middle, far) }]);
        }
        let (way, clearance) = (Polyline::new(points.iter().copied()).unwrap(), Clearance::new(0.1, 0.1).unwrap());
        let goal = Pose::from_yaw_pitch(way.end(), yaw_deg.to_radians(), 0.2);
        let run = || {
            let mut robot = Robot::new(&Pose::from_yaw_pitch(points[0], 0.5, 0.0), limits, noise(sigma));
            let errand = Errand { way: &way, from: 0.0, to: way.length(), pose: goal, number: 7 };
            let ride = robot.ride(&errand, Corridor::along(&grid, &clearance, &way, 0.0));
            (robot, ride)
        };
        let (robot, ride) = run();
        prop_assert_eq!(run(), (robot, ride.clone()));
        prop_assert!(keeps_to(&Corridor::along(&grid, &clearance, &way, 0.0), &ride));
        prop_assert!(!ride.is_stopped, "stopped at {:?}", robot.body);
        prop_assert!((robot.body.position - way.end()).norm() <= ARRIVED_M + 2e-3, "{:?} {:?}", robot.body, way.end());
        prop_assert!(wrapped(robot.body.yaw - goal.yaw()).abs() <= AIMED_RAD + 1e-9);
        let fastest = 1.5 * (2.0f64).sqrt() * speed.max(0.3) * TICK_SECS;
        prop_assert!(ride.trace.windows(2).all(|ends| (ends[1] - ends[0]).norm() <= fastest));
        prop_assert!(ride.length_m <= robot.secs * (speed * speed * 2.0 + 0.09).sqrt() + 1e-9);
    }
}
