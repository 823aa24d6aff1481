//! A recorded run, into the model: played, held, or gone to any time of it. The state at a time is whole: it is read forward
//! from the last checkpoint before it.

use std::collections::{BTreeMap, BTreeSet};
use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::Duration;

use elk_bus::Payload;
use elk_bus::clock::Stopwatch;
use elk_bus::drawing::{Drawing, KeyTable};
use elk_log::{Index, LogError, LogReader, Record};
use elk_spatial::Scan;
use elk_spatial::messages::CameraPose;
use serde_json::{Value, json};

use crate::model::{Heard, Model, always};
use crate::shared::{Play, Shared};

/// How often what is played goes on.
const STEP_EVERY: Duration = Duration::from_millis(33);
/// Checkpoints that are kept; of more every second one goes, and the next ones are twice as far apart.
const MOST_CHECKPOINTS: usize = 16;
/// Messages between the first checkpoints.
const FIRST_SPACING: u64 = 500;
/// Places of a damaged log that are told apart.
const MOST_DAMAGE: usize = 1_000;

/// When each variable was last said (s), up to where the log was read.
type LastSaid = BTreeMap<String, f64>;

/// A log, where it is, and whole states of before.
pub(crate) struct Recording {
    path: PathBuf,
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
    last_said: LastSaid,
    /// Why not all of the log is there: what its index says, and what was found where it was read.
    damage: Vec<String>,
    /// How much of what the reader has found is among it, and how much of it pages have been told.
    damage_taken: usize,
    damage_told: usize,
    /// The time that is shown (s).
    at: f64,
    play: Play,
}

/// Whole states, each as it was before the first message of its time.
struct Checkpoints {
    states: Vec<Checkpoint>,
    spacing: u64,
    /// Messages since the last one.
    messages: u64,
}

#[derive(Clone)]
struct Checkpoint {
    /// (s)
    time: f64,
    model: Model,
    last_said: LastSaid,
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
            path: path.to_owned(),
            reader: LogReader::open(path)?,
            damage: index.damage(),
            index,
            start,
            end,
            shown,
            watched: BTreeSet::new(),
            checkpoints: Checkpoints { states: Vec::new(), spacing: FIRST_SPACING, messages: 0 },
            read: f64::NEG_INFINITY,
            is_found: false,
            last_said: LastSaid::new(),
            damage_taken: 0,
            damage_told: 0,
            at: start,
            play: Play { playing: true, rate: 1.0, looping: false },
        })
    }

    /// When it begins and ends (s).
    pub fn span(&self) -> (f64, f64) {
        (self.start, self.end)
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
    pub fn play(mut self, shared: &Shared, stop: &AtomicBool) {
        let variables = self.variables();
        shared.change(|model| {
            model.began(self.start);
            model.status(true, "");
            model.variables(&variables);
        });
        let (mut clock, mut told) = (Stopwatch::start(), Value::Null);
        while !stop.load(Ordering::Relaxed) {
            let asked = shared.asked(STEP_EVERY.saturating_sub(clock.elapsed()));
            if let Some(wants) = asked.wants {
                self.watch(wants.values, shared);
            }
            if let Some(play) = asked.play {
                self.play = play;
                if play.playing && self.at >= self.end {
                    self.go_to(self.start, shared);
                }
            }
            // What was recorded has been; nobody hears a key.
            if let Some(time) = asked.seek {
                self.go_to(time, shared);
            }
            let passed = clock.elapsed().as_secs_f64();
            clock = Stopwatch::start();
            if self.play.playing {
                self.go_on(passed * self.play.rate, shared);
            }
            self.tell_damage(shared);
            let Play { playing, rate, looping } = self.play;
            let timeline = json!({
                "type": "timeline", "start": self.start, "end": self.end, "at": self.at, "playing": playing,
                "rate": rate, "looping": looping,
            });
            if timeline != told {
                shared.change(|model| model.timeline(&timeline));
                told = timeline;
            }
        }
    }

    /// Tells pages what has been found to be damaged since they were told last.
    fn tell_damage(&mut self, shared: &Shared) {
        let found = self.reader.damage();
        found.iter().skip(self.damage_taken).for_each(|reason| note(&mut self.damage, reason));
        self.damage_taken = found.len();
        if self.damage.len() > self.damage_told {
            self.damage_told = self.damage.len();
            shared.change(|model| model.damage(&self.damage));
        }
    }

    /// Somebody watches the values of these variables: what they were when they were last said is shown at once.
    fn watch(&mut self, keys: BTreeSet<String>, shared: &Shared) {
        let before = std::mem::replace(&mut self.watched, keys);
        shared.change(|model| model.watch(self.watched.clone()));
        for record in self.watched.difference(&before).filter_map(|key| self.recall(key)) {
            shared.change(|model| model.show(&heard(&record)));
        }
    }

    /// What was last said of a variable, up to where the log was read; `None`: nothing, or it cannot be read.
    fn recall(&self, key: &str) -> Option<Record> {
        let time = *self.last_said.get(key)?;
        let mut reader = LogReader::open(&self.path).ok()?;
        reader.seek(&self.index, time).ok()?;
        let mut last = None;
        while reader.advance().ok()? {
            match reader.head() {
                Some((_, _, received)) if received > time => break,
                Some((said, ..)) if said == key => last = reader.record()?.ok().map(|record| record.to_record()),
                _ => {}
            }
        }
        last
    }

    /// The state before the first message.
    fn beginning(&self) -> Checkpoint {
        let mut model = Model::default();
        model.began(self.start);
        Checkpoint { time: self.start, model, last_said: LastSaid::new() }
    }

    /// Lets so much time pass (s).
    fn go_on(&mut self, secs: f64, shared: &Shared) {
        self.at = (self.at + secs).min(self.end);
        let at = self.at;
        let mut is_changed = false;
        let mut hear = |heard: &Heard<'_>| {
            is_changed = true;
            shared.model().hear(heard);
        };
        self.read_to(at, &mut hear, &mut || shared.model().clone());
        if is_changed {
            shared.tell();
        }
        if shared.model().is_over_at(at) {
            shared.change(|model| model.pass(at));
        }
        if self.at >= self.end {
            match self.play.looping {
                true => self.go_to(self.start, shared),
                false => self.play.playing = false,
            }
        }
    }

    /// Goes to a time (s).
    fn go_to(&mut self, time: f64, shared: &Shared) {
        self.at = time.clamp(self.start, self.end);
        let found = self.checkpoints.before(self.at);
        let Checkpoint { time: from, mut model, last_said } = found.unwrap_or_else(|| self.beginning());
        if let Err(error) = self.reader.seek(&self.index, from) {
            self.play.playing = false;
            return shared.change(|model| model.status(false, &error.to_string()));
        }
        (self.read, self.is_found, self.last_said) = (f64::NEG_INFINITY, false, last_said);
        // Others may have been watched then.
        model.watch(self.watched.clone());
        let (at, variables) = (self.at, self.variables());
        let model = std::cell::RefCell::new(model);
        self.read_to(at, &mut |heard| model.borrow_mut().hear(heard), &mut || model.borrow().clone());
        let mut model = model.into_inner();
        let is_before = |key: &&String| self.last_said.get(*key).is_some_and(|said| *said < from);
        for record in self.watched.iter().filter(is_before).filter_map(|key| self.recall(key)) {
            model.show(&heard(&record));
        }
        model.pass(at);
        shared.change(|shown| {
            shown.replace_by(model);
            shown.status(true, "");
            shown.variables(&variables);
            shown.damage(&self.damage);
        });
    }

    /// Reads what was recorded up to `time` (s); `state` is the whole state so far.
    fn read_to(&mut self, time: f64, hear: &mut dyn FnMut(&Heard<'_>), state: &mut dyn FnMut() -> Model) {
        while self.find() {
            let Some((key, _, received)) = self.reader.head().filter(|(.., received)| *received <= time) else {
                return;
            };
            let is_shown = self.shown.contains(key) || self.watched.contains(key);
            if is_shown && received > self.read {
                self.checkpoints.offer(received, &self.last_said, state);
                self.read = received;
            }
            match self.last_said.get_mut(key) {
                Some(said) => *said = received,
                None => {
                    self.last_said.insert(key.to_owned(), received);
                }
            }
            self.is_found = false;
            if !is_shown {
                continue;
            }
            match self.reader.record() {
                Some(Ok(record)) => {
                    let (key, source, value) = (record.key, record.source, record.value);
                    hear(&Heard { key, source, time: received, value });
                }
                Some(Err(error)) => note(&mut self.damage, &error.to_string()),
                None => {}
            }
        }
    }

    /// Finds the next message, if the reader does not stand at one; whether there is one.
    fn find(&mut self) -> bool {
        while !self.is_found {
            match self.reader.advance() {
                Ok(true) => self.is_found = true,
                Ok(false) => return false,
                // The reader has noted it, and goes on with the next file.
                Err(_) => {}
            }
        }
        true
    }
}

/// Notes what is damaged, once: a place is found again whenever it is read again.
fn note(damage: &mut Vec<String>, reason: &str) {
    if damage.len() < MOST_DAMAGE && !damage.iter().any(|known| known == reason) {
        damage.push(reason.to_owned());
    }
}

/// What was recorded, as the model hears it.
fn heard(record: &Record) -> Heard<'_> {
    let Record { key, source, received, value, .. } = record;
    Heard { key, source, time: *received, value: value.as_ref() }
}

impl Checkpoints {
    /// Keeps the state before the first message of `time` (s), if the last one is far enough behind.
    fn offer(&mut self, time: f64, last_said: &LastSaid, state: &mut dyn FnMut() -> Model) {
        self.messages += 1;
        let is_new = self.states.last().is_none_or(|last| time > last.time);
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
        self.states.push(Checkpoint { time, model: state(), last_said: last_said.clone() });
    }

    /// The last state before or at `time` (s).
    fn before(&mut self, time: f64) -> Option<Checkpoint> {
        self.messages = 0;
        self.states.iter().rfind(|state| state.time <= time).cloned()
    }
}
