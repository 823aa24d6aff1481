//! A type that elk has never seen, on its way through all of elk's tools: shown, written by hand, recorded, exported,
//! replayed.

mod common;

use std::process::{Command, Stdio};

use common::lab::{Lab, hear, wait_for_reader};
use common::{Elk, kill};
use elk_bus::{Client, Key, payload};
use elk_geometry::pose::Pose;
use elk_spatial::Points;
use nalgebra::{Point3, Vector3};
use rustix::process::Signal;
use serde_json::{Value, json};

/// How the car is steered.
#[payload]
#[derive(Debug, Clone, PartialEq)]
pub struct Steering {
    /// Anticlockwise.
    #[describe(unit = "rad", range = -4.0..=4.0)]
    pub angle: f64,
    /// Where each wheel points.
    pub wheels: Vec<Wheel>,
    /// Who steers.
    pub who: Driver,
}

/// A wheel.
#[payload]
#[derive(Debug, Clone, PartialEq)]
pub struct Wheel {
    /// Whether it is driven.
    pub driven: bool,
    /// How fast it turns.
    #[describe(unit = "1/s")]
    pub speed: f32,
}

/// Whoever steers.
#[payload]
#[derive(Debug, Clone, PartialEq)]
pub enum Driver {
    /// Nobody.
    Nobody,
    /// Somebody, by name.
    Person(String),
}

/// What a laser saw.
#[payload]
#[describe(drawn = "points")]
#[derive(Debug, Clone, PartialEq)]
pub struct Sweep<'a> {
    /// Where the laser is.
    pub pose: Pose,
    /// Points in its frame.
    #[serde(borrow)]
    #[describe(unit = "m")]
    pub points: Points<'a>,
}

const STEERING: Key<Steering> = Key::new("STEERING");
const SWEEP: Key<Sweep<'static>> = Key::new("SWEEP");

fn steering(angle: f64) -> Steering {
    let wheel = |speed| Wheel { driven: speed > 1.0, speed };
    Steering { angle, wheels: vec![wheel(0.5), wheel(1.5)], who: Driver::Person("Ann".into()) }
}

/// A community, and the commands that look into it.
struct Visit {
    _lab: Lab,
    elk: Elk,
}

impl Visit {
    fn new(test: &str) -> Self {
        let elk = Elk::new(test);
        Self { _lab: Lab::deaf(&elk), elk }
    }

    /// A command of this community.
    fn command(&self, arguments: &[&str]) -> Command {
        let mut command = self.elk.command(arguments);
        command.env(elk_bus::launched::COMMUNITY, self.elk.community());
        command
    }

    /// What a command says, and whether it succeeded.
    fn run(&self, arguments: &[&str]) -> (bool, String) {
        let output = self.command(arguments).output().unwrap();
        let said = [output.stdout, output.stderr].concat();
        (output.status.success(), String::from_utf8(said).unwrap())
    }

    fn said(&self, arguments: &[&str]) -> String {
        let (done, said) = self.run(arguments);
        assert!(done, "{arguments:?}: {said}");
        said
    }

    fn json(&self, arguments: &[&str]) -> Value {
        serde_json::from_str(&self.said(arguments)).unwrap()
    }

    /// A client that has said how it steers, and what a laser saw.
    fn car(&self) -> Client {
        let mut car = self.elk.join("car");
        self.drive(&mut car, 0.25);
        car
    }

    fn drive(&self, car: &mut Client, angle: f64) {
        car.comms.publish(&STEERING, &steering(angle)).unwrap();
        let pose = Pose::looking(Point3::new(1.0, 2.0, 3.0), Vector3::x());
        let points = (0..2000).map(|i| Point3::new(i as f32, 0.5, -1.0)).collect();
        car.comms.publish(&SWEEP, &Sweep { pose, points }).unwrap();
        car.comms.flush().unwrap();
    }
}

fn as_json(angle: f64) -> Value {
    let wheels = json!([{"driven": false, "speed": 0.5}, {"driven": true, "speed": 1.5}]);
    json!({"angle": angle, "wheels": wheels, "who": {"Person": "Ann"}})
}

#[test]
fn whoever_looks_in_sees_a_strangers_values_field_by_field() {
    let visit = Visit::new("look-in");
    let said = |arguments: &[&str]| visit.said(arguments);
    let _car = visit.car();
    let info = said(&["info", "STEERING"]);
    for line in [
        "carries     Steering (layout",
        "angle: f64, rad, -4 to 4     Anticlockwise.",
        "  speed: f32, 1/s              How fast it turns.",
        "  Person(text)                 Somebody, by name.",
        "latest      angle: 0.25, wheels: [{driven: false, speed: 0.5}, {driven: true, speed: 1.5}], who: {Person: Ann}",
    ] {
        assert!(info.contains(line), "{line:?} is not in:\n{info}");
    }
    let echoed: Value =
        serde_json::from_str(&said(&["echo", "STEERING", "--latest", "--count", "1", "--json"])).unwrap();
    assert_eq!(echoed["value"], as_json(0.25));
    assert!(said(&["list"]).contains("angle: 0.25"));
}

#[test]
fn a_person_writes_a_strangers_variable_and_is_told_what_is_right() {
    let visit = Visit::new("by-hand");
    let poke = |value: &str| visit.run(&["poke", "STEERING", value]);
    // Nobody has written it; a reader says what it reads.
    let mut reader = visit.elk.join("reader");
    reader.comms.register(&STEERING).unwrap();
    reader.comms.flush().unwrap();
    let (done, said) = poke(r#"{"angle": 1, "wheels": [{"driven": true, "speed": "fast"}], "who": "Nobody"}"#);
    assert!(!done, "{said}");
    assert!(said.contains(r#"wheels[0].speed is "fast"; it has to be a number"#), "{said}");
    assert!(said.contains(r#"its form is {"angle":0.0,"wheels":[],"who":"Nobody"}"#), "{said}");
    let (done, said) = poke(r#"{"angle": 1, "wheels": [], "who": {"Person": "Bob"}}"#);
    assert!(done && said.contains("heard by reader"), "{said}");
    let heard = hear(&mut reader, "what was poked", |mail| mail.decode(&STEERING).ok());
    assert_eq!(heard, Steering { angle: 1.0, wheels: vec![], who: Driver::Person("Bob".into()) });
}

#[test]
fn a_strangers_values_are_recorded_exported_and_replayed_to_the_bit() {
    let visit = Visit::new("recorded");
    let mut car = visit.elk.join("car");
    let log = visit.elk.folder().join("drive.mcap");
    let log = log.to_str().unwrap();
    let mut recorder = visit.command(&["log", "record", "-o", log]);
    let mut recorder = recorder.stdout(Stdio::null()).stderr(Stdio::null()).spawn().unwrap();
    wait_for_reader(&mut visit.elk.join("witness"), |name| name.contains("record"));
    for angle in [0.25, 0.1 + 0.2, -3.75] {
        visit.drive(&mut car, angle);
    }
    car.comms.notify("DONE", 1.0).unwrap();
    car.comms.flush().unwrap();
    // The last word is in the recorder's hands once the broker has answered a question that came after it.
    common::lab::table(&mut car);
    kill(recorder.id() as i32, Signal::INT);
    assert!(recorder.wait().unwrap().success());

    let cat = visit.said(&["log", "cat", log, "--keys", "STEERING", "--json"]);
    let values: Vec<Value> =
        cat.lines().map(|line| serde_json::from_str::<Value>(line).unwrap()["value"].clone()).collect();
    assert_eq!(values, [0.25, 0.1 + 0.2, -3.75].map(as_json));
    let csv = visit.said(&["log", "export", log, "--to", "csv", "-o", "-"]);
    for field in [
        "STEERING.angle,car,0.30000000000000004",
        "STEERING.wheels[1].speed,car,1.5",
        "STEERING.wheels[0].driven,car,0",
    ] {
        assert!(csv.contains(field), "{field} is not in:\n{csv}");
    }
    // A viewer draws the sweep, and plots the steering.
    let info = visit.json(&["log", "info", log, "--json"]);
    let topics = info["topics"].as_array().unwrap();
    let schema = |name: &str| topics.iter().find(|topic| topic["name"] == name).map(|topic| topic["schema"].clone());
    assert_eq!(schema("SWEEP"), Some(json!("foxglove.PointCloud")), "{info}");
    assert_eq!(schema("STEERING"), Some(json!("Steering")), "{info}");

    // Replayed into another community, its readers hear the very bytes, and strangers to the type read them.
    let other = Visit::new("replayed");
    let mut reader = other.elk.join("reader");
    reader.comms.register(&STEERING).unwrap();
    reader.comms.register(&SWEEP).unwrap();
    reader.comms.flush().unwrap();
    let replay = ["replay", log, "--rate", "max"];
    assert!(other.run(&replay).0);
    let (mut angles, mut sweeps) = (Vec::new(), 0);
    hear(&mut reader, "all of it", |mail| {
        if mail.is(&SWEEP) {
            let sweep = mail.decode(&SWEEP).unwrap();
            assert_eq!((sweep.points.len(), sweep.pose.position()), (2000, Point3::new(1.0, 2.0, 3.0)));
            sweeps += 1;
        } else if mail.is(&STEERING) {
            angles.push(mail.decode(&STEERING).unwrap());
        }
        (sweeps == 3 && angles.len() == 3).then_some(())
    });
    assert_eq!(angles, [0.25, 0.1 + 0.2, -3.75].map(steering));
    let echo = other.json(&["echo", "STEERING", "--latest", "--count", "1", "--json"]);
    assert_eq!(echo["value"], as_json(-3.75));
}
