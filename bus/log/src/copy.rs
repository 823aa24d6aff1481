//! A log made from another: mended, or shortened.

use std::path::Path;

use crate::damage::Damage;
use crate::error::LogError;
use crate::index::OnProgress;
use crate::reader::{Item, LogReader};
use crate::segment::Segment;
use crate::selection::{Position, Selection, Window};
use crate::writer::{LogOptions, LogWriter};

/// Bytes that may wait in memory before they are written.
const FLUSH_BYTES: u64 = 4 << 20;

/// What a copy came to.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Copied {
    /// Records in the new log.
    pub records: u64,
    /// Those of them that lie in a damaged chunk: some may not be what was recorded.
    pub doubtful: u64,
    /// Records that could not be read.
    pub unreadable: u64,
    /// What was found in the old log to be damaged or cut short, in words.
    pub damage: Vec<String>,
    /// What is right and is not in the new log, though nobody left it out, in words.
    pub left_out: Vec<String>,
}

/// Copies the records of `from` (a file or a run's folder) that `selection` takes into a new log at `to`, with all that
/// the old one says of its run. What other tools have written (channels, attachments, metadata) is kept byte by byte. What
/// cannot be relied on is not in the copy: see [`recover`].
///
/// # Errors
/// The old log cannot be opened, or the new one cannot be written; there must be no file at `to`.
pub fn copy(
    from: &Path,
    to: &Path,
    selection: &Selection,
    options: LogOptions,
    on_progress: OnProgress<'_>,
) -> Result<Copied, LogError> {
    let (mut log, window) = (LogReader::open(from)?, selection.window(from)?);
    log.within(&window);
    copy_of(log, window, to, options, on_progress)
}

/// Copies all that can be had of a damaged log into a new one, which is whole: also messages behind a damage, and those
/// within a damaged chunk that decode.
///
/// # Errors
/// As [`copy`].
pub fn recover(from: &Path, to: &Path, options: LogOptions, on_progress: OnProgress<'_>) -> Result<Copied, LogError> {
    let all = Selection::default();
    copy_of(LogReader::open_damaged(from)?, all.window(from)?, to, options, on_progress)
}

/// A copy that is being made.
struct Copy {
    to: LogWriter,
    records: u64,
    doubtful: u64,
    unreadable: u64,
    left_out: Damage,
    /// When the last record was recorded (s).
    last: f64,
}

fn copy_of(
    mut log: LogReader,
    window: Window<'_>,
    to: &Path,
    options: LogOptions,
    on_progress: OnProgress<'_>,
) -> Result<Copied, LogError> {
    if to.exists() {
        let source = std::io::ErrorKind::AlreadyExists.into();
        return Err(LogError::Create { path: to.into(), source });
    }
    let mut item = log.next_item();
    let profile = log.segment().map_or("", Segment::profile).to_owned();
    let to = LogWriter::create_for(to, log.metadata(), options, &profile)?;
    let mut copy = Copy { to, records: 0, doubtful: 0, unreadable: 0, left_out: Damage::default(), last: 0.0 };
    let mut flushed = 0;
    while let Some(found) = item {
        match found {
            Item::Other(opcode) => copy.other(&log, opcode)?,
            Item::Message => copy.message(&mut log, &window)?,
        }
        let (done, all) = log.progress();
        if done - flushed > FLUSH_BYTES {
            flushed = done;
            copy.to.flush()?;
            on_progress(done, all);
        }
        item = log.next_item();
    }
    if log.dropped() > 0 {
        copy.to.note_dropped(log.dropped(), copy.last)?;
    }
    let left_out = log.left_out().into_iter().chain(copy.left_out.reasons()).collect();
    let Copy { to, records, doubtful, unreadable, .. } = copy;
    to.finish()?;
    Ok(Copied { records, doubtful, unreadable, damage: log.damage(), left_out })
}

impl Copy {
    /// Takes the message that was found last, if it is wanted.
    fn message(&mut self, log: &mut LogReader, window: &Window<'_>) -> Result<(), LogError> {
        let Some((key, source, received)) = log.head() else {
            return Ok(());
        };
        if window.position(received) != Position::Within || !window.selection.takes(key, source) {
            return Ok(());
        }
        if let Some((channel, body)) = log.segment().and_then(Segment::foreign) {
            self.to.append_foreign(channel, body)?;
        } else {
            match log.record() {
                Some(Ok(record)) => {
                    self.last = record.received;
                    self.to.append(&record)?;
                }
                _ => {
                    self.unreadable += 1;
                    return Ok(());
                }
            }
        }
        self.records += 1;
        self.doubtful += u64::from(log.segment().is_some_and(Segment::is_doubtful));
        Ok(())
    }

    /// Takes another tool's record that is no message.
    fn other(&mut self, log: &LogReader, opcode: u8) -> Result<(), LogError> {
        let body = log.segment().map_or(&[][..], Segment::body);
        if !self.to.append_record(opcode, body)? {
            self.left_out.note(format!("a record of {} bytes, of kind {opcode}", body.len()));
        }
        Ok(())
    }
}
