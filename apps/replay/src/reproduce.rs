//! Recorded input through live apps: do they do the same again?
//!
//! The recording says in which order the broker took everything, and so after which outputs each input came. The same
//! order is kept here: an input is played once the live apps have said all that they had said before it. Nothing then
//! depends on how fast anybody is, and apps that are functions of their input give what they gave.
//!
//! What is played: everything recorded that matches the selection, and whatever else a live app has registered for (an
//! explorer answers requests: scans alone make no path). Not what live apps say themselves, and not what tells of
//! processes and the wall's clock ([`VOLATILE_KEYS`]).

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::Duration;

use elk_bus::broker::table::CommunityTable;
use elk_bus::clock::Stopwatch;
use elk_bus::drawing::variables::{DRAWINGS, KEYS};
use elk_bus::pattern::matches;
use elk_bus::{Client, Drive, Mail, any, tell};
use elk_log::diff::VOLATILE_KEYS;
use elk_log::selection::{Position, Window};
use elk_log::{LogReader, Selection};
use elk_mission::{AppSpec, Mission, Program};
use elk_outside::time;

use crate::error::ReplayError;
use crate::live::Live;
use crate::player::origin;
use crate::schedule::{Rate, Schedule, Wait};
use crate::table::table_and;

/// The player's name on the bus.
const NAME: &str = "replay";
/// How long live apps may be silent while an output is waited for; then it is not waited for any more.
const OUTPUT_PATIENCE: Duration = Duration::from_secs(30);
/// How long apps may take to register.
const REGISTER_PATIENCE: Duration = Duration::from_secs(60);
/// How long live apps are silent at the end before they are asked to stop (what is missing then comes only with that),
/// if they were quick, and if they were slow.
const QUIET: [Duration; 2] = [Duration::from_secs(2), Duration::from_secs(12)];
/// How often it is seen whether everyone is alive.
const LOOK: Duration = Duration::from_millis(50);

/// What apps show to persons, and what they keep for their successors: nobody's input as long as an app goes on. How much of it
/// there is depends on an app's type, so it is neither waited for nor missed.
const ASIDE_KEYS: [&str; 4] = [DRAWINGS, KEYS, "*_MEMORY", "*_PAST"];

/// How a recording is to be reproduced.
#[derive(Debug, Clone)]
pub struct ReproduceOptions {
    /// How fast.
    pub rate: Rate,
    /// Which part of the recording.
    pub selection: Selection,
    /// The live apps, by name or element.
    pub only: Vec<String>,
    /// Where the new run's folder is made.
    pub log_dir: PathBuf,
}

/// What a reproduction came to.
#[derive(Debug, Clone, PartialEq)]
pub struct Reproduced {
    /// The new run's folder.
    pub folder: PathBuf,
    /// Inputs played.
    pub played: u64,
    /// What the live apps said: by variable and source.
    pub streams: Vec<StreamCount>,
}

/// How many messages one live app has published on one variable.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct StreamCount {
    /// The variable.
    pub key: String,
    /// The app.
    pub source: String,
    /// Messages in the recording.
    pub recorded: u64,
    /// Messages now.
    pub live: u64,
}

impl StreamCount {
    /// Whether the app has said as often now what others go by.
    pub fn is_complete(&self) -> bool {
        self.live == self.recorded || is_aside(&self.key)
    }
}

/// Plays the inputs of `log` into the apps of `mission` that `options` names, and logs what they say into a new run's
/// folder. `on_progress` is told how far the log has been read (bytes, of bytes).
///
/// # Errors
/// The log cannot be read; an app cannot run, or ends by itself.
pub fn reproduce(
    log: &Path,
    mission: Mission,
    options: &ReproduceOptions,
    on_progress: &mut dyn FnMut(u64, u64),
    stop: &AtomicBool,
) -> Result<Reproduced, ReplayError> {
    let mut reader = LogReader::open(log)?;
    let window = options.selection.window(log)?;
    reader.within(&window);
    let folder = make_folder(&options.log_dir, &mission.file)?;
    let (apps, logger) = select_apps(mission, &options.only, &folder, reader.metadata())?;
    let mut live = Live::new(&apps, &folder)?;
    let mut reproduction = Reproduction::new(live.join(NAME)?, &apps)?;
    if let Some(logger) = &logger {
        live.start(logger)?;
        reproduction.wait_for_registrations(std::slice::from_ref(&logger.name))?;
    }
    apps.iter().try_for_each(|app| live.start(app))?;
    let names: Vec<String> = apps.iter().map(|app| app.name.clone()).collect();
    reproduction.wanted = reproduction.wait_for_registrations(&names)?;
    reproduction.feed(&mut reader, &window, options.rate, &mut live, on_progress, stop)?;
    reproduction.settle(stop)?;
    // As a launcher does it: who commands ends before who obeys, the logger last.
    names.iter().rev().try_for_each(|name| live.stop(name))?;
    reproduction.settle_logger(logger.as_ref())?;
    if let Some(logger) = &logger {
        live.stop(&logger.name)?;
    }
    Ok(Reproduced { folder, played: reproduction.played, streams: reproduction.counts() })
}

fn no_app(app: &str, reason: String) -> ReplayError {
    ReplayError::App { app: app.into(), reason }
}

/// `<logs>/<mission>-replayed`, numbered if there is one.
fn make_folder(logs: &Path, mission: &Path) -> Result<PathBuf, ReplayError> {
    let failed = |source| ReplayError::Folder { folder: logs.into(), source };
    std::fs::create_dir_all(logs).map_err(failed)?;
    let stem = mission.file_stem().unwrap_or_default().to_string_lossy();
    for number in 1.. {
        let suffix = if number == 1 { String::new() } else { format!("-{number}") };
        let folder = logs.join(format!("{stem}-replayed{suffix}"));
        match std::fs::create_dir(&folder) {
            Ok(()) => return Ok(folder),
            Err(error) if error.kind() == std::io::ErrorKind::AlreadyExists => {}
            Err(source) => return Err(failed(source)),
        }
    }
    Err(failed(std::io::ErrorKind::AlreadyExists.into()))
}

/// The live apps, and the logger, told where the new run is kept.
fn select_apps(
    mission: Mission,
    only: &[String],
    folder: &Path,
    recorded: &elk_log::Metadata,
) -> Result<(Vec<AppSpec>, Option<AppSpec>), ReplayError> {
    let is = |app: &AppSpec, name: &str| app.name.eq_ignore_ascii_case(name) || app.element.eq_ignore_ascii_case(name);
    let (loggers, apps): (Vec<AppSpec>, Vec<AppSpec>) =
        mission.apps.into_iter().partition(|app| app.element == "Logger");
    if let Some(name) = only.iter().find(|name| !apps.iter().any(|app| is(app, name))) {
        let known = apps.iter().map(|app| app.name.as_str()).collect::<Vec<_>>().join(", ");
        return Err(ReplayError::NoApp { name: name.clone(), known });
    }
    let mut live: Vec<AppSpec> = apps.into_iter().filter(|app| only.iter().any(|name| is(app, name))).collect();
    let in_folder = |name: &str| folder.join(name).to_string_lossy().into_owned();
    for map in live.iter_mut().filter(|app| app.element == "Map") {
        suppose(map, "File", &in_folder("map.bt"))?;
    }
    let mut logger = loggers.into_iter().next();
    if let Some(logger) = &mut logger {
        let copy = folder.join(mission.file.file_name().unwrap_or_default());
        let kept = std::fs::copy(&mission.file, &copy);
        kept.map_err(|source| ReplayError::Folder { folder: folder.into(), source })?;
        suppose(logger, "File", &in_folder("log.mcap"))?;
        suppose(logger, "MissionFile", &copy.to_string_lossy())?;
        suppose(logger, "Seed", &recorded.seed.to_string())?;
    }
    Ok((live, logger))
}

/// Sets a parameter that the mission left at its default.
fn suppose(app: &mut AppSpec, param: &str, text: &str) -> Result<(), ReplayError> {
    let Program::Builtin(app_type, _) = app.program else {
        return Ok(());
    };
    match app_type.param(param) {
        Some(spec) if app.setting(param) == spec.default => {
            let name = app.name.clone();
            app.set(param, text).map_err(|problems| no_app(&name, problems.to_string()))
        }
        _ => Ok(()),
    }
}

/// A variable and its source.
type Stream = (String, String);

/// A reproduction under way: its client, what that has heard of the live apps, and what the recording heard of them.
struct Reproduction {
    client: Client,
    live: Vec<String>,
    heard: BTreeMap<Stream, u64>,
    recorded: BTreeMap<Stream, u64>,
    /// Streams that have fallen behind the recording for good.
    given_up: Vec<Stream>,
    /// Variables that the live apps read.
    wanted: Vec<String>,
    /// The longest that an output was waited for.
    longest: Duration,
    played: u64,
}

impl Reproduction {
    /// Listens to the live apps before they say anything.
    fn new(mut client: Client, apps: &[AppSpec]) -> Result<Self, ReplayError> {
        for app in apps {
            client.comms.register(any("*").from(&app.name).lossless())?;
        }
        client.comms.flush()?;
        let live = apps.iter().map(|app| app.name.clone()).collect();
        let (heard, recorded) = (BTreeMap::new(), BTreeMap::new());
        let (given_up, wanted) = (Vec::new(), Vec::new());
        Ok(Self { client, live, heard, recorded, given_up, wanted, longest: Duration::ZERO, played: 0 })
    }

    fn table(&mut self) -> Result<CommunityTable, ReplayError> {
        let heard = &mut self.heard;
        table_and(&mut self.client, &mut |mail| {
            note(heard, mail);
        })
    }

    /// Waits until all of `names` have registered; answers the patterns for which they have.
    fn wait_for_registrations(&mut self, names: &[String]) -> Result<Vec<String>, ReplayError> {
        let waited = Stopwatch::start();
        loop {
            let table = self.table()?;
            let of = |name: &String| table.clients.iter().find(|client| client.name == *name);
            let missing = names.iter().find(|name| of(name).is_none_or(|client| client.registrations.is_empty()));
            let Some(missing) = missing else {
                let all = names.iter().filter_map(of).flat_map(|client| &client.registrations);
                return Ok(all.map(|registration| registration.key_pattern.clone()).collect());
            };
            if waited.elapsed() > REGISTER_PATIENCE {
                return Err(ReplayError::NotRegistered { app: missing.clone(), secs: REGISTER_PATIENCE.as_secs() });
            }
            self.listen(Duration::from_millis(5))?;
        }
    }

    /// Hears what the live apps say; whether there was any output. (That they are alive they say for ever.)
    fn listen(&mut self, timeout: Duration) -> Result<bool, ReplayError> {
        let (heard, mut any) = (&mut self.heard, false);
        self.client.receive(timeout, |mail| any |= note(heard, mail))?;
        Ok(any)
    }

    /// Plays the recorded inputs, each after the outputs that came before it.
    fn feed(
        &mut self,
        log: &mut LogReader,
        window: &Window<'_>,
        rate: Rate,
        live: &mut Live,
        on_progress: &mut dyn FnMut(u64, u64),
        stop: &AtomicBool,
    ) -> Result<(), ReplayError> {
        let mut schedule = Schedule::new(rate);
        let clock = Stopwatch::start();
        let mut told = 0;
        while log.advance()? && !stop.load(Ordering::Relaxed) {
            let Some((key, source, time)) = log.head() else {
                break;
            };
            // What elk does not understand no app has registered for.
            if window.position(time) != Position::Within || is_volatile(key) || log.unknown_type().is_some() {
                continue;
            }
            if self.live.iter().any(|name| name == source) {
                *self.recorded.entry((key.into(), source.into())).or_default() += 1;
            } else if is_input(window.selection, &self.wanted, key, source) {
                self.catch_up(live, stop)?;
                while let Wait::For(left) = schedule.wait(clock.elapsed(), time)
                    && !stop.load(Ordering::Relaxed)
                {
                    self.listen(left.min(LOOK))?;
                }
                self.play(log)?;
            }
            let (done, all) = log.progress();
            if done != told {
                told = done;
                on_progress(done, all);
            }
        }
        log.damage().iter().for_each(|reason| tell(format_args!("the log is not whole: {reason}")));
        Ok(())
    }

    fn play(&mut self, log: &mut LogReader) -> Result<(), ReplayError> {
        let Some(record) = log.record() else {
            return Ok(());
        };
        let record = record?;
        // The live apps' time is that of their input, however long they take over it.
        if let Some(time) = time::seconds(record.received) {
            self.client.comms.drive_clock(Drive::standing_at(time))?;
        }
        self.client.comms.publish_value(record.key, record.value, origin(&record))?;
        self.client.comms.flush()?;
        self.played += 1;
        Ok(())
    }

    /// A stream of which less was heard than the recording has so far.
    fn behind(&self) -> Option<&Stream> {
        let lacks = |(stream, recorded): &(&Stream, &u64)| {
            self.heard.get(*stream).copied().unwrap_or_default() < **recorded
                && !is_aside(&stream.0)
                && !self.given_up.contains(stream)
        };
        self.recorded.iter().find(lacks).map(|(stream, _)| stream)
    }

    /// Waits until the live apps have said as much as the recording has by now.
    fn catch_up(&mut self, live: &mut Live, stop: &AtomicBool) -> Result<(), ReplayError> {
        let mut silent = Stopwatch::start();
        while let Some(stream) = self.behind().cloned()
            && !stop.load(Ordering::Relaxed)
        {
            if silent.elapsed() > OUTPUT_PATIENCE {
                let (key, source) = &stream;
                let secs = OUTPUT_PATIENCE.as_secs();
                tell(format_args!("{source} has not said {key} again within {secs} s; it is not waited for any more"));
                self.given_up.push(stream);
            } else if self.listen(LOOK)? {
                self.longest = self.longest.max(silent.elapsed());
                silent = Stopwatch::start();
            } else {
                live.check()?;
            }
        }
        Ok(())
    }

    /// Waits until everything recorded has come, or nothing comes any more.
    fn settle(&mut self, stop: &AtomicBool) -> Result<(), ReplayError> {
        let quiet = (QUIET[0] + 5 * self.longest).min(QUIET[1]);
        let mut silent = Stopwatch::start();
        while self.behind().is_some() && silent.elapsed() < quiet && !stop.load(Ordering::Relaxed) {
            if self.listen(LOOK)? {
                silent = Stopwatch::start();
            }
        }
        Ok(())
    }

    /// Waits until the logger has taken all that was said.
    fn settle_logger(&mut self, logger: Option<&AppSpec>) -> Result<(), ReplayError> {
        let Some(logger) = logger else {
            return Ok(());
        };
        loop {
            let table = self.table()?;
            let waits = table.clients.iter().any(|client| client.name == logger.name && client.waiting_bytes > 0);
            if !waits {
                return Ok(());
            }
            self.listen(Duration::from_millis(5))?;
        }
    }

    fn counts(&self) -> Vec<StreamCount> {
        let mut streams: Vec<&Stream> = self.heard.keys().chain(self.recorded.keys()).collect();
        streams.sort();
        streams.dedup();
        let count = |counts: &BTreeMap<Stream, u64>, stream: &Stream| counts.get(stream).copied().unwrap_or_default();
        let counted = |stream: &Stream| StreamCount {
            key: stream.0.clone(),
            source: stream.1.clone(),
            recorded: count(&self.recorded, stream),
            live: count(&self.heard, stream),
        };
        streams.into_iter().map(counted).collect()
    }
}

/// Counts an output; whether it is one.
fn note(heard: &mut BTreeMap<Stream, u64>, mail: &Mail<'_>) -> bool {
    let output = !is_volatile(mail.key());
    if output {
        *heard.entry((mail.key().into(), mail.source().into())).or_default() += 1;
    }
    output
}

fn is_volatile(key: &str) -> bool {
    VOLATILE_KEYS.iter().any(|pattern| matches(pattern, key))
}

fn is_aside(key: &str) -> bool {
    ASIDE_KEYS.iter().any(|pattern| matches(pattern, key))
}

/// Whether what `source` said on `key` is played.
fn is_input(selection: &Selection, wanted: &[String], key: &str, source: &str) -> bool {
    let excluded = selection.exclude.iter().any(|pattern| matches(pattern, key));
    let asked_for = wanted.iter().any(|pattern| matches(pattern, key));
    !excluded && (asked_for || selection.takes(key, source))
}
