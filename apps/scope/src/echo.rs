//! `elk echo`: every message.
//!
//! It reads as fast as it can and shows as much as it may: on a terminal at most [`LINES_PER_SECOND`], which is more
//! than anybody reads; elsewhere as much as whoever reads its output takes. What is too much for that waits in a mailbox
//! like everybody's, which forgets its oldest mail; what was not shown is counted and said.

use std::sync::atomic::{AtomicBool, Ordering};
use std::time::Duration;

use elk_bus::Mail;
use elk_bus::clock::Stopwatch;
use elk_outside::text::name;
use serde::Serialize;
use serde_json::{Value, json};

use crate::error::ScopeError;
use crate::output::Output;
use crate::pattern::Pattern;
use crate::session::{LOOK_EVERY, Scope, unknown_variable};
use crate::show;

/// Lines that a terminal is given in a second.
pub const LINES_PER_SECOND: u64 = 1000;

/// What to show of all that is said.
#[derive(Debug, Clone)]
pub struct Echo {
    /// The variables.
    pub patterns: Vec<Pattern>,
    /// The sources.
    pub source: Pattern,
    /// Begin with the latest value of each variable, which was said before.
    pub latest: bool,
    /// End after so many messages.
    pub count: Option<u64>,
    /// Write JSON, an object a line.
    pub json: bool,
}

impl Echo {
    /// Variables that are named and that nobody has written so far: they may come, and may be misspelt.
    pub fn unwritten(&self, scope: &mut Scope) -> Result<Vec<ScopeError>, ScopeError> {
        unwritten(&self.patterns, scope)
    }

    /// Shows messages until enough have come, or `stop` is set.
    pub fn run(&self, scope: &mut Scope, output: &mut Output<'_>, stop: &AtomicBool) -> Result<(), ScopeError> {
        let started = scope.table()?.started;
        scope.register(&self.patterns, &self.source)?;
        let (quota, since_told) = (Quota::start(), Stopwatch::start());
        let mut writer = Writer { echo: self, started, output, shown: 0, skipped: 0, told: 0, since_told, quota };
        while !stop.load(Ordering::Relaxed) && !writer.is_done() {
            let mut written = Ok(());
            scope.receive(LOOK_EVERY, |mail| {
                if written.is_ok() {
                    written = writer.take(mail);
                }
            })?;
            written?;
            // A person is told once a second, not after every batch.
            if !writer.output.is_terminal() || writer.since_told.elapsed() >= Duration::from_secs(1) {
                writer.say_what_was_missed(scope.missed())?;
            }
            writer.output.flush()?;
        }
        writer.say_what_was_missed(scope.missed())?;
        writer.output.flush()
    }
}

pub(crate) fn unwritten(patterns: &[Pattern], scope: &mut Scope) -> Result<Vec<ScopeError>, ScopeError> {
    let table = scope.table()?;
    let written = |name: &str| table.variables.iter().any(|variable| variable.name == name);
    let missing = patterns.iter().filter_map(Pattern::literal).filter(|name| !written(name));
    Ok(missing.map(|name| unknown_variable(&table, name)).collect())
}

/// How many lines may still be written in this second.
struct Quota {
    second: Stopwatch,
    used: u64,
}

impl Quota {
    fn start() -> Self {
        Self { second: Stopwatch::start(), used: 0 }
    }

    /// Whether there is one line more; the clock is only read when there is none.
    fn take(&mut self) -> bool {
        if self.used == LINES_PER_SECOND && self.second.elapsed() >= Duration::from_secs(1) {
            *self = Self::start();
        }
        let left = self.used < LINES_PER_SECOND;
        self.used += u64::from(left);
        left
    }
}

struct Writer<'a, 'b> {
    echo: &'a Echo,
    /// When the broker started: people are shown times since then, and times before it, of a recording, as they are.
    started: f64,
    output: &'a mut Output<'b>,
    shown: u64,
    /// Messages that came and were not shown.
    skipped: u64,
    /// Messages missed, as far as they have been told of.
    told: u64,
    since_told: Stopwatch,
    quota: Quota,
}

/// A message as programs read it.
#[derive(Serialize)]
struct Line<'a> {
    time: f64,
    key: &'a str,
    source: &'a str,
    sequence: u64,
    #[serde(skip_serializing_if = "std::ops::Not::not")]
    latest: bool,
    #[serde(rename = "type")]
    type_name: &'a str,
    value: Value,
}

impl Writer<'_, '_> {
    fn is_done(&self) -> bool {
        self.echo.count.is_some_and(|count| self.shown >= count)
    }

    fn take(&mut self, mail: &Mail<'_>) -> Result<(), ScopeError> {
        if self.is_done() || (mail.is_latest() && !self.echo.latest) {
            return Ok(());
        }
        if self.output.is_terminal() && !self.quota.take() {
            self.skipped += 1;
            return Ok(());
        }
        self.shown += 1;
        match self.echo.json {
            true => self.for_programs(mail),
            false => self.output.line(&self.for_people(mail)),
        }
    }

    fn for_people(&self, mail: &Mail<'_>) -> String {
        let since = mail.time() - if mail.time() >= self.started { self.started } else { 0.0 };
        let (key, source, value) = (name(mail.key()), name(mail.source()), show::value_for_people(mail.value()));
        format!("{since:.6}  {key:<16} {source:<12} {value}")
    }

    fn for_programs(&mut self, mail: &Mail<'_>) -> Result<(), ScopeError> {
        let value = mail.value();
        self.output.json(&Line {
            time: mail.time(),
            key: mail.key(),
            source: mail.source(),
            sequence: mail.sequence(),
            latest: mail.is_latest(),
            type_name: show::type_name(&value),
            value: show::value_for_programs(value),
        })
    }

    fn say_what_was_missed(&mut self, dropped: u64) -> Result<(), ScopeError> {
        self.since_told = Stopwatch::start();
        let missed = dropped + self.skipped;
        // A broker that was started anew counts from zero.
        let since = missed.saturating_sub(std::mem::replace(&mut self.told, missed));
        match self.echo.json {
            _ if since == 0 => Ok(()),
            true => self.output.json(&json!({"missed": since})),
            false => self.output.line(&format!("… {since} messages missed")),
        }
    }
}
