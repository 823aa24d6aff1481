//! A chunk of an MCAP file: records, packed together.
//!
//! Unpacked, a chunk is as large as its writer liked, and a few bytes of zstd make a gigabyte. So a chunk is believed only
//! up to [`MAX_RATIO`] or [`ALWAYS_BYTES`], it is unpacked piece by piece, and the first thing in it that is no record that
//! a chunk may hold ends it: memory is what its records really take, never what somebody says.

use std::io::{BufRead, Read};
use std::ops::{Range, RangeInclusive};

use mcap::records::op;

use crate::head::{Head, MAX_RECORD_BYTES, MESSAGE_HEAD, word};

/// A chunk's header without the name of its compression.
pub(crate) const HEAD_BYTES: u64 = 40;
/// No compression has a longer name.
pub(crate) const LONGEST_NAME: usize = 8;
/// No chunk is larger, compressed or not: the largest value of the bus, and a chunk's worth of others.
pub(crate) const MAX_BYTES: u64 = (1 << 30) + (64 << 20);
/// A chunk of at most so many bytes may be packed as tightly as its compression can.
pub(crate) const ALWAYS_BYTES: u64 = 64 << 20;
/// A larger one unpacks to at most so many times its size: LZ4 cannot pack tighter, as a byte of its lengths stands for 255 at
/// most. Zstandard can; the writer sees to it that what it writes can be read (`writer.rs`).
pub(crate) const MAX_RATIO: u64 = 256;
/// Bytes that are unpacked at once: at most so many are in memory that turn out to be no records.
const PIECE_BYTES: usize = 1 << 20;

/// What a chunk says of itself.
#[derive(Debug)]
pub(crate) struct ChunkHead {
    /// When its first and its last message were recorded (ns).
    pub times: (u64, u64),
    pub uncompressed: u64,
    pub crc: u32,
    pub compression: String,
    pub compressed: u64,
}

/// What came out of a chunk.
#[derive(Debug, PartialEq, Eq)]
pub(crate) enum Unpacked {
    /// All that there should be.
    Whole,
    /// The records up to here, of a chunk that has no checksum; and why not more.
    Broken(String),
    /// Nothing that can be relied on, and why.
    Lost(String),
}

/// A chunk, unpacked. The memory is used again for the next one.
#[derive(Debug, Default)]
pub(crate) struct Chunk {
    bytes: Vec<u8>,
    /// Where the next record to be given begins.
    next: usize,
    /// Where the first record begins that is not all there: no record that is given goes beyond.
    end: usize,
}

impl ChunkHead {
    /// The header that a chunk's record begins with; nothing: its compression has no name that it can have.
    pub fn of(body: &[u8]) -> Option<Self> {
        let (fixed, rest) = body.split_first_chunk::<32>()?;
        let number = |at: usize| u32::from_le_bytes(std::array::from_fn(|i| fixed[at + i]));
        let name_bytes = Some(number(28) as usize).filter(|bytes| *bytes <= LONGEST_NAME)?;
        let (name, rest) = rest.split_at_checked(name_bytes)?;
        Some(Self {
            times: (word(fixed), word(&fixed[8..])),
            uncompressed: word(&fixed[16..]),
            crc: number(24),
            compression: String::from_utf8_lossy(name).into_owned(),
            compressed: rest.first_chunk::<8>().map(|size| word(size))?,
        })
    }

    /// Whether no message of the chunk was recorded within `times` (ns), as it says itself; some writers say nothing.
    pub fn is_outside(&self, times: &RangeInclusive<u64>) -> bool {
        let (first, last) = self.times;
        (first, last) != (0, 0) && first <= last && (last < *times.start() || first > *times.end())
    }

    /// Length of the header itself.
    pub fn bytes(&self) -> u64 {
        HEAD_BYTES + self.compression.len() as u64
    }

    /// Whether the sizes agree with each other and with the record's `length`: a flipped bit in one of them is found
    /// here, before it is believed.
    pub fn check(&self, length: u64) -> Result<(), String> {
        let head = self.bytes();
        if head.checked_add(self.compressed) != Some(length) {
            let said = self.compressed;
            return Err(format!("has {length} bytes, its header says {head} and {said}: one of them is damaged"));
        }
        if self.compression.is_empty() && self.compressed != self.uncompressed {
            return Err("is not compressed, but has two sizes: its header is damaged".into());
        }
        Ok(())
    }

    /// Whether the chunk can be what it says that it is.
    pub fn believable(&self) -> Result<(), String> {
        let largest = self.compressed.max(self.uncompressed);
        if largest > MAX_BYTES {
            return Err(format!("has {largest} bytes; more than {MAX_BYTES} are not read"));
        }
        if self.uncompressed > ALWAYS_BYTES.max(self.compressed.saturating_mul(MAX_RATIO)) {
            let Self { uncompressed, compressed, .. } = self;
            return Err(format!(
                "claims {uncompressed} bytes in {compressed}; a chunk of more than {ALWAYS_BYTES} bytes that is packed \
                 tighter than {MAX_RATIO} to 1 is not read"
            ));
        }
        Ok(())
    }

    /// Whether `unpacked` is what the chunk was when it was written.
    fn verify(&self, unpacked: &[u8]) -> Result<(), String> {
        if unpacked.len() as u64 != self.uncompressed {
            return Err(format!("unpacks to {} bytes instead of {}", unpacked.len(), self.uncompressed));
        }
        match self.crc {
            0 => Ok(()), // its writer did not calculate any
            crc if crc32fast::hash(unpacked) == crc => Ok(()),
            _ => Err("does not agree with its checksum".into()),
        }
    }
}

impl Chunk {
    /// The chunk that these bytes are, unpacked; they themselves, if they are not records throughout.
    pub fn of(bytes: Vec<u8>) -> Result<Self, Vec<u8>> {
        let length = bytes.len() as u64;
        let mut chunk = Self { bytes, ..Self::default() };
        match chunk.see_records(length) {
            Ok(()) if chunk.end as u64 == length => Ok(chunk),
            _ => Err(chunk.bytes),
        }
    }

    /// All of its bytes.
    pub fn into_bytes(self) -> Vec<u8> {
        self.bytes
    }

    /// Reads a chunk from `packed`, as far as it goes.
    ///
    /// # Errors
    /// The file cannot be read. What is wrong with its bytes is in the answer.
    pub fn unpack(&mut self, head: &ChunkHead, packed: &mut impl BufRead) -> std::io::Result<Unpacked> {
        self.clear();
        match head.compression.as_str() {
            "" => self.take(head, packed),
            "lz4" => Ok(lz4::Decoder::new(packed).and_then(|mut it| self.take(head, &mut it)).unwrap_or_else(lost)),
            "zstd" => {
                Ok(zstd::Decoder::with_buffer(packed).and_then(|mut it| self.take(head, &mut it)).unwrap_or_else(lost))
            }
            other => Ok(Unpacked::Lost(format!("is compressed with {other:?}; known are lz4 and zstd"))),
        }
    }

    /// Takes the bytes of a chunk piece by piece, as long as they are records.
    fn take(&mut self, head: &ChunkHead, unpacking: &mut impl Read) -> std::io::Result<Unpacked> {
        // One byte more than there should be: a chunk that goes on is found by its length.
        let most = head.uncompressed + 1;
        loop {
            let piece = (most - self.bytes.len() as u64).min(PIECE_BYTES as u64);
            self.bytes.try_reserve(piece as usize).map_err(|_| std::io::ErrorKind::OutOfMemory)?;
            let read = unpacking.by_ref().take(piece).read_to_end(&mut self.bytes);
            if let Err(reason) = self.see_records(head.uncompressed) {
                // Whether what came before is what was written only a checksum over all of it could tell.
                return Ok(if head.crc == 0 { Unpacked::Broken(reason) } else { Unpacked::Lost(reason) });
            }
            if (read? as u64) < piece || self.bytes.len() as u64 == most {
                return Ok(head.verify(&self.bytes).map_or_else(Unpacked::Lost, |()| Unpacked::Whole));
            }
        }
    }

    /// Looks at the heads of all records that have come so far, of a chunk that has `length` bytes in all.
    fn see_records(&mut self, length: u64) -> Result<(), String> {
        while let Some(left) = self.bytes.get(self.end..).filter(|left| !left.is_empty()) {
            let from = self.end as u64;
            let Some(head) = left.first_chunk().map(Head::of) else {
                return if length.saturating_sub(from) < Head::BYTES as u64 { Err(breaks_off()) } else { Ok(()) };
            };
            plausible(head)?;
            let end = head.end(from);
            if end > length {
                return Err(breaks_off());
            }
            if end > self.bytes.len() as u64 {
                return Ok(());
            }
            self.end = end as usize;
        }
        Ok(())
    }

    /// Bytes of the records that have come so far.
    pub fn seen(&self) -> u64 {
        self.end as u64
    }

    /// Forgets everything.
    pub fn clear(&mut self) {
        self.bytes.clear();
        (self.next, self.end) = (0, 0);
    }

    /// The next record: its opcode, and where its body lies.
    pub fn next(&mut self) -> Option<(u8, Range<usize>)> {
        let head = self.bytes.get(self.next..self.end)?.first_chunk().map(Head::of)?;
        let start = self.next + Head::BYTES;
        self.next = start + head.length as usize;
        Some((head.opcode, start..self.next))
    }

    /// The bytes of a record that was given.
    pub fn bytes(&self, range: &Range<usize>) -> &[u8] {
        let bytes = self.bytes.get(range.clone());
        debug_assert!(bytes.is_some(), "{range:?} is of another chunk");
        bytes.unwrap_or_default()
    }
}

/// Whether a chunk may hold a record of this kind and size: a schema, a channel, a message, or another program's own.
fn plausible(Head { opcode, length: size }: Head) -> Result<(), String> {
    match opcode {
        op::MESSAGE if size < MESSAGE_HEAD as u64 => Err(format!("holds a message of {size} bytes, which is none")),
        op::MESSAGE => Ok(()),
        op::SCHEMA | op::CHANNEL | 0x80.. if size <= MAX_RECORD_BYTES => Ok(()),
        op::SCHEMA | op::CHANNEL | 0x80.. => {
            Err(format!("holds a record of {size} bytes; right are {MAX_RECORD_BYTES}"))
        }
        _ => Err(format!("holds a record of kind {opcode}, which no chunk has")),
    }
}

fn breaks_off() -> String {
    "breaks off in the middle of a record".into()
}

fn lost(error: std::io::Error) -> Unpacked {
    Unpacked::Lost(format!("does not unpack: {error}"))
}
