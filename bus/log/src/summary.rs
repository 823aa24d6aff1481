//! The end of a file, which says what is in it: where that lies, and whether it is what was written.

use std::fs::File;
use std::io::Result;
use std::ops::Range;
use std::os::unix::fs::FileExt;

use crate::footer::Footer;

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
    pub fn find(file: &File) -> Result<Self> {
        let Some(footer) = Footer::read(file)? else {
            return Ok(Self::Missing);
        };
        let Some(start) = footer.index else {
            return Ok(Self::Missing);
        };
        let end = footer.start;
        if end.checked_sub(start).is_none_or(|size| size > MAX_SUMMARY_BYTES) {
            return Ok(Self::Damaged(format!("it is said to begin at byte {start} and to end at byte {end}")));
        }
        match footer.agrees(checksum(file, start..end)?) {
            true => Ok(Self::Found(start..end)),
            false => Ok(Self::Damaged("it does not agree with its checksum".into())),
        }
    }
}

/// The checksum of a part of a file.
pub(crate) fn checksum(file: &File, Range { start: mut at, end }: Range<u64>) -> Result<crc32fast::Hasher> {
    let mut crc = crc32fast::Hasher::new();
    let mut piece = vec![0; end.saturating_sub(at).min(READ_BYTES) as usize];
    while at < end {
        let wanted = (end - at).min(READ_BYTES) as usize;
        let count = file.read_at(&mut piece[..wanted], at)?;
        if count == 0 {
            break; // the file has become shorter: the checksum will not be right
        }
        crc.update(&piece[..count]);
        at += count as u64;
    }
    Ok(crc)
}
