//! The way of the oracle, followed by the simulated robot with its own camera: what it promises is seen, and nothing touched.

use elk_evaluate::oracle::Oracle;
use elk_evaluate::site::Around;
use elk_evaluate::truth::{Terms, Truth};
use elk_geometry::delta::Changes;
use elk_geometry::random::Random;
use elk_geometry::{Bounds, Pose};
use elk_map::{MapConfig, OccupancyMap};
use elk_sensor::simulator::{Settings, Simulator};
use elk_sensor::surroundings::Body;
use elk_sensor::{Camera, Robot};
use elk_spatial::messages::PoseCommand;
use elk_world::{Placement, World};
use nalgebra::Point3;

/// Edge of a voxel (m): so that a few hundred looks around do not take minutes.
const EDGE_M: f64 = 0.2;
/// Pixels in a row of a camera that sees [`FOV_DEG`].
const PIXELS: u32 = 50;
const FOV_DEG: f64 = 75.0;

/// Headings and elevations (degrees) of a camera that sees 75° of all that is around.
fn looks() -> impl Iterator<Item = [f64; 2]> {
    let ring = |pitch: f64| (0..6).map(move |k| [60.0 * f64::from(k), pitch]);
    [[0.0, 89.0], [0.0, -89.0]].into_iter().chain([-55.0, 0.0, 55.0].into_iter().flat_map(ring))
}

/// Share of what is visible that the robot knows after it has looked around at each corner, and its contacts.
fn followed(world: &World, truth: &Truth, corners: &[Point3<f64>]) -> (f64, u64) {
    let pose =
        |place: Point3<f64>, [yaw, pitch]: [f64; 2]| Pose::from_yaw_pitch(place, yaw.to_radians(), pitch.to_radians());
    let camera = Camera::new(PIXELS, PIXELS, FOV_DEG.to_radians());
    let settings = Settings { camera, ..Settings::default() };
    let simulator = Simulator::new(Body::new(world.clone(), pose(corners[0], [0.0; 2]), 0.05), settings);
    let mut robot = Robot::new(Box::new(simulator)).unwrap();
    let mut map = OccupancyMap::new(MapConfig { resolution: truth.resolution(), ..MapConfig::default() }).unwrap();
    let mut id = 0;
    for corner in corners {
        for look in looks() {
            id += 1;
            let (travel, _) = robot.go(&PoseCommand { id, via: vec![], pose: pose(*corner, look) });
            assert!(travel.refused.is_none(), "{travel:?} at {corner:?}");
            let (scan, camera) = (robot.scan(0.0).unwrap(), robot.pose());
            map.insert(*corner, scan.points.iter().map(|point| camera.to_world(point.cast())));
        }
    }
    let mut changes = Changes::default();
    map.grid().bricks().iter().for_each(|(brick, cells)| changes.add((brick, *cells.known())));
    let mut coverage = truth.coverage();
    coverage.update(map.grid(), &changes);
    (coverage.share(), robot.contacts().unwrap())
}

fn explored(name: &str, mid: [f64; 3], dim: [f64; 3], starts: usize) {
    let world = World::load(name, &Placement::default()).unwrap();
    let bounds = Some(Bounds::from_mid_dim(mid.into(), dim.into()));
    let truth = Truth::of(&world, Terms { resolution: EDGE_M, radius_m: 0.1, bounds }).unwrap();
    let oracle = Oracle::new(
        &world,
        &truth,
        Around { spacing: (FOV_DEG / f64::from(PIXELS)).to_radians(), range_m: f64::INFINITY },
    );
    for start in truth.starts(&world, starts, &mut Random::new(5, 0)).unwrap() {
        let way = oracle.way(start.position).unwrap();
        let length: f64 = way.corners.windows(2).map(|pair| (pair[1] - pair[0]).norm()).sum();
        let (seen, contacts) = followed(&world, &truth, &way.corners);
        println!(
            "{name} from {:?}: {:.2} m, {} looks; {:.5} seen by the oracle's rays, {seen:.5} by the camera, {contacts} contacts",
            start.position.coords.as_slice(),
            way.way_m,
            way.corners.len(),
            way.seen
        );
        assert_eq!(way.corners[0], start.position);
        assert!((length - way.way_m).abs() < 1e-6 && way.seen >= 0.999, "{way:?}");
        assert!(seen >= 0.999 && contacts == 0, "{seen} of what is visible is seen, {contacts} contacts");
        assert_eq!(oracle.way(start.position).unwrap(), way);
    }
}

#[test]
fn following_it_shows_the_car() {
    explored("car-interior", [0.0; 3], [5.7, 4.3, 4.5], 2);
}

#[test]
fn following_it_shows_the_kitchen() {
    explored("kitchen", [4.0, 4.0, 1.5], [8.5, 8.5, 3.5], 1);
}
