//! Robots that are not told where they are: where they truly go, and what they say of it.

use elk_geometry::Pose;
use elk_sensor::frame::Frame;
use elk_sensor::localised::{Estimating, Localised, LookSpacing};
use elk_sensor::pose_estimator::{
    Drift, DriftingOdometry, Located, MapMatchingSettings, PoseEstimator, VisualOdometry, VisualOdometrySettings,
};
use elk_sensor::simulated_stereo::{Eyes, Look, Settings, SimulatedStereo};
use elk_sensor::simulator::{self, Simulator};
use elk_sensor::source::{Capture, DepthSource};
use elk_sensor::surroundings::Body;
use elk_sensor::{Camera, Obstruction, Robot};
use elk_spatial::messages::PoseCommand;
use elk_stereo::{Sad5, Sad5Config};
use elk_world::World;
use elk_world::scenery::{Scenery, Solid};
use nalgebra::{Isometry3, Point3, Vector3};

/// 5×4×2.5 m, corner at the origin, with a cupboard from (3, 1, 0) to (4, 2, 1.5) in it.
fn room() -> World {
    let mut scenery = Scenery::within(Solid::block("room", [0.0; 3], [5.0, 4.0, 2.5]));
    scenery.block("cupboard", [3.0, 1.0, 0.0], [4.0, 2.0, 1.5]);
    World::from_triangles("room", scenery.triangles_at(Vector3::zeros())).unwrap()
}

fn start() -> Pose {
    Pose::from_yaw_pitch(Point3::new(1.0, 2.0, 1.2), 0.0, 0.0)
}

fn body() -> Body {
    Body::new(room(), start(), 0.1)
}

fn stereo(contrast: f32) -> SimulatedStereo {
    let camera = Camera::new(320, 240, 75_f64.to_radians());
    let eyes = Eyes { camera, baseline_m: 0.12, noise: 1.0, seed: 1 };
    let settings = Settings { eyes, look: Look { contrast, blank: 0.0, seed: 1 }, range: None };
    SimulatedStereo::new(body(), settings, Box::new(Sad5::new(Sad5Config::default()).unwrap())).unwrap()
}

fn odometry(stereo: &SimulatedStereo) -> VisualOdometry {
    let settings = VisualOdometrySettings { rig: *stereo.rig(), size: [320, 240], patience: None, memory: 0, seed: 1 };
    VisualOdometry::new(settings).unwrap()
}

fn command(id: u64, pose: Pose) -> PoseCommand {
    PoseCommand { id, via: Vec::new(), pose }
}

/// Always off by the same, in the world's frame.
struct Off(Vector3<f64>);

impl PoseEstimator for Off {
    fn locate(&mut self, frame: &Frame) -> Located {
        let pose = frame.pose.clone().unwrap().0;
        Located::At(Pose(Isometry3::from_parts((pose.translation.vector + self.0).into(), pose.rotation)), vec![], 1.0)
    }
}

/// A robot in a room that takes itself to be elsewhere goes as far as it was sent, and meets the wall that is truly there.
#[test]
fn it_goes_from_where_it_truly_is_and_says_where_it_takes_itself_to_be() {
    let simulator = Simulator::new(body(), simulator::Settings::default());
    let off = Vector3::new(0.0, 0.5, 0.0);
    let mut robot =
        Robot::localised(Localised::new(Box::new(simulator), Estimating::new(Off(off), LookSpacing::AT_THE_END)))
            .unwrap();
    // The first look is at the start, from which it is 0.5 m off at once.
    let sent = Pose::from_yaw_pitch(Point3::new(2.0, 2.5, 1.2), 0.3, 0.0);
    let (travel, advance) = robot.go(&command(1, sent));
    assert_eq!((travel.contact, travel.refused), (false, None));
    let [estimate] = &advance.estimates[..] else { panic!("{advance:?}") };
    let truly = estimate.recorded.unwrap();
    assert!((robot.pose().position() - sent.position()).norm() < 1e-9 && estimate.pose == Some(robot.pose()));
    assert!((truly.position() - Point3::new(2.0, 2.0, 1.2)).norm() < 1e-9, "{truly:?}");
    let scan = robot.scan(0.0).unwrap();
    assert_eq!((scan.id, scan.command, scan.pose), (1, 1, robot.pose()));
    // Its map would have the wall at y = 4 m half a metre farther on.
    let (travel, _) = robot.go(&command(2, Pose::from_yaw_pitch(Point3::new(2.0, 4.45, 1.2), 0.3, 0.0)));
    assert!(travel.contact && travel.refused.is_none(), "{travel:?}: it is truly 5 cm from the wall");
    let (travel, _) = robot.go(&command(3, Pose::from_yaw_pitch(Point3::new(2.0, 4.6, 1.2), 0.3, 0.0)));
    assert!(matches!(travel.refused, Some(Obstruction::NotFree(_))), "{travel:?}");
    assert_eq!(robot.contacts(), Some(2));
    assert!(!robot.can_succeed());
}

/// The straight way would lead through the cupboard.
#[test]
fn it_goes_by_way_of_all_corners_and_looks_at_each() {
    let simulator = Simulator::new(body(), simulator::Settings::default());
    let exact = Estimating::new(Off(Vector3::zeros()), LookSpacing::AT_THE_END);
    let mut robot = Robot::localised(Localised::new(Box::new(simulator), exact)).unwrap();
    let via = vec![Point3::new(2.0, 2.5, 1.2), Point3::new(4.5, 2.5, 1.2)];
    let pose = Pose::from_yaw_pitch(Point3::new(4.5, 0.8, 1.2), -1.5, 0.0);
    let (travel, advance) = robot.go(&PoseCommand { id: 1, via, pose });
    assert_eq!((travel.contact, travel.refused), (false, None));
    assert!((robot.pose().position() - pose.position()).norm() < 1e-9, "{:?}", robot.pose());
    assert_eq!(advance.estimates[0].frame, "look 4", "one at the start, and one at each end of a straight part");
    let straight = robot.go(&command(2, Pose::from_yaw_pitch(Point3::new(2.0, 1.9, 1.2), 0.0, 0.0))).0;
    assert!(straight.contact && straight.refused.is_some(), "{straight:?}");
}

#[test]
fn odometry_drifts_and_exact_odometry_does_not() {
    let gone = |way: f64, turn: f64| {
        let simulator = Simulator::new(body(), simulator::Settings::default());
        let odometry = DriftingOdometry::new(Drift { way, turn, seed: 3 });
        let mut robot =
            Robot::localised(Localised::new(Box::new(simulator), Estimating::new(odometry, LookSpacing::AT_THE_END)))
                .unwrap();
        let mut worst: f64 = 0.0;
        for id in 1..=20 {
            let back = id % 2 == 0;
            let sent = Pose::from_yaw_pitch(
                Point3::new(if back { 1.0 } else { 2.0 }, 2.0, 1.2),
                if back { 0.0 } else { 1.0 },
                0.0,
            );
            let advance = robot.go(&command(id, sent)).1;
            let truly = advance.estimates[0].recorded.unwrap();
            worst = worst.max((truly.position() - robot.pose().position()).norm());
        }
        worst
    };
    assert!(gone(0.0, 0.0) < 1e-9, "{}", gone(0.0, 0.0));
    let drifted = gone(0.02, 0.02);
    assert!((0.01..0.5).contains(&drifted), "{drifted}");
    assert_eq!(drifted.to_bits(), gone(0.02, 0.02).to_bits());
}

/// To and fro before the cupboard, by an odometry that errs by a tenth of each motion.
#[test]
fn scans_take_out_what_odometry_drifts() {
    let gone = |is_refined: bool| {
        let simulator = Simulator::new(body(), simulator::Settings::default());
        let drift = Drift { way: 0.1, turn: 0.1, seed: 3 };
        let mut estimating = Estimating::new(DriftingOdometry::new(drift), LookSpacing::AT_THE_END);
        if is_refined {
            estimating = estimating.refined(&MapMatchingSettings { voxel: 0.05, drift }).unwrap();
        }
        let mut robot = Robot::localised(Localised::new(Box::new(simulator), estimating)).unwrap();
        let mut worst: f64 = 0.0;
        for id in 1..=20 {
            let to = (id % 3) as f64;
            let sent = Pose::from_yaw_pitch(Point3::new(1.0 + 0.3 * to, 2.0 + 0.2 * to, 1.2), 0.2 * to, -0.1 * to);
            let advance = robot.go(&command(id, sent)).1;
            let truly = advance.estimates[0].recorded.unwrap();
            worst = worst.max((truly.position() - robot.pose().position()).norm());
        }
        worst
    };
    let (drifted, refined) = (gone(false), gone(true));
    assert!(drifted > 0.05 && refined < 0.03, "{refined} m at most, without scans {drifted}");
    assert_eq!(refined.to_bits(), gone(true).to_bits());
}

/// A quarter of a metre from it the wall's points lie 100 columns apart in the two images, of 320.
#[test]
fn before_a_wall_cameras_know_where_they_are() {
    let mut stereo = stereo(20.0);
    let mut odometry = odometry(&stereo);
    let mut worst: f64 = 0.0;
    for look in 0..40 {
        let step = f64::from(look);
        let pose = Pose::from_yaw_pitch(Point3::new(1.0 + 0.03 * step, 3.75, 1.2), std::f64::consts::FRAC_PI_2, 0.0);
        let capture = Capture { scan: look as u64, time_secs: 0.0, pose };
        let pair = stereo.pair(&capture).unwrap();
        let frame = Frame {
            name: String::new(),
            secs: 0.0,
            pose: Ok(pose),
            odometry: None,
            pair,
            points: Vec::new(),
            no_return: Vec::new(),
        };
        match odometry.locate(&frame) {
            Located::At(said, ..) => worst = worst.max((said.position() - pose.position()).norm()),
            other => panic!("look {look}: {other:?}"),
        }
    }
    assert!(worst < 0.02, "{worst} m");
}

/// All around the room, from the images alone, with a turn at each corner.
#[test]
fn cameras_that_look_on_their_way_know_where_they_are() {
    let stereo = stereo(20.0);
    let odometry = odometry(&stereo);
    let spacing = LookSpacing { way_m: 0.1, turn_rad: 10_f64.to_radians() };
    let mut robot = Robot::localised(Localised::new(Box::new(stereo), Estimating::new(odometry, spacing))).unwrap();
    let stops = [(2.0, 2.0, 0.0), (2.0, 2.8, 0.8), (1.2, 2.8, 2.4), (1.0, 2.0, 3.6), (1.0, 1.2, 5.0), (1.5, 1.5, 6.2)];
    for (id, (x, y, yaw)) in (1..).zip(stops) {
        let sent = Pose::from_yaw_pitch(Point3::new(x, y, 1.2), yaw, 0.0);
        let (travel, advance) = robot.go(&command(id, sent));
        assert!(advance.passed_over.is_empty() && travel.refused.is_none(), "{advance:?}");
        let estimate = &advance.estimates[0];
        let off = estimate.recorded.unwrap().0.inverse() * robot.pose().0;
        assert!(off.translation.vector.norm() < 0.03 && off.rotation.angle() < 0.02, "{id}: {off}");
        assert!((robot.pose().position() - sent.position()).norm() < 0.02, "it comes near to where it is sent");
        assert_eq!((estimate.scan, estimate.covariance.len()), (id, 36));
        assert!(robot.scan(0.0).unwrap().points.len() > 10_000);
    }
    // A scan that is taken again is the same: its images are those of the last look.
    assert_eq!(robot.scan(0.0).unwrap().points, robot.scan(1.0).unwrap().points);
}

/// Lost beyond a place along x (m).
struct Dark {
    within: f64,
}

impl PoseEstimator for Dark {
    fn locate(&mut self, frame: &Frame) -> Located {
        let pose = frame.pose.clone().unwrap();
        match pose.position().x <= self.within {
            true => Located::At(pose, vec![], 1.0),
            false => Located::Lost("it is dark".into()),
        }
    }
}

#[test]
fn one_that_is_lost_goes_back_and_takes_smaller_steps_and_one_that_stays_lost_says_so() {
    let spacing = LookSpacing { way_m: 0.1, turn_rad: 1.0 };
    let robot = |within: f64| {
        let simulator = Simulator::new(body(), simulator::Settings::default());
        Robot::localised(Localised::new(Box::new(simulator), Estimating::new(Dark { within }, spacing))).unwrap()
    };
    let sent = Pose::from_yaw_pitch(Point3::new(2.0, 2.0, 1.2), 0.0, 0.0);
    let mut lost = robot(1.36);
    let (travel, advance) = lost.go(&command(1, sent));
    assert!((lost.pose().position().x - 1.35).abs() < 1e-9 && travel.refused.is_none(), "{:?}", lost.pose());
    assert_eq!(
        advance.passed_over.len(),
        4,
        "at 1.4 m, there again from half of the step, at 1.375 and at 1.3625: {advance:?}"
    );
    assert!(advance.passed_over[0].to_string().starts_with("look 5: lost, so that the robot goes back: it is dark"));
    assert!(lost.scan(0.0).is_ok(), "it scans where it is");
    // Lost at the place that it was sent from as well, it goes farther back, by the way of the command before.
    let mut twice = robot(1.36);
    twice.go(&command(1, Pose::from_yaw_pitch(Point3::new(1.3, 2.0, 1.2), 0.0, 0.0)));
    let (_, advance) = twice.go(&command(2, sent));
    assert!((twice.pose().position().x - 1.35).abs() < 1e-9 && twice.scan(0.0).is_ok(), "{advance:?}");
    // It is dark everywhere.
    let mut never = robot(0.0);
    never.go(&command(1, sent));
    let said = never.scan(0.0).unwrap_err().to_string();
    assert!(
        said.contains("the robot has gone back the way that it came, up to 256 looks, and does not know"),
        "{said}"
    );
}

/// Without a texture there is nothing to go by.
#[test]
fn before_blank_walls_nobody_knows_where_it_is() {
    let stereo = stereo(0.0);
    let odometry = odometry(&stereo);
    let spacing = LookSpacing { way_m: 0.5, turn_rad: 1.0 };
    let mut robot = Robot::localised(Localised::new(Box::new(stereo), Estimating::new(odometry, spacing))).unwrap();
    let (_, advance) = robot.go(&command(1, Pose::from_yaw_pitch(Point3::new(1.5, 2.0, 1.2), 0.0, 0.0)));
    assert!(advance.passed_over[0].why.contains("corners are seen by both cameras"), "{advance:?}");
    assert!(robot.scan(0.0).is_err());
}
