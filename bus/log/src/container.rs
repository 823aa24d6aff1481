//! An MCAP file, record by record: whole, cut anywhere, or damaged.
//!
//! The crate `mcap` reads files that are right, and stops at the first thing that is not. A log of a robot that lost its
//! power is not right, so this reader is told apart: every length is held against the file before memory is set aside,
//! a chunk whose checksum is wrong is passed over, and what is left of the last chunk is given message by message.

use std::fs::File;
use std::io::{BufReader, ErrorKind, Read, Seek, SeekFrom};
use std::ops::Range;
use std::path::{Path, PathBuf};

use mcap::records::op;

use crate::error::LogError;

/// Bytes that are read from the file at once.
const READ_BYTES: usize = 1 << 20;
/// Opcode and length of a record.
const RECORD_HEAD: u64 = 9;
/// A chunk's header without the name of its compression.
const CHUNK_HEAD: usize = 40;
/// No chunk is larger, compressed or not: the largest value of the bus, and a chunk's worth of others.
const MAX_CHUNK_BYTES: u64 = (1 << 30) + (64 << 20);
/// No schema, channel, metadata or attachment that elk writes is larger.
const MAX_RECORD_BYTES: u64 = 64 << 20;
/// Opcode, length and body of the footer, and the magic behind it.
const TAIL_BYTES: u64 = RECORD_HEAD + 20 + 8;

/// What was found next.
#[derive(Debug)]
pub(crate) enum Found {
    /// A record of this opcode, its bytes in [`Container::body`]; those of chunks come one by one.
    Record(u8),
    /// A chunk that is not what it was when it was written; its messages are lost, the next one is read on.
    Damaged(String),
    /// The file breaks off; nothing follows.
    Cut(String),
    /// The data have come to their proper end.
    End,
}

/// Where the next record is.
enum Place {
    File,
    Chunk,
    Over,
}

/// One file, read from front to back.
pub(crate) struct Container {
    path: PathBuf,
    file: BufReader<File>,
    length: u64,
    /// Where the next record of the file begins.
    at: u64,
    place: Place,
    body: Vec<u8>,
    chunk: Vec<u8>,
    /// Where in `chunk` the next record begins.
    rest: usize,
    /// Where in `chunk` the record that was found last lies; nothing: in `body`.
    found: Option<Range<usize>>,
    /// Why the file ends with this chunk.
    cut: Option<String>,
}

/// The sizes that a chunk gives itself.
struct ChunkHead {
    uncompressed: u64,
    crc: u32,
    compression: String,
    compressed: u64,
}

impl Container {
    /// Opens a file that begins as MCAP does.
    pub fn open(path: &Path) -> Result<Self, LogError> {
        let read = |source| LogError::Read { path: path.into(), source };
        let mut file = File::open(path).map_err(read)?;
        let length = file.metadata().map_err(read)?.len();
        check_magic(&mut file, path)?;
        let magic = mcap::MAGIC.len() as u64;
        Ok(Self {
            path: path.into(),
            file: BufReader::with_capacity(READ_BYTES, file),
            length,
            at: magic,
            place: Place::File,
            body: Vec::new(),
            chunk: Vec::new(),
            rest: 0,
            found: None,
            cut: None,
        })
    }

    /// Length of the file when it was opened (bytes).
    pub fn length(&self) -> u64 {
        self.length
    }

    /// How much of the file has been read (bytes).
    pub fn position(&self) -> u64 {
        self.at
    }

    /// Goes on at the record that begins at `offset`.
    pub fn seek(&mut self, offset: u64) -> Result<(), LogError> {
        self.file.seek(SeekFrom::Start(offset)).map_err(|source| read_error(&self.path, source))?;
        (self.at, self.place, self.rest) = (offset, Place::File, self.chunk.len());
        Ok(())
    }

    /// The bytes of the record that was found last.
    pub fn body(&self) -> &[u8] {
        self.found.as_ref().map_or(&self.body, |range| &self.chunk[range.clone()])
    }

    /// Whether the record that was found last lies in a chunk.
    pub fn in_chunk(&self) -> bool {
        self.found.is_some()
    }

    /// The next record, or what is there instead.
    pub fn next(&mut self) -> Result<Found, LogError> {
        loop {
            self.found = None;
            let found = match self.place {
                Place::Over => Some(Found::End),
                Place::Chunk => self.record_of_chunk(),
                Place::File => self.record_of_file()?,
            };
            if let Some(found) = found {
                return Ok(found);
            }
        }
    }

    /// The next record of the chunk; nothing at its end.
    fn record_of_chunk(&mut self) -> Option<Found> {
        match (record_in(&self.chunk, &mut self.rest), self.cut.take()) {
            (Some(Ok((opcode, body))), cut) => {
                (self.found, self.cut) = (Some(body), cut);
                Some(Found::Record(opcode))
            }
            (_, Some(cut)) => Some(self.over(cut)),
            (Some(Err(reason)), None) => {
                self.place = Place::File;
                Some(Found::Damaged(reason))
            }
            (None, None) => {
                self.place = Place::File;
                None
            }
        }
    }

    /// The next record of the file itself; nothing for those that are passed over, and for chunks that can be read.
    fn record_of_file(&mut self) -> Result<Option<Found>, LogError> {
        let mut head = [0; RECORD_HEAD as usize];
        if self.length.saturating_sub(self.at) < RECORD_HEAD {
            return Ok(Some(self.over(format!("it ends after {} bytes, in the middle of the data", self.length))));
        }
        self.read_exact(&mut head)?;
        let (opcode, length) = (head[0], word(&head[1..]));
        let left = self.length - self.at - RECORD_HEAD;
        if opcode == 0 || opcode == op::FOOTER {
            return Ok(Some(self.over(format!("there is no record at byte {}", self.at))));
        }
        if opcode == op::CHUNK {
            return self.chunk(length, left);
        }
        if length > left {
            let reason = format!("the record at byte {} has {length} bytes, but the file ends after {left}", self.at);
            return Ok(Some(self.over(reason)));
        }
        self.at += RECORD_HEAD + length;
        match opcode {
            op::DATA_END => Ok(Some(self.end(length)?)),
            op::MESSAGE_INDEX => self.skip(length),
            _ if length > MAX_RECORD_BYTES => self.skip(length),
            _ => {
                self.body.resize(length as usize, 0);
                read_exact(&mut self.file, &self.path, &mut self.body)?;
                Ok(Some(Found::Record(opcode)))
            }
        }
    }

    fn skip(&mut self, length: u64) -> Result<Option<Found>, LogError> {
        let length = i64::try_from(length).unwrap_or(i64::MAX);
        self.file.seek_relative(length).map_err(|source| read_error(&self.path, source))?;
        Ok(None)
    }

    fn over(&mut self, reason: String) -> Found {
        self.place = Place::Over;
        Found::Cut(reason)
    }

    /// Reads a chunk of `length` bytes, of which `left` are in the file.
    fn chunk(&mut self, length: u64, left: u64) -> Result<Option<Found>, LogError> {
        let start = self.at;
        let head = match self.chunk_head(length, left)? {
            Ok(head) => head,
            Err(reason) => return Ok(Some(self.over(format!("the chunk at byte {start} {reason}")))),
        };
        let head_bytes = (CHUNK_HEAD + head.compression.len()) as u64;
        let there = head.compressed.min(left - head_bytes);
        self.at = start + RECORD_HEAD + head_bytes + there;
        let target = if head.compression.is_empty() { &mut self.chunk } else { &mut self.body };
        target.resize(there as usize, 0);
        read_exact(&mut self.file, &self.path, target)?;
        self.rest = 0;
        let cut = there < head.compressed;
        let unpacked = unpack(&head, &self.body, &mut self.chunk);
        if cut {
            self.cut = Some(format!("the chunk at byte {start} is cut short by the end of the file"));
        } else if let Err(reason) = unpacked.and_then(|()| head.verify(&self.chunk)) {
            self.rest = self.chunk.len();
            return Ok(Some(Found::Damaged(format!("the chunk at byte {start} {reason}; its messages are lost"))));
        }
        self.place = Place::Chunk;
        Ok(None)
    }

    /// The chunk's header, held against the length of its record; else what is wrong with it.
    fn chunk_head(&mut self, length: u64, left: u64) -> Result<Result<ChunkHead, String>, LogError> {
        let mut fixed = [0; 32];
        if left < CHUNK_HEAD as u64 + 8 {
            return Ok(Err("is cut short by the end of the file".into()));
        }
        self.read_exact(&mut fixed)?;
        let name_bytes = u32::from_le_bytes(std::array::from_fn(|i| fixed[28 + i])) as usize;
        if name_bytes > 8 {
            return Ok(Err(format!("names its compression with {name_bytes} letters: its header is damaged")));
        }
        let mut rest = [0; 16];
        self.read_exact(&mut rest[..name_bytes + 8])?;
        let head = ChunkHead {
            uncompressed: word(&fixed[16..]),
            crc: u32::from_le_bytes(std::array::from_fn(|i| fixed[24 + i])),
            compression: String::from_utf8_lossy(&rest[..name_bytes]).into_owned(),
            compressed: word(&rest[name_bytes..]),
        };
        Ok(head.check(length).map(|()| head))
    }

    /// The data are over: sees that the end is all there.
    fn end(&mut self, length: u64) -> Result<Found, LogError> {
        self.place = Place::Over;
        if length != 4 || self.length < self.at + TAIL_BYTES {
            return Ok(Found::Cut("the end of the file, with its index, is cut short".into()));
        }
        let mut tail = [0; TAIL_BYTES as usize];
        self.file.seek(SeekFrom::End(-(TAIL_BYTES as i64))).map_err(|source| read_error(&self.path, source))?;
        self.read_exact(&mut tail)?;
        let footer = tail[0] == op::FOOTER && word(&tail[1..]) == 20 && tail.ends_with(mcap::MAGIC);
        Ok(if footer { Found::End } else { Found::Cut("the end of the file, with its index, is damaged".into()) })
    }

    fn read_exact(&mut self, bytes: &mut [u8]) -> Result<(), LogError> {
        read_exact(&mut self.file, &self.path, bytes)
    }
}

impl ChunkHead {
    /// Whether the sizes agree with each other and with the record's `length`: a flipped bit in one of them is found
    /// here, before it is believed.
    fn check(&self, length: u64) -> Result<(), String> {
        let head = (CHUNK_HEAD + self.compression.len()) as u64;
        if head.checked_add(self.compressed) != Some(length) {
            let said = self.compressed;
            return Err(format!("has {length} bytes, its header says {head} and {said}: one of them is damaged"));
        }
        if self.compression.is_empty() && self.compressed != self.uncompressed {
            return Err("is not compressed, but has two sizes: its header is damaged".into());
        }
        let largest = self.compressed.max(self.uncompressed);
        if largest > MAX_CHUNK_BYTES {
            return Err(format!("has {largest} bytes; more than {MAX_CHUNK_BYTES} are not read"));
        }
        Ok(())
    }

    fn verify(&self, chunk: &[u8]) -> Result<(), String> {
        if chunk.len() as u64 != self.uncompressed {
            return Err(format!("unpacks to {} bytes instead of {}", chunk.len(), self.uncompressed));
        }
        match self.crc {
            0 => Ok(()), // its writer did not calculate any
            crc if crc32fast::hash(chunk) == crc => Ok(()),
            _ => Err("does not agree with its checksum".into()),
        }
    }
}

/// Unpacks `packed`, as far as it goes; a chunk that is not compressed is where it should be already.
fn unpack(head: &ChunkHead, packed: &[u8], chunk: &mut Vec<u8>) -> Result<(), String> {
    if head.compression.is_empty() {
        return Ok(());
    }
    chunk.clear();
    let failed = |error: std::io::Error| format!("does not unpack: {error}");
    // One byte more than there should be: a chunk that goes on is found by its length.
    let most = head.uncompressed + 1;
    let unpacked = match head.compression.as_str() {
        "lz4" => lz4::Decoder::new(packed).and_then(|decoder| decoder.take(most).read_to_end(chunk)),
        "zstd" => zstd::Decoder::new(packed).and_then(|decoder| decoder.take(most).read_to_end(chunk)),
        other => return Err(format!("is compressed with {other:?}; known are lz4 and zstd")),
    };
    unpacked.map(drop).map_err(failed)
}

/// The record of `chunk` that begins at `rest`, which then is the next one's place.
fn record_in(chunk: &[u8], rest: &mut usize) -> Option<Result<(u8, Range<usize>), String>> {
    let left = &chunk[*rest..];
    if left.is_empty() {
        return None;
    }
    let broken = |what: &str| Some(Err(format!("a chunk breaks off in the middle of {what}")));
    let Some(head) = left.get(..RECORD_HEAD as usize) else {
        *rest = chunk.len();
        return broken("a record's length");
    };
    let start = *rest + RECORD_HEAD as usize;
    match usize::try_from(word(&head[1..])).ok().and_then(|length| start.checked_add(length)) {
        Some(end) if end <= chunk.len() => {
            *rest = end;
            Some(Ok((head[0], start..end)))
        }
        _ => {
            *rest = chunk.len();
            broken("a record")
        }
    }
}

/// Understands a record. The crate `mcap` sets memory aside for as many bytes as a text says it has, up to 4 GiB: so texts
/// are held against the record first.
pub(crate) fn parse(opcode: u8, body: &[u8]) -> Result<mcap::records::Record<'static>, String> {
    texts_fit(opcode, body).ok_or("a text in it is longer than its record")?;
    mcap::parse_record(opcode, body).map(mcap::records::Record::into_owned).map_err(|error| error.to_string())
}

/// Whether all texts of a record end within it.
fn texts_fit(opcode: u8, mut body: &[u8]) -> Option<()> {
    let rest = &mut body;
    match opcode {
        op::SCHEMA => {
            skip(rest, 2)?;
            texts(rest, 2)
        }
        op::CHANNEL => {
            skip(rest, 4)?;
            texts(rest, 2)?;
            map_of_texts(rest)
        }
        op::METADATA => {
            texts(rest, 1)?;
            map_of_texts(rest)
        }
        op::ATTACHMENT => {
            skip(rest, 16)?;
            texts(rest, 2)
        }
        op::CHUNK_INDEX => {
            skip(rest, 32)?;
            texts(rest, 1)?; // the map of offsets: a length and so many bytes, as a text is
            skip(rest, 8)?;
            texts(rest, 1)
        }
        op::STATISTICS => Some(()),
        _ => None,
    }
}

fn skip<'a>(rest: &mut &'a [u8], bytes: usize) -> Option<&'a [u8]> {
    let (skipped, left) = rest.split_at_checked(bytes)?;
    *rest = left;
    Some(skipped)
}

fn text<'a>(rest: &mut &'a [u8]) -> Option<&'a [u8]> {
    let length = u32::from_le_bytes(skip(rest, 4)?.try_into().ok()?);
    skip(rest, length as usize)
}

fn texts(rest: &mut &[u8], count: usize) -> Option<()> {
    (0..count).try_for_each(|_| text(rest).map(drop))
}

fn map_of_texts(rest: &mut &[u8]) -> Option<()> {
    let mut entries = text(rest)?;
    while !entries.is_empty() {
        texts(&mut entries, 2)?;
    }
    Some(())
}

fn check_magic(file: &mut File, path: &Path) -> Result<(), LogError> {
    let no_log = |reason: &str| LogError::NoLog { path: path.into(), reason: reason.into() };
    let mut magic = [0; 8];
    match file.read_exact(&mut magic) {
        Ok(()) if magic == mcap::MAGIC => Ok(()),
        Ok(()) if magic.starts_with(b"\x89MCAP") => {
            Err(no_log(&format!("it is MCAP of version {:?}, which is newer than this program", magic[5] as char)))
        }
        Ok(()) => Err(no_log("it does not begin as an MCAP file does")),
        Err(error) if error.kind() == ErrorKind::UnexpectedEof => Err(no_log("it is empty, or ends within 8 bytes")),
        Err(source) => Err(read_error(path, source)),
    }
}

fn read_exact(file: &mut BufReader<File>, path: &Path, bytes: &mut [u8]) -> Result<(), LogError> {
    file.read_exact(bytes).map_err(|source| read_error(path, source))
}

fn read_error(path: &Path, source: std::io::Error) -> LogError {
    LogError::Read { path: path.into(), source }
}

/// A little-endian number of 64 bits; there are at least eight bytes.
fn word(bytes: &[u8]) -> u64 {
    bytes.iter().take(8).rev().fold(0, |word, byte| word << 8 | u64::from(*byte))
}
