//! The end of a file, which says what is in it: where that lies, and whether it is what was written.

use std::fs::File;
use std::io::{Read, Result, Seek, SeekFrom};
use std::ops::Range;

use mcap::records::op;

use crate::head::{Head, word};

/// Opcode, length and body of the footer, and the magic behind it.
pub(crate) const TAIL_BYTES: u64 = Head::BYTES as u64 + 20 + 8;
/// An index that claims to be larger is taken for damaged (bytes).
const MAX_SUMMARY_BYTES: u64 = 256 << 20;
/// Bytes that are read from the file at once.
const READ_BYTES: u64 = 1 << 20;

/// The records at the end of a file.
pub(crate) enum Summary {
    /// They lie here.
    Found(Range<u64>),
    /// The file breaks off before, or was written without.
    Missing,
    /// They are not what was written, and why.
    Damaged(String),
}

impl Summary {
    /// Looks for them, and holds them against their checksum.
    pub fn find(file: &mut File) -> Result<Self> {
        let length = file.metadata()?.len();
        let mut tail = [0; TAIL_BYTES as usize];
        let Some(end) = length.checked_sub(TAIL_BYTES) else {
            return Ok(Self::Missing);
        };
        file.seek(SeekFrom::Start(end))?;
        file.read_exact(&mut tail)?;
        let start = word(&tail[Head::BYTES..]);
        if tail[0] != op::FOOTER || !tail.ends_with(mcap::MAGIC) || start == 0 {
            return Ok(Self::Missing);
        }
        if end.checked_sub(start).is_none_or(|size| size > MAX_SUMMARY_BYTES) {
            return Ok(Self::Damaged(format!("it is said to begin at byte {start} of {length}")));
        }
        let mut crc = checksum(file, start..end)?;
        // The footer up to the checksum itself is part of what it covers.
        let (covered, said) = tail[..Head::BYTES + 20].split_at(Head::BYTES + 16);
        crc.update(covered);
        match said == [0; 4] || said == crc.finalize().to_le_bytes() {
            true => Ok(Self::Found(start..end)),
            false => Ok(Self::Damaged("it does not agree with its checksum".into())),
        }
    }
}

/// The checksum of a part of a file.
pub(crate) fn checksum(file: &mut File, place: Range<u64>) -> Result<crc32fast::Hasher> {
    file.seek(SeekFrom::Start(place.start))?;
    let mut crc = crc32fast::Hasher::new();
    let mut left = place.end.saturating_sub(place.start);
    let mut piece = vec![0; left.min(READ_BYTES) as usize];
    while left > 0 {
        let wanted = left.min(READ_BYTES) as usize;
        let count = file.read(&mut piece[..wanted])?;
        if count == 0 {
            break; // the file has become shorter: the checksum will not be right
        }
        crc.update(&piece[..count]);
        left -= count as u64;
    }
    Ok(crc)
}
