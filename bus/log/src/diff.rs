//! Two logs, message by message.
//!
//! Messages are compared within a stream: all that one source said on one variable, in its order. How streams lie
//! between each other is decided by the processes' scheduling, and so is every time; neither is compared. What else
//! differs by nature from run to run is in [`VOLATILE_FIELDS`] and [`VOLATILE_KEYS`], and nowhere else.

use std::collections::{BTreeMap, VecDeque};
use std::path::Path;

use elk_bus::{Value, ValueRef};
use serde_json::Value as Json;

use crate::error::LogError;
use crate::reader::LogReader;
use crate::record::Record;
use crate::selection::{Position, Selection, Window};

/// Fields that hold measured times of the processor, wherever they are: not even the same program on the same machine
/// takes the same time twice.
pub const VOLATILE_FIELDS: [&str; 1] = ["cpu_secs"];

/// Variables that tell of processes and of the wall's clock: the broker's own tables, what apps say of themselves, and
/// what was asked for from outside.
pub const VOLATILE_KEYS: [&str; 2] = ["DB_*", "*_STATUS"];

/// Messages that wait for their counterpart in the other log take at most so much memory (bytes).
const MAX_WAITING_BYTES: usize = 512 << 20;

/// What is compared.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct DiffOptions {
    /// The part of both logs.
    pub selection: Selection,
    /// Compare volatile fields and variables as well.
    pub exact: bool,
}

/// How two logs compare.
#[derive(Debug, Clone, PartialEq)]
pub struct Diff {
    /// Messages that are the same.
    pub same: u64,
    /// The first difference of each stream that has one, in the order of their times.
    pub differences: Vec<Difference>,
    /// Damage of either log, in words: what it hid was not compared.
    pub damage: Vec<String>,
}

/// The first message of a stream in which two logs differ.
#[derive(Debug, Clone, PartialEq)]
pub struct Difference {
    /// The variable.
    pub key: String,
    /// Who published it.
    pub source: String,
    /// Number of the message in its stream, from 0.
    pub number: u64,
    /// The message in the first log; none: it ends before.
    pub first: Option<Record>,
    /// The message in the second log; none: it ends before.
    pub second: Option<Record>,
    /// Where in the value they differ, where that can be said.
    pub divergence: Option<Divergence>,
}

/// Where two values differ.
#[derive(Debug, Clone, PartialEq)]
pub struct Divergence {
    /// The way there: `decision.Go.points[3][0]`.
    pub path: String,
    /// What is there in the first value.
    pub first: Json,
    /// What is there in the second.
    pub second: Json,
}

impl Difference {
    /// When the message was published (s), in the log that has it.
    pub fn time(&self) -> f64 {
        self.first.as_ref().or(self.second.as_ref()).map_or(0.0, |record| record.time)
    }
}

/// How far both logs are.
struct Sides {
    /// Which are read on.
    reading: [bool; 2],
    /// Bytes of all messages that wait for their counterpart.
    waiting: usize,
}

/// One source's messages on one variable.
#[derive(Default)]
struct Stream {
    /// Messages that one log has and the other has not come to yet.
    ahead: [VecDeque<Record>; 2],
    compared: u64,
    /// Whether a difference was found: the rest does not count.
    over: bool,
}

/// Compares two logs, files or runs' folders.
///
/// # Errors
/// Either cannot be read.
pub fn diff(first: &Path, second: &Path, options: &DiffOptions) -> Result<Diff, LogError> {
    let mut logs = [LogReader::open(first)?, LogReader::open(second)?];
    let windows = [options.selection.window(first)?, options.selection.window(second)?];
    logs.iter_mut().zip(&windows).for_each(|(log, window)| log.within(window));
    let mut streams: BTreeMap<(String, String), Stream> = BTreeMap::new();
    let mut diff = Diff { same: 0, differences: Vec::new(), damage: Vec::new() };
    let mut sides = Sides { reading: [true; 2], waiting: 0 };
    // In turns: what waits for its counterpart stays little if the logs are alike.
    for side in [0, 1].into_iter().cycle() {
        if sides.reading == [false; 2] {
            break;
        }
        let next = if sides.reading[side] { next_of(&mut logs[side], &windows[side], options)? } else { None };
        let Some(record) = next else {
            sides.reading[side] = false;
            continue;
        };
        let stream = streams.entry((record.key.clone(), record.source.clone())).or_default();
        stream.take(side, record, &mut sides, options.exact, &mut diff);
        if sides.waiting > MAX_WAITING_BYTES {
            return Err(LogError::TooDifferent { first: first.into(), second: second.into(), most: MAX_WAITING_BYTES });
        }
    }
    for (_, mut stream) in streams {
        stream.end(&mut sides, &mut diff);
    }
    diff.differences.sort_by(|one, other| one.time().total_cmp(&other.time()));
    diff.damage = logs.iter().flat_map(LogReader::damage).collect();
    Ok(diff)
}

/// The next record that counts.
fn next_of(log: &mut LogReader, window: &Window<'_>, options: &DiffOptions) -> Result<Option<Record>, LogError> {
    while let Some(next) = log.next_ref() {
        let record = next?;
        if window.position(record.received) == Position::Within
            && options.selection.takes(record.key, record.source)
            && (options.exact || !is_volatile(record.key))
        {
            return Ok(Some(record.to_record()));
        }
    }
    Ok(None)
}

fn is_volatile(key: &str) -> bool {
    VOLATILE_KEYS.iter().any(|pattern| elk_bus::pattern::matches(pattern, key))
}

impl Stream {
    /// Takes a message of one log, and compares it if the other's is there.
    fn take(&mut self, side: usize, record: Record, sides: &mut Sides, exact: bool, diff: &mut Diff) {
        if self.over {
            return;
        }
        let Some(other) = self.ahead[1 - side].pop_front() else {
            sides.waiting += weight(&record);
            self.ahead[side].push_back(record);
            if !sides.reading[1 - side] {
                self.end(sides, diff);
            }
            return;
        };
        sides.waiting -= weight(&other);
        let (first, second) = if side == 0 { (record, other) } else { (other, record) };
        match compare(&first.value, &second.value, exact) {
            Comparison::Same => {
                diff.same += 1;
                self.compared += 1;
            }
            Comparison::Different(divergence) => self.differ(Some(first), Some(second), divergence, sides, diff),
        }
    }

    /// One log is over: what is left of the other has no counterpart.
    fn end(&mut self, sides: &mut Sides, diff: &mut Diff) {
        let [first, second] = self.ahead.each_mut().map(VecDeque::pop_front);
        sides.waiting -= first.iter().chain(&second).map(weight).sum::<usize>();
        if !self.over && (first.is_some() || second.is_some()) {
            self.differ(first, second, None, sides, diff);
        }
    }

    fn differ(
        &mut self,
        first: Option<Record>,
        second: Option<Record>,
        divergence: Option<Divergence>,
        sides: &mut Sides,
        diff: &mut Diff,
    ) {
        self.over = true;
        sides.waiting -= std::mem::take(&mut self.ahead).iter().flatten().map(weight).sum::<usize>();
        if let Some(Record { key, source, .. }) = first.as_ref().or(second.as_ref()) {
            let (key, source, number) = (key.clone(), source.clone(), self.compared);
            diff.differences.push(Difference { key, source, number, first, second, divergence });
        }
    }
}

/// What a record takes of memory (bytes), about.
fn weight(record: &Record) -> usize {
    let value = match &record.value {
        Value::Double(_) => 0,
        Value::Text(text) => text.len(),
        Value::Binary { type_, bytes } => type_.as_ref().name().len() + bytes.len(),
    };
    size_of::<Record>()
        + record.key.len()
        + record.source.len()
        + record.source_aux.len()
        + record.community.len()
        + value
}

enum Comparison {
    Same,
    /// Where, if that can be said.
    Different(Option<Divergence>),
}

fn compare(first: &Value, second: &Value, exact: bool) -> Comparison {
    let alike = match (first, second) {
        (Value::Double(first), Value::Double(second)) => first.to_bits() == second.to_bits(),
        _ => first == second,
    };
    if alike {
        return Comparison::Same;
    }
    let (Some(mut one), Some(mut other)) = (json(first.as_ref()), json(second.as_ref())) else {
        return Comparison::Different(None);
    };
    let volatile = !exact && forget_volatile(&mut one) && forget_volatile(&mut other);
    match divergence(String::new(), &one, &other) {
        None if volatile => Comparison::Same,
        divergence => Comparison::Different(divergence),
    }
}

fn json(value: ValueRef<'_>) -> Option<Json> {
    value.to_json(usize::MAX).ok()
}

/// Removes volatile fields; whether there were any.
fn forget_volatile(json: &mut Json) -> bool {
    match json {
        Json::Object(fields) => {
            let before = fields.len();
            fields.retain(|name, _| !VOLATILE_FIELDS.contains(&name.as_str()));
            let here = before != fields.len();
            fields.values_mut().map(forget_volatile).fold(here, |any, one| any | one)
        }
        Json::Array(entries) => entries.iter_mut().map(forget_volatile).fold(false, |any, one| any | one),
        _ => false,
    }
}

/// The first place in which two values differ.
fn divergence(path: String, first: &Json, second: &Json) -> Option<Divergence> {
    match (first, second) {
        (Json::Object(one), Json::Object(other)) if one.keys().eq(other.keys()) => {
            let dot = if path.is_empty() { "" } else { "." };
            one.iter().find_map(|(name, field)| divergence(format!("{path}{dot}{name}"), field, other.get(name)?))
        }
        (Json::Array(one), Json::Array(other)) if one.len() == other.len() => {
            let mut pairs = one.iter().zip(other).enumerate();
            pairs.find_map(|(number, (first, second))| divergence(format!("{path}[{number}]"), first, second))
        }
        _ if first == second => None,
        _ => Some(Divergence { path, first: first.clone(), second: second.clone() }),
    }
}
