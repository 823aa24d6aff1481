//! A damaged file: every record that is whole, wherever it lies.
//!
//! Where [`Container`](crate::container::Container) stops believing, this reader goes on: behind a stretch that is no
//! record it looks for the next one (`resync.rs`), a chunk whose checksum is wrong is taken apart all the same, one
//! that is compressed as far as it unpacks, and one whose header is lost by the mark that its compression begins with.
//! A single flipped bit is put back (`flip.rs`). Everything that is not as it was written is said.

use std::cell::Cell;
use std::collections::VecDeque;
use std::fs::File;
use std::io::{BufRead, BufReader, Read, Result as IoResult};
use std::ops::Range;
use std::os::unix::fs::FileExt;
use std::path::{Path, PathBuf};

use elk_outside::file;
use mcap::records::op;

use crate::chunk::{self, Chunk, ChunkHead, Unpacked};
use crate::container::{Found, read_error};
use crate::error::LogError;
use crate::flip::{Flip, flipped};
use crate::footer::Footer;
use crate::head::{Head, MAX_RECORD_BYTES};
use crate::resync::{AHEAD_BYTES, Bytes, DamagedChunk, RecordAt, RecordFinder, affordable, chunk_head, spend};
use crate::summary::checksum;

/// Bytes that are read from the file at once.
const READ_BYTES: usize = 1 << 20;
/// Packed bytes that are read at once.
const PACKED_BYTES: usize = 16 << 10;
/// In chunks up to this length (bytes) a flipped bit is looked for: in larger ones too much else passes for one.
const MAX_MENDED_BYTES: u64 = 4 << 20;
/// In files up to this length (bytes) a flipped bit is looked for: it takes a second.
const MAX_MENDED_FILE: u64 = 256 << 20;
/// What packed bytes begin with.
const MARKS: [(&str, [u8; 4]); 2] = [("zstd", [0x28, 0xb5, 0x2f, 0xfd]), ("lz4", [0x04, 0x22, 0x4d, 0x18])];
/// Behind such marks so many times the length of the file is read.
const MOST_BEHIND_MARKS: u64 = 4;
/// So many texts that lie apart are looked at in any file, and one more for each so many of its bytes.
const FAR_TEXTS: u64 = 1 << 16;
const BYTES_OF_A_FAR_TEXT: u64 = 256;
/// Behind such a mark so many bytes are unpacked to see whether they begin a record.
const TRIED_BYTES: u64 = 64;
/// The window begins so far before what is looked for in it: a record's head is looked at before its texts.
const LOOK_BACK_BYTES: u64 = 256;

/// A file that is read as far as it can be.
pub(crate) struct Salvage {
    path: PathBuf,
    source: Source,
    finder: RecordFinder,
    /// Where the next record of the file begins.
    at: u64,
    over: bool,
    /// What begins before here lies in a chunk that is not what was written.
    doubtful_to: u64,
    chunk: Opened,
    body: Vec<u8>,
    /// Where in the chunk the record that was found last lies; nothing: in `body`.
    found: Option<Range<usize>>,
    /// What is to be said before anything else is read.
    said: VecDeque<String>,
    /// Bytes that were read behind marks of packed ones: a file may be full of these.
    behind_marks: u64,
    /// The next record of the file, or that there is none, where that was found before all bytes ahead of it were looked at.
    ahead: Option<Option<RecordAt>>,
}

/// The chunk that is being read.
enum Opened {
    None,
    /// It is what was written.
    Right(Chunk),
    /// It is not; where in it the next record is looked for.
    Wrong {
        damaged: DamagedChunk,
        at: u64,
    },
}

/// The file's bytes, one of them put right, and those of them that were looked at last.
struct Source {
    file: File,
    length: u64,
    /// The byte that is put right, and how.
    mended: Option<(u64, u8)>,
    window: Vec<u8>,
    window_at: u64,
    /// Bytes that were read from the file so far, some of them again and again.
    read: Cell<u64>,
    /// So many texts may still be looked at, and so many that lie apart from what was looked at last: each of these costs a
    /// read of its own.
    texts: (u64, u64),
}

impl Source {
    /// Begins anew to count what is looked at.
    fn begin(&mut self) {
        self.texts = (affordable(self.length), FAR_TEXTS + self.length / BYTES_OF_A_FAR_TEXT);
    }

    /// Reads what is at `at`, as far as it goes.
    fn read_at(&self, at: u64, to: &mut [u8]) -> IoResult<usize> {
        let mut read = 0;
        while read < to.len() {
            match self.file.read_at(&mut to[read..], at + read as u64)? {
                0 => break,
                count => read += count,
            }
        }
        self.read.set(self.read.get() + read as u64);
        if let Some((byte, mask)) = self.mended
            && let Some(index) = byte.checked_sub(at).filter(|index| *index < read as u64)
        {
            to[index as usize] ^= mask;
        }
        Ok(read)
    }

    /// These bytes, if they were looked at last.
    fn in_window(&self, at: u64, count: usize) -> Option<&[u8]> {
        let from = usize::try_from(at.checked_sub(self.window_at)?).ok()?;
        self.window.get(from..)?.get(..count)
    }

    fn section(&self, Range { start, end }: Range<u64>) -> BufReader<Section<'_>> {
        BufReader::with_capacity(PACKED_BYTES, Section { source: self, at: start, end })
    }
}

impl Bytes for Source {
    fn length(&self) -> u64 {
        self.length
    }

    fn get(&mut self, at: u64, count: usize) -> IoResult<&[u8]> {
        let count = (self.length.saturating_sub(at)).min(count as u64) as usize;
        if self.in_window(at, count).is_none() {
            let start = at.min(self.length).saturating_sub(LOOK_BACK_BYTES);
            let wanted = (self.length - start).min(count as u64 + READ_BYTES as u64);
            let mut window = std::mem::take(&mut self.window);
            window.resize(wanted as usize, 0);
            let read = self.read_at(start, &mut window)?;
            window.truncate(read);
            (self.window, self.window_at) = (window, start);
        }
        let from = (at - self.window_at) as usize;
        let rest = self.window.get(from..).unwrap_or_default();
        Ok(&rest[..count.min(rest.len())])
    }

    fn peek<const N: usize>(&mut self, at: u64) -> IoResult<Option<[u8; N]>> {
        if let Some(there) = self.in_window(at, N) {
            return Ok(there.first_chunk().copied());
        }
        let mut bytes = [0; N];
        Ok((self.read_at(at, &mut bytes)? == N).then_some(bytes))
    }

    fn afford(&mut self, at: u64) -> bool {
        spend(&mut self.texts.0) && (self.in_window(at, 4).is_some() || spend(&mut self.texts.1))
    }
}

/// A part of the file.
struct Section<'a> {
    source: &'a Source,
    at: u64,
    end: u64,
}

impl Read for Section<'_> {
    fn read(&mut self, to: &mut [u8]) -> IoResult<usize> {
        let count = (self.end.saturating_sub(self.at)).min(to.len() as u64) as usize;
        let read = self.source.read_at(self.at, &mut to[..count])?;
        self.at += read as u64;
        Ok(read)
    }
}

impl Salvage {
    /// Opens a file, whatever it begins with.
    pub fn open(path: &Path) -> Result<Self, LogError> {
        let opened = file::open(path).and_then(|file| Ok((file.metadata()?.len(), file)));
        let (length, file) = opened.map_err(|source| read_error(path, source))?;
        let (window, read) = (Vec::new(), Cell::new(0));
        let source = Source { file, length, mended: None, window, window_at: 0, read, texts: (0, 0) };
        let mut salvage = Self {
            path: path.into(),
            source,
            finder: RecordFinder::default(),
            at: 0,
            over: false,
            doubtful_to: 0,
            chunk: Opened::None,
            body: Vec::new(),
            found: None,
            said: VecDeque::new(),
            behind_marks: 0,
            ahead: None,
        };
        salvage.mend()?;
        salvage.begin(RecordFinder::default());
        Ok(salvage)
    }

    /// Begins anew, with what is known of the file now.
    pub fn begin(&mut self, finder: RecordFinder) {
        let magic = mcap::MAGIC.len() as u64;
        let begins_right = self.source.get(0, mcap::MAGIC.len()).is_ok_and(|bytes| bytes == mcap::MAGIC);
        (self.at, self.over, self.chunk, self.behind_marks) =
            (if begins_right { magic } else { 0 }, false, Opened::None, 0);
        (self.finder, self.doubtful_to, self.ahead) = (finder, 0, None);
        self.source.begin();
        self.said.clear();
        if !begins_right {
            self.said.push_back("it does not begin as an MCAP file does".into());
        }
        if let Some((byte, _)) = self.source.mended {
            self.said.push_back(format!("a bit of byte {byte} was flipped; it is put back"));
        }
    }

    /// Puts back the one bit of the data that was flipped, if the checksum over all of them says that it is one, and all
    /// is right with it then.
    fn mend(&mut self) -> Result<(), LogError> {
        let failed = |source| read_error(&self.path, source);
        let end = match Footer::read(&self.source.file).map_err(failed)? {
            Some(footer) => footer.index.unwrap_or(footer.start),
            None => return Ok(()),
        };
        let Some(data) = end.checked_sub(Head::BYTES as u64 + 4).filter(|end| *end <= MAX_MENDED_FILE) else {
            return Ok(());
        };
        let mut said = [0; 4];
        self.source.read_at(data + Head::BYTES as u64, &mut said).map_err(failed)?;
        let said = u32::from_le_bytes(said);
        let found = checksum(&self.source.file, 0..data).map_err(failed)?.finalize();
        if said == 0 || said == found {
            return Ok(());
        }
        if let Some(Flip::Data(byte, mask)) = flipped(data, found, said) {
            self.source.mended = Some((byte, mask));
            self.begin(RecordFinder::default());
            let told = self.said.len();
            if !self.is_right(told)? {
                self.source.mended = None;
            }
            self.source.window.clear();
        }
        Ok(())
    }

    /// Whether nothing is said of the file beyond the first `told` words.
    fn is_right(&mut self, told: usize) -> Result<bool, LogError> {
        let mut damaged = 0;
        loop {
            match self.next()? {
                Found::Damaged(_) => damaged += 1,
                Found::Cut(_) => return Ok(false),
                Found::End => return Ok(damaged <= told),
                Found::Record(_) | Found::LeftOut(_) => {}
            }
        }
    }

    /// Length of the file when it was opened (bytes).
    pub fn length(&self) -> u64 {
        self.source.length
    }

    /// How much of the file has been read (bytes).
    pub fn position(&self) -> u64 {
        self.at.min(self.source.length)
    }

    /// The bytes of the record that was found last.
    pub fn body(&self) -> &[u8] {
        match (&self.found, &self.chunk) {
            (Some(range), Opened::Right(chunk)) => chunk.bytes(range),
            (Some(range), Opened::Wrong { damaged, .. }) => damaged.bytes.get(range.clone()).unwrap_or_default(),
            _ => &self.body,
        }
    }

    /// Whether the record that was found last lies in a chunk.
    pub fn in_chunk(&self) -> bool {
        self.found.is_some()
    }

    /// Whether the record that was found last lies in a chunk that is what was written.
    pub fn is_certain(&self) -> bool {
        self.found.is_some() && matches!(self.chunk, Opened::Right(_))
    }

    /// Whether the record that was found last lies in one that is not.
    pub fn is_doubtful(&self) -> bool {
        matches!(self.chunk, Opened::Wrong { .. }) || self.at <= self.doubtful_to
    }

    /// The next record, or what is said instead.
    pub fn next(&mut self) -> Result<Found, LogError> {
        loop {
            self.found = None;
            if let Some(said) = self.said.pop_front() {
                return Ok(Found::Damaged(said));
            }
            if self.over {
                return Ok(Found::End);
            }
            let found = match self.chunk {
                Opened::None => self.record_of_file(),
                _ => self.record_of_chunk(),
            };
            if let Some(found) = found.map_err(|source| read_error(&self.path, source))? {
                return Ok(found);
            }
        }
    }

    fn record_of_chunk(&mut self) -> IoResult<Option<Found>> {
        let found = match &mut self.chunk {
            Opened::None => None,
            Opened::Right(chunk) => chunk.next(),
            Opened::Wrong { damaged, at } => {
                let located = self.finder.next(damaged, *at)?;
                *at = located.map_or(u64::MAX, |located| located.end());
                located.map(|located| (located.head.opcode, located.at as usize + Head::BYTES..located.end() as usize))
            }
        };
        match (found, &self.chunk) {
            (None, _) => {
                self.chunk = Opened::None;
                Ok(None)
            }
            (Some((opcode, _)), Opened::Wrong { .. }) if !is_of_chunk(opcode) => Ok(None),
            (Some((opcode, range)), _) => {
                self.found = Some(range);
                Ok(Some(Found::Record(opcode)))
            }
        }
    }

    fn record_of_file(&mut self) -> IoResult<Option<Found>> {
        let located = match self.ahead.take() {
            Some(located) => located,
            None => self.finder.next(&mut self.source, self.at)?,
        };
        let to = located.map_or(self.source.length, |located| located.at);
        match located {
            _ if to > self.at => {
                self.ahead = Some(located);
                self.pass_over(to).map(|()| None)
            }
            Some(located) if located.head.opcode != op::FOOTER => self.take(located),
            _ => self.end().map(Some),
        }
    }

    /// Passes over what is no record, up to `to`; a chunk whose header is lost lies in what has the mark of one.
    fn pass_over(&mut self, to: u64) -> IoResult<()> {
        let start = std::mem::replace(&mut self.at, to);
        if let Some((mark, damaged)) = self.packed(start..to)? {
            self.said.push_back(format!("the header of the chunk before byte {mark} is damaged"));
            self.chunk = Opened::Wrong { damaged, at: 0 };
            self.at = mark + 1;
        } else {
            let passed = to - start;
            self.said.push_back(format!("{passed} bytes from byte {start} on are no record; they are passed over"));
        }
        Ok(())
    }

    /// Records that are packed, without the head of a chunk, in a part of the file: where they begin, and what they are.
    fn packed(&mut self, Range { mut start, end }: Range<u64>) -> IoResult<Option<(u64, DamagedChunk)>> {
        while let Some((at, name)) = self.mark(start..end)? {
            start = at + 1;
            if self.behind_marks > self.source.length.saturating_mul(MOST_BEHIND_MARKS) {
                return Ok(None);
            }
            let before = self.source.read.get();
            let packed = at..self.source.length;
            // Most of what has such a mark is something else: that is seen after a few bytes.
            let (begin, _) = unpack(name, self.source.section(packed.clone()), TRIED_BYTES)?;
            let mut bytes = Vec::new();
            if self.finder.may_begin(&begin) {
                (bytes, _) = unpack(name, self.source.section(packed), chunk::ALWAYS_BYTES)?;
            }
            self.behind_marks += self.source.read.get() - before;
            let mut damaged = DamagedChunk::of(bytes);
            let first = self.finder.next(&mut damaged, 0)?;
            if first.is_some_and(|located| located.at == 0 && is_of_chunk(located.head.opcode)) {
                return Ok(Some((at, damaged)));
            }
            // What was unpacked for nothing is work, too.
            self.behind_marks += damaged.length();
        }
        Ok(None)
    }

    /// The first mark that begins in a part of the file, and of what.
    fn mark(&mut self, Range { mut start, end }: Range<u64>) -> IoResult<Option<(u64, &'static str)>> {
        while start < end {
            let ahead = self.source.get(start, AHEAD_BYTES)?;
            let marks = ahead.windows(4).map(|bytes| MARKS.iter().find(|(_, mark)| mark == bytes));
            if let Some((at, name)) = (start..end).zip(marks).find_map(|(at, mark)| Some((at, mark?.0))) {
                return Ok(Some((at, name)));
            }
            start += (ahead.len() as u64).saturating_sub(3).max(1);
        }
        Ok(None)
    }

    /// Takes the record that begins here.
    fn take(&mut self, located: RecordAt) -> IoResult<Option<Found>> {
        self.at = located.end();
        let Head { opcode, length } = located.head;
        match opcode {
            op::CHUNK => self.open_chunk(located).map(|()| None),
            op::ATTACHMENT if length > MAX_RECORD_BYTES => Ok(Some(Found::too_large(located.at, length))),
            op::HEADER | op::SCHEMA | op::CHANNEL | op::MESSAGE | op::ATTACHMENT | op::METADATA | 0x80.. => {
                let body = self.source.get(located.at + Head::BYTES as u64, length as usize)?;
                self.body.clear();
                self.body.extend_from_slice(body);
                Ok(Some(Found::Record(opcode)))
            }
            _ => Ok(None),
        }
    }

    /// Opens the chunk that begins here, whatever state it is in.
    fn open_chunk(&mut self, located: RecordAt) -> IoResult<()> {
        let start = located.at + Head::BYTES as u64;
        let Some(head) = chunk_head(&mut self.source, start)? else {
            return Ok(());
        };
        let packed = start + head.bytes()..located.end().min(self.source.length);
        if head.compression.is_empty() && located.at < self.doubtful_to {
            // It begins within a damaged one: its records are read where they lie, too. One may begin at every byte,
            // and each would be read to its end.
            (self.at, self.doubtful_to) = (packed.start, self.doubtful_to.max(packed.end));
            return Ok(());
        }
        let mut right = Chunk::default();
        let reason = match head.believable() {
            Ok(()) => match right.unpack(&head, &mut self.source.section(packed.clone()))? {
                Unpacked::Whole => {
                    self.chunk = Opened::Right(right);
                    return Ok(());
                }
                Unpacked::Broken(reason) | Unpacked::Lost(reason) => reason,
            },
            Err(reason) => reason,
        };
        let most = right.seen() + chunk::ALWAYS_BYTES;
        drop(right);
        if head.compression.is_empty() && head.compressed > MAX_MENDED_BYTES {
            // Its records are read where they lie, as if there was no chunk: that takes no memory for what is none.
            self.said.push_back(taken_as_it_is(located.at, &reason));
            (self.at, self.doubtful_to) = (packed.start, packed.end);
            return Ok(());
        }
        let (bytes, stopped) = unpack(&head.compression, self.source.section(packed), most)?;
        let reason = stopped.unwrap_or(reason);
        let at = located.at;
        self.chunk = match mended(bytes, &head) {
            Ok(chunk) if head.compression.is_empty() => {
                self.said.push_back(format!("the chunk at byte {at} had one flipped bit; it is put back"));
                Opened::Right(chunk)
            }
            // What was flipped is packed: one bit of that makes many others of what it unpacks to, some of which pass
            // for one. So this chunk may be what was written, and may not.
            Ok(chunk) => {
                self.said
                    .push_back(format!("the chunk at byte {at} agrees with its checksum but for one bit, put back"));
                Opened::Wrong { damaged: DamagedChunk::of(chunk.into_bytes()), at: 0 }
            }
            Err(bytes) => {
                self.said.push_back(taken_as_it_is(at, &reason));
                Opened::Wrong { damaged: DamagedChunk::of(bytes), at: 0 }
            }
        };
        Ok(())
    }

    /// Nothing more can be found.
    fn end(&mut self) -> IoResult<Found> {
        self.over = true;
        self.at = self.source.length;
        Ok(match Footer::read(&self.source.file)? {
            Some(_) => Found::End,
            None => Found::Cut(format!("it breaks off after {} bytes, or its end is damaged", self.source.length)),
        })
    }
}

fn taken_as_it_is(at: u64, reason: &str) -> String {
    format!("the chunk at byte {at} {reason}; its messages are taken as they are, as far as it goes")
}

/// Whether records of this kind are looked for in a damaged chunk. A message's kind with a flipped bit is that of another
/// program's record, or of one that no chunk has.
fn is_of_chunk(opcode: u8) -> bool {
    matches!(opcode, op::MESSAGE | op::SCHEMA | op::CHANNEL)
}

/// Unpacks as much as can be, up to `most` bytes, and says why it is not more.
fn unpack(compression: &str, mut packed: impl BufRead, most: u64) -> IoResult<(Vec<u8>, Option<String>)> {
    let mut bytes = Vec::new();
    let outcome = match compression {
        "lz4" => lz4::Decoder::new(packed).and_then(|it| it.take(most).read_to_end(&mut bytes)),
        "zstd" => {
            zstd::Decoder::with_buffer(packed).and_then(|it| it.single_frame().take(most).read_to_end(&mut bytes))
        }
        _ => return packed.by_ref().take(most).read_to_end(&mut bytes).map(|_| (bytes, None)),
    };
    Ok((bytes, outcome.err().map(|error| format!("unpacks only in part: {error}"))))
}

/// The chunk with its one flipped bit put back; else the bytes as they are.
fn mended(mut bytes: Vec<u8>, head: &ChunkHead) -> Result<Chunk, Vec<u8>> {
    let length = bytes.len() as u64;
    if head.crc == 0 || length != head.uncompressed || length > MAX_MENDED_BYTES {
        return Err(bytes);
    }
    let flip = flipped(length, crc32fast::hash(&bytes), head.crc);
    let bit = match flip {
        None => return Err(bytes),
        Some(Flip::Checksum) => None,
        Some(Flip::Data(at, mask)) => Some((at as usize, mask)),
    };
    let put_back = |bytes: &mut [u8]| {
        if let Some((byte, mask)) = bit.and_then(|(at, mask)| Some((bytes.get_mut(at)?, mask))) {
            *byte ^= mask;
        }
    };
    put_back(&mut bytes);
    Chunk::of(bytes).map_err(|mut bytes| {
        put_back(&mut bytes);
        bytes
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Bytes that were read of a file to recover all that there is in it.
    fn read_of(bytes: &[u8]) -> u64 {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("damaged.mcap");
        std::fs::write(&path, bytes).unwrap();
        let mut salvage = Salvage::open(&path).unwrap();
        let mut found = 0;
        while !matches!(salvage.next().unwrap(), Found::End) {
            found += 1;
        }
        assert!(found > 0);
        salvage.source.read.get()
    }

    fn head(opcode: u8, length: u64) -> Vec<u8> {
        [&[opcode][..], &length.to_le_bytes()].concat()
    }

    /// A chunk, uncompressed, that says to have so many bytes.
    fn chunk(length: u64) -> Vec<u8> {
        let body = [&[0; 16][..], &length.to_le_bytes(), &7_u32.to_le_bytes(), &[0; 4], &length.to_le_bytes()].concat();
        [head(op::CHUNK, 40 + length), body].concat()
    }

    /// Files in which every few bytes something claims to lead far away, of so many bytes each.
    fn traps(length: u64) -> Vec<(&'static str, Vec<u8>)> {
        let again = |make: &dyn Fn(u64) -> Vec<u8>| {
            let mut bytes = mcap::MAGIC.to_vec();
            while (bytes.len() as u64) < length {
                let left = length - bytes.len() as u64;
                bytes.extend(make(left));
            }
            bytes
        };
        let message = |left: u64| [head(op::MESSAGE, left / 2), vec![0; MESSAGE_BYTES]].concat();
        // Each text leads to where the one of another record lies.
        let far_texts = |left: u64| {
            let (name, map, text) = (0_u32, left.saturating_sub(64) as u32 / 2, 12 * 34 - 4_u32);
            let lengths = [name, map, text].map(u32::to_le_bytes).concat();
            [head(op::METADATA, u64::from(map) + 8), lengths, vec![0; 13]].concat()
        };
        vec![
            ("records of another program", again(&|left| head(0x80, left / 2))),
            ("messages", again(&message)),
            ("schemas", again(&|left| [head(op::SCHEMA, left / 2), vec![0; 7]].concat())),
            ("metadata", again(&|left| [head(op::METADATA, left / 2), vec![0; 4]].concat())),
            ("texts of a map", again(&|left| [head(op::METADATA, left / 2), vec![0; 200]].concat())),
            ("far texts of a map", again(&far_texts)),
            ("chunks in chunks", again(&|left| [chunk(left), message(left)].concat())),
            ("marks of zstd", again(&|_| vec![0x28, 0xb5, 0x2f, 0xfd])),
            ("marks of lz4", again(&|_| vec![0x04, 0x22, 0x4d, 0x18, 0x64, 0x40, 0xa7])),
            ("zeros", again(&|_| vec![0])),
            ("small numbers", again(&|_| vec![1, 0, 5, 0, 0, 0, 0, 0, 0, 0, 0])),
        ]
    }

    const MESSAGE_BYTES: usize = crate::head::MESSAGE_HEAD;

    /// Regression: behind each mark of a packed chunk the next record was looked for up to where it had been found before.
    #[test]
    fn what_lies_ahead_is_looked_for_once() {
        let channel = [&1_u16.to_le_bytes()[..], &[0; 2], &[0; 12]].concat();
        let records = [head(op::CHANNEL, channel.len() as u64), channel].concat();
        let packed = zstd::encode_all(&records[..], 1).unwrap();
        let length = 4 << 20;
        let mut bytes = mcap::MAGIC.to_vec();
        (0..16).for_each(|_| bytes.extend(&packed));
        bytes.resize(length, 0);
        let read = read_of(&bytes);
        assert!(read <= 4 * length as u64, "{read} bytes of {length}");
    }

    /// Regression: a megabyte was read for every byte that could be a head, before and after it.
    #[test]
    fn a_damaged_file_is_read_a_few_times_for_every_trap() {
        // So many times in one pass: to look for records, for marks, and what is tried.
        const MOST: u64 = 16;
        for length in [2 << 20, 6 << 20] {
            for (what, bytes) in traps(length) {
                let read = read_of(&bytes);
                assert!(read <= MOST * length, "{what}: {read} bytes of {length}");
            }
        }
    }
}
