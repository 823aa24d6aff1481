//! An MCAP file, record by record: whole, cut anywhere, or damaged.
//!
//! The crate `mcap` reads files that are right, and stops at the first thing that is not. A log of a robot that lost its
//! power is not right, so this reader is told apart: every length is held against the file before memory is set aside,
//! a chunk whose checksum is wrong is passed over, and what is left of the last chunk is given message by message.
//!
//! A log may also be a trap: a chunk that claims to be a gigabyte, and is, of zeros, packed into next to nothing. So no
//! chunk unpacks to more than it can honestly hold (`chunk.rs`), memory grows only as bytes come that are records, and
//! nothing that is kept for the whole file grows with what the file says of itself.

use std::fs::File;
use std::io::{BufReader, ErrorKind, Read, Seek, SeekFrom};
use std::ops::{Range, RangeInclusive};
use std::path::{Path, PathBuf};

use elk_outside::file;
use mcap::records::op;

use crate::chunk::{self, Chunk, ChunkHead, Unpacked};
use crate::error::LogError;
use crate::footer::{Footer, TAIL_BYTES};
use crate::head::{Head, MAX_RECORD_BYTES};
use crate::resync::end_of_content;

/// Bytes that are read from the file at once.
const READ_BYTES: usize = 1 << 20;

/// What was found next.
#[derive(Debug)]
pub(crate) enum Found {
    /// A record of this opcode, its bytes in [`Container::body`]; those of chunks come one by one.
    Record(u8),
    /// A chunk that is not what it was when it was written; its messages are lost, the next one is read on.
    Damaged(String),
    /// Something right that is too large to be kept.
    LeftOut(String),
    /// The file breaks off; nothing follows.
    Cut(String),
    /// The data have come to their proper end.
    End,
}

impl Found {
    /// An attachment that is larger than those that are kept.
    pub fn too_large(at: u64, length: u64) -> Self {
        Self::LeftOut(format!(
            "the attachment at byte {at} has {length} bytes; more than {MAX_RECORD_BYTES} are left out"
        ))
    }
}

/// Whether the next record is one of the file or of its chunk.
enum Level {
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
    level: Level,
    body: Vec<u8>,
    chunk: Chunk,
    /// Where in `chunk` the record that was found last lies; nothing: in `body`.
    found: Option<Range<usize>>,
    /// What is said behind the last record of the chunk, if that is not its proper end.
    ending: Option<Ending>,
    /// Chunks without a message that was recorded then (ns) are passed over; nothing: none is.
    wanted: Option<RangeInclusive<u64>>,
}

/// How a chunk ends whose end is not there.
enum Ending {
    /// The file ends with it.
    Cut(String),
    /// What follows in it is not read; the next chunk may be.
    Broken(String),
}

impl Container {
    /// Opens a file that begins as MCAP does.
    pub fn open(path: &Path) -> Result<Self, LogError> {
        check_magic(&mut file::open(path).map_err(|source| read_error(path, source))?, path)?;
        let mut container = Self::unchecked(path)?;
        container.seek(mcap::MAGIC.len() as u64)?;
        Ok(container)
    }

    /// Opens a file, whatever it begins with.
    pub fn unchecked(path: &Path) -> Result<Self, LogError> {
        let read = |source| LogError::Read { path: path.into(), source };
        let file = file::open(path).map_err(read)?;
        let length = file.metadata().map_err(read)?.len();
        Ok(Self {
            path: path.into(),
            file: BufReader::with_capacity(READ_BYTES, file),
            length,
            at: 0,
            level: Level::File,
            body: Vec::new(),
            chunk: Chunk::default(),
            found: None,
            ending: None,
            wanted: None,
        })
    }

    /// From now on passes over chunks without a message that was recorded at one of these times (ns).
    pub fn want(&mut self, times: RangeInclusive<u64>) {
        self.wanted = Some(times);
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
        (self.at, self.level, self.ending) = (offset, Level::File, None);
        Ok(())
    }

    /// The bytes of the record that was found last.
    pub fn body(&self) -> &[u8] {
        self.found.as_ref().map_or(&self.body, |range| self.chunk.bytes(range))
    }

    /// Whether the record that was found last lies in a chunk.
    pub fn in_chunk(&self) -> bool {
        self.found.is_some()
    }

    /// The next record, or what is there instead.
    pub fn next(&mut self) -> Result<Found, LogError> {
        loop {
            self.found = None;
            let found = match self.level {
                Level::Over => Some(Found::End),
                Level::Chunk => self.record_of_chunk(),
                Level::File => self.record_of_file()?,
            };
            if let Some(found) = found {
                return Ok(found);
            }
        }
    }

    /// The next record of the chunk; nothing at its end.
    fn record_of_chunk(&mut self) -> Option<Found> {
        if let Some((opcode, body)) = self.chunk.next() {
            self.found = Some(body);
            return Some(Found::Record(opcode));
        }
        self.level = Level::File;
        self.ending.take().map(|ending| match ending {
            Ending::Cut(reason) => self.over(reason),
            Ending::Broken(reason) => Found::Damaged(reason),
        })
    }

    /// The next record of the file itself; nothing for those that are passed over, and for chunks that can be read.
    fn record_of_file(&mut self) -> Result<Option<Found>, LogError> {
        let Some(left) = self.length.saturating_sub(self.at).checked_sub(Head::BYTES as u64) else {
            return Ok(Some(self.over(format!("it ends after {} bytes, in the middle of the data", self.length))));
        };
        let mut head = [0; Head::BYTES];
        self.read_exact(&mut head)?;
        let head = Head::of(&head);
        let Head { opcode, length } = head;
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
        let start = self.at;
        self.at = head.end(start);
        match opcode {
            op::DATA_END => Ok(Some(self.end(length)?)),
            op::MESSAGE_INDEX => self.skip(length),
            op::ATTACHMENT if length > MAX_RECORD_BYTES => {
                self.skip(length)?;
                Ok(Some(Found::too_large(start, length)))
            }
            _ if length > longest(opcode) => {
                self.skip(length)?;
                let most = longest(opcode);
                let reason = format!("the record at byte {start} has {length} bytes; more than {most} are not read");
                Ok(Some(Found::Damaged(reason)))
            }
            _ => {
                self.body.clear();
                let read = (&mut self.file).take(length).read_to_end(&mut self.body);
                match read.map_err(|source| read_error(&self.path, source))? as u64 == length {
                    true => Ok(Some(Found::Record(opcode))),
                    false => Err(read_error(&self.path, ErrorKind::UnexpectedEof.into())),
                }
            }
        }
    }

    fn skip(&mut self, length: u64) -> Result<Option<Found>, LogError> {
        let length = i64::try_from(length).unwrap_or(i64::MAX);
        self.file.seek_relative(length).map_err(|source| read_error(&self.path, source))?;
        Ok(None)
    }

    fn over(&mut self, reason: String) -> Found {
        self.level = Level::Over;
        Found::Cut(reason)
    }

    /// Reads a chunk of `length` bytes, of which `left` are in the file.
    fn chunk(&mut self, length: u64, left: u64) -> Result<Option<Found>, LogError> {
        let start = self.at;
        let head = match self.chunk_head(length, left)? {
            Ok(head) => head,
            Err(reason) => return Ok(Some(self.over(format!("the chunk at byte {start} {reason}")))),
        };
        let there = head.compressed.min(left - head.bytes());
        let end = start + Head::BYTES as u64 + head.bytes() + there;
        if there == head.compressed && self.wanted.as_ref().is_some_and(|wanted| head.is_outside(wanted)) {
            self.at = end;
            return self.skip(there);
        }
        let mut packed = (&mut self.file).take(there);
        let unpacked = match head.believable() {
            Ok(()) => self.chunk.unpack(&head, &mut packed),
            Err(reason) => Ok(Unpacked::Lost(reason)),
        };
        let unread = packed.limit().cast_signed();
        let passed = unpacked.and_then(|unpacked| self.file.seek_relative(unread).map(|()| unpacked));
        let unpacked = passed.map_err(|source| read_error(&self.path, source))?;
        (self.at, self.level) = (end, Level::Chunk);
        let cut = there < head.compressed;
        self.ending = match unpacked {
            _ if cut => Some(Ending::Cut(format!("the chunk at byte {start} is cut short by the end of the file"))),
            Unpacked::Whole => None,
            Unpacked::Broken(reason) => Some(Ending::Broken(format!("the chunk at byte {start} {reason}"))),
            Unpacked::Lost(reason) => {
                self.chunk.clear();
                Some(Ending::Broken(format!("the chunk at byte {start} {reason}; its messages are lost")))
            }
        };
        Ok(None)
    }

    /// The chunk's header, held against the length of its record; else what is wrong with it.
    fn chunk_head(&mut self, length: u64, left: u64) -> Result<Result<ChunkHead, String>, LogError> {
        const MOST: usize = chunk::HEAD_BYTES as usize + chunk::LONGEST_NAME;
        if left < MOST as u64 {
            return Ok(Err("is cut short by the end of the file".into()));
        }
        let mut bytes = [0; MOST];
        self.read_exact(&mut bytes)?;
        let Some(head) = ChunkHead::of(&bytes) else {
            return Ok(Err("names a compression that there is not: its header is damaged".into()));
        };
        let behind = head.bytes().cast_signed() - MOST as i64;
        self.file.seek_relative(behind).map_err(|source| read_error(&self.path, source))?;
        Ok(head.check(length).map(|()| head))
    }

    /// The data are over: sees that the end is all there.
    fn end(&mut self, length: u64) -> Result<Found, LogError> {
        self.level = Level::Over;
        if length != 4 || self.length < self.at + TAIL_BYTES as u64 {
            return Ok(Found::Cut("the end of the file, with its index, is cut short".into()));
        }
        match Footer::read(self.file.get_ref()).map_err(|source| read_error(&self.path, source))? {
            Some(_) => Ok(Found::End),
            None => Ok(Found::Cut("the end of the file, with its index, is damaged".into())),
        }
    }

    fn read_exact(&mut self, bytes: &mut [u8]) -> Result<(), LogError> {
        read_exact(&mut self.file, &self.path, bytes)
    }
}

/// The most bytes that a record of this kind has.
fn longest(opcode: u8) -> u64 {
    if opcode == op::MESSAGE { chunk::MAX_BYTES } else { MAX_RECORD_BYTES }
}

/// Understands a record. The crate `mcap` sets memory aside for as many bytes as a text says it has, up to 4 GiB, and relies
/// on what follows the texts being there: so all of it is held against the record first.
pub(crate) fn parse(opcode: u8, body: &[u8]) -> Result<mcap::records::Record<'static>, String> {
    let ends = end_of_content(opcode, &mut { body }, 0..body.len() as u64);
    ends.ok().flatten().ok_or("what it says to hold is longer than it is")?;
    mcap::parse_record(opcode, body).map(mcap::records::Record::into_owned).map_err(|error| error.to_string())
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

pub(crate) fn read_error(path: &Path, source: std::io::Error) -> LogError {
    LogError::Read { path: path.into(), source }
}
