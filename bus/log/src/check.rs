//! Whether a log is whole: every checksum, every message.

use std::fs::File;
use std::io::{BufReader, Read};
use std::path::Path;

use crate::error::LogError;
use crate::index::{Index, OnProgress};
use crate::reader::LogReader;
use crate::segments::segments;

/// The last record before the index: opcode, length, checksum.
const DATA_END_BYTES: u64 = 9 + 4;
/// The footer, and the magic behind it.
const TAIL_BYTES: u64 = 9 + 20 + 8;

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
    let (mut messages, mut damage, mut told) = (0, Vec::new(), 0);
    while let Some(next) = log.next_ref() {
        match next {
            Ok(_) => messages += 1,
            Err(error) => damage.push(error.to_string()),
        }
        let (done, all) = log.progress();
        if done != told {
            told = done;
            on_progress(done, all);
        }
    }
    let found = log.damage().iter().filter(|reason| !damage.contains(reason)).cloned().collect::<Vec<_>>();
    damage.extend(found);
    let index = Index::read(path, on_progress)?;
    damage.extend(
        index
            .damage()
            .filter(|reason| !damage.iter().any(|known| known == reason))
            .map(str::to_owned)
            .collect::<Vec<_>>(),
    );
    if damage.is_empty() && index.messages() != messages {
        damage.push(format!(
            "{}: the index counts {} messages, there are {messages}",
            path.display(),
            index.messages()
        ));
    }
    if damage.is_empty() {
        for file in segments(path)? {
            damage.extend(data_damage(&file)?);
        }
    }
    Ok(Checked { messages, dropped: log.dropped(), damage })
}

/// Holds everything before the index against its checksum; a file that has none is right.
fn data_damage(path: &Path) -> Result<Option<String>, LogError> {
    let read = |source| LogError::Read { path: path.into(), source };
    let file = File::open(path).map_err(read)?;
    let length = file.metadata().map_err(read)?.len();
    let mut tail = [0; TAIL_BYTES as usize];
    std::os::unix::fs::FileExt::read_exact_at(&file, &mut tail, length.saturating_sub(TAIL_BYTES)).map_err(read)?;
    let summary = u64::from_le_bytes(std::array::from_fn(|i| tail[9 + i]));
    let index_start = if summary == 0 { length - TAIL_BYTES } else { summary };
    let Some(data_end) = index_start.checked_sub(DATA_END_BYTES) else {
        return Ok(Some(format!("{}: its end is damaged", path.display())));
    };
    let mut said = [0; 4];
    std::os::unix::fs::FileExt::read_exact_at(&file, &mut said, data_end + 9).map_err(read)?;
    let mut crc = crc32fast::Hasher::new();
    let mut data = BufReader::with_capacity(1 << 20, file).take(data_end);
    let mut piece = vec![0; 1 << 20];
    loop {
        match data.read(&mut piece).map_err(read)? {
            0 => break,
            count => crc.update(&piece[..count]),
        }
    }
    let said = u32::from_le_bytes(said);
    let right = said == 0 || said == crc.finalize();
    Ok((!right).then(|| format!("{}: its data do not agree with their checksum", path.display())))
}
