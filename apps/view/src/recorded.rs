//! A recorded run, into the model: played, held, or gone to any time of it. The state at a time is whole: it is read forward
//! from the last checkpoint before it.

use std::collections::BTreeSet;
use std::path::Path;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::mpsc::{Receiver, RecvTimeoutError};
use std::time::Duration;

use elk_bus::Payload;
use elk_bus::clock::Stopwatch;
use elk_bus::drawing::{Drawing, KeyTable};
use elk_log::{Index, LogError, LogReader};
use elk_spatial::Scan;
use elk_spatial::messages::CameraPose;
use serde_json::{Value, json};

use crate::model::{Heard, Model, always};
use crate::shared::{Command, Shared};

/// How often what is played goes on.
const STEP_EVERY: Duration = Duration::from_millis(33);
/// Checkpoints that are kept; of more every second one goes, and the next ones are twice as far apart.
const MOST_CHECKPOINTS: usize = 16;
/// Messages between the first checkpoints.
const FIRST_SPACING: u64 = 500;

/// A log, where it is, and whole states of before.
pub(crate) struct Recording {
    reader: LogReader,
    index: Index,
    start: f64,
    end: f64,
    /// Variables that pages draw.
    shown: BTreeSet<String>,
    /// Variables whose values somebody watches.
    watched: BTreeSet<String>,
    checkpoints: Checkpoints,
    /// When the last message that was read was recorded (s).
    read: f64,
    /// Whether the reader stands at a message that was not read.
    is_found: bool,
    /// What could not be read, until pages were told.
    damage: Vec<String>,
    /// The time that is shown (s).
    at: f64,
    playing: bool,
    rate: f64,
    looping: bool,
}

/// Whole states, each as it was before the first message of its time.
struct Checkpoints {
    states: Vec<(f64, Model)>,
    spacing: u64,
    /// Messages since the last one.
    messages: u64,
}

impl Recording {
    /// Opens the log at `path`: a run's folder, or a file.
    pub fn open(path: &Path) -> Result<Self, LogError> {
        let index = Index::read(path, &mut |_, _| {})?;
        let (start, end) = index.span().unwrap_or_default();
        let types = [CameraPose::NAME, <Scan<'_> as Payload>::NAME, Drawing::NAME, KeyTable::NAME];
        let is_drawn = |name: &str| types.contains(&name);
        let drawn = index.topics().into_iter().filter(|topic| is_drawn(&topic.type_name)).map(|topic| topic.name);
        let shown = always().into_iter().chain(drawn).collect();
        Ok(Self {
            reader: LogReader::open(path)?,
            index,
            start,
            end,
            shown,
            watched: BTreeSet::new(),
            checkpoints: Checkpoints { states: Vec::new(), spacing: FIRST_SPACING, messages: 0 },
            read: f64::NEG_INFINITY,
            is_found: false,
            damage: Vec::new(),
            at: start,
            playing: true,
            rate: 1.0,
            looping: false,
        })
    }

    /// When it begins and ends (s).
    pub fn span(&self) -> (f64, f64) {
        (self.start, self.end)
    }

    /// Why not all of it is there, in words; `None`: it is whole, as far as its index says.
    pub fn damage(&self) -> Option<String> {
        let damage = self.index.damage();
        let first = damage.first()?;
        let others = if damage.len() > 1 { format!(", and {} places more", damage.len() - 1) } else { String::new() };
        Some(format!("the log is not whole: {first}{others}; what is there is shown"))
    }

    /// Its variables, as the page lists them.
    pub fn variables(&self) -> Value {
        let secs = (self.end - self.start).max(1e-3);
        let rows: Vec<Value> = self
            .index
            .topics()
            .iter()
            .map(|topic| {
                let rate = topic.count as f64 / secs;
                json!({
                    "key": topic.name, "type": topic.type_name, "writer": topic.source, "age": null, "rate": rate,
                    "bytes": null, "count": topic.count, "readers": null,
                })
            })
            .collect();
        json!({"type": "variables", "rows": rows, "left_out": 0})
    }

    /// Plays until `stop` is set, as pages say.
    pub fn play(mut self, shared: &Shared, commands: &Receiver<Command>, stop: &AtomicBool) {
        let variables = self.variables();
        shared.change(|model| {
            model.began(self.start);
            model.status(true, "");
            model.variables(&variables);
        });
        let (mut clock, mut told) = (Stopwatch::start(), Value::Null);
        while !stop.load(Ordering::Relaxed) {
            match commands.recv_timeout(STEP_EVERY) {
                Ok(Command::Want(wants)) => {
                    self.watched.clone_from(&wants.values);
                    shared.change(|model| model.watch(wants.values));
                }
                Ok(Command::Play { playing, rate, looping }) => {
                    (self.playing, self.rate, self.looping) = (playing, rate, looping);
                    if playing && self.at >= self.end {
                        self.go_to(self.start, shared);
                    }
                }
                Ok(Command::Seek(time)) => self.go_to(time, shared),
                // What was recorded has been; nobody hears a key.
                Ok(Command::Press(_)) => {}
                Err(RecvTimeoutError::Timeout) => {}
                Err(RecvTimeoutError::Disconnected) => return,
            }
            let passed = clock.elapsed().as_secs_f64();
            clock = Stopwatch::start();
            if self.playing {
                self.go_on(passed * self.rate, shared);
            }
            let timeline = json!({
                "type": "timeline", "start": self.start, "end": self.end, "at": self.at, "playing": self.playing,
                "rate": self.rate, "looping": self.looping,
            });
            let (at, damage) = (self.at, std::mem::take(&mut self.damage));
            if timeline != told || !damage.is_empty() {
                shared.change(|model| {
                    model.timeline(&timeline);
                    damage.into_iter().for_each(|what| model.note(at, format!("the log is not whole: {what}")));
                });
                told = timeline;
            }
        }
    }

    /// The state before the first message.
    fn beginning(&self) -> Model {
        let mut model = Model::default();
        model.began(self.start);
        model
    }

    /// Lets so much time pass (s).
    fn go_on(&mut self, secs: f64, shared: &Shared) {
        self.at = (self.at + secs).min(self.end);
        let at = self.at;
        self.read_to(at, &mut |heard| shared.change(|model| model.hear(heard)), &mut || shared.model().clone());
        if shared.model().is_over_at(at) {
            shared.change(|model| model.pass(at));
        }
        if self.at >= self.end {
            match self.looping {
                true => self.go_to(self.start, shared),
                false => self.playing = false,
            }
        }
    }

    /// Goes to a time (s).
    fn go_to(&mut self, time: f64, shared: &Shared) {
        self.at = time.clamp(self.start, self.end);
        let (from, model) = self.checkpoints.before(self.at).unwrap_or_else(|| (self.start, self.beginning()));
        if let Err(error) = self.reader.seek(&self.index, from) {
            self.playing = false;
            return shared.change(|model| model.status(false, &error.to_string()));
        }
        (self.read, self.is_found) = (f64::NEG_INFINITY, false);
        let (at, variables) = (self.at, self.variables());
        let model = std::cell::RefCell::new(model);
        self.read_to(at, &mut |heard| model.borrow_mut().hear(heard), &mut || model.borrow().clone());
        let mut model = model.into_inner();
        model.pass(at);
        shared.change(|shown| {
            shown.replace_by(model);
            shown.status(true, "");
            shown.variables(&variables);
        });
    }

    /// Reads what was recorded up to `time` (s); `state` is the whole state so far.
    fn read_to(&mut self, time: f64, hear: &mut dyn FnMut(&Heard<'_>), state: &mut dyn FnMut() -> Model) {
        while let Some(received) = self.next() {
            if received > time {
                return;
            }
            if received > self.read {
                self.checkpoints.offer(received, state);
            }
            (self.read, self.is_found) = (received, false);
            match self.reader.record() {
                Some(Ok(record)) => {
                    let (key, source, value) = (record.key, record.source, record.value);
                    hear(&Heard { key, source, time: received, value });
                }
                Some(Err(error)) => self.damage.push(error.to_string()),
                None => {}
            }
        }
    }

    /// When the next message was recorded that pages can show (s).
    fn next(&mut self) -> Option<f64> {
        loop {
            if !self.is_found {
                match self.reader.advance() {
                    Ok(true) => {}
                    Ok(false) => return None,
                    Err(error) => {
                        self.damage.push(error.to_string());
                        continue;
                    }
                }
            }
            self.is_found = true;
            let (key, _, received) = self.reader.head()?;
            if self.shown.contains(key) || self.watched.contains(key) {
                return Some(received);
            }
            self.is_found = false;
        }
    }
}

impl Checkpoints {
    /// Keeps the state before the first message of `time` (s), if the last one is far enough behind.
    fn offer(&mut self, time: f64, state: &mut dyn FnMut() -> Model) {
        self.messages += 1;
        let is_new = self.states.last().is_none_or(|(last, _)| time > *last);
        if self.messages < self.spacing || !is_new {
            return;
        }
        self.messages = 0;
        if self.states.len() == MOST_CHECKPOINTS {
            let mut number = 0;
            self.states.retain(|_| {
                number += 1;
                number % 2 == 0
            });
            self.spacing *= 2;
        }
        self.states.push((time, state()));
    }

    /// The last state before or at `time` (s).
    fn before(&mut self, time: f64) -> Option<(f64, Model)> {
        self.messages = 0;
        self.states.iter().rfind(|(at, _)| *at <= time).cloned()
    }
}
