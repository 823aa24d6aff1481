//! A client of the same user that writes whatever it likes to every variable that elk's apps hear: no app is lost, none
//! hangs, and what is rejected is named with its writer and its field.
//!
//! `ELK_HOSTILE_ROUNDS=100 cargo test --release --test hostile -- --nocapture` goes on for longer.

mod common;

use std::collections::{BTreeMap, BTreeSet};
use std::time::Duration;

use common::car::car;
use common::events::WATCHDOG;
use common::spoilt::spoilt;
use common::{Elk, Launcher};
use elk_bus::clock::Stopwatch;
use elk_bus::comms::CommsError;
use elk_bus::{Client, Mail, Origin, TypeRef, Value, ValueRef};
use elk_geometry::{Pose, Voxel};
use elk_spatial::keys::{PLAN, PLAN_REQUEST, POSE_COMMAND};
use elk_spatial::messages::{Decision, MotionPolicy, Path, Plan};
use elk_spatial::samples::{Sample, named};
use nalgebra::Point3;

const APPS: [&str; 5] = ["Sensor", "Filter", "Map", "Explorer", "Controller"];

/// Memory that each process may have for itself (kB).
const MEMORY_KB: u64 = 1 << 20;

/// What elk's apps hear, with the type that they read there; `None`: a number or a text.
const HEARD: &[(&str, Option<&str>)] = &[
    ("POSE_COMMAND", Some("PoseCommand")),
    ("SIM_SENSOR", Some("CameraPose")),
    ("SENSOR_REPORT", Some("SensorReport")),
    ("PLAYBACK", Some("Playback")),
    ("ACCURACY_REPORT", Some("AccuracyReport")),
    ("SCAN", Some("Scan")),
    ("SCAN_1", Some("Scan")),
    ("MAP_UPDATE", Some("MapUpdate")),
    ("MAP_PART", Some("MapPart")),
    ("MAP", Some("MapUpdate")),
    ("MAP_UNSURE", Some("MapUpdate")),
    ("MAP_KNOWN", Some("MapStatus")),
    ("MAP_MEMORY", Some("MapMemory")),
    ("PLAN_REQUEST", Some("PlanRequest")),
    ("PLAN", Some("Plan")),
    ("PROGRESS", Some("Progress")),
    ("MOTION_REPORT", Some("MotionReport")),
    ("TRAVEL_REPORT", Some("TravelReport")),
    ("MOTION_MEMORY", Some("MotionMemory")),
    ("EXPLORATION_REPORT", Some("ExplorationReport")),
    ("EXPLORER_MEMORY", Some("ExplorerMemory")),
    ("EXPLORER_PAST", Some("ExplorerPast")),
    ("MAP_CONFIDENCE", None),
    ("MAP_REQUEST", None),
    ("MAP_RECALL", None),
    ("MOTION", None),
    ("STEP", None),
    ("LAUNCH_STATE", None),
    ("LOGGER_ERROR", None),
    ("MAIL_REJECTED", None),
    ("MAP_STATUS", None),
];

/// The car, with all that an explorer may hear of a map.
fn mission() -> String {
    let text = car("manual");
    let inspecting =
        text.replace("<Explorer type=\"Potential\">", "<Explorer type=\"Potential\"><Confidence> 0.9 </Confidence>");
    assert_ne!(text, inspecting);
    inspecting
}

/// A mission whose processes may have so much memory, and somebody in its community who wishes it ill.
struct Attack {
    elk: Elk,
    launcher: Launcher,
    hostile: Client,
    /// What the apps have said of messages that they rejected.
    said: Vec<String>,
}

impl Attack {
    fn begin(test: &str, mission: &str) -> Self {
        let elk = Elk::new(test);
        let launcher = elk.launch_limited(mission, &format!("ulimit -d {MEMORY_KB}"));
        let hostile = elk.join("hostile");
        let mut attack = Self { elk, launcher, hostile, said: Vec::new() };
        attack.hostile.comms.register("MAIL_REJECTED").unwrap();
        attack.hostile.comms.register("*_STATUS").unwrap();
        attack.hostile.comms.register(&PLAN_REQUEST).unwrap();
        attack.hostile.comms.register(&POSE_COMMAND).unwrap();
        attack.nobody_is_lost("before it begins");
        attack
    }

    fn write(&mut self, key: &str, value: ValueRef<'_>) {
        self.hostile.comms.publish_value(key, value, Origin::default()).unwrap();
    }

    fn write_typed(&mut self, key: &str, sample: &Sample, bytes: &[u8]) {
        self.write(key, ValueRef::Binary { type_: sample.type_, bytes });
    }

    /// Hears what there is to hear of a mission that goes on.
    fn listen(&mut self, patience: Duration, on_mail: impl FnMut(&Mail<'_>)) {
        let heard = self.try_listen(patience, on_mail);
        heard.unwrap_or_else(|error| panic!("{error}:\n{}", self.launcher.said()));
    }

    /// Hears what there is to hear.
    ///
    /// # Errors
    /// The broker is gone, as it is when the mission is over.
    fn try_listen(&mut self, patience: Duration, mut on_mail: impl FnMut(&Mail<'_>)) -> Result<(), CommsError> {
        let said = &mut self.said;
        let note = |mail: &Mail<'_>| {
            if mail.key() == "MAIL_REJECTED" && mail.source() != "hostile" {
                said.extend(mail.as_text().map(str::to_owned));
            }
            on_mail(mail);
        };
        self.hostile.receive(patience, note).map(drop)
    }

    /// Every app goes on and handles its mail: it says so after this.
    fn nobody_is_lost(&mut self, when: &str) {
        self.hostile.comms.flush().unwrap();
        let mut silent: BTreeMap<String, Option<f64>> =
            APPS.iter().map(|app| (format!("{}_STATUS", app.to_uppercase()), None)).collect();
        let waited = Stopwatch::start();
        // Two words of each: the first may have been on its way.
        while !silent.is_empty() {
            assert!(!self.launcher.is_over(), "{when}: the mission ended:\n{}", self.launcher.said());
            assert!(waited.elapsed() < WATCHDOG, "{when}: {silent:?} say nothing:\n{}", self.launcher.said());
            self.listen(Duration::from_millis(100), |mail| {
                let Some(first) = silent.get_mut(mail.key()) else { return };
                let uptime = mail.as_text().and_then(uptime);
                match (*first, uptime.filter(|_| mail.source() != "hostile")) {
                    (None, Some(uptime)) => *first = Some(uptime),
                    (Some(first), Some(uptime)) if uptime > first => drop(silent.remove(mail.key())),
                    _ => {}
                }
            });
        }
        for app in APPS {
            assert_eq!(self.elk.row(app)["restarts"], 0, "{when}: {app} was lost");
        }
    }

    fn end(self) {
        let Self { elk, launcher, hostile, said } = self;
        drop(hostile);
        println!("{} rejections were said in full", said.len());
        common::kill(launcher.id(), rustix::process::Signal::TERM);
        let (_, words) = launcher.end();
        assert!(!words.contains("was killed"), "{words}");
        assert_eq!(common::processes_of(&elk), [0; 0]);
        assert_eq!(common::shared_memory_of(&elk), [""; 0]);
    }
}

fn uptime(status: &str) -> Option<f64> {
    status.split(',').find_map(|part| part.strip_prefix("Uptime="))?.parse().ok()
}

fn bad_values(sample: &Sample) -> Vec<Vec<u8>> {
    spoilt(sample).chain(junk()).collect()
}

/// The same numbers every time.
fn noise(seed: u64) -> impl Iterator<Item = u8> {
    let mut state = seed.wrapping_mul(0x9e37_79b9_7f4a_7c15) | 1;
    std::iter::repeat_with(move || {
        state ^= state << 13;
        state ^= state >> 7;
        state ^= state << 17;
        (state >> 24) as u8
    })
}

/// Bytes that are no value of any type, of many lengths; and lists that claim to be long.
fn junk() -> impl Iterator<Item = Vec<u8>> {
    let random = [0, 1, 7, 8, 48, 100, 1000, 100_000].into_iter();
    let random = random.map(|len| noise(len as u64).take(len).collect());
    random.chain([vec![0; 1000], vec![255; 1000], vec![0; 8_000_000]])
}

fn rounds() -> usize {
    std::env::var("ELK_HOSTILE_ROUNDS").ok().and_then(|rounds| rounds.parse().ok()).unwrap_or(4)
}

#[test]
fn whatever_is_written_to_a_running_mission_nobody_is_lost() {
    let mut attack = Attack::begin("attack", &mission());
    attack.elk.obeyed(&["step"]);
    for app in APPS.iter().chain(&["launcher"]) {
        let unknown = heard_by(&attack.elk, app);
        assert_eq!(unknown, [""; 0], "{app} hears what is not attacked here");
    }
    let mut sent = 0;
    for (place, (key, type_name)) in HEARD.iter().enumerate() {
        attack.write(key, ValueRef::Text("what a text"));
        attack.write(key, ValueRef::Text(&"x".repeat(1_000_000)));
        for number in [0.0, -1.0, f64::NAN, f64::INFINITY, 1e300, -1e300, 2f64.powi(64)] {
            attack.write(key, ValueRef::Double(number));
        }
        attack.write(key, ValueRef::Binary { type_: TypeRef::undescribed("Stranger", 7), bytes: &[1, 2, 3] });
        if let Some(sample) = type_name.map(|name| named(name).unwrap()) {
            for bytes in bad_values(sample) {
                attack.write_typed(key, sample, &bytes);
                sent += 1;
                if sent % 1000 == 0 {
                    attack.listen(Duration::ZERO, |_| {});
                }
            }
        }
        attack.hostile.comms.flush().unwrap();
        // Everybody is asked now and then: two words of each take seconds.
        if place % 5 == 4 {
            attack.nobody_is_lost(key);
        }
    }
    attack.nobody_is_lost("in the end");
    println!("{sent} messages");
    for (key, _) in HEARD.iter().filter(|(_, type_name)| type_name.is_some()) {
        let of_key: Vec<&String> =
            attack.said.iter().filter(|said| said.contains(&format!(" rejects {key} #"))).collect();
        assert!(!of_key.is_empty() || unread_by_apps(key), "nobody rejected anything of {key}: {:#?}", attack.said);
        if is_report(key) {
            let said = attack.launcher.said();
            assert!(said.contains(&format!("{key} by hostile: ")), "{said}");
        }
        for said in of_key {
            let reasons = ["; it has to be ", "the bytes are no ", " is ", " has ", " have ", " carries "];
            let names_field = reasons.iter().any(|reason| said.contains(reason));
            // What a lie has made an app say may be rejected as well.
            let writer =
                said.contains(" by hostile: ") || APPS.iter().any(|app| said.contains(&format!(" by {app}: ")));
            assert!(writer && names_field, "{said}");
        }
    }
    attack.end();
}

/// What an app hears, and [`HEARD`] does not have; the broker's own variables nobody else can write.
fn heard_by(elk: &Elk, app: &str) -> Vec<String> {
    let told = elk.obeyed(&["info", app]);
    let registered = told.lines().find_map(|line| line.trim().strip_prefix("registered")).unwrap();
    let is_attacked = |key: &&str| {
        HEARD.iter().any(|(heard, _)| heard == key) || ["DB_", "*_STATUS"].iter().any(|own| key.starts_with(own))
    };
    registered.split(',').map(str::trim).filter(|key| !is_attacked(key)).map(str::to_owned).collect()
}

/// Memories are read when an app starts, and not by an app that is there; reports by the launcher, which says what is wrong
/// with them itself.
fn unread_by_apps(key: &str) -> bool {
    key == "MAP_KNOWN" || key == "PROGRESS" || key == "EXPLORER_PAST" || key.ends_with("_MEMORY") || is_report(key)
}

fn is_report(key: &str) -> bool {
    // That of a recording, which no app of this mission reads.
    key == "PLAYBACK" || key.ends_with("_REPORT")
}

/// Each round, another choice of bad values lies there as the latest when the apps start.
#[test]
fn whatever_lies_there_when_they_start_all_apps_come_up() {
    let mut attack = Attack::begin("ambush", &mission());
    for round in 0..rounds() {
        for app in APPS {
            attack.elk.obeyed(&["stop", app]);
        }
        for (place, (key, type_name)) in HEARD.iter().enumerate() {
            let Some(sample) = type_name.map(|name| named(name).unwrap()) else {
                let values = ["what a text".into(), Value::Double(f64::NAN), Value::Double(1e300)];
                values.iter().for_each(|value| attack.write(key, value.as_ref()));
                continue;
            };
            // A place that differs from key to key and from round to round. A controller that remembers steps which a
            // person allowed takes them: of its memory, only what cannot be true.
            let is_let = |bytes: &Vec<u8>| *key != "MOTION_MEMORY" || sample.check(bytes).is_err();
            let all: Vec<Vec<u8>> = bad_values(sample).into_iter().filter(is_let).collect();
            let chosen = &all[(round * 7919 + place * 104_729) % all.len()];
            attack.write_typed(key, sample, chosen);
        }
        attack.hostile.comms.flush().unwrap();
        for app in APPS {
            let (code, said) = attack.elk.order(&["start", app]);
            assert_eq!(code, Some(0), "round {round}: {app}: {said}\n{}", attack.launcher.said());
        }
        attack.nobody_is_lost(&format!("round {round}"));
    }
    attack.end();
}

/// A plan that nobody can follow, in answer to a request.
fn lies(request: u64, revision: u64) -> impl Iterator<Item = Plan> {
    let near = |x: f64| Point3::new(x, 0.0, 0.8);
    let path = |points: Vec<Point3<f64>>| Path {
        looks: vec![Pose::from_yaw_pitch(points[0], 0.0, 0.0)],
        again: false,
        points,
        target: Voxel::new(1, 0, 8),
        unknown: vec![],
    };
    let motion = |clearance_m: f64, scan_spacing_m: f64| MotionPolicy {
        name: "lie".to_owned(),
        scan_spacing_m,
        early_stop: false,
        look_at_target: false,
        clearance_m,
        level: false,
    };
    let short = move || path(vec![near(0.0), near(0.5)]);
    [
        (short(), motion(100.0, 0.4)),
        (short(), motion(1000.0, 0.4)),
        (path(vec![near(0.0), near(1e9)]), motion(0.1, 0.4)),
        (path(vec![near(0.0), near(f64::NAN)]), motion(0.1, 0.4)),
        (short(), motion(0.1, 0.0)),
        (short(), motion(0.1, 1e-12)),
        (path(vec![near(0.0); 1_000_000]), motion(0.1, 0.4)),
        (path((0..1_000_000).map(|i| near(f64::from(i % 2) * 0.5)).collect()), motion(0.1, 0.4)),
        (path(vec![near(0.0), near(3000.0), near(-3000.0)]), motion(9.0, 0.01)),
    ]
    .into_iter()
    .map(move |(path, motion)| Plan { request, revision, decision: Decision::Go(path), motion, cpu_secs: 0.0 })
}

/// Answers the request for a plan that it hears, if any and not yet answered, with all the lies.
///
/// # Errors
/// The broker is gone, as it is when the mission is over.
fn answer_with_lies(attack: &mut Attack, answered: &mut BTreeSet<u64>) -> Result<(), CommsError> {
    let mut asked = None;
    attack.try_listen(Duration::from_millis(20), |mail| {
        if mail.is(&PLAN_REQUEST) {
            asked = mail.decode(&PLAN_REQUEST).ok().map(|request| (request.id, request.revision));
        }
    })?;
    let Some((request, revision)) = asked.filter(|(request, _)| answered.insert(*request)) else { return Ok(()) };
    for lie in lies(request, revision) {
        attack.hostile.comms.publish(&PLAN, &lie)?;
    }
    attack.hostile.comms.flush()
}

/// Whoever answers first is believed, unless what it says cannot be.
#[test]
fn a_liar_that_answers_first_stops_nobody() {
    // It waits until somebody listens: the car's world is explored in less time than it takes to join.
    let mut attack = Attack::begin("liar", &mission());
    attack.elk.obeyed(&["resume"]);
    let waited = Stopwatch::start();
    let mut answered = BTreeSet::new();
    while answered.len() < 12 && waited.elapsed() < WATCHDOG {
        // The broker goes before the launcher's process does. How the mission ended is looked at below.
        if answer_with_lies(&mut attack, &mut answered).is_err() {
            break;
        }
    }
    assert!(!answered.is_empty());
    let (code, said) = attack.launcher.end();
    assert_eq!(code, Some(0), "{said}");
    assert_eq!(attack.elk.summary()["complete"], true, "{said}");
    let named = attack.said.iter().filter(|said| said.starts_with("Controller rejects PLAN #")).count();
    assert!(named > 0, "{:?}", attack.said);
}
