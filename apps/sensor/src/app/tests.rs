use std::time::Duration;

use elk_bus::memory::MemoryBroker;
use elk_bus::{BrokerConfig, Client, Clock, Community, any};
use elk_geometry::{State, Voxel};
use elk_spatial::keys::SCAN;
use elk_spatial::playback::Playback;

use super::*;
use crate::simulator::{Settings, Simulator};
use crate::surroundings::Body;
use elk_world::{CAR_INTERIOR, Placement, World};
use nalgebra::Point3;

fn app() -> Handled<SensorApp> {
    let world = World::load(CAR_INTERIOR, &Placement::default()).unwrap();
    let start = Pose::from_yaw_pitch(Point3::new(0.0, 0.0, 0.8), 0.0, 0.0);
    let simulator = Simulator::new(Body::new(world, start, 0.05), Settings::default());
    SensorApp::new(Robot::new(Box::new(simulator)).unwrap(), (SCAN, camera_pose("SIM_SENSOR"))).on_the_bus()
}

fn join(broker: &MemoryBroker, name: &str) -> Client {
    let community = Community::new("sensor-test").unwrap();
    Client::over(broker.connect(name).unwrap(), name, &community)
}

/// Hands the app what has come for it, on the spot.
fn serve(app: &mut Handled<SensorApp>, client: &mut Client) {
    let (comms, inbox) = (&mut client.comms, &mut client.inbox);
    while inbox.receive(comms, Duration::ZERO, |comms, mail| app.on_new_mail(comms, mail)).unwrap() > 0 {}
    comms.flush().unwrap();
}

/// As [`serve`], until nothing comes any more; the number of rejections.
fn rejections(app: &mut Handled<SensorApp>, client: &mut Client) -> usize {
    let (comms, inbox) = (&mut client.comms, &mut client.inbox);
    let mut count = 0;
    let mut give = |comms: &mut Comms, mail: &Mail<'_>| match app.on_new_mail(comms, mail) {
        Err(failure) if failure.is::<Rejection>() || failure.is::<elk_bus::codec::DecodeError>() => {
            count += 1;
            Ok::<(), AppError>(())
        }
        done => done,
    };
    while inbox.receive(comms, Duration::ZERO, &mut give).unwrap() > 0 {
        comms.flush().unwrap();
    }
    count
}

/// Regression: whoever said once that a recording was elsewhere stopped who plays it, for good.
#[test]
fn who_says_that_the_recording_is_elsewhere_is_answered_where_it_is() {
    let broker = MemoryBroker::new(BrokerConfig::new("sensor-test"), Clock::new(1.0));
    let (mut sensor, mut probe) = (join(&broker, "Recorded"), join(&broker, "probe"));
    let robot = Robot::carried(crate::recording::mostly(1, 100, 0.0));
    let mut app = SensorApp::new(robot, (SCAN, camera_pose("SIM_SENSOR"))).on_the_bus();
    app.on_start_up(&mut sensor.comms).unwrap();
    probe.comms.register(PLAYBACK.subscription().from("Recorded")).unwrap();
    let command = |id| PoseCommand { id, via: Vec::new(), pose: Pose(Isometry3::identity()) };
    for id in 1..=3 {
        probe.comms.publish(&POSE_COMMAND, &command(id)).unwrap();
    }
    probe.comms.flush().unwrap();
    assert_eq!(rejections(&mut app, &mut sensor), 0);
    let truth = app.state.robot.playback().unwrap();
    assert_eq!((truth.command, truth.scans), (3, 3));
    let mut last = || {
        let mut last = None;
        probe.receive(Duration::ZERO, |mail| last = mail.decode(&PLAYBACK).ok().or(last.take())).unwrap();
        last
    };
    assert_eq!(last().as_ref(), Some(&truth));
    let mut liar = join(&broker, "liar");
    for lie in [
        Playback { command: 1 << 40, ..truth.clone() },
        Playback { command: 1, ..truth.clone() },
        Playback { scans: 1 << 40, ..truth.clone() },
        Playback { next_secs: Some(1e9), ..truth.clone() },
    ] {
        liar.comms.publish(&PLAYBACK, &lie).unwrap();
        liar.comms.flush().unwrap();
        assert_eq!(rejections(&mut app, &mut sensor), 1, "{lie:?}");
        assert_eq!(last().as_ref(), Some(&truth), "{lie:?}");
    }
    // What is true may be said by anybody; commands of elsewhere are answered as well.
    liar.comms.publish(&PLAYBACK, &truth).unwrap();
    liar.comms.flush().unwrap();
    assert_eq!((rejections(&mut app, &mut sensor), last()), (0, None));
    for (id, rejected) in [(1, 0), (1 << 40, 1)] {
        liar.comms.publish(&POSE_COMMAND, &command(id)).unwrap();
        liar.comms.flush().unwrap();
        assert_eq!((rejections(&mut app, &mut sensor), last().as_ref()), (rejected, Some(&truth)));
    }
}

/// What the probe has been sent, as key and the command, scan or revision that it carries.
fn heard(probe: &mut Client) -> Vec<(String, u64)> {
    let mut heard = Vec::new();
    probe
        .receive(Duration::ZERO, |mail| {
            let number = match mail.key() {
                "SIM_SENSOR" => mail.decode(&camera_pose("SIM_SENSOR")).unwrap().command,
                "SCAN" => mail.decode(&SCAN).unwrap().command,
                "SENSOR_REPORT" => mail.decode(&SENSOR_REPORT).unwrap().contacts.unwrap(),
                _ => mail.decode(&ACCURACY_REPORT).unwrap().voxels,
            };
            heard.push((mail.key().to_owned(), number));
        })
        .unwrap();
    heard
}

#[test]
fn a_command_is_answered_by_pose_scan_and_report_once_and_a_map_by_its_accuracy() {
    let broker = MemoryBroker::new(BrokerConfig::new("sensor-test"), Clock::new(1.0));
    let (mut app, mut sensor, mut probe) = (app(), join(&broker, "Simulator"), join(&broker, "probe"));
    probe.comms.register(any("*").from("Simulator")).unwrap();
    probe.comms.flush().unwrap();
    app.on_start_up(&mut sensor.comms).unwrap();
    serve(&mut app, &mut sensor);
    assert_eq!(heard(&mut probe), [("SIM_SENSOR".to_owned(), 0)]);

    let pose = Pose::from_yaw_pitch(Point3::new(0.4, 0.0, 0.8), 1.0, 0.0);
    let command = PoseCommand { id: 1, via: Vec::new(), pose };
    for _ in 0..2 {
        probe.comms.publish(&POSE_COMMAND, &command).unwrap();
    }
    probe.comms.flush().unwrap();
    serve(&mut app, &mut sensor);
    let expected = [("SIM_SENSOR", 1), ("SENSOR_REPORT", 0), ("SCAN", 1)];
    assert_eq!(heard(&mut probe), expected.map(|(key, n)| (key.to_owned(), n)));
    assert_eq!(app.state.robot.pose(), pose);

    let mut map = OccupancyGrid::new(0.1);
    map.set(Voxel::new(0, 0, 8), State::Free);
    // Somebody asks for the map on the way: a robot has no time to evaluate it.
    let part = MapPart::of(&map, 1, 0, 8);
    probe.comms.publish(&MAP_PART, &part).unwrap();
    probe.comms.publish(&MAP, &MapUpdate::new(map.whole(), 1)).unwrap();
    probe.comms.flush().unwrap();
    serve(&mut app, &mut sensor);
    assert_eq!(heard(&mut probe), []);
    probe
        .comms
        .publish(&MOTION_REPORT, &MotionReport { scans: 1, path_length_m: 0.4, free: 1, marks: Vec::new() })
        .unwrap();
    probe.comms.publish(&MAP_PART, &part).unwrap();
    probe.comms.publish(&MAP, &MapUpdate::new(map.whole(), 1)).unwrap();
    probe.comms.flush().unwrap();
    serve(&mut app, &mut sensor);
    // The second one is of the same revision: it is said again, not evaluated again.
    assert_eq!(heard(&mut probe), [("ACCURACY_REPORT".to_owned(), 1), ("ACCURACY_REPORT".to_owned(), 1)]);
}
#[test]
fn a_successor_goes_on_from_where_the_other_one_stood_and_takes_the_scan_that_is_missing() {
    let broker = MemoryBroker::new(BrokerConfig::new("sensor-test"), Clock::new(1.0));
    let mut probe = join(&broker, "probe");
    let pose = Pose::from_yaw_pitch(Point3::new(0.4, 0.0, 0.8), 1.0, 0.0);
    let mut other = app();
    other.state.robot.go(&PoseCommand { id: 1, via: Vec::new(), pose });
    let scan = other.state.robot.scan(0.0).unwrap();
    let report = SensorReport { contacts: Some(2), ..other.state.report() };
    probe.comms.publish(&other.state.camera_pose, &CameraPose { command: 1, pose }).unwrap();
    probe.comms.publish(&SENSOR_REPORT, &report).unwrap();
    probe.comms.register(any("*").from("Simulator")).unwrap();
    probe.comms.flush().unwrap();
    for published in [vec![("SCAN".to_owned(), 1)], vec![]] {
        let (mut successor, mut sensor) = (app(), join(&broker, "Simulator"));
        successor.on_start_up(&mut sensor.comms).unwrap();
        serve(&mut successor, &mut sensor);
        assert_eq!(heard(&mut probe), published);
        assert_eq!(successor.state.robot.scan(0.0).unwrap(), scan);
        assert_eq!((successor.state.robot.pose(), successor.state.report()), (pose, report.clone()));
    }
}

/// Regression: it stayed at the start, refused what did not begin there, and the mission stood still.
#[test]
fn a_successor_that_nothing_was_left_for_goes_where_the_controller_sends_it() {
    let broker = MemoryBroker::new(BrokerConfig::new("sensor-test"), Clock::new(1.0));
    let (mut app, mut sensor, mut probe) = (app(), join(&broker, "Simulator"), join(&broker, "probe"));
    let there = Point3::new(0.4, 0.0, 0.8);
    let pose = Pose::from_yaw_pitch(Point3::new(0.6, 0.2, 0.8), 1.0, 0.0);
    probe.comms.register(any("*").from("Simulator")).unwrap();
    probe.comms.publish(&POSE_COMMAND, &PoseCommand { id: 7, via: vec![there], pose }).unwrap();
    probe.comms.flush().unwrap();
    app.on_start_up(&mut sensor.comms).unwrap();
    serve(&mut app, &mut sensor);
    let expected = [("SIM_SENSOR", 0), ("SIM_SENSOR", 7), ("SENSOR_REPORT", 0), ("SCAN", 7)];
    assert_eq!(heard(&mut probe), expected.map(|(key, n)| (key.to_owned(), n)));
    assert_eq!((app.state.robot.pose(), app.state.robot.scans()), (pose, 7), "scans are counted on");
}

/// Regression: it ended, and so did each that came after it.
#[test]
fn a_successor_in_another_world_begins_at_its_own_start() {
    let (mut app, start) = (app(), Point3::new(0.0, 0.0, 0.8));
    let broker = MemoryBroker::new(BrokerConfig::new("sensor-test"), Clock::new(1.0));
    let (mut sensor, mut probe) = (join(&broker, "Simulator"), join(&broker, "probe"));
    let pose = Pose::from_yaw_pitch(Point3::new(0.0, 0.0, 99.0), 0.0, 0.0);
    probe.comms.publish(&camera_pose("SIM_SENSOR"), &CameraPose { command: 3, pose }).unwrap();
    probe.comms.register(any("*").from("Simulator")).unwrap();
    probe.comms.flush().unwrap();
    app.on_start_up(&mut sensor.comms).unwrap();
    serve(&mut app, &mut sensor);
    assert_eq!(heard(&mut probe), [("SIM_SENSOR".to_owned(), 0)]);
    assert_eq!(app.state.robot.pose().position(), start);
}

#[test]
fn a_command_of_a_foreign_number_is_refused_and_the_next_one_carried_out() {
    let (mut app, broker) = (app(), MemoryBroker::new(BrokerConfig::new("sensor-test"), Clock::new(1.0)));
    let mut sensor = join(&broker, "Simulator");
    let pose = Pose::from_yaw_pitch(Point3::new(0.4, 0.0, 0.8), 1.0, 0.0);
    let command = |id| PoseCommand { id, via: Vec::new(), pose };
    app.state.on_command(&mut sensor.comms, command(1)).unwrap();
    for foreign in [3, 1000, 1 << 47] {
        let failure = app.state.on_command(&mut sensor.comms, command(foreign)).unwrap_err();
        assert!(failure.is::<Rejection>(), "{failure}");
    }
    app.state.on_command(&mut sensor.comms, command(2)).unwrap();
    assert_eq!((app.state.robot.command(), app.state.robot.scans()), (2, 2));
    // Of a predecessor's last commands the word may be lost.
    app.state.inherited = true;
    app.state.on_command(&mut sensor.comms, command(4)).unwrap();
    assert!(app.state.on_command(&mut sensor.comms, command(6)).is_err());
}

/// Regression: it was scanned, and counted as a contact.
#[test]
fn a_pose_that_is_no_number_is_no_motion() {
    let broker = MemoryBroker::new(BrokerConfig::new("sensor-test"), Clock::new(1.0));
    let (mut app, mut sensor, mut probe) = (app(), join(&broker, "Simulator"), join(&broker, "probe"));
    app.on_start_up(&mut sensor.comms).unwrap();
    serve(&mut app, &mut sensor);
    let (here, nowhere) = (app.state.robot.pose(), Point3::new(f64::NAN, 0.0, 0.8));
    let lost = Pose::from_yaw_pitch(nowhere, 0.0, 0.0);
    for (via, pose) in [(vec![], lost), (vec![nowhere], here)] {
        probe.comms.publish(&POSE_COMMAND, &PoseCommand { id: 1, via, pose }).unwrap();
        probe.comms.flush().unwrap();
        assert_eq!(rejections(&mut app, &mut sensor), 1);
    }
    assert_eq!((app.state.robot.scans(), app.state.robot.contacts(), app.state.robot.pose()), (0, Some(0), here));
}

/// Regression: nobody contradicted a pose that somebody made up, and the controller stood there for ever.
#[test]
fn a_pose_that_is_not_the_sensors_own_is_answered_by_the_true_one() {
    let broker = MemoryBroker::new(BrokerConfig::new("sensor-test"), Clock::new(1.0));
    let (mut app, mut sensor, mut probe) = (app(), join(&broker, "Simulator"), join(&broker, "probe"));
    let pose = Pose::from_yaw_pitch(Point3::new(0.4, 0.0, 0.8), 1.0, 0.0);
    let memory = CameraPose { command: 3, pose };
    probe.comms.publish(&app.state.camera_pose, &memory).unwrap();
    probe.comms.register(any("*").from("Simulator")).unwrap();
    probe.comms.flush().unwrap();
    app.on_start_up(&mut sensor.comms).unwrap();
    assert_eq!(rejections(&mut app, &mut sensor), 0, "what was left is memory");
    assert_eq!((app.state.place(), heard(&mut probe)), (memory.clone(), vec![]));
    let elsewhere = Pose::from_yaw_pitch(Point3::new(0.6, 0.2, 0.8), 1.0, 0.0);
    let lies = [CameraPose { command: 3, pose: elsewhere }, CameraPose { command: 4, pose }];
    for (said, rejected) in [(&memory, 0), (&lies[0], 1), (&lies[1], 1)] {
        probe.comms.publish(&app.state.camera_pose, said).unwrap();
        probe.comms.flush().unwrap();
        assert_eq!(rejections(&mut app, &mut sensor), rejected);
        assert_eq!(heard(&mut probe), vec![("SIM_SENSOR".to_owned(), 3); rejected]);
    }
}

#[test]
fn whoever_counts_fewer_commands_is_told_how_many_there_were() {
    let broker = MemoryBroker::new(BrokerConfig::new("sensor-test"), Clock::new(1.0));
    let (mut app, mut sensor, mut probe) = (app(), join(&broker, "Simulator"), join(&broker, "probe"));
    let pose = Pose::from_yaw_pitch(Point3::new(0.4, 0.0, 0.8), 1.0, 0.0);
    let command = |id| PoseCommand { id, via: Vec::new(), pose };
    app.state.on_command(&mut sensor.comms, command(1)).unwrap();
    app.state.on_command(&mut sensor.comms, command(2)).unwrap();
    sensor.comms.flush().unwrap();
    probe.comms.register(any("SIM_SENSOR").from("Simulator")).unwrap();
    probe.comms.flush().unwrap();
    assert_eq!(heard(&mut probe), [("SIM_SENSOR".to_owned(), 2)]);
    app.state.on_command(&mut sensor.comms, command(1)).unwrap();
    sensor.comms.flush().unwrap();
    assert_eq!(heard(&mut probe), [("SIM_SENSOR".to_owned(), 2)]);
}

/// A report that speaks of far more scans than there were commands is of another run, or made up.
#[test]
fn a_report_that_the_pose_contradicts_is_not_believed() {
    let (mut app, broker) = (self::app(), MemoryBroker::new(BrokerConfig::new("sensor-test"), Clock::new(1.0)));
    let pose = Pose::from_yaw_pitch(Point3::new(0.4, 0.0, 0.8), 1.0, 0.0);
    let report = Some(SensorReport { scans: 1 << 47, contacts: Some(9), scan: 1 << 47, cpu_secs: 0.0 });
    app.state.past = Some(Past { pose: Some(CameraPose { command: 5, pose }), report, scan: 5 });
    app.state.begin(&mut join(&broker, "Simulator").comms).unwrap();
    assert_eq!((app.state.robot.scans(), app.state.robot.contacts()), (5, Some(0)));
    // Nor is a pose after commands of which nobody has seen a scan.
    let mut app = self::app();
    app.state.past = Some(Past { pose: Some(CameraPose { command: 1 << 47, pose }), ..Past::default() });
    app.state.begin(&mut join(&broker, "Another").comms).unwrap();
    assert_eq!((app.state.robot.command(), app.state.robot.scans()), (0, 0));
}
