//! What pages show of a mission, kept as they need it: whatever changed is there once, and a page that is late skips what
//! was overwritten meanwhile.
//!
//! Model, View and Controller of the thesis (4.4.1) lie here so: this is the Model; the page in the browser is the View; the
//! Controller are the page's messages ([`crate::words::Said`]) and whoever does what they say ([`crate::Steering`]).

use std::collections::BTreeSet;

use axum::body::Bytes;
use axum::extract::ws::{Message, Utf8Bytes};
use elk_bus::drawing::{Declared, Keyboard, variables};
use elk_bus::{Key, Payload, ValueRef};
use elk_geometry::Pose;
use elk_spatial::keys::{
    EXPLORATION_REPORT, MAP, MAP_PART, MAP_UPDATE, MOTION, MOTION_REPORT, PLAN, PLAYBACK, PROGRESS, camera_pose,
};
use elk_spatial::messages::{CameraPose, Decision, Plan, Progress};
use elk_spatial::{CameraInfo, Scan};
use nalgebra::{Point3, UnitQuaternion, Vector3};
use serde_json::{Value, json};

use crate::drawings::Drawings;
use crate::journal::Journal;
use crate::track::{Read, Track};
use crate::world::World;

/// The most points of a way or a curve that are kept.
const MOST_POINTS: usize = 100_000;
/// The most events, and lines of an app's log, that are kept.
const MOST_LINES: usize = 2_000;
/// The most points of a scan that a page is sent.
const MOST_SCAN_POINTS: usize = 8_000;
/// Lists of a value that are longer are counted.
const LONGEST_LIST: usize = 64;
/// Texts of a value that are longer are cut (bytes).
const LONGEST_TEXT: usize = 4_096;
/// Of a value that is longer as JSON only its length is said (bytes).
const LONGEST_VALUE: usize = 256 << 10;
/// What the broker says of clients that come, go, and take over.
const EVENTS: &str = "DB_EVENT";
/// What the broker says of who is there.
const CLIENTS: &str = "DB_CLIENTS";
/// What sums a run up.
const REPORTS: [&str; 4] = ["EXPLORATION_REPORT", "MOTION_REPORT", "ACCURACY_REPORT", "PLAYBACK"];
/// The first byte of a frame with a scan.
const SCAN: u8 = 2;

/// Variables that the model always hears: what it shows of them has places of its own.
pub(crate) fn always() -> BTreeSet<String> {
    let typed = [MAP_UPDATE.name(), MAP_PART.name(), MAP.name(), PLAN.name(), PROGRESS.name()].map(str::to_owned);
    typed
        .into_iter()
        .chain([EVENTS, CLIENTS, MOTION, variables::KEYS].into_iter().chain(REPORTS).map(str::to_owned))
        .collect()
}

/// One thing that was said, whoever said it: on the bus or in a log.
#[derive(Debug, Clone, Copy)]
pub struct Heard<'a> {
    /// The variable.
    pub key: &'a str,
    /// Who wrote it.
    pub source: &'a str,
    /// When (s, the community's time).
    pub time: f64,
    /// What.
    pub value: ValueRef<'a>,
}

/// What a page is told whole whenever it changes.
#[derive(Debug, Clone, PartialEq, Eq, PartialOrd, Ord)]
pub(crate) enum Fact {
    Status,
    Damage,
    Robot,
    Plan,
    Progress,
    Apps,
    Variables,
    Timeline,
    End,
    Drawings,
    Keys,
    /// The latest value of a variable.
    Value(String),
}

/// What is known.
#[derive(Clone)]
pub struct Model {
    /// Counts up when everything is forgotten.
    generation: u64,
    world: World,
    facts: Journal<Fact, Utf8Bytes>,
    /// The last scan, as it is sent, and its number.
    scan: (u64, Bytes),
    camera: CameraInfo,
    way: Track<[f32; 3]>,
    coverage: Track<[f64; 2]>,
    events: Track<(f64, String)>,
    /// The last word of how far the run is, and what its phase follows from.
    progress: Value,
    is_over: bool,
    is_paused: bool,
    /// When the run began (s); `None`: nobody has said yet.
    began: Option<f64>,
    /// What was said of the run's end, by variable.
    reports: serde_json::Map<String, Value>,
    drawings: Drawings,
    keyboard: Keyboard,
    /// Variables whose values somebody watches.
    watched: BTreeSet<String>,
}

/// What a page wants of it.
#[derive(Debug, Clone, Default, PartialEq, Eq)]
pub(crate) struct Wants {
    /// Variables whose values it shows.
    pub values: BTreeSet<String>,
    /// Whether it shows scans.
    pub scan: bool,
    /// Whether it shows what apps draw.
    pub drawings: bool,
}

/// How much of it a page has.
#[derive(Debug, Clone, Default)]
pub(crate) struct Seen {
    generation: u64,
    bricks: u64,
    facts: u64,
    scan: u64,
    way: Read,
    coverage: Read,
    events: Read,
    drawings: u64,
}

/// A message to a page, of text.
pub(crate) fn message(value: &Value) -> Message {
    Message::text(value.to_string())
}

impl Default for Model {
    fn default() -> Self {
        Self {
            generation: 1,
            world: World::new(),
            facts: Journal::default(),
            scan: (0, Bytes::new()),
            camera: CameraInfo::default(),
            way: Track::new(MOST_POINTS),
            coverage: Track::new(MOST_POINTS),
            events: Track::new(MOST_LINES),
            progress: json!({"type": "progress"}),
            is_over: false,
            is_paused: false,
            began: None,
            reports: serde_json::Map::new(),
            drawings: Drawings::default(),
            keyboard: Keyboard::default(),
            watched: BTreeSet::new(),
        }
    }
}

impl Model {
    /// Forgets all but what pages watch: another run begins.
    pub fn reset(&mut self) {
        self.replace_by(Self::default());
    }

    /// Becomes what another one is, for pages that have this one.
    pub fn replace_by(&mut self, other: Self) {
        let watched = std::mem::take(&mut self.watched);
        *self = Self { generation: self.generation + 1, watched, ..other };
    }

    /// Whether the map is to be asked for all it knows.
    pub fn take_question(&mut self) -> bool {
        self.world.take_question()
    }

    /// The variables whose values somebody watches.
    pub fn watch(&mut self, keys: BTreeSet<String>) {
        self.facts.retain(|fact| !matches!(fact, Fact::Value(key) if !keys.contains(key)));
        self.watched = keys;
    }

    /// Takes what was said; what makes no sense is an event, which names variable and writer.
    pub fn hear(&mut self, heard: &Heard<'_>) {
        if let Err(reason) = self.take(heard) {
            self.note(heard.time, format!("{} by {}: {reason}", heard.key, heard.source));
        }
        if self.watched.contains(heard.key) {
            self.show(heard);
        }
    }

    fn take(&mut self, heard: &Heard<'_>) -> Result<(), String> {
        let is = |name: &str| matches!(heard.value, ValueRef::Binary { type_, .. } if type_.name() == name);
        let failed = |error: elk_bus::DecodeError| error.to_string();
        match heard.key {
            key if key == MAP_UPDATE.name() || key == MAP.name() => {
                let update = heard.value.decode(&MAP_UPDATE).map_err(failed)?;
                self.world.take(&update).map_err(|error| error.to_string())?;
            }
            key if key == MAP_PART.name() => {
                let part = heard.value.decode(&MAP_PART).map_err(failed)?;
                self.world.take_part(&part).map_err(|error| error.to_string())?;
            }
            key if key == PLAN.name() => {
                self.plan(&heard.value.decode(&PLAN).map_err(failed)?);
            }
            key if key == PROGRESS.name() => {
                let progress = heard.value.decode(&PROGRESS).map_err(failed)?;
                self.progress(&progress, heard.time);
            }
            key if REPORTS.contains(&key) => {
                let report = readable(heard.value)?;
                self.reports.insert(key.to_lowercase(), report);
                // What the sensor says of the map at the end comes before the explorer's own word or after it.
                if self.is_summed_up() {
                    self.tell(Fact::End, &json!({"type": "end", "summary": self.reports}));
                }
            }
            MOTION => {
                if let ValueRef::Text(text) = heard.value {
                    self.is_paused = text == "pause";
                    self.tell_progress();
                }
            }
            EVENTS => {
                if let ValueRef::Text(text) = heard.value {
                    self.note(heard.time, text.to_owned());
                }
            }
            CLIENTS => {
                if let ValueRef::Text(names) = heard.value {
                    self.keyboard.hear_of_clients(names);
                    self.tell_keys();
                    if self.drawings.hear_of_clients(names) {
                        self.tell(Fact::Drawings, &self.drawings.list());
                    }
                }
            }
            key if variables::is_keys(key) => {
                let table = heard.value.decode(&variables::keys_of(heard.source)).map_err(failed)?;
                self.keyboard.declare(heard.source, heard.time, table);
                self.tell_keys();
            }
            key if variables::is_drawing(key) => {
                let drawing = heard.value.decode(&variables::drawing(heard.source, "")).map_err(failed)?;
                if self.drawings.take(heard.source, heard.time, &drawing) {
                    self.tell(Fact::Drawings, &self.drawings.list());
                }
            }
            _ if is(CameraPose::NAME) => {
                let at = heard.value.decode(&camera_pose(heard.key)).map_err(failed)?;
                self.robot(&at.pose, heard.time);
            }
            _ if is(<Scan<'_> as Payload>::NAME) => {
                let scan = heard.value.decode(&Key::<Scan<'_>>::named(heard.key)).map_err(failed)?;
                self.camera = scan.camera;
                self.scan = (self.scan.0 + 1, scan_frame(&scan));
            }
            _ => {}
        }
        Ok(())
    }

    /// When the run began (s).
    pub fn began(&mut self, time: f64) {
        self.began = Some(time);
    }

    /// Whether the explorer has said that it is done, or a recording, which nobody explores, was played to its end.
    fn is_summed_up(&self) -> bool {
        let is_there = |name: &str| self.reports.contains_key(&name.to_lowercase());
        is_there(EXPLORATION_REPORT.name()) || is_there(PLAYBACK.name()) && is_there(MOTION_REPORT.name())
    }

    /// How long the run had gone on at `time` (s): all times that a page is told are counted so.
    fn since_beginning(&self, time: f64) -> Option<f64> {
        self.began.map(|began| time - began)
    }

    /// Which variables there are ([`crate::table`]).
    pub fn variables(&mut self, variables: &Value) {
        self.tell(Fact::Variables, variables);
    }

    /// Takes what the launcher says of the mission's apps: rows, as `elk apps --json` has them.
    pub fn apps(&mut self, rows: &Value) {
        self.tell(Fact::Apps, &json!({"type": "apps", "rows": rows}));
    }

    /// Whether the community is there; if not, in words why.
    pub fn status(&mut self, connected: bool, text: &str) {
        self.tell(Fact::Status, &json!({"type": "status", "connected": connected, "text": text}));
    }

    /// Why not all of a log is there.
    pub fn damage(&mut self, reasons: &[String]) {
        let Some(first) = reasons.first() else { return };
        let others = if reasons.len() > 1 { format!(", and {} places more", reasons.len() - 1) } else { String::new() };
        let text = format!("the log is not whole: {first}{others}; what is there is shown");
        self.tell(Fact::Damage, &json!({"type": "damage", "text": text}));
    }

    /// Where a recorded run is (s).
    pub fn timeline(&mut self, timeline: &Value) {
        self.tell(Fact::Timeline, timeline);
    }

    /// Something that happened at `time` (s).
    pub fn note(&mut self, time: f64, text: String) {
        self.events.push((time, text));
    }

    /// Whether something goes at this time (s).
    pub fn is_over_at(&self, now: f64) -> bool {
        self.drawings.is_any_over(now)
    }

    /// It is this time (s): what has a lifetime goes when that is over.
    pub fn pass(&mut self, now: f64) {
        if self.drawings.expire(now) {
            self.tell(Fact::Drawings, &self.drawings.list());
        }
    }

    /// Whose a key is.
    pub fn owner(&self, key: &str) -> Option<&str> {
        self.keyboard.owner(key)
    }

    fn tell_keys(&mut self) {
        let row = |one: Declared<'_>| {
            let Declared { app, key, meaning, taken_by } = one;
            json!({"app": app, "key": key, "meaning": meaning, "taken_by": taken_by})
        };
        let rows: Vec<Value> = self.keyboard.declared().map(row).collect();
        self.tell(Fact::Keys, &json!({"type": "keys", "rows": rows}));
    }

    fn tell(&mut self, fact: Fact, message: &Value) {
        let text = Utf8Bytes::from(message.to_string());
        if self.facts.get(&fact) != Some(&text) {
            self.facts.put(fact, text);
        }
    }

    /// This is the value of a variable that somebody watches.
    pub fn show(&mut self, heard: &Heard<'_>) {
        let kind = match heard.value {
            ValueRef::Double(_) => "number",
            ValueRef::Text(_) => "text",
            ValueRef::Binary { type_, .. } => type_.name(),
        };
        let (value, text) = readable(heard.value).map_or_else(|why| (Value::Null, why), |value| (value, String::new()));
        let Heard { key, source, time, .. } = heard;
        let time = self.since_beginning(*time);
        let message = json!({
            "type": "value", "key": key, "source": source, "time": time, "kind": kind, "value": value, "text": text,
        });
        self.tell(Fact::Value((*key).to_owned()), &message);
    }

    fn robot(&mut self, pose: &Pose, time: f64) {
        let position = single(&pose.position());
        if self.way.last() != Some(&position) {
            self.way.push(position);
        }
        // Pages have cameras that look along x, with z up.
        let [x, y, z, w] = forward_left_up(pose).coords.into();
        let CameraInfo { fov_x, fov_y, range_m, .. } = self.camera;
        let camera = (fov_x > 0.0).then(|| {
            let range = (range_m > 0.0).then_some(range_m);
            json!({"horizontal": fov_x, "vertical": fov_y, "range": range})
        });
        let message = json!({
            "type": "robot", "position": position, "quaternion": [x, y, z, w], "camera": camera,
            "time": self.since_beginning(time),
        });
        self.tell(Fact::Robot, &message);
    }

    fn plan(&mut self, plan: &Plan) {
        let (points, target) = match &plan.decision {
            Decision::Go(path) => {
                let target = path.target.center(self.world.grid().resolution());
                (path.points.iter().map(single).collect(), Some(single(&target)))
            }
            Decision::Done => (Vec::new(), None),
        };
        self.tell(Fact::Plan, &json!({"type": "plan", "points": points, "target": target}));
    }

    fn progress(&mut self, progress: &Progress, time: f64) {
        let Progress { scans, path_length_m, free, finished, .. } = *progress;
        self.coverage.push([path_length_m, free as f64]);
        self.progress = json!({
            "type": "progress", "scans": scans, "way": path_length_m, "known": free,
            "frontier": self.world.frontier(), "time": self.since_beginning(time),
        });
        self.is_over = finished;
        self.tell_progress();
    }

    fn tell_progress(&mut self) {
        self.progress["phase"] = match (self.is_over, self.is_paused) {
            (true, _) => "finished",
            (false, true) => "paused",
            (false, false) => "exploring",
        }
        .into();
        let progress = self.progress.clone();
        self.tell(Fact::Progress, &progress);
    }

    /// What a page does not have yet of what it wants, with bricks of at most `most_bytes`; empty: nothing. It has it then.
    pub(crate) fn news(&self, seen: &mut Seen, wants: &Wants, most_bytes: usize) -> Vec<Message> {
        let mut news = Vec::new();
        if seen.generation != self.generation {
            if seen.generation != 0 {
                news.push(message(&json!({"type": "reset"})));
            }
            *seen = Seen { generation: self.generation, ..Seen::default() };
        }
        for (number, fact, text) in self.facts.since(seen.facts) {
            seen.facts = number;
            if !matches!(fact, Fact::Value(key) if !wants.values.contains(key)) {
                news.push(Message::Text(text.clone()));
            }
        }
        if let Some((from, points)) = self.way.next(&mut seen.way) {
            news.push(message(&json!({"type": "way", "from": from, "points": points})));
        }
        if let Some((from, points)) = self.coverage.next(&mut seen.coverage) {
            news.push(message(&json!({"type": "curve", "name": "coverage", "from": from, "points": points})));
        }
        // Before it is known when the run began, nobody can say when anything happened.
        if let Some(began) = self.began
            && let Some((_, events)) = self.events.next(&mut seen.events)
        {
            let event =
                |(at, text): &(f64, String)| message(&json!({"type": "event", "time": at - began, "text": text}));
            news.extend(events.iter().map(event));
        }
        if wants.scan && seen.scan != self.scan.0 {
            seen.scan = self.scan.0;
            news.push(Message::Binary(self.scan.1.clone()));
        }
        if wants.drawings {
            news.extend(self.drawings.news(&mut seen.drawings, most_bytes).into_iter().map(Message::Binary));
        }
        news.extend(self.world.frame(&mut seen.bricks, most_bytes).map(Message::binary));
        news
    }

    /// The values of these variables once more: a page has begun to watch them.
    pub(crate) fn values(&self, keys: &BTreeSet<String>) -> Vec<Message> {
        keys.iter().filter_map(|key| Some(Message::Text(self.facts.get(&Fact::Value(key.clone()))?.clone()))).collect()
    }
}

/// A value for people: what is too long for them is cut. An error says in words why there is none.
fn readable(value: ValueRef<'_>) -> Result<Value, String> {
    let mut value = match value {
        // Of a text as long as may be no copy is made.
        ValueRef::Text(text) => return Ok(cut(text).unwrap_or_else(|| text.to_owned()).into()),
        other => other.to_json(LONGEST_LIST).map_err(|error| error.to_string())?,
    };
    cut_texts(&mut value);
    match value.to_string().len() {
        0..=LONGEST_VALUE => Ok(value),
        bytes => Err(format!("a value of {bytes} bytes as JSON, which is more than a page is sent")),
    }
}

fn cut_texts(value: &mut Value) {
    match value {
        Value::String(text) => {
            if let Some(short) = cut(text) {
                *text = short;
            }
        }
        Value::Array(all) => all.iter_mut().for_each(cut_texts),
        Value::Object(all) => all.values_mut().for_each(cut_texts),
        Value::Null | Value::Bool(_) | Value::Number(_) => {}
    }
}

/// The beginning of a text that is too long, and how much there is of it; `None`: it is not too long.
fn cut(text: &str) -> Option<String> {
    let is_long = text.len() > LONGEST_TEXT;
    is_long.then(|| format!("{}… ({} bytes in all)", &text[..text.floor_char_boundary(LONGEST_TEXT)], text.len()))
}

fn single(point: &Point3<f64>) -> [f32; 3] {
    [point.x as f32, point.y as f32, point.z as f32]
}

/// The rotation that takes (forward, left, up) to the world, of a camera whose own axes are (right, down, forward).
fn forward_left_up(pose: &Pose) -> UnitQuaternion<f64> {
    let (forward, right) = (pose.forward(), pose.0.rotation * Vector3::x());
    let up = pose.0.rotation * -Vector3::y();
    let axes = nalgebra::Matrix3::from_columns(&[forward, -right, up]);
    UnitQuaternion::from_rotation_matrix(&nalgebra::Rotation3::from_matrix_unchecked(axes))
}

/// A scan as pages are sent it, see `PROTOCOL.md`: of very many points every second, third, …, each as three whole numbers of
/// steps from the camera.
fn scan_frame(scan: &Scan<'_>) -> Bytes {
    let every = scan.points.len().div_ceil(MOST_SCAN_POINTS).max(1);
    let camera = scan.pose.position();
    let offsets: Vec<Vector3<f64>> = scan.world_points().step_by(every).map(|point| point - camera).collect();
    let farthest = offsets.iter().map(Vector3::amax).fold(0.0, f64::max);
    // A scan of the camera's own place alone has any step.
    let step = if farthest > 0.0 { farthest / f64::from(i16::MAX) } else { 1.0 };
    let mut frame = vec![SCAN, 0, 0, 0];
    frame.extend((offsets.len() as u32).to_le_bytes());
    single(&camera).iter().chain([&(step as f32)]).for_each(|value| frame.extend(value.to_le_bytes()));
    let steps =
        offsets.iter().flat_map(|offset| [offset.x, offset.y, offset.z]).map(|part| (part / step).round() as i16);
    steps.for_each(|steps| frame.extend(steps.to_le_bytes()));
    frame.into()
}

#[cfg(test)]
mod tests {
    use nalgebra::Isometry3;

    use super::*;

    fn shown(points: Vec<[f32; 3]>) -> Vec<[f64; 3]> {
        let count = points.len();
        let pose = Pose(Isometry3::from_parts(Vector3::new(7.0, 8.0, 9.0).into(), UnitQuaternion::identity()));
        let frame = scan_frame(&Scan::new(1, 1, pose, points.into_iter().map(Point3::from).collect()));
        let float = |at: usize| f64::from(f32::from_le_bytes(frame[at..at + 4].try_into().unwrap()));
        let steps = |at: usize| f64::from(i16::from_le_bytes(frame[at..at + 2].try_into().unwrap()));
        let sent = u32::from_le_bytes(frame[4..8].try_into().unwrap()) as usize;
        assert!(sent <= MOST_SCAN_POINTS && sent >= count.min(MOST_SCAN_POINTS / 2));
        assert_eq!((frame[0], frame.len()), (SCAN, 24 + 6 * sent));
        let part = |point: usize, axis: usize| float(8 + 4 * axis) + float(20) * steps(24 + 6 * point + 2 * axis);
        (0..sent).map(|point| [0, 1, 2].map(|axis| part(point, axis))).collect()
    }

    #[test]
    fn a_scan_is_shown_where_it_was_to_within_a_millimetre() {
        let points = vec![[30.0, -29.9, 0.001], [0.0; 3], [-1.5, 2.5, 30.0]];
        for (shown, [x, y, z]) in shown(points.clone()).iter().zip(points) {
            let off = (Vector3::from(*shown)
                - Vector3::new(7.0 + f64::from(x), 8.0 + f64::from(y), 9.0 + f64::from(z)))
            .amax();
            assert!(off < 1e-3, "{off}");
        }
        assert_eq!(shown(vec![[0.0; 3]]), [[7.0, 8.0, 9.0]]);
        assert_eq!(shown(Vec::new()), [[0.0; 3]; 0]);
        assert_eq!(shown(vec![[1.0; 3]; 20_001]).len(), 6_667);
    }

    #[test]
    fn a_recording_that_was_played_is_over_without_an_explorer() {
        let mut model = Model::default();
        let mut hear = |name: &str| {
            let sample = elk_spatial::samples::named(name).unwrap();
            let key = if name == "Playback" { "PLAYBACK" } else { "MOTION_REPORT" };
            let value = ValueRef::Binary { type_: sample.type_, bytes: &sample.bytes() };
            model.hear(&Heard { key, source: "somebody", time: 1.0, value });
            model.facts.get(&Fact::End).map(|text| serde_json::from_str::<Value>(text).unwrap())
        };
        assert_eq!(hear("MotionReport"), None, "the explorer, if there is one, has not said that it is done");
        let end = hear("Playback").unwrap();
        assert_eq!(
            end["summary"]["playback"]["frames"],
            elk_spatial::samples::named("Playback").unwrap().value()["frames"]
        );
    }
}
