//! The footer of an MCAP file: its last record, which says where the index lies that ends with it.

use std::fs::File;
use std::io::Result;
use std::os::unix::fs::FileExt;

use mcap::records::op;

use crate::head::{Head, word};

/// Bytes of the footer behind its head: two places and a checksum.
const BODY_BYTES: usize = 20;
/// The footer up to its checksum, which covers so much of it.
const COVERED_BYTES: usize = Head::BYTES + BODY_BYTES - 4;
/// The footer, and the magic behind it: the last bytes of a file.
pub(crate) const TAIL_BYTES: usize = Head::BYTES + BODY_BYTES + mcap::MAGIC.len();

/// What the last record of a file says.
#[derive(Debug)]
pub(crate) struct Footer {
    /// Where it begins itself.
    pub start: u64,
    /// Where the index is said to begin; nothing: the file was written without.
    pub index: Option<u64>,
    covered: [u8; COVERED_BYTES],
    /// 0: its writer did not calculate any.
    crc: u32,
}

impl Footer {
    /// The footer of `file`; nothing: the file does not end with one.
    ///
    /// # Errors
    /// The file cannot be read.
    pub fn read(file: &File) -> Result<Option<Self>> {
        let Some(start) = file.metadata()?.len().checked_sub(TAIL_BYTES as u64) else {
            return Ok(None);
        };
        let mut tail = [0; TAIL_BYTES];
        file.read_exact_at(&mut tail, start)?;
        let head = tail.first_chunk().map(Head::of);
        if head != Some(Head { opcode: op::FOOTER, length: BODY_BYTES as u64 }) || !tail.ends_with(mcap::MAGIC) {
            return Ok(None);
        }
        let index = Some(word(&tail[Head::BYTES..])).filter(|start| *start > 0);
        let covered = std::array::from_fn(|i| tail[i]);
        let crc = u32::from_le_bytes(std::array::from_fn(|i| tail[COVERED_BYTES + i]));
        Ok(Some(Self { start, index, covered, crc }))
    }

    /// Whether the index, all of which `crc` has seen, is what was written.
    pub fn agrees(&self, mut crc: crc32fast::Hasher) -> bool {
        crc.update(&self.covered);
        self.crc == 0 || self.crc == crc.finalize()
    }
}
