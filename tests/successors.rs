//! Whole missions in which apps are exchanged, or killed, and their successors go on: every app, at every moment that the
//! bus can tell from another. Once without leases, so that mail is lost and latest values have to be enough, and once with:
//! a successor has the mail that the other one had not handled, the message that it died of among it.
//!
//! All apps take turns on one thread, so each run is the same run. What is asked of a run with a successor in it is the
//! strongest that can be asked: that it ends as the undisturbed one does, to the last scan, metre and voxel. Only a map that
//! was killed may go another way, since how sure it was of its voxels is lost; it still has to explore everything, without a
//! contact.

#[path = "common/coarse.rs"]
mod coarse;
#[path = "../apps/elk/registry.rs"]
mod registry;

use std::cell::Cell;
use std::collections::BTreeMap;
use std::path::Path;
use std::rc::Rc;
use std::time::Duration;

use coarse::{MISSION, WARP, let_time_pass};
use elk_bus::broker::Introduction;
use elk_bus::link::{Fill, LinkError, Uplink};
use elk_bus::memory::MemoryBroker;
use elk_bus::wire::BulkRef;
use elk_bus::{App, AppError, BrokerConfig, Client, Clock, Community, Mail};
use elk_mission::{AppSpec, Mission, Program};
use elk_spatial::keyframe::MapPart;
use elk_spatial::keys::{EXPLORATION_REPORT, MAP_PART, MAP_REQUEST, MOTION_REPORT, SENSOR_REPORT};
use elk_spatial::messages::{ExplorationReport, MotionReport, SensorReport};
use registry::registry;

/// The places of apps of [`MISSION`].
const FILTER: usize = 1;
const MAP_APP: usize = 2;
const EXPLORER: usize = 3;
const CONTROLLER: usize = 4;

/// A lease that does not run out in these missions (s).
const LEASE_SECS: f64 = 1e9;
/// Rounds in which nothing moves after which a mission hangs. A map that waits for a copy in vain needs some.
const PATIENCE_ROUNDS: usize = 1000;

/// An app's way up, which ends with the app's life.
struct KillableUplink {
    up: Box<dyn Uplink>,
    life: Rc<Life>,
    broker: MemoryBroker,
    name: String,
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

impl Uplink for KillableUplink {
    /// A dead app's batch is lost, and what it does after that comes to nothing.
    fn send(&mut self, batch: &[u8]) -> Result<(), LinkError> {
        let was_over = self.life.is_over();
        self.life.sent.set(self.life.sent.get() + 1);
        if !self.life.is_over() {
            return self.up.send(batch);
        }
        if !was_over {
            self.broker.kill(&self.name);
        }
        Err(LinkError::SharedMemory("killed".into()))
    }

    fn has_room(&self) -> bool {
        self.up.has_room()
    }

    fn handled(&self) -> u64 {
        self.up.handled()
    }

    fn send_bulk(&mut self, len: usize, fill: &mut Fill<'_>) -> Result<Option<BulkRef>, LinkError> {
        self.up.send_bulk(len, fill)
    }

    fn kept_bulk(&self, sample: u64) -> Option<&[u8]> {
        self.up.kept_bulk(sample)
    }

    fn say_goodbye(&mut self) {
        self.up.say_goodbye();
    }

    fn keep_bulk(&mut self, wanted: &dyn Fn(u64) -> bool) {
        self.up.keep_bulk(wanted);
    }
}

/// An app of the mission, and its present instance.
struct Slot {
    spec: AppSpec,
    /// Nobody, for as long as it takes.
    instance: Option<Instance>,
    /// Messages handled, and batches sent, by all instances.
    handled: u64,
    sent: u64,
}

struct Instance {
    app: Box<dyn App>,
    client: Client,
    life: Rc<Life>,
}

/// What becomes of an app.
#[derive(Debug, Clone, Copy, PartialEq)]
enum Termination {
    /// It is asked to stop after it has handled so many messages, counted over all instances.
    Stopped { after: u64 },
    /// It is killed while it sends this batch.
    Killed { at: u64 },
}

/// A change of instances.
#[derive(Debug, Clone)]
struct Change {
    slot: usize,
    termination: Termination,
    /// Whether the successor comes only when the others have nothing left to do.
    late: bool,
    /// Another type for the successor.
    type_: Option<&'static str>,
}

/// What a mission came to.
#[derive(Debug, Clone, PartialEq)]
struct MissionResult {
    motion: MotionReport,
    exploration: ExplorationReport,
    contacts: u64,
    scans: u64,
    /// The whole map, which is one part, its bricks in order.
    map: MapPart,
}

/// A community with a mission in it.
struct Table {
    broker: MemoryBroker,
    /// How long the session of an app that died is kept (s).
    lease_secs: f64,
    slots: Vec<Slot>,
    probe: Client,
    motion: Option<MotionReport>,
    exploration: Option<ExplorationReport>,
    sensor: Option<SensorReport>,
    map: Option<MapPart>,
}

fn mission(text: &str) -> Mission {
    Mission::parse(text, Path::new("successors.xml"), &registry(), &[]).unwrap()
}

fn join(broker: &MemoryBroker, who: &Introduction<'_>) -> (Client, Rc<Life>) {
    let mut link = broker.join(who).unwrap();
    let life = Rc::new(Life { sent: Cell::new(0), last: Cell::new(u64::MAX) });
    let (broker, name) = (broker.clone(), who.name.to_owned());
    link.up = Box::new(KillableUplink { up: link.up, life: life.clone(), broker, name });
    (Client::over(link, who.name, &Community::new("successors").unwrap()), life)
}

impl Table {
    fn new(lease_secs: f64) -> Self {
        let broker = MemoryBroker::new(BrokerConfig::new("successors"), Clock::new(WARP));
        let (mut probe, _) = join(&broker, &Introduction::new("probe"));
        probe.comms.register(&MOTION_REPORT).unwrap();
        probe.comms.register(&EXPLORATION_REPORT).unwrap();
        probe.comms.register(&SENSOR_REPORT).unwrap();
        probe.comms.register(&MAP_PART).unwrap();
        probe.comms.flush().unwrap();
        let slot = |spec| Slot { spec, instance: None, handled: 0, sent: 0 };
        let slots = mission(MISSION).apps.into_iter().filter(|app| app.element != "Logger").map(slot).collect();
        Self { broker, lease_secs, slots, probe, motion: None, exploration: None, sensor: None, map: None }
    }

    /// Everybody who has no instance gets one.
    fn begin(&mut self, to_come: &[Change]) {
        let empty: Vec<usize> = (0..self.slots.len()).filter(|slot| self.slots[*slot].instance.is_none()).collect();
        empty.into_iter().for_each(|slot| self.start(slot, to_come));
    }

    /// Runs the mission to its end, through these changes; those that come are taken out.
    fn run(&mut self, to_come: &mut Vec<Change>) -> MissionResult {
        self.go_on(to_come, |table| table.motion.is_some() && table.exploration.is_some());
        self.probe.comms.notify(MAP_REQUEST, 1.0).unwrap();
        self.probe.comms.flush().unwrap();
        self.map = None;
        self.go_on(to_come, |table| table.map.is_some() && table.slots.iter().all(|slot| slot.instance.is_some()));
        let mut map = self.map.take().unwrap();
        assert_eq!(map.total, map.bricks.len() as u64);
        map.bricks.sort_by_key(|brick| brick.brick);
        let sensor = self.sensor.take().unwrap();
        let mut exploration = self.exploration.take().unwrap();
        exploration.cpu_secs.clear();
        MissionResult {
            motion: self.motion.take().unwrap(),
            exploration,
            contacts: sensor.contacts.unwrap(),
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
                let_time_pass();
            }
        }
    }

    /// Starts an instance of an app.
    fn start(&mut self, at: usize, to_come: &[Change]) {
        self.slots[at].instance = Some(self.instance(at, to_come));
    }

    /// A new instance of an app. It dies when its time comes.
    fn instance(&self, at: usize, to_come: &[Change]) -> Instance {
        let slot = &self.slots[at];
        let Program::Builtin(app_type, params) = &slot.spec.program else { panic!("{:?}", slot.spec) };
        let mut app = (app_type.build)(params).unwrap();
        let lease_secs = self.lease_secs;
        let who = Introduction { lease_secs, succeeds: lease_secs > 0.0, ..Introduction::new(&slot.spec.name) };
        let (mut client, life) = join(&self.broker, &who);
        let end = to_come.iter().find_map(|change| match change.termination {
            Termination::Killed { at: batch } if change.slot == at => Some((batch - 1).saturating_sub(slot.sent)),
            _ => None,
        });
        life.last.set(end.unwrap_or(u64::MAX));
        let up = app.on_start_up(&mut client.comms).and_then(|()| Ok(client.comms.flush()?));
        up.unwrap_or_else(|error| assert!(life.is_over(), "{error}"));
        Instance { app, client, life }
    }

    /// Everybody takes one turn; whether anybody had anything to do.
    fn round(&mut self, to_come: &mut Vec<Change>) -> bool {
        let mut moved = false;
        for at in 0..self.slots.len() {
            moved |= self.turn(at, to_come);
        }
        moved |= self.listen();
        for at in 0..self.slots.len() {
            if self.slots[at].instance.is_none() && (!moved || !to_come.iter().any(|c| c.slot == at && c.late)) {
                self.succeed(at, to_come);
                moved = true;
            }
        }
        moved
    }

    /// Kills an app between two messages.
    fn kill(&mut self, at: usize) {
        let instance = self.slots[at].instance.take().unwrap();
        instance.life.last.set(0);
    }

    fn turn(&mut self, at: usize, to_come: &mut Vec<Change>) -> bool {
        let slot = &mut self.slots[at];
        let Some(Instance { app, client, life }) = &mut slot.instance else { return false };
        let mut handled = 0;
        let on_mail = |comms: &mut elk_bus::Comms, mail: &Mail<'_>| {
            handled += 1;
            app.on_new_mail(comms, mail)
        };
        let turn: Result<usize, AppError> = client.inbox.receive(&mut client.comms, Duration::ZERO, on_mail);
        let turn = turn.and_then(|_| app.iterate(&mut client.comms)).and_then(|()| Ok(client.comms.flush()?));
        slot.handled += handled;
        if life.is_over() {
            slot.sent += life.last.get() + 1;
            slot.instance = None;
            return true;
        }
        turn.unwrap();
        let is_stopped = |change: &Change| {
            change.slot == at && matches!(change.termination, Termination::Stopped { after } if after <= slot.handled)
        };
        if let Some(change) = to_come.iter().find(|change| is_stopped(change)) {
            if self.lease_secs > 0.0 && !change.late {
                self.hand_over(at, to_come);
                return true;
            }
            let end = app.on_stop(&mut client.comms).and_then(|()| Ok(client.comms.flush()?));
            end.unwrap_or_else(|error| assert!(life.is_over(), "{error}"));
            slot.sent += life.sent.get();
            slot.instance = None;
        }
        handled > 0
    }

    /// Starts a successor where no instance is left.
    fn succeed(&mut self, at: usize, to_come: &mut Vec<Change>) {
        self.change(at, to_come);
        self.start(at, to_come);
    }

    /// Starts a successor of an instance, which leaves when it is ready.
    fn hand_over(&mut self, at: usize, to_come: &mut Vec<Change>) {
        self.change(at, to_come);
        let successor = self.instance(at, to_come);
        let slot = &mut self.slots[at];
        let Some(Instance { app, client, life }) = &mut slot.instance else { panic!("nobody to succeed") };
        // A successor that died on its way asks nobody to leave.
        if client.inbox.retiring() {
            let end = app.on_stop(&mut client.comms).and_then(|()| Ok(client.comms.flush()?));
            end.unwrap_or_else(|error| assert!(life.is_over(), "{error}"));
            slot.sent += life.sent.get();
            slot.instance = None;
            slot.instance = Some(successor);
        }
    }

    /// Takes a change out of those to come.
    fn change(&mut self, at: usize, to_come: &mut Vec<Change>) {
        let change = to_come.iter().position(|change| change.slot == at).unwrap();
        if let Some(type_) = to_come.remove(change).type_ {
            self.slots[at].spec = swapped(&self.slots[at].spec, type_);
        }
    }

    fn listen(&mut self) -> bool {
        let Self { probe, motion, exploration, sensor, map, .. } = self;
        let note = |mail: &Mail<'_>| match mail.key() {
            "MOTION_REPORT" => *motion = Some(mail.decode(&MOTION_REPORT).unwrap()),
            "EXPLORATION_REPORT" => *exploration = Some(mail.decode(&EXPLORATION_REPORT).unwrap()),
            "SENSOR_REPORT" => *sensor = Some(mail.decode(&SENSOR_REPORT).unwrap()),
            _ => *map = Some(mail.decode(&MAP_PART).unwrap()),
        };
        probe.receive(Duration::ZERO, note).unwrap() > 0
    }
}

/// The same app of another type.
fn swapped(spec: &AppSpec, type_: &str) -> AppSpec {
    let text = MISSION.replace(&format!("type=\"{}\"", spec.type_name()), &format!("type=\"{type_}\""));
    mission(&text).apps.into_iter().find(|other| other.element == spec.element).unwrap()
}

/// What the mission comes to if nothing happens, and how many messages each app handles and batches it sends.
fn undisturbed() -> (MissionResult, BTreeMap<usize, (u64, u64)>) {
    let mut table = Table::new(0.0);
    table.begin(&[]);
    let result = table.run(&mut Vec::new());
    let counts = |(at, slot): (usize, &Slot)| {
        let sent = slot.sent + slot.instance.as_ref().map_or(0, |instance| instance.life.sent.get());
        (at, (slot.handled, sent))
    };
    (result, table.slots.iter().enumerate().map(counts).collect())
}

/// Runs the mission with changes, at least one of which comes.
fn disturbed(changes: &[Change], lease_secs: f64) -> MissionResult {
    let (mut table, mut to_come) = (Table::new(lease_secs), changes.to_vec());
    table.begin(&to_come);
    let result = table.run(&mut to_come);
    assert!(to_come.len() < changes.len(), "nothing came of {changes:?}");
    result
}

/// Runs the mission with changes, without leases and with; each result has to be `right`.
fn assert_each(changes: &[Change], right: impl Fn(&MissionResult) -> bool) {
    for lease_secs in [0.0, LEASE_SECS] {
        let result = disturbed(changes, lease_secs);
        let MissionResult { motion, exploration, contacts, scans, .. } = &result;
        assert!(
            right(&result),
            "{changes:?}, lease {lease_secs} s: {motion:?}, {exploration:?}, {contacts} contacts, {scans} scans"
        );
    }
}

fn is_complete(result: &MissionResult) -> bool {
    result.exploration.complete && result.contacts == 0 && result.motion.scans == result.scans
}

/// One change, at once and late.
fn each(slot: usize, termination: Termination, type_: Option<&'static str>) -> [[Change; 1]; 2] {
    [false, true].map(|late| [Change { slot, termination, late, type_ }])
}

#[test]
fn an_undisturbed_mission_is_the_same_every_time() {
    let (once, _) = undisturbed();
    assert!(is_complete(&once), "{once:?}");
    assert_eq!(once, undisturbed().0);
}

#[test]
fn every_app_is_exchanged_at_every_message() {
    let (expected, counts) = undisturbed();
    for (slot, (handled, _)) in counts {
        for after in 0..=handled {
            for change in each(slot, Termination::Stopped { after }, None) {
                assert_each(&change, |result| *result == expected);
            }
        }
    }
}

#[test]
fn every_app_is_killed_with_every_batch_on_its_lips() {
    let (expected, counts) = undisturbed();
    for (slot, (_, sent)) in counts {
        for at in 1..=sent {
            for change in each(slot, Termination::Killed { at }, None) {
                assert_each(&change, |result| match slot {
                    MAP_APP => is_complete(result),
                    _ => *result == expected,
                });
            }
        }
    }
}

#[test]
fn another_strategy_goes_on_at_every_message() {
    let (_, counts) = undisturbed();
    for after in 0..=counts[&EXPLORER].0 {
        for change in each(EXPLORER, Termination::Stopped { after }, Some("Potential")) {
            assert_each(&change, |result| {
                is_complete(result) && (after > 0 || result.exploration.explorer == "Potential")
            });
        }
    }
}

#[test]
fn another_filter_goes_on_at_every_message() {
    let (_, counts) = undisturbed();
    for after in 0..=counts[&FILTER].0 {
        for change in each(FILTER, Termination::Stopped { after }, Some("VoxelGrid")) {
            assert_each(&change, is_complete);
        }
    }
}

/// The map and all who have a copy of it die at once; what was known is lost, and is explored again.
#[test]
fn a_map_that_nobody_has_a_copy_of_is_explored_again() {
    let (expected, _) = undisturbed();
    for lease_secs in [0.0, LEASE_SECS] {
        let mut table = Table::new(lease_secs);
        table.begin(&[]);
        assert!((0..20).all(|_| table.round(&mut Vec::new())));
        for slot in [MAP_APP, EXPLORER, CONTROLLER] {
            table.kill(slot);
        }
        table.begin(&[]);
        let result = table.run(&mut Vec::new());
        assert!(is_complete(&result), "{result:?}");
        assert!(result.map.revision > result.scans, "its revisions go on behind the lost ones: {result:?}");
        assert!(result.scans > expected.scans, "{} scans", result.scans);
    }
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
        let slot = self.below(counts.len() as u64) as usize;
        let (handled, sent) = counts[&slot];
        let termination = match self.below(2) {
            0 => Termination::Stopped { after: self.below(handled) },
            _ => Termination::Killed { at: 1 + self.below(sent) },
        };
        Change { slot, termination, late: self.below(2) == 0, type_: None }
    }
}

/// Three apps, or one three times, are exchanged or killed wherever it hits them, at once or one after the other.
#[test]
fn whatever_happens_to_three_apps_the_mission_completes() {
    let (expected, counts) = undisturbed();
    let mut dice = Dice(1);
    for _ in 0..150 {
        let changes: Vec<Change> = (0..3).map(|_| dice.change(&counts)).collect();
        let map_is_killed =
            changes.iter().any(|c| c.slot == MAP_APP && matches!(c.termination, Termination::Killed { .. }));
        assert_each(&changes, |result| match map_is_killed {
            true => is_complete(result),
            false => *result == expected,
        });
    }
}
