//! Apps among liars: every variable that elk's apps hear carries what cannot be true, live and as what whoever starts is
//! given first. Nobody ends, nobody hangs, and what is true is still heard.
//!
//! All apps take turns on one thread, as in `successors.rs`. What an app cannot use it passes over as the framework has it
//! (see `elk_bus::Rejection`); any other failure fails the test.

#[path = "common/coarse.rs"]
mod coarse;
#[path = "../apps/elk/registry.rs"]
mod registry;
#[path = "common/spoilt.rs"]
mod spoilt;

use std::collections::BTreeMap;
use std::time::Duration;

use coarse::{MISSION, WARP, let_time_pass};
use elk_bus::codec::encode_onto;
use elk_bus::memory::MemoryBroker;
use elk_bus::{
    App, BrokerConfig, Client, Clock, Comms, Community, DecodeError, Key, Mail, Origin, Payload, Rejection, TypeRef,
    Value, number,
};
use elk_geometry::{OccupancyGrid, Pose, State, Voxel};
use elk_mission::{Mission, Program};
use elk_spatial::Scan;
use elk_spatial::keys::*;
use elk_spatial::map::MapUpdate;
use elk_spatial::messages::{self, *};
use elk_spatial::samples::{Sample, named};
use nalgebra::{Point3, Vector3};
use registry::registry;
use spoilt::spoilt;

/// Rounds in which nothing moves after which somebody hangs.
const PATIENCE_ROUNDS: usize = 1000;

/// What each variable carries.
const CARRIED: &[(&str, &str)] = &[
    ("POSE_COMMAND", "PoseCommand"),
    ("SIM_SENSOR", "CameraPose"),
    ("SCAN", "Scan"),
    ("SCAN_1", "Scan"),
    ("MAP_UPDATE", "MapUpdate"),
    ("MAP_PART", "MapPart"),
    ("MAP", "MapUpdate"),
    ("MAP_KNOWN", "MapStatus"),
    ("MAP_MEMORY", "MapMemory"),
    ("PLAN_REQUEST", "PlanRequest"),
    ("PLAN", "Plan"),
    ("PROGRESS", "Progress"),
    ("MOTION_MEMORY", "MotionMemory"),
    ("EXPLORER_MEMORY", "ExplorerMemory"),
    ("EXPLORER_PAST", "ExplorerPast"),
    ("SENSOR_REPORT", "SensorReport"),
    ("ACCURACY_REPORT", "AccuracyReport"),
];
/// Variables that carry a number or a word.
const PLAIN: &[&str] = &["MAP_RECALL", "MAP_REQUEST", "STEP", "MOTION"];

fn sample(variable: &str) -> &'static Sample {
    let (_, name) = CARRIED.iter().find(|(key, _)| *key == variable).unwrap();
    named(name).unwrap()
}

/// All lies about one variable; `believable`: also those that could be true.
fn lies(variable: &'static str, believable: bool) -> Vec<(&'static str, Value)> {
    let sample = sample(variable);
    let told = spoilt(sample).filter(|bytes| believable || sample.check(bytes).is_err());
    told.map(|bytes| (variable, Value::Binary { type_: sample.type_.to_type(), bytes })).collect()
}

/// A value of a type, whether it can be true or not.
fn value<T: Payload>(key: &Key<T>, value: &T::View<'_>) -> (String, Value) {
    let mut bytes = Vec::new();
    encode_onto(value, &mut bytes).unwrap();
    (key.name().to_owned(), Value::Binary { type_: TypeRef::of::<T>().to_type(), bytes })
}

fn say(client: &mut Client, key: &str, value: &Value) {
    client.comms.publish_value(key, value.as_ref(), Origin::default()).unwrap();
}

/// An app under test, and what it passed over.
struct TestedApp {
    app: Box<dyn App>,
    client: Client,
    rejected: BTreeMap<String, usize>,
}

impl TestedApp {
    /// Takes what has come; whether there was anything.
    fn turn(&mut self) -> bool {
        let Self { app, client, rejected } = self;
        let give = |comms: &mut Comms, mail: &Mail<'_>| match app.on_new_mail(comms, mail) {
            Err(failure) if failure.is::<Rejection>() || failure.is::<DecodeError>() => {
                assert!(!failure.to_string().is_empty());
                *rejected.entry(mail.key().to_owned()).or_default() += 1;
                Ok(())
            }
            done => done,
        };
        let taken = client.inbox.receive(&mut client.comms, Duration::ZERO, give).unwrap();
        app.iterate(&mut client.comms).unwrap();
        client.comms.flush().unwrap();
        taken > 0
    }
}

fn mission() -> Mission {
    Mission::parse(MISSION, std::path::Path::new("lies.xml"), &registry(), &[]).unwrap()
}

fn join(broker: &MemoryBroker, name: &str) -> Client {
    Client::over(broker.connect(name).unwrap(), name, &Community::new("lies").unwrap())
}

fn broker() -> MemoryBroker {
    MemoryBroker::new(BrokerConfig::new("lies"), Clock::new(WARP))
}

/// The mission's app of this element.
fn start(broker: &MemoryBroker, element: &str) -> TestedApp {
    let spec = mission().apps.into_iter().find(|app| app.element == element).unwrap();
    let Program::Builtin(app_type, params) = &spec.program else { panic!("{spec:?}") };
    let mut tested =
        TestedApp { app: (app_type.build)(params).unwrap(), client: join(broker, element), rejected: BTreeMap::new() };
    tested.app.on_start_up(&mut tested.client.comms).unwrap();
    tested.client.comms.flush().unwrap();
    tested
}

/// What others hear of an app.
#[derive(Default)]
struct Heard {
    camera: Option<CameraPose>,
    scans: u64,
    revision: u64,
    known: u64,
    plans: u64,
    map: Option<MapUpdate>,
    asked_for_map: bool,
}

/// Everybody else in the community of one app.
struct Others {
    client: Client,
    heard: Heard,
    /// The map as it is in truth, of the mission's resolution.
    map: OccupancyGrid,
}

fn at(x: f64) -> Pose {
    Pose::looking(Point3::new(x, 0.0, 0.8), Vector3::x())
}

impl Others {
    fn new(broker: &MemoryBroker) -> Self {
        let mut client = join(broker, "others");
        client.comms.register(&camera_pose("SIM_SENSOR")).unwrap();
        client.comms.register(&SCAN).unwrap();
        client.comms.register(&MAP_UPDATE).unwrap();
        client.comms.register(&MAP_KNOWN).unwrap();
        client.comms.register(&PLAN).unwrap();
        client.comms.register(&MAP).unwrap();
        client.comms.register(number(MAP_REQUEST)).unwrap();
        client.comms.flush().unwrap();
        let mut map = OccupancyGrid::new(0.25);
        for cell in 0..1000 {
            map.set(Voxel::new(cell % 10 - 5, cell / 10 % 10 - 5, cell / 100), State::Free);
        }
        Self { client, heard: Heard::default(), map }
    }

    /// Hears what the app says; what somebody else made up is none of it.
    fn listen(&mut self, app: &str) {
        let heard = &mut self.heard;
        let note = |mail: &Mail<'_>| {
            // A sensor that believes where it is said to be has nothing to add.
            if mail.key() == "SIM_SENSOR" {
                heard.camera = mail.decode(&camera_pose("SIM_SENSOR")).ok().or(heard.camera.take());
            }
            if mail.source() != app {
                return;
            }
            match mail.key() {
                "SIM_SENSOR" => {}
                "SCAN" => heard.scans += 1,
                "MAP_UPDATE" => heard.revision = mail.decode(&MAP_UPDATE).unwrap().revision,
                "MAP_KNOWN" => heard.known = mail.decode(&MAP_KNOWN).unwrap().free,
                "PLAN" => heard.plans = mail.decode(&PLAN).unwrap().request,
                "MAP" => heard.map = Some(mail.decode(&MAP).unwrap()),
                _ => heard.asked_for_map = true,
            }
        };
        self.client.receive(Duration::ZERO, note).unwrap();
    }

    fn publish<T: Payload>(&mut self, key: &Key<T>, value: &T::View<'_>) {
        self.client.comms.publish(key, value).unwrap();
    }

    /// The map takes a scan that teaches nothing, and answers whoever asks for all of it.
    fn map_goes_on(&mut self, tested: &mut TestedApp, app: &str) {
        let update = MapUpdate::new(self.map.advance(&[]), 0);
        self.publish(&MAP_UPDATE, &update);
        for _ in 0..4 {
            self.settle(tested, app);
            if std::mem::take(&mut self.heard.asked_for_map) {
                let whole = MapUpdate::new(self.map.whole(), 0);
                self.publish(&MAP, &whole);
            }
        }
    }

    fn settle(&mut self, tested: &mut TestedApp, app: &str) {
        self.client.comms.flush().unwrap();
        while tested.turn() {}
        self.listen(app);
    }
}

/// Puts something true before an app and sees that it does what it is there for.
fn assert_well(element: &str, tested: &mut TestedApp, others: &mut Others) {
    others.settle(tested, element);
    match element {
        "Sensor" => {
            let (id, scans) = (others.heard.camera.as_ref().unwrap().command + 1, others.heard.scans);
            others.publish(&POSE_COMMAND, &PoseCommand { id, via: vec![], pose: at(0.1) });
            others.settle(tested, element);
            assert_eq!((others.heard.camera.as_ref().unwrap().command, others.heard.scans), (id, scans + 1));
        }
        "Filter" => {
            let scan = Scan::new(1, 1, at(0.0), [Point3::new(0.0, 0.0, 1.0)].into_iter().collect());
            let before = tested.client.comms.rejected();
            others.client.comms.register(&Key::<Scan<'static>>::new("SCAN_1")).unwrap();
            others.publish(&SCAN, &scan);
            others.settle(tested, element);
            let mut through = 0;
            others.publish(&SCAN, &scan);
            others.client.comms.flush().unwrap();
            tested.turn();
            let note = |mail: &Mail<'_>| through += u64::from(mail.key() == "SCAN_1" && mail.source() == "Filter");
            others.client.receive(Duration::ZERO, note).unwrap();
            assert_eq!((through, tested.client.comms.rejected()), (1, before));
        }
        "Map" => {
            let revision = others.heard.revision;
            for id in [7_000_001, 7_000_002] {
                let points = [Point3::new(0.0, 0.0, 1.0)].into_iter().collect();
                others.publish(&Key::<Scan<'static>>::new("SCAN_1"), &Scan::new(id, 1, at(0.0), points));
            }
            wait(|| {
                others.settle(tested, element);
                others.heard.revision >= revision + 2
            });
            assert!(others.heard.known > 2);
        }
        "Explorer" => {
            others.map_goes_on(tested, element);
            let (id, revision) = (7_000_000 + others.map.revision(), others.map.revision());
            others.publish(&PLAN_REQUEST, &PlanRequest { id, pose: at(0.0), revision, outcome: Outcome::First });
            // If its map is ahead of the request it asks for the true one.
            for _ in 0..3 {
                others.settle(tested, element);
                if std::mem::take(&mut others.heard.asked_for_map) {
                    let whole = MapUpdate::new(others.map.whole(), 0);
                    others.publish(&MAP, &whole);
                }
            }
            assert_eq!(others.heard.plans, id);
        }
        _ => {
            others.publish(&camera_pose("SIM_SENSOR"), &CameraPose { command: 0, pose: at(0.0) });
            others.map_goes_on(tested, element);
            others.map_goes_on(tested, element);
            others.client.comms.notify(MAP_RECALL, 0.0).unwrap();
            others.settle(tested, element);
            let copy = others.heard.map.take().unwrap();
            assert_eq!((copy.revision, copy.resolution), (others.map.revision(), 0.25));
        }
    }
}

fn wait(mut done: impl FnMut() -> bool) {
    for _ in 0..20_000 {
        if done() {
            return;
        }
        let_time_pass();
    }
    panic!("it hangs");
}

/// Words where numbers belong and numbers where words do.
fn plain_lies() -> Vec<(&'static str, Value)> {
    let values = [f64::NAN, f64::INFINITY, -1.0, 1e300, 0.0].map(Value::Double);
    let values = values.into_iter().chain(["", "walk", "1e9"].map(Value::from));
    let values: Vec<Value> = values.chain([Value::Text("x".repeat(1_000_000))]).collect();
    PLAIN.iter().flat_map(|key| values.iter().map(|value| (*key, value.clone()))).collect()
}

/// Every lie, believable or not, to an app that runs.
fn live(element: &str) {
    let broker = broker();
    let (mut others, mut tested) = (Others::new(&broker), start(&broker, element));
    let mut liar = join(&broker, "liar");
    assert_well(element, &mut tested, &mut others);
    let mut told = 0;
    for (variable, _) in CARRIED {
        // Every third: their places differ from type to type, their kinds do not.
        for (key, lie) in lies(variable, true).iter().step_by(3) {
            say(&mut liar, key, lie);
            told += 1;
            if told % 64 == 0 {
                liar.comms.flush().unwrap();
                tested.turn();
            }
        }
        liar.comms.flush().unwrap();
        while tested.turn() {}
    }
    for (key, lie) in plain_lies() {
        say(&mut liar, key, &lie);
        liar.comms.flush().unwrap();
        while tested.turn() {}
    }
    assert!(told > 1000 && !tested.rejected.is_empty(), "{told} told, {:?}", tested.rejected);
    assert_well(element, &mut tested, &mut others);
}

/// Lies that are there before an app is: some of each variable at once, again and again.
fn before_start(element: &str) {
    for round in 0..40 {
        let broker = broker();
        let mut liar = join(&broker, "liar");
        for (variable, _) in CARRIED {
            // What somebody else says is heard by none of its own name.
            let all = lies(variable, true);
            let (key, lie) = &all[round * all.len() / 40];
            say(&mut liar, key, lie);
        }
        // Of another kind nobody could write them any more: the first value makes a variable what it is.
        let right = |(key, value): &(&str, Value)| matches!(value, Value::Double(_)) == (*key != MOTION);
        let plain: Vec<_> = plain_lies().into_iter().filter(right).collect();
        plain.iter().skip(round % 5).step_by(5).for_each(|(key, lie)| say(&mut liar, key, lie));
        liar.comms.flush().unwrap();
        let (mut others, mut tested) = (Others::new(&broker), start(&broker, element));
        wait(|| {
            others.settle(&mut tested, element);
            element != "Sensor" || others.heard.camera.is_some()
        });
        assert_well(element, &mut tested, &mut others);
    }
}

/// Lists of a million entries, empty ones, and maps that reach as far as there are voxels.
fn long_lies() -> Vec<(String, Value)> {
    const MANY: usize = 1_000_000;
    let here = Point3::new(0.0, 0.0, 0.8);
    let path =
        |points| messages::Path { points, target: Voxel::new(0, 0, 0), unknown: vec![], looks: vec![], again: false };
    let motion = || MotionPolicy {
        name: String::new(),
        scan_spacing_m: 0.01,
        early_stop: false,
        look_at_target: false,
        clearance_m: 0.0,
        level: false,
    };
    let plan = |points| Plan {
        request: 1,
        revision: 1,
        decision: Decision::Go(path(points)),
        motion: motion(),
        cpu_secs: 0.0,
    };
    let bricks = |count| vec![elk_geometry::state::BrickStates { brick: [0; 3], cells: vec![] }; count];
    let map = |bricks| MapUpdate { revision: 2, since: 0, scan: 2, resolution: 0.25, bricks };
    // Far apart, and each of them full of free voxels.
    let spread =
        |i: i16| elk_geometry::state::BrickStates { brick: [i % 90 * 40, i / 90 * 40, 0], cells: vec![0x55; 128] };
    let far = |z: f32| (0..MANY).map(move |i| Point3::new(i as f32 % 1000.0, i as f32 / 1000.0, z)).collect();
    let scan = |id, points| Scan::new(id, 1, at(0.0), points);
    let far_voxels = || (0..MANY as i32).map(|i| Voxel::new(i % 30_000, i / 30_000, 0)).collect();
    let memory = |trail: Vec<Voxel>| ExplorerMemory {
        plan: plan(vec![here]),
        ended: None,
        plans: 1,
        fallbacks: 0,
        counters: vec![],
        strategy: None,
        cpu_secs: vec![],
        goes_on: false,
        lists: ExplorerPast { hidden: trail.clone(), barred: trail.clone(), targets: vec![], trail },
        standing: Standing::default(),
        progress_at: 0,
        refused: 0,
        no_return: 0,
    };
    let sample = CoverageSample { scans: 1, free: 1, path_length_m: 0.0 };
    let over = |samples| MotionMemory {
        pose: at(0.0),
        awaited: Awaited::Start,
        commands: 0,
        allowed: 0,
        steps: 0,
        last_step: None,
        requests: 0,
        path_length_m: 0.0,
        leg: None,
        drive: None,
        samples,
    };
    vec![
        value(&PLAN, &plan(vec![here; MANY])),
        value(&PLAN, &plan(vec![])),
        value(&POSE_COMMAND, &PoseCommand { id: 1, via: vec![here; MANY], pose: at(0.0) }),
        value(&MAP_UPDATE, &map(bricks(MANY))),
        value(&MAP_UPDATE, &map(vec![])),
        value(&MAP, &map((0..8100).map(spread).collect())),
        value(&MAP_MEMORY, &MapMemory { revision: 1, scan: 1, resolution: 0.25, bricks: vec![] }),
        value(&SCAN, &scan(1, far(3000.0))),
        value(&Key::<Scan<'static>>::new("SCAN_1"), &scan(2, far(3000.0))),
        value(&Key::<Scan<'static>>::new("SCAN_1"), &scan(3, far(f32::NAN))),
        value(&Key::<Scan<'static>>::new("SCAN_1"), &scan(4, [].into_iter().collect())),
        value(&EXPLORER_MEMORY, &memory(far_voxels())),
        value(&EXPLORER_MEMORY, &memory(vec![])),
        value(
            &EXPLORER_PAST,
            &ExplorerPast { hidden: far_voxels(), barred: far_voxels(), trail: far_voxels(), targets: vec![] },
        ),
        value(&MOTION_MEMORY, &over(vec![sample; MANY])),
        value(&MOTION_MEMORY, &over(vec![])),
    ]
}

#[test]
fn what_is_long_or_empty_or_far_is_survived_live_and_before_the_start() {
    for element in ["Sensor", "Filter", "Map", "Explorer", "Controller"] {
        for live in [true, false] {
            let broker = broker();
            let mut liar = join(&broker, "liar");
            let running = live.then(|| (Others::new(&broker), start(&broker, element)));
            for (key, lie) in long_lies() {
                say(&mut liar, &key, &lie);
                liar.comms.flush().unwrap();
            }
            let (mut others, mut tested) = running.unwrap_or_else(|| (Others::new(&broker), start(&broker, element)));
            wait(|| {
                others.settle(&mut tested, element);
                element != "Sensor" || others.heard.camera.is_some()
            });
            assert_well(element, &mut tested, &mut others);
        }
    }
}

/// A text, and a number where a word belongs, that were written first.
#[test]
fn values_of_another_type_that_were_first_reach_no_reader_and_do_not_keep_the_right_ones_away() {
    for element in ["Sensor", "Filter", "Map", "Explorer", "Controller"] {
        let broker = broker();
        let mut liar = join(&broker, "liar");
        CARRIED.iter().for_each(|(key, _)| say(&mut liar, key, &Value::from("what")));
        PLAIN.iter().filter(|key| **key != MOTION).for_each(|key| say(&mut liar, key, &Value::from("what")));
        say(&mut liar, MOTION, &Value::Double(1.0));
        liar.comms.flush().unwrap();
        let (mut others, mut tested) = (Others::new(&broker), start(&broker, element));
        wait(|| {
            others.settle(&mut tested, element);
            element != "Sensor" || others.heard.camera.is_some()
        });
        assert!(tested.rejected.is_empty(), "{element}: {:?}", tested.rejected);
        assert_well(element, &mut tested, &mut others);
    }
}

macro_rules! apps {
    ($($live:ident, $before:ident: $element:literal;)*) => {$(
        #[test]
        fn $live() {
            live($element);
        }

        #[test]
        fn $before() {
            before_start($element);
        }
    )*};
}

apps! {
    a_sensor_among_liars, a_sensor_that_starts_with_lies: "Sensor";
    a_filter_among_liars, a_filter_that_starts_with_lies: "Filter";
    a_map_among_liars, a_map_that_starts_with_lies: "Map";
    an_explorer_among_liars, an_explorer_that_starts_with_lies: "Explorer";
    a_controller_among_liars, a_controller_that_starts_with_lies: "Controller";
}

/// A whole mission, with somebody in it who lies.
struct Round {
    apps: Vec<TestedApp>,
    probe: Client,
    liar: Client,
    /// The last request of the controller, and the last command.
    request: u64,
    command: u64,
    motion: Option<MotionReport>,
    exploration: Option<ExplorationReport>,
    sensor: Option<SensorReport>,
}

impl Round {
    /// Everybody sits down; `first` is said before anybody is there.
    fn new(first: impl IntoIterator<Item = (String, Value)>) -> Self {
        let broker = broker();
        let mut liar = join(&broker, "liar");
        first.into_iter().for_each(|(key, lie)| say(&mut liar, &key, &lie));
        liar.comms.flush().unwrap();
        let mut probe = join(&broker, "probe");
        for key in ["MOTION_REPORT", "EXPLORATION_REPORT", "SENSOR_REPORT", "PLAN_REQUEST", "POSE_COMMAND"] {
            probe.comms.register(key).unwrap();
        }
        probe.comms.flush().unwrap();
        let apps = ["Sensor", "Filter", "Map", "Explorer", "Controller"].map(|element| start(&broker, element)).into();
        Self { apps, probe, liar, request: 0, command: 0, motion: None, exploration: None, sensor: None }
    }

    /// Runs to the end; `lies` has what is said in each round. What it came to: ways, voxels, scans and contacts.
    fn run(mut self, lies: impl Fn(usize, &Self) -> Vec<(String, Value)>) -> (MotionReport, bool, u64, usize) {
        let mut idle = 0;
        for round in 0.. {
            for (key, lie) in lies(round, &self) {
                say(&mut self.liar, &key, &lie);
            }
            self.liar.comms.flush().unwrap();
            let before = self.command;
            for tested in &mut self.apps {
                tested.turn();
            }
            self.listen();
            idle = if self.command > before { 0 } else { idle + 1 };
            if self.motion.is_some() && self.exploration.is_some() {
                break;
            }
            if idle > 20 {
                let_time_pass();
            }
            assert!(idle < PATIENCE_ROUNDS, "nothing moves any more: {:?}", self.rejected());
        }
        let rejected = self.rejected().values().sum();
        let contacts = self.sensor.unwrap().contacts.unwrap();
        (self.motion.unwrap(), self.exploration.unwrap().complete, contacts, rejected)
    }

    fn rejected(&self) -> BTreeMap<&str, usize> {
        let mut all = BTreeMap::new();
        for (key, count) in self.apps.iter().flat_map(|tested| &tested.rejected) {
            *all.entry(key.as_str()).or_default() += count;
        }
        all
    }

    fn listen(&mut self) {
        let Self { probe, motion, exploration, sensor, request, command, .. } = self;
        let note = |mail: &Mail<'_>| match (mail.source(), mail.key()) {
            ("Controller", "MOTION_REPORT") => *motion = Some(mail.decode(&MOTION_REPORT).unwrap()),
            ("Explorer", "EXPLORATION_REPORT") => *exploration = Some(mail.decode(&EXPLORATION_REPORT).unwrap()),
            ("Sensor", "SENSOR_REPORT") => *sensor = Some(mail.decode(&SENSOR_REPORT).unwrap()),
            ("Controller", "PLAN_REQUEST") => *request = mail.decode(&PLAN_REQUEST).unwrap().id,
            ("Controller", "POSE_COMMAND") => *command = mail.decode(&POSE_COMMAND).unwrap().id,
            _ => {}
        };
        probe.receive(Duration::ZERO, note).unwrap();
    }
}

/// What decodes, and contradicts what somebody knows.
fn contradictions(request: u64, command: u64) -> Vec<(String, Value)> {
    let mut outlier = OccupancyGrid::new(0.25);
    outlier.set(Voxel::new(12_000, 12_000, 12_000), State::Free);
    let mut coarse = OccupancyGrid::new(0.5);
    coarse.set(Voxel::new(0, 0, 0), State::Free);
    let far = MapUpdate { revision: 1_000_000, ..MapUpdate::new(outlier.whole(), 1) };
    let plan = |points: Vec<Point3<f64>>, clearance_m: f64, revision: u64| {
        let path = messages::Path { points, target: Voxel::new(0, 0, 3), unknown: vec![], looks: vec![], again: false };
        let motion = MotionPolicy {
            name: "liar".into(),
            scan_spacing_m: 0.01,
            early_stop: false,
            look_at_target: false,
            clearance_m,
            level: false,
        };
        value(&PLAN, &Plan { request, revision, decision: Decision::Go(path), motion, cpu_secs: 0.0 })
    };
    let here = Point3::new(0.0, 0.0, 0.8);
    let there = Point3::new(3e5, 0.0, 0.8);
    let zigzag = (0..100_000).map(|i| here + Vector3::x() * f64::from(i % 2)).collect();
    let ask = |pose, revision| PlanRequest { id: 1 << 40, pose, revision, outcome: Outcome::Unresolved };
    vec![
        value(&MAP_UPDATE, &MapUpdate { revision: 3, ..MapUpdate::new(coarse.whole(), 1) }),
        value(&MAP, &MapUpdate { revision: 1_000_000, ..MapUpdate::new(coarse.whole(), 1) }),
        value(&MAP_UPDATE, &far),
        value(&MAP, &MapUpdate { revision: (1 << 48) - 1, ..far.clone() }),
        plan(vec![here], 9.0, 1),
        plan(vec![here, there], 0.1, 1),
        plan(zigzag, 0.1, 1),
        plan(vec![here], 0.1, 1 << 47),
        value(&POSE_COMMAND, &PoseCommand { id: command + 1000, via: vec![], pose: at(0.1) }),
        value(&camera_pose("SIM_SENSOR"), &CameraPose { command: 1 << 47, pose: at(0.1) }),
        value(&PLAN_REQUEST, &ask(at(3000.0), 1)),
        value(&PLAN_REQUEST, &ask(at(0.0), 1 << 47)),
    ]
}

/// Whatever is said that cannot be true, a mission goes the very way that it goes alone.
#[test]
fn a_mission_among_liars_goes_the_way_that_it_goes_alone() {
    let alone = Round::new([]).run(|_, _| vec![]);
    assert!(alone.1 && alone.2 == 0 && alone.3 == 0, "{alone:?}");
    let incredible: Vec<(String, Value)> = CARRIED
        .iter()
        .flat_map(|(variable, _)| lies(variable, false).into_iter().step_by(41))
        .map(|(key, lie)| (key.to_owned(), lie))
        .collect();
    let among = Round::new([])
        .run(|round, _| incredible.iter().cycle().skip(round * 30 % incredible.len()).take(30).cloned().collect());
    assert_eq!((&among.0, among.1, among.2), (&alone.0, true, 0));
    assert!(among.3 > 500, "{} rejected", among.3);
    // A contradiction costs a question for the whole map, not more; once there is a map to be contradicted.
    let contradicted = Round::new([]).run(|round, mission| match (mission.request, round % 5) {
        (1.., 0) => contradictions(mission.request, mission.command),
        _ => vec![],
    });
    assert_eq!((&contradicted.0, contradicted.1, contradicted.2), (&alone.0, true, 0));
    assert!(contradicted.3 > 20, "{} rejected", contradicted.3);
}

/// Whoever starts is given lies first: each by itself, and all of what is incredible.
#[test]
fn a_mission_that_begins_with_lies_is_completed() {
    let incredible = CARRIED.iter().map(|(variable, _)| lies(variable, false).remove(7));
    let incredible: Vec<(String, Value)> = incredible.map(|(key, lie)| (key.to_owned(), lie)).collect();
    let alone = contradictions(1, 0).into_iter().map(|lie| vec![lie]);
    for first in alone.chain([incredible]) {
        let (key, lie) = &first[0];
        let mut words = format!("{key} {lie:?}");
        words.truncate(200);
        let (motion, complete, contacts, _) = Round::new(first.clone()).run(|_, _| vec![]);
        assert!(complete && contacts == 0 && motion.scans > 5, "{words}: {motion:?}, {contacts} contacts");
    }
}
