//! The logger on the bus.

use std::path::Path;

use elk_bus::clock::{Clock, Stopwatch};
use elk_bus::{App, AppError, Comms, Mail};
use elk_log::{LogError, Metadata, RecordRef};
use elk_mission::{AppType, Kind, ParamSpec, Params};

use crate::recorder::Recorder;

/// Logger to anyone: why the log cannot be written; empty: it can again.
pub const LOGGER_ERROR: &str = "LOGGER_ERROR";

/// The logger, as mission files know it.
pub static TYPES: &[AppType] = &[AppType {
    element: "Logger",
    name: "Mcap",
    summary: "Records every message of the community, from the first one on, into an MCAP file.",
    params: PARAMS,
    build: |params| Ok(Box::new(Logger::new(params)?)),
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
];

/// Records all mail. Trouble with the disk is said at once, on the terminal and on the bus, and stops nobody.
pub struct Logger {
    recorder: Recorder,
    flush_secs: f64,
    since_flush: Stopwatch,
    trouble: Option<String>,
    refused: bool,
}

impl Logger {
    /// The logger that `params` describe; fails if the mission file cannot be read.
    pub fn new(params: &Params) -> Result<Self, AppError> {
        let metadata = metadata(params.text("MissionFile"), params.integer("Seed"))?;
        Ok(Self {
            recorder: Recorder::new(params.text("File").into(), metadata),
            flush_secs: params.number("Flush"),
            since_flush: Stopwatch::start(),
            trouble: None,
            refused: false,
        })
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
            (Some(trouble), None) => {
                eprintln!("{trouble}. The mission goes on, the logger tries again.")
            }
            (None, Some(_)) => eprintln!("the log is written again; {} messages are missing", self.recorder.lost()),
        }
        comms.notify(LOGGER_ERROR, self.trouble.as_deref().unwrap_or_default())?;
        Ok(())
    }

    /// Says that messages are refused, once: how many there were is said at the end.
    fn complain(&mut self, error: &LogError, comms: &mut Comms) -> Result<(), AppError> {
        if !std::mem::replace(&mut self.refused, true) {
            eprintln!("{error}");
            comms.notify(LOGGER_ERROR, error.to_string())?;
        }
        Ok(())
    }
}

impl App for Logger {
    fn on_start_up(&mut self, comms: &mut Comms) -> Result<(), AppError> {
        self.flush(comms)?;
        comms.register_lossless("*", "*")?;
        Ok(())
    }

    fn on_new_mail(&mut self, comms: &mut Comms, mail: &Mail<'_>) -> Result<(), AppError> {
        let record = RecordRef {
            key: mail.key(),
            source: mail.source(),
            source_aux: mail.source_aux(),
            community: mail.community(),
            time: mail.time(),
            sequence: mail.sequence(),
            received: comms.time(),
            value: mail.value(),
        };
        if let Err(error) = self.recorder.record(&record) {
            self.complain(&error, comms)?;
        }
        self.flush_if_due(comms)
    }

    fn tick_hz(&self) -> Option<f64> {
        Some(4.0)
    }

    fn iterate(&mut self, comms: &mut Comms) -> Result<(), AppError> {
        self.flush_if_due(comms)
    }

    fn on_stop(&mut self, _comms: &mut Comms) -> Result<(), AppError> {
        if let Err(error) = self.recorder.finish() {
            eprintln!("{error}. The log is readable up to its last flush.");
        }
        match self.recorder.lost() {
            0 => {}
            lost => eprintln!("{lost} messages are missing from the log"),
        }
        Ok(())
    }
}

fn metadata(mission_file: &str, seed: i64) -> Result<Metadata, AppError> {
    let unreadable = |error| format!("cannot read the mission file {mission_file}: {error}");
    let mission = match mission_file {
        "" => String::new(),
        file => std::fs::read_to_string(file).map_err(unreadable)?,
    };
    Ok(Metadata {
        mission_name: Path::new(mission_file).file_name().unwrap_or_default().to_string_lossy().into_owned(),
        mission,
        version: env!("CARGO_PKG_VERSION").into(),
        seed: seed.unsigned_abs(),
        started: Clock::new(1.0).now(),
    })
}
