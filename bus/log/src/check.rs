//! Whether a log is whole: every checksum, every message.

use std::os::unix::fs::FileExt;
use std::path::Path;

use elk_outside::file;

use crate::damage::Damage;
use crate::error::LogError;
use crate::footer::Footer;
use crate::head::Head;
use crate::index::{Index, OnProgress};
use crate::reader::LogReader;
use crate::segments::segments;
use crate::summary::checksum;

/// The last record before the index: opcode, length, checksum.
const DATA_END_BYTES: u64 = Head::BYTES as u64 + 4;

/// What a check found.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Checked {
    /// Messages that decode.
    pub messages: u64,
    /// Messages that the logger missed.
    pub dropped: u64,
    /// What is wrong, in words; empty: the log is whole.
    pub damage: Vec<String>,
}

/// Reads the log at `path`, a file or a run's folder, from end to end: every chunk is held against its checksum, every
/// message is decoded, every file against its checksum and its index against what was found.
///
/// # Errors
/// A file cannot be read, or is no log of this program.
pub fn check(path: &Path, on_progress: OnProgress<'_>) -> Result<Checked, LogError> {
    let mut log = LogReader::open(path)?;
    let (mut messages, mut damage, mut told) = (0, Damage::default(), 0);
    loop {
        match log.advance() {
            Ok(false) => break,
            Ok(true) => match log.record() {
                Some(Err(error)) => damage.note(error.to_string()),
                record => messages += u64::from(record.is_some()),
            },
            Err(_) => {} // the reader takes note of it, and goes on
        }
        let (done, all) = log.progress();
        if done != told {
            told = done;
            on_progress(done, all);
        }
    }
    damage.merge(log.found());
    let index = Index::read(path, on_progress)?;
    // Whatever else is wrong the reader has found as well.
    index.index_damage().for_each(|reason| damage.note(reason.to_owned()));
    if damage.is_empty() && index.messages() != messages {
        let counted = index.messages();
        damage.note(format!("{}: the index counts {counted} messages, there are {messages}", path.display()));
    }
    if damage.is_empty() {
        for file in segments(path)? {
            data_damage(&file)?.into_iter().for_each(|reason| damage.note(reason));
        }
    }
    Ok(Checked { messages, dropped: log.dropped(), damage: damage.reasons() })
}

/// Holds everything before the index against its checksum; a file that has none is right.
fn data_damage(path: &Path) -> Result<Option<String>, LogError> {
    let read = |source| LogError::Read { path: path.into(), source };
    let file = file::open(path).map_err(read)?;
    let footer = Footer::read(&file).map_err(read)?;
    let index = footer.map(|footer| footer.index.unwrap_or(footer.start));
    let Some(data_end) = index.and_then(|index| index.checked_sub(DATA_END_BYTES)) else {
        return Ok(Some(format!("{}: its end is damaged", path.display())));
    };
    let mut said = [0; 4];
    file.read_exact_at(&mut said, data_end + Head::BYTES as u64).map_err(read)?;
    let said = u32::from_le_bytes(said);
    let right = said == 0 || said == checksum(&file, 0..data_end).map_err(read)?.finalize();
    Ok((!right).then(|| format!("{}: its data do not agree with their checksum", path.display())))
}
