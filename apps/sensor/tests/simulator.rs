//! Scans, contacts and refusals, in rooms whose distances can be told by hand.

use elk_geometry::Pose;
use elk_geometry::random::Random;
use elk_sensor::simulator::{Settings, Simulator, StereoNoise};
use elk_sensor::surroundings::{Body, random_start};
use elk_sensor::{Camera, Obstruction, Robot, Travel};
use elk_spatial::Scan;
use elk_spatial::messages::PoseCommand;
use elk_world::scenery::{SITES, Scenery, Solid};
use elk_world::triangle::Triangle;
use elk_world::{World, WorldError};
use nalgebra::{Point3, Vector3};

/// 4×6×2 m, corner at the origin, with a closet from (1, 4, 0) to (2, 5, 2) in it.
fn room() -> World {
    let mut scenery = Scenery::within(Solid::block("room", [0.0; 3], [4.0, 6.0, 2.0]));
    scenery.block("closet", [1.0, 4.0, 0.0], [2.0, 5.0, 2.0]);
    World::from_triangles("room", scenery.triangles_at(Vector3::zeros())).unwrap()
}

fn at(x: f64, y: f64, z: f64) -> Pose {
    Pose::looking(Point3::new(x, y, z), Vector3::x())
}

fn robot(settings: Settings) -> Robot {
    robot_of(0.05, settings)
}

fn robot_of(radius: f64, settings: Settings) -> Robot {
    Robot::new(Box::new(Simulator::new(Body::new(room(), at(0.5, 1.0, 1.0), radius), settings))).unwrap()
}

fn go(robot: &mut Robot, id: u64, pose: Pose) -> (Travel, Scan<'static>) {
    go_by(robot, id, Vec::new(), pose)
}

fn go_by(robot: &mut Robot, id: u64, via: Vec<Point3<f64>>, pose: Pose) -> (Travel, Scan<'static>) {
    (robot.go(&PoseCommand { id, via, pose }).0, robot.scan(0.0).unwrap())
}

/// Distance to the walls of the empty part of the room along a ray.
fn to_walls(from: Point3<f64>, d: Vector3<f64>) -> f64 {
    let size = [4.0, 6.0, 2.0];
    (0..3)
        .map(|i| if d[i] > 0.0 { (size[i] - from[i]) / d[i] } else { -from[i] / d[i] })
        .filter(|t| !t.is_nan())
        .fold(f64::INFINITY, f64::min)
}

#[test]
fn hits_lie_on_the_walls() {
    let world = World::from_triangles(
        "empty",
        Scenery::within(Solid::block("room", [0.0; 3], [4.0, 6.0, 2.0])).triangles_at(Vector3::zeros()),
    )
    .unwrap();
    let mut random = Random::new(1, 1);
    for _ in 0..20_000 {
        let origin = Point3::new(random.between(0.1, 3.9), random.between(0.1, 5.9), random.between(0.1, 1.9));
        let direction = Vector3::from_fn(|_, _| random.between(-1.0, 1.0));
        let (found, expected) = (world.cast(origin, direction).unwrap(), to_walls(origin, direction));
        assert!((found - expected).abs() < 1e-9 * (1.0 + expected), "{found} {expected}");
    }
}

#[test]
fn no_ray_slips_out_at_an_edge_or_a_corner() {
    let mut random = Random::new(2, 1);
    for site in &SITES {
        let world = World::from_triangles(site.name, (site.build)().triangles()).unwrap();
        let triangles = world.surfaces().triangles();
        for i in 0..20_000 {
            let Triangle(corners) = triangles[(random.next_u64() % triangles.len() as u64) as usize];
            let along = if i % 2 == 0 { 0.0 } else { random.unit() };
            let target = corners[0] + (corners[1] - corners[0]) * along;
            let origin = world.draw_place(0.01, &mut random).unwrap();
            assert!(world.cast(origin, target - origin).is_some(), "{}: {origin} to {target}", site.name);
        }
    }
}

#[test]
fn the_image_is_right_way_up_and_its_points_are_in_the_camera_frame() {
    let scan = go(&mut robot(Settings::default()), 1, at(1.0, 2.0, 0.5)).1;
    assert_eq!((scan.id, scan.command, scan.points.len()), (1, 1, 10_000));
    let points: Vec<_> = scan.points.iter().collect();
    let (first, last) = (points[0], points[9_999]);
    assert!(first.x < 0.0 && first.y < 0.0, "top left comes first");
    assert!(last.x > 0.0 && last.y > 0.0);
    // The camera looks along +x from 3 m before the wall, 0.5 m above the floor: the lower half sees the floor.
    assert!((points[50 * 100 + 50].z - 3.0).abs() < 1e-5);
    assert!((last.y - 0.5).abs() < 1e-5);
    for p in scan.world_points() {
        let nearest = [p.x, 4.0 - p.x, p.y, 6.0 - p.y, p.z, 2.0 - p.z].into_iter().fold(f64::INFINITY, f64::min);
        let on_closet = (p.y - 4.0).abs() < 1e-5 || (p.x - 2.0).abs() < 1e-5 || (p.x - 1.0).abs() < 1e-5;
        assert!(nearest.abs() < 1e-5 || on_closet, "{p}");
    }
}

#[test]
fn a_ray_out_of_an_open_world_gives_no_point() {
    let wall = [[3.0, -1.0, -1.0], [3.0, 1.0, -1.0], [3.0, 0.0, 1.0]].map(Point3::from);
    let world = World::from_triangles("wall", vec![Triangle(wall)]).unwrap();
    let camera = Camera::new(60, 60, 1.2);
    let seen = camera.pixels().filter(|&(u, v)| {
        world.cast(Point3::origin(), at(0.0, 0.0, 0.0).0.rotation * camera.direction(u, v)).is_some()
    });
    let share = seen.count() as f64 / 3600.0;
    // 2 m² of 3 m · 2 tan 0.6 squared.
    let expected = 2.0 / (6.0 * 0.6_f64.tan()).powi(2);
    assert!((share - expected).abs() < 0.01, "{share} {expected}");
}

#[test]
fn the_body_touches_what_comes_within_its_radius() {
    let mut s = robot_of(0.2, Settings::default());
    assert!(!go(&mut s, 1, at(0.5, 1.0, 1.0)).0.contact, "standing still in the open");
    assert!(!go(&mut s, 2, at(3.0, 3.75, 1.0)).0.contact, "past the closet at 0.25 m");
    assert!(go(&mut s, 3, at(1.5, 3.85, 1.0)).0.contact, "to 0.15 m from its front");
    assert!(go(&mut s, 4, at(2.15, 3.9, 1.0)).0.contact, "along its front to its corner");
    assert_eq!(s.pose(), at(2.15, 3.9, 1.0), "a touch does not stop the robot");
    assert_eq!((s.contacts(), s.scans()), (Some(2), 4));
}

#[test]
fn poses_in_solids_beyond_walls_and_nowhere_are_refused() {
    let mut s = robot(Settings::default());
    let start = s.pose();
    let not_free = [at(1.5, 4.5, 1.0), at(-0.5, 1.0, 1.0), at(2.0, 3.0, 2.5)];
    for (i, pose) in not_free.into_iter().enumerate() {
        let (travel, scan) = go(&mut s, i as u64 + 1, pose);
        assert_eq!(travel, Travel { contact: true, refused: Some(Obstruction::NotFree(pose.position())) });
        assert!(scan.pose == start && scan.command == i as u64 + 1);
    }
    go(&mut s, 4, at(0.5, 4.5, 1.0));
    let (through, _) = go(&mut s, 5, at(3.0, 4.5, 1.0));
    assert!(matches!(through.refused, Some(Obstruction::Blocked(..))), "the closet is in the way");
    assert_eq!((s.contacts(), s.scans()), (Some(4), 5));
    let message = Robot::new(Box::new(Simulator::new(Body::new(room(), at(1.5, 4.5, 1.0), 0.05), Settings::default())));
    let message = message.err().unwrap().to_string();
    assert_eq!(message, "(1.500; 4.500; 1.000) is inside an obstacle or outside the world");
}

#[test]
fn a_way_with_corners_is_judged_segment_by_segment() {
    let mut s = robot(Settings::default());
    go(&mut s, 1, at(0.5, 4.5, 1.0));
    let around = |y: f64| vec![Point3::new(0.5, y, 1.0), Point3::new(2.5, y, 1.0)];
    let (travel, _) = go_by(&mut s, 2, around(3.5), at(2.5, 4.5, 1.0));
    assert!(travel.refused.is_none() && !travel.contact, "around the closet");
    let (travel, _) = go_by(&mut s, 3, around(4.2).into_iter().rev().collect(), at(0.5, 4.5, 1.0));
    assert_eq!(travel.refused, Some(Obstruction::Blocked(Point3::new(2.5, 4.2, 1.0), Point3::new(0.5, 4.2, 1.0))));
    let (travel, _) = go_by(&mut s, 4, vec![Point3::new(2.02, 4.5, 1.0)], at(2.5, 4.5, 1.0));
    assert!(travel.contact && travel.refused.is_none(), "there and back, 2 cm from the closet");
}

#[test]
fn noise_belongs_to_the_scan_and_not_to_its_history() {
    let focal_px = Settings::default().camera.focal_px;
    let noise = Some(StereoNoise { sigma_px: 1.0, focal_px, baseline_m: 0.12 });
    let settings = |seed| Settings { noise, seed, ..Settings::default() };
    let third = |seed, way: [f64; 2]| {
        let mut s = robot(settings(seed));
        for (i, x) in way.into_iter().enumerate() {
            go(&mut s, i as u64 + 1, at(x, 1.0, 1.0));
        }
        go(&mut s, 3, at(1.0, 1.0, 1.0)).1
    };
    assert_eq!(third(1, [0.6, 0.7]), third(1, [2.0, 3.0]));
    assert_ne!(third(1, [0.6, 0.7]), third(2, [0.6, 0.7]));
    let mut s = robot(settings(1));
    let (a, b) = (go(&mut s, 1, at(1.0, 1.0, 1.0)).1, go(&mut s, 2, at(1.0, 1.0, 1.0)).1);
    assert_ne!(a.points, b.points, "two scans from one place differ");
}

#[test]
fn random_starts_are_free_with_room_around_and_repeat() {
    let world = room();
    for seed in 0..200 {
        let start = random_start(&world, seed).unwrap();
        let place = start.position();
        assert!(world.is_free(place) && !world.touches(place, place, 0.3));
        assert_eq!(start, random_start(&world, seed).unwrap());
    }
    assert_ne!(random_start(&world, 1).unwrap(), random_start(&world, 2).unwrap());
    let shaft = Scenery::within(Solid::block("shaft", [0.0; 3], [0.5, 0.5, 9.0]));
    let shaft = World::from_triangles("shaft", shaft.triangles()).unwrap();
    assert!(matches!(random_start(&shaft, 1), Err(WorldError::NoFreePlace { .. })));
}
