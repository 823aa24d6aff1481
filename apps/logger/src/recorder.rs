//! A log that goes on whatever the disk does.

use std::path::PathBuf;

use elk_bus::clock::Stopwatch;
use elk_log::{LogError, LogOptions, LogWriter, Metadata, RecordRef};

/// Writes a log and, where it cannot, counts what is missing and tries again.
pub struct Recorder {
    path: PathBuf,
    metadata: Metadata,
    options: LogOptions,
    sync_secs: Option<f64>,
    since_sync: Stopwatch,
    log: Option<LogWriter>,
    lost: u64,
    /// Those of them that the log does not tell of yet, and when the last of these was recorded (s).
    untold: (u64, f64),
}

impl Recorder {
    /// A recorder for a log at `path`; nothing is touched before [`Recorder::flush`].
    pub fn new(path: PathBuf, metadata: Metadata) -> Self {
        let (options, since_sync) = (LogOptions::default(), Stopwatch::start());
        Self { path, metadata, options, sync_secs: None, since_sync, log: None, lost: 0, untold: (0, 0.0) }
    }

    /// The same recorder with another way of writing.
    pub fn with_options(self, options: LogOptions) -> Self {
        Self { options, ..self }
    }

    /// The same recorder, which with a flush waits for the disk itself, at most every `sync_secs`; `None`: only at the
    /// end.
    pub fn with_sync(self, sync_secs: Option<f64>) -> Self {
        Self { sync_secs, ..self }
    }

    /// Records a message. An error means that it is missing from the log, and is counted as such.
    pub fn record(&mut self, record: &RecordRef<'_>) -> Result<(), LogError> {
        let outcome = match &mut self.log {
            Some(log) => log.append(record),
            // That there is no file was the last flush's error.
            None => {
                self.lose(record);
                return Ok(());
            }
        };
        if outcome.is_err() {
            self.lose(record);
        }
        outcome
    }

    fn lose(&mut self, record: &RecordRef<'_>) {
        self.lost += 1;
        self.untold = (self.untold.0 + 1, record.received);
    }

    /// Brings what was recorded onto the disk; creates the file where that has not succeeded yet.
    pub fn flush(&mut self) -> Result<(), LogError> {
        match &mut self.log {
            None => self.log = Some(LogWriter::create_with(&self.path, &self.metadata, self.options)?),
            Some(log) if self.sync_secs.is_some_and(|secs| self.since_sync.elapsed().as_secs_f64() >= secs) => {
                log.sync()?;
                self.since_sync = Stopwatch::start();
            }
            Some(log) => log.flush()?,
        }
        self.tell_of_losses()
    }

    /// Notes in the log what was lost while it could not be written, now that it can.
    fn tell_of_losses(&mut self) -> Result<(), LogError> {
        let (untold, received) = std::mem::take(&mut self.untold);
        match &mut self.log {
            Some(log) if untold > 0 => log.note_dropped(untold, received),
            _ => Ok(()),
        }
    }

    /// Notes in the log that `newly` messages never reached it, at time `now` (s).
    pub fn note_dropped(&mut self, newly: u64, now: f64) -> Result<(), LogError> {
        self.lost += newly;
        self.log.as_mut().map_or(Ok(()), |log| log.note_dropped(newly, now))
    }

    /// Ends the file. What was flushed before stays readable even if this fails.
    pub fn finish(&mut self) -> Result<(), LogError> {
        match self.log.take() {
            Some(log) => log.finish(),
            None => Ok(()),
        }
    }

    /// Messages that are missing from the log.
    pub fn lost(&self) -> u64 {
        self.lost
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use elk_bus::{Value, ValueRef};
    use elk_log::{Index, LogReader};

    fn say(number: f64) -> RecordRef<'static> {
        RecordRef {
            key: "DEPTH",
            source: "sensor",
            source_aux: "",
            community: "elk",
            time: number,
            sequence: number as u64,
            received: number,
            order: number as u64,
            epoch: 1,
            value: ValueRef::Double(number),
        }
    }

    #[test]
    fn a_folder_that_appears_later_costs_only_what_was_said_before() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("run/log.mcap");
        let mut recorder = Recorder::new(path.clone(), Metadata::default());
        assert!(matches!(recorder.flush(), Err(LogError::Create { .. })));
        recorder.record(&say(1.0)).unwrap();
        assert_eq!(recorder.lost(), 1);
        std::fs::create_dir(folder.path().join("run")).unwrap();
        recorder.flush().unwrap();
        recorder.record(&say(2.0)).unwrap();
        recorder.finish().unwrap();
        let values: Vec<Value> = LogReader::open(&path).unwrap().map(|r| r.unwrap().value).collect();
        assert_eq!((values, recorder.lost()), (vec![Value::Double(2.0)], 1));
        assert_eq!(Index::read(&path, &mut |_, _| {}).unwrap().dropped(), 1, "the log tells of it");
    }

    /// `/dev/full` is a disk without room: every write fails as on a full disk.
    #[test]
    #[cfg(target_os = "linux")]
    fn a_full_disk_is_an_error_at_the_first_flush() {
        let mut recorder = Recorder::new("/dev/full".into(), Metadata::default());
        let error = recorder.flush().unwrap_err();
        assert!(matches!(&error, LogError::Write { source, .. } if source.raw_os_error() == Some(28)), "{error}");
        recorder.record(&say(1.0)).unwrap();
        assert_eq!(recorder.lost(), 1);
    }
}
