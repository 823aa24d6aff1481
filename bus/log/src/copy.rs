//! A log made from another: mended, or shortened.

use std::path::Path;

use crate::error::LogError;
use crate::index::OnProgress;
use crate::reader::LogReader;
use crate::selection::{Place, Selection};
use crate::writer::{LogOptions, LogWriter};

/// Bytes that may wait in memory before they are written.
const FLUSH_BYTES: u64 = 4 << 20;

/// What a copy came to.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Copied {
    /// Records in the new log.
    pub records: u64,
    /// Records that could not be read, with the first reason.
    pub unreadable: u64,
    /// What was found in the old log to be damaged or cut short, in words.
    pub damage: Vec<String>,
}

/// Copies the records of `from` (a file or a run's folder) that `selection` takes into a new log at `to`, with all that
/// the old one says of its run. Everything that can be read of a damaged log is: the copy is whole.
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
    let mut log = LogReader::open(from)?;
    if to.exists() {
        let source = std::io::ErrorKind::AlreadyExists.into();
        return Err(LogError::Create { path: to.into(), source });
    }
    let mut copy = LogWriter::create_with(to, log.metadata(), options)?;
    let mut copied = Copied { records: 0, unreadable: 0, damage: Vec::new() };
    let (mut start, mut last) = (None, 0.0);
    let mut flushed = 0;
    loop {
        match log.next_ref() {
            None => break,
            Some(Err(_)) => copied.unreadable += 1,
            Some(Ok(record)) => {
                let place = selection.place(record.received - *start.get_or_insert(record.received));
                if place == Place::After {
                    break;
                }
                last = record.received;
                if place == Place::Within && selection.takes(record.key, record.source) {
                    copy.append(&record)?;
                    copied.records += 1;
                }
            }
        }
        let (done, all) = log.progress();
        if done - flushed > FLUSH_BYTES {
            flushed = done;
            copy.flush()?;
            on_progress(done, all);
        }
    }
    if log.dropped() > 0 {
        copy.note_dropped(log.dropped(), last)?;
    }
    copy.finish()?;
    copied.damage = log.damage();
    Ok(copied)
}
