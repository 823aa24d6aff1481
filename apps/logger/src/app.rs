//! The logger on the bus.

use std::path::Path;
use std::time::Duration;

use elk_bus::clock::{Clock, Stopwatch};
use elk_bus::{AppError, Comms, Handled, Handlers, Mail, any, tell};
use elk_log::{Compression, LogError, LogOptions, Metadata, Reception};
use elk_mission::variables::LOGGER_ERROR;
use elk_mission::{AppType, Kind, Mission, ParamSpec, Params};
use elk_outside::checksum::fnv1a_of_file;
use elk_outside::file;

use crate::recorder::Recorder;

/// The logger, as mission files know it.
pub static TYPES: &[AppType] = &[AppType {
    element: "Logger",
    name: "Mcap",
    summary: "Records every message of the community, from the first one on, into an MCAP file.",
    params: PARAMS,
    build: |params| Ok(Box::new(Logger::new(params)?.on_the_bus())),
    preflight: None,
}];

const PARAMS: &[ParamSpec] = &[
    ParamSpec {
        name: "File",
        kind: Kind::Text,
        default: Some("log.mcap"),
        doc: "The log to write; the launcher puts it into the run's folder.",
    },
    ParamSpec {
        name: "MissionFile",
        kind: Kind::Text,
        default: Some(""),
        doc: "The mission file to attach to the log; the launcher gives the one that it runs.",
    },
    ParamSpec {
        name: "EffectiveMission",
        kind: Kind::Text,
        default: Some(""),
        doc: "The mission as it ran, defaults and command line included, to note in the log; the launcher gives it.",
    },
    ParamSpec {
        name: "Run",
        kind: Kind::Text,
        default: Some(""),
        doc: "What the run was made of (run.json), to note in the log; the launcher gives it.",
    },
    ParamSpec {
        name: "Seed",
        kind: Kind::Integer { min: 0, max: i64::MAX },
        default: Some("0"),
        doc: "The run's seed, noted in the log; the launcher gives the mission's.",
    },
    ParamSpec {
        name: "Flush",
        kind: Kind::Number { unit: "s", min: 0.0, max: 1.0 },
        default: Some("1.0"),
        doc: "The longest time for which a message may be in memory only.",
    },
    ParamSpec {
        name: "Sync",
        kind: Kind::Number { unit: "s", min: 0.0, max: 3600.0 },
        default: Some("0"),
        doc: "How often a flush waits for the disk itself (fdatasync), so that the log survives the machine; 0: only at \
              the end.",
    },
    ParamSpec {
        name: "Compression",
        kind: Kind::Choice(&["none", "lz4", "zstd"]),
        default: Some("zstd"),
        doc: "How the log is compressed: not at all (none), a little (lz4), to about a third of its size (zstd).",
    },
    ParamSpec {
        name: "RotateSize",
        kind: Kind::Number { unit: "MB", min: 0.0, max: 1e9 },
        default: Some("0"),
        doc: "Size at which the log goes on in the next file (log.1.mcap, …); 0: never.",
    },
    ParamSpec {
        name: "RotateTime",
        kind: Kind::Number { unit: "s", min: 0.0, max: 1e9 },
        default: Some("0"),
        doc: "Time after which the log goes on in the next file; 0: never.",
    },
    ParamSpec {
        name: "World",
        kind: Kind::Text,
        default: Some(""),
        doc: "The world of a simulated run, noted in the log with its checksum; the launcher gives the sensor's.",
    },
];

/// How often it is seen whether a flush is due.
const LOOK_EVERY: Duration = Duration::from_millis(250);
/// How long mail gathers: who logs is in no hurry, and wakes up less often than messages come.
const GATHERING: Duration = Duration::from_millis(5);

/// Records all mail. Trouble with the disk is said at once, on the terminal and on the bus, and stops nobody.
pub struct Logger {
    recorder: Recorder,
    /// Patterns of the variables to record.
    keys: Vec<String>,
    flush_secs: f64,
    since_flush: Stopwatch,
    reception: Reception,
    /// Messages that this app has missed, as far as the log says so.
    dropped: u64,
    trouble: Option<String>,
    refused: bool,
}

impl Logger {
    /// The logger that `params` describe; fails if the mission file cannot be read.
    pub fn new(params: &Params) -> Result<Self, AppError> {
        let recorder = Recorder::new(params.text("File").into(), metadata(params)?).with_options(options(params));
        let recorder = recorder.with_sync(positive(params.number("Sync")));
        Ok(Self { flush_secs: params.number("Flush"), ..Self::of(recorder, vec!["*".into()]) })
    }

    /// A logger of the variables that match any of `keys`, into `recorder`.
    pub fn of(recorder: Recorder, keys: Vec<String>) -> Self {
        Self {
            recorder,
            keys,
            reception: Reception::begun(f64::NEG_INFINITY),
            dropped: 0,
            flush_secs: 1.0,
            since_flush: Stopwatch::start(),
            trouble: None,
            refused: false,
        }
    }

    /// Messages that came so far.
    pub fn messages(&self) -> u64 {
        self.reception.messages()
    }

    /// Flushes after half the time allowed: the next chance may come as late as that.
    fn flush_if_due(&mut self, comms: &mut Comms) -> Result<(), AppError> {
        match self.since_flush.elapsed().as_secs_f64() < self.flush_secs / 2.0 {
            true => Ok(()),
            false => self.flush(comms),
        }
    }

    /// Flushes, and says what changed: that there is trouble, or that it is over.
    fn flush(&mut self, comms: &mut Comms) -> Result<(), AppError> {
        self.since_flush = Stopwatch::start();
        let now = self.recorder.flush().err().map(|error| error.to_string());
        let before = std::mem::replace(&mut self.trouble, now);
        match (&self.trouble, before) {
            (Some(_), Some(_)) | (None, None) => return Ok(()),
            (Some(trouble), None) => tell(format_args!("{trouble}. The mission goes on, the logger tries again.")),
            (None, Some(_)) => {
                tell(format_args!("the log is written again; {} messages are missing", self.recorder.lost()))
            }
        }
        comms.notify(LOGGER_ERROR, self.trouble.as_deref().unwrap_or_default())?;
        Ok(())
    }

    /// Notes in the log what this app has missed since it last did.
    fn note_drops(&mut self, comms: &mut Comms) -> Result<(), AppError> {
        let newly = comms.dropped() - self.dropped;
        self.dropped += newly;
        if newly > 0
            && let Err(error) = self.recorder.note_dropped(newly, comms.time())
        {
            self.complain(&error, comms)?;
        }
        Ok(())
    }

    /// Says that messages are refused, once: how many there were is said at the end.
    fn complain(&mut self, error: &LogError, comms: &mut Comms) -> Result<(), AppError> {
        if !std::mem::replace(&mut self.refused, true) {
            tell(error);
            comms.notify(LOGGER_ERROR, error.to_string())?;
        }
        Ok(())
    }
}

impl Logger {
    /// The logger as an app.
    pub fn on_the_bus(self) -> Handled<Self> {
        let table = Handlers::<Self>::new()
            .on_start_up(Self::begin)
            .iterate(LOOK_EVERY, Self::look)
            .gathering(GATHERING)
            .on_stop(Self::finish);
        self.keys.iter().fold(table, |table, key| table.on(any(key).lossless(), Self::record)).with(self)
    }

    fn begin(&mut self, comms: &mut Comms) -> Result<(), AppError> {
        self.reception = Reception::begun(comms.time());
        self.flush(comms)
    }

    fn record(&mut self, comms: &mut Comms, mail: Mail<'_>) -> Result<(), AppError> {
        self.note_drops(comms)?;
        let record = self.reception.record(&mail, comms.epoch(), comms.time());
        if let Err(error) = self.recorder.record(&record) {
            self.complain(&error, comms)?;
        }
        self.flush_if_due(comms)
    }

    fn look(&mut self, comms: &mut Comms) -> Result<(), AppError> {
        self.note_drops(comms)?;
        self.flush_if_due(comms)
    }

    fn finish(&mut self, comms: &mut Comms) -> Result<(), AppError> {
        self.note_drops(comms)?;
        if let Err(error) = self.recorder.finish() {
            let trouble = format!("{error}. The log is readable up to its last flush.");
            tell(&trouble);
            comms.notify(LOGGER_ERROR, trouble)?;
        }
        match self.recorder.lost() {
            0 => {}
            lost => tell(format_args!("{lost} messages are missing from the log")),
        }
        Ok(())
    }
}

/// What is zero stands for: never.
fn positive(number: f64) -> Option<f64> {
    (number > 0.0).then_some(number)
}

fn options(params: &Params) -> LogOptions {
    LogOptions {
        compression: match params.text("Compression") {
            "lz4" => Compression::Lz4,
            "none" => Compression::None,
            _ => Compression::Zstd,
        },
        rotate_bytes: positive(params.number("RotateSize")).map(|megabytes| (megabytes * 1e6) as u64),
        rotate_secs: positive(params.number("RotateTime")),
    }
}

fn metadata(params: &Params) -> Result<Metadata, AppError> {
    let mission_file = params.text("MissionFile");
    let mission = read_if_said(mission_file)?;
    let effective = read_if_said(params.text("EffectiveMission"))?;
    let run = read_if_said(params.text("Run"))?;
    let world = params.text("World");
    // A world that is no file is built into the program, whose version is noted.
    let world_checksum = fnv1a_of_file(Path::new(world)).map(|sum| format!("{sum:016x}")).unwrap_or_default();
    Ok(Metadata {
        mission_name: file_name(mission_file),
        mission,
        effective_mission: effective,
        run,
        version: env!("CARGO_PKG_VERSION").into(),
        seed: params.integer("Seed").unsigned_abs(),
        started: Clock::new(1.0).now(),
        world: file_name(world),
        world_checksum,
    })
}

/// The text of a file that the log is to have with it; empty if there is none.
fn read_if_said(file: &str) -> Result<String, AppError> {
    match file {
        "" => Ok(String::new()),
        // An effective mission is longer than what it came from.
        file => Ok(file::read_text(Path::new(file), Mission::LONGEST_EFFECTIVE)
            .map_err(|error| format!("cannot read {file}: {error}"))?),
    }
}

fn file_name(path: &str) -> String {
    Path::new(path).file_name().unwrap_or_default().to_string_lossy().into_owned()
}
