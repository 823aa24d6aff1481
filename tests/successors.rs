//! Whole missions in which apps are exchanged, or killed, and their successors go on: every app, at every moment that the
//! bus can tell from another.
//!
//! All apps take turns on one thread, so each run is the same run. What is asked of a run with a successor in it is the
//! strongest that can be asked: that it ends as the undisturbed one does, to the last scan, metre and voxel. Only a map that
//! was killed may go another way, since how sure it was of its voxels is lost; it still has to explore everything, without a
//! contact.

use std::cell::Cell;
use std::collections::BTreeMap;
use std::path::Path;
use std::rc::Rc;
use std::time::Duration;

use elk_bus::link::{Fill, Link, LinkError, Uplink};
use elk_bus::memory::MemoryBroker;
use elk_bus::wire::BulkRef;
use elk_bus::{App, AppError, BrokerConfig, Client, Clock, Community, Mail};
use elk_mission::{AppSpec, Mission, Program, Registry};
use elk_spatial::keys::{EXPLORATION_REPORT, MAP, MAP_REQUEST, MOTION_REPORT, SENSOR_REPORT};
use elk_spatial::map::MapUpdate;
use elk_spatial::messages::{ExplorationReport, MotionReport, SensorReport};

/// The middle of the car's interior, with few and coarse pixels and voxels: a mission of 17 scans.
const MISSION: &str = r#"
<Scenario name="Car, coarse">
    <Sensor type="Simulator">
        <Width>24</Width> <Height>24</Height> <Start> 0.0; 0.0; 0.8 </Start> <StartPitch> -15 deg </StartPitch>
    </Sensor>
    <Filter type="Distance"/>
    <Map type="OctoMap"> <Res> 0.25 m </Res> </Map>
    <Explorer type="ClosestFrontier"> <Res> 0.25 m </Res> <Mid> 0.0; 0.0; 0.5 </Mid> <Dim> 3; 3; 3 </Dim> </Explorer>
    <Controller type="MOOSSim"/>
</Scenario>"#;

/// The places of apps of [`MISSION`].
const FILTER: usize = 1;
const MAP_APP: usize = 2;
const EXPLORER: usize = 3;
const CONTROLLER: usize = 4;

/// The clocks of these missions run fast, so that nobody has to wait for a patience to run out.
const WARP: f64 = 1000.0;
/// Rounds in which nothing moves after which a mission hangs. A map that waits for a copy in vain needs some.
const PATIENCE_ROUNDS: usize = 1000;

/// An app's way up, which ends with the app's life.
struct Mortal {
    up: Box<dyn Uplink>,
    life: Rc<Life>,
}

/// How many batches an app sends before it dies.
struct Life {
    sent: Cell<u64>,
    last: Cell<u64>,
}

impl Life {
    fn is_over(&self) -> bool {
        self.sent.get() > self.last.get()
    }
}

impl Uplink for Mortal {
    /// A dead app's batch is lost, and what it does after that comes to nothing.
    fn send(&mut self, batch: &[u8]) -> Result<(), LinkError> {
        self.life.sent.set(self.life.sent.get() + 1);
        match self.life.is_over() {
            true => Err(LinkError::SharedMemory("killed".into())),
            false => self.up.send(batch),
        }
    }

    fn send_bulk(&mut self, len: usize, fill: &mut Fill<'_>) -> Result<Option<BulkRef>, LinkError> {
        self.up.send_bulk(len, fill)
    }
}

/// An app in its place.
struct Seat {
    spec: AppSpec,
    /// Nobody, for as long as it takes.
    sitter: Option<Sitter>,
    /// Messages handled, and batches sent, by all who sat here.
    handled: u64,
    sent: u64,
}

struct Sitter {
    app: Box<dyn App>,
    client: Client,
    life: Rc<Life>,
}

/// What becomes of an app.
#[derive(Debug, Clone, Copy, PartialEq)]
enum Fate {
    /// It is asked to stop after it has handled so many messages, counted over all who sat there.
    Stopped { after: u64 },
    /// It is killed with this batch on its lips.
    Killed { at: u64 },
}

/// A change of sitters.
#[derive(Debug, Clone)]
struct Change {
    seat: usize,
    fate: Fate,
    /// Whether the successor comes only when the others have nothing left to do.
    late: bool,
    /// Another type for the successor.
    type_: Option<&'static str>,
}

/// What a mission came to.
#[derive(Debug, Clone, PartialEq)]
struct Outcome {
    motion: MotionReport,
    exploration: ExplorationReport,
    contacts: u64,
    scans: u64,
    /// The whole map, its bricks in order.
    map: MapUpdate,
}

/// A community with a mission in it.
struct Table {
    broker: MemoryBroker,
    seats: Vec<Seat>,
    probe: Client,
    motion: Option<MotionReport>,
    exploration: Option<ExplorationReport>,
    sensor: Option<SensorReport>,
    map: Option<MapUpdate>,
}

fn registry() -> Registry {
    Registry::new(&[elk_sensor::TYPES, elk_filter::TYPES, elk_map::TYPES, elk_explorer::TYPES, elk_controller::TYPES])
}

fn mission(text: &str) -> Mission {
    Mission::parse(text, Path::new("successors.xml"), &registry(), &[]).unwrap()
}

fn join(broker: &MemoryBroker, name: &str) -> (Client, Rc<Life>) {
    let Link { up, down, clock, epoch } = broker.connect(name).unwrap();
    let life = Rc::new(Life { sent: Cell::new(0), last: Cell::new(u64::MAX) });
    let link = Link { up: Box::new(Mortal { up, life: life.clone() }), down, clock, epoch };
    (Client::over(link, name, &Community::new("successors").unwrap()), life)
}

impl Table {
    fn new(clock: Clock) -> Self {
        let broker = MemoryBroker::new(BrokerConfig::new("successors"), clock);
        let (mut probe, _) = join(&broker, "probe");
        probe.comms.register(&MOTION_REPORT).unwrap();
        probe.comms.register(&EXPLORATION_REPORT).unwrap();
        probe.comms.register(&SENSOR_REPORT).unwrap();
        probe.comms.register(&MAP).unwrap();
        probe.comms.flush().unwrap();
        let seat = |spec| Seat { spec, sitter: None, handled: 0, sent: 0 };
        let seats = mission(MISSION).apps.into_iter().filter(|app| app.element != "Logger").map(seat).collect();
        Self { broker, seats, probe, motion: None, exploration: None, sensor: None, map: None }
    }

    /// Everybody who has no sitter gets one.
    fn begin(&mut self, to_come: &[Change]) {
        let empty: Vec<usize> = (0..self.seats.len()).filter(|seat| self.seats[*seat].sitter.is_none()).collect();
        empty.into_iter().for_each(|seat| self.sit(seat, to_come));
    }

    /// Runs the mission to its end, through these changes; those that come are taken out.
    fn run(&mut self, to_come: &mut Vec<Change>) -> Outcome {
        self.go_on(to_come, |table| table.motion.is_some() && table.exploration.is_some());
        self.probe.comms.notify(MAP_REQUEST, 1.0).unwrap();
        self.probe.comms.flush().unwrap();
        self.map = None;
        self.go_on(to_come, |table| table.map.is_some() && table.seats.iter().all(|seat| seat.sitter.is_some()));
        let mut map = self.map.take().unwrap();
        map.bricks.sort_by_key(|brick| brick.brick);
        let sensor = self.sensor.take().unwrap();
        let mut exploration = self.exploration.take().unwrap();
        exploration.cpu_secs.clear();
        Outcome {
            motion: self.motion.take().unwrap(),
            exploration,
            contacts: sensor.contacts,
            scans: sensor.scans,
            map,
        }
    }

    /// Takes rounds until `done`.
    fn go_on(&mut self, to_come: &mut Vec<Change>, done: impl Fn(&Self) -> bool) {
        let mut idle = 0;
        while !done(self) {
            idle = if self.round(to_come) { 0 } else { idle + 1 };
            assert!(idle < PATIENCE_ROUNDS, "nothing moves any more");
            if idle > 1 {
                std::thread::sleep(Duration::from_millis(1));
            }
        }
    }

    /// Puts an app into its place. It dies when its time comes.
    fn sit(&mut self, at: usize, to_come: &[Change]) {
        let seat = &mut self.seats[at];
        let Program::Builtin(app_type, params) = &seat.spec.program else { panic!("{:?}", seat.spec) };
        let mut app = (app_type.build)(params).unwrap();
        let (mut client, life) = join(&self.broker, &seat.spec.name);
        let end = to_come.iter().find_map(|change| match change.fate {
            Fate::Killed { at: batch } if change.seat == at => Some((batch - 1).saturating_sub(seat.sent)),
            _ => None,
        });
        life.last.set(end.unwrap_or(u64::MAX));
        let up = app.on_start_up(&mut client.comms).and_then(|()| Ok(client.comms.flush()?));
        up.unwrap_or_else(|error| assert!(life.is_over(), "{error}"));
        seat.sitter = Some(Sitter { app, client, life });
    }

    /// Everybody takes one turn; whether anybody had anything to do.
    fn round(&mut self, to_come: &mut Vec<Change>) -> bool {
        let mut moved = false;
        for at in 0..self.seats.len() {
            moved |= self.turn(at, to_come);
        }
        moved |= self.listen();
        for at in 0..self.seats.len() {
            if self.seats[at].sitter.is_none() && (!moved || !to_come.iter().any(|c| c.seat == at && c.late)) {
                self.succeed(at, to_come);
                moved = true;
            }
        }
        moved
    }

    /// Kills an app between two messages.
    fn kill(&mut self, at: usize) {
        let sitter = self.seats[at].sitter.take().unwrap();
        sitter.life.last.set(0);
    }

    fn turn(&mut self, at: usize, to_come: &[Change]) -> bool {
        let seat = &mut self.seats[at];
        let Some(Sitter { app, client, life }) = &mut seat.sitter else { return false };
        let mut handled = 0;
        let on_mail = |comms: &mut elk_bus::Comms, mail: &Mail<'_>| {
            handled += 1;
            app.on_new_mail(comms, mail)
        };
        let turn: Result<usize, AppError> = client.inbox.receive(&mut client.comms, Duration::ZERO, on_mail);
        let turn = turn.and_then(|_| app.iterate(&mut client.comms)).and_then(|()| Ok(client.comms.flush()?));
        seat.handled += handled;
        if life.is_over() {
            seat.sent += life.last.get() + 1;
            seat.sitter = None;
            return true;
        }
        turn.unwrap();
        let is_stopped = |change: &Change| {
            change.seat == at && matches!(change.fate, Fate::Stopped { after } if after <= seat.handled)
        };
        if to_come.iter().any(is_stopped) {
            let end = app.on_stop(&mut client.comms).and_then(|()| Ok(client.comms.flush()?));
            end.unwrap_or_else(|error| assert!(life.is_over(), "{error}"));
            seat.sent += life.sent.get();
            seat.sitter = None;
        }
        handled > 0
    }

    /// Puts a successor where nobody sits.
    fn succeed(&mut self, at: usize, to_come: &mut Vec<Change>) {
        let change = to_come.iter().position(|change| change.seat == at).unwrap();
        let change = to_come.remove(change);
        if let Some(type_) = change.type_ {
            self.seats[at].spec = swapped(&self.seats[at].spec, type_);
        }
        self.sit(at, to_come);
    }

    fn listen(&mut self) -> bool {
        let Self { probe, motion, exploration, sensor, map, .. } = self;
        let note = |mail: &Mail<'_>| match mail.key() {
            "MOTION_REPORT" => *motion = Some(mail.decode(&MOTION_REPORT).unwrap()),
            "EXPLORATION_REPORT" => *exploration = Some(mail.decode(&EXPLORATION_REPORT).unwrap()),
            "SENSOR_REPORT" => *sensor = Some(mail.decode(&SENSOR_REPORT).unwrap()),
            _ => *map = Some(mail.decode(&MAP).unwrap()),
        };
        probe.receive(Duration::ZERO, note).unwrap() > 0
    }
}

/// The same app of another type.
fn swapped(spec: &AppSpec, type_: &str) -> AppSpec {
    let text = MISSION.replace(&format!("type=\"{}\"", spec.type_name()), &format!("type=\"{type_}\""));
    mission(&text).apps.into_iter().find(|other| other.element == spec.element).unwrap()
}

fn undisturbed() -> (Outcome, BTreeMap<usize, (u64, u64)>) {
    let mut table = Table::new(Clock::new(WARP));
    table.begin(&[]);
    let outcome = table.run(&mut Vec::new());
    let counts = |(at, seat): (usize, &Seat)| {
        let sent = seat.sent + seat.sitter.as_ref().map_or(0, |sitter| sitter.life.sent.get());
        (at, (seat.handled, sent))
    };
    (outcome, table.seats.iter().enumerate().map(counts).collect())
}

/// Runs the mission with changes, at least one of which comes.
fn disturbed(changes: &[Change]) -> Outcome {
    let (mut table, mut to_come) = (Table::new(Clock::new(WARP)), changes.to_vec());
    table.begin(&to_come);
    let outcome = table.run(&mut to_come);
    assert!(to_come.len() < changes.len(), "nothing came of {changes:?}");
    outcome
}

fn assert_same(changes: &[Change], expected: &Outcome) {
    let outcome = disturbed(changes);
    let in_short =
        |o: &Outcome| format!("{:?}\n{:?}\n{} contacts, {} scans", o.motion, o.exploration, o.contacts, o.scans);
    assert!(outcome == *expected, "{changes:?}:\n{}\ninstead of\n{}", in_short(&outcome), in_short(expected));
}

fn assert_explored(changes: &[Change]) {
    assert_complete(&disturbed(changes), changes);
}

fn assert_complete(outcome: &Outcome, changes: &[Change]) {
    assert!(outcome.exploration.complete && outcome.contacts == 0, "{changes:?}: {outcome:?}");
    assert_eq!(outcome.motion.scans, outcome.scans, "{changes:?}");
}

/// One change, at once and late.
fn each(seat: usize, fate: Fate, type_: Option<&'static str>) -> [Change; 2] {
    [false, true].map(|late| Change { seat, fate, late, type_ })
}

#[test]
fn an_undisturbed_mission_is_the_same_every_time() {
    let (once, _) = undisturbed();
    assert_complete(&once, &[]);
    assert_eq!(once, undisturbed().0);
}

#[test]
fn every_app_is_exchanged_at_every_message() {
    let (outcome, counts) = undisturbed();
    for (seat, (handled, _)) in counts {
        for after in 0..=handled {
            each(seat, Fate::Stopped { after }, None).into_iter().for_each(|change| assert_same(&[change], &outcome));
        }
    }
}

#[test]
fn every_app_is_killed_with_every_batch_on_its_lips() {
    let (outcome, counts) = undisturbed();
    for (seat, (_, sent)) in counts {
        for at in 1..=sent {
            for change in each(seat, Fate::Killed { at }, None) {
                match seat {
                    MAP_APP => assert_explored(&[change]),
                    _ => assert_same(&[change], &outcome),
                }
            }
        }
    }
}

#[test]
fn another_strategy_goes_on_at_every_message() {
    let (_, counts) = undisturbed();
    for after in 0..=counts[&EXPLORER].0 {
        for change in each(EXPLORER, Fate::Stopped { after }, Some("Potential")) {
            let explored = disturbed(std::slice::from_ref(&change));
            assert_complete(&explored, &[change]);
            assert!(after > 0 || explored.exploration.explorer == "Potential", "{explored:?}");
        }
    }
}

#[test]
fn another_filter_goes_on_at_every_message() {
    let (_, counts) = undisturbed();
    for after in 0..=counts[&FILTER].0 {
        for change in each(FILTER, Fate::Stopped { after }, Some("VoxelGrid")) {
            assert_explored(&[change]);
        }
    }
}

/// The map and all who have a copy of it die at once; what was known is lost, and is explored again.
#[test]
fn a_map_that_nobody_has_a_copy_of_is_explored_again() {
    let (expected, _) = undisturbed();
    let mut table = Table::new(Clock::new(WARP));
    table.begin(&[]);
    assert!((0..20).all(|_| table.round(&mut Vec::new())));
    for seat in [MAP_APP, EXPLORER, CONTROLLER] {
        table.kill(seat);
    }
    table.begin(&[]);
    let outcome = table.run(&mut Vec::new());
    assert_complete(&outcome, &[]);
    assert!(outcome.map.revision > outcome.scans, "its revisions go on behind the lost ones: {outcome:?}");
    assert!(outcome.scans > expected.scans, "{:?} {:?}", outcome.exploration, outcome.motion);
}

/// Numbers that look random and are the same in every run (Knuth's MMIX generator).
struct Dice(u64);

impl Dice {
    /// From 0 to `n` - 1.
    fn below(&mut self, n: u64) -> u64 {
        self.0 = self.0.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        (self.0 >> 33) % n
    }

    fn change(&mut self, counts: &BTreeMap<usize, (u64, u64)>) -> Change {
        let seat = self.below(counts.len() as u64) as usize;
        let (handled, sent) = counts[&seat];
        let fate = match self.below(2) {
            0 => Fate::Stopped { after: self.below(handled) },
            _ => Fate::Killed { at: 1 + self.below(sent) },
        };
        Change { seat, fate, late: self.below(2) == 0, type_: None }
    }
}

/// Three apps, or one three times, are exchanged or killed wherever it hits them, at once or one after the other.
#[test]
fn whatever_happens_to_three_apps_the_mission_completes() {
    let (outcome, counts) = undisturbed();
    let mut dice = Dice(1);
    for _ in 0..300 {
        let changes: Vec<Change> = (0..3).map(|_| dice.change(&counts)).collect();
        let map_is_killed = changes.iter().any(|c| c.seat == MAP_APP && matches!(c.fate, Fate::Killed { .. }));
        match map_is_killed {
            true => assert_explored(&changes),
            false => assert_same(&changes, &outcome),
        }
    }
}
