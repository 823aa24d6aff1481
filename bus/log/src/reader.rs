//! Reading a log, from its first message to where it ends or breaks off.

use std::collections::VecDeque;
use std::ops::RangeInclusive;
use std::path::{Path, PathBuf};

use elk_outside::file;

use crate::damage::Damage;
use crate::encoding::{Scratch, nanoseconds, seconds};
use crate::error::LogError;
use crate::index::Index;
use crate::record::{Metadata, Record, RecordRef};
use crate::segment::{Next, Segment};
use crate::segments::{missing, segments};
use crate::selection::Window;

/// Gives the records of a log in the order in which they were recorded, all segments of a run one after the other.
///
/// A log whose writer was killed has no end: all its whole messages are given, then the iteration stops and
/// [`LogReader::whole`] stays false. A chunk that is damaged is passed over, and the log is not whole either;
/// [`LogReader::damage`] says what was found. What other tools have written into the log is given as well: under its
/// topic, as a number or a text where it is one, else as bytes of a type that is called as its schema.
pub struct LogReader {
    /// Segments that are still to be read.
    segments: VecDeque<PathBuf>,
    current: Option<Segment>,
    /// Whether all that can be had of a damaged file is wanted.
    salvages: bool,
    /// Nobody asks for messages that were recorded at other times (ns); nothing: all are wanted.
    wanted: Option<RangeInclusive<u64>>,
    metadata: Metadata,
    /// What is right and too large to be kept, in words.
    left_out: Damage,
    damage: Damage,
    /// Losses of the segments before, and of this one so far.
    dropped: (u64, u64),
    /// Bytes of the segments read before, and of all.
    bytes: (u64, u64),
    scratch: Scratch,
}

/// What is next in a log.
pub(crate) enum Item {
    /// A message.
    Message,
    /// A record of another tool, of this kind.
    Other(u8),
}

impl LogReader {
    /// Opens the log at `path`, a file or a run's folder, and reads where it came from.
    pub fn open(path: &Path) -> Result<Self, LogError> {
        let paths = segments(path)?;
        let metadata = match paths.first() {
            Some(first) => Segment::metadata_of(first)?,
            None => Metadata::default(),
        };
        Ok(Self::of(path, paths, metadata))
    }

    /// A reader of the log at `path`, of which these files are there.
    fn of(path: &Path, paths: Vec<PathBuf>, metadata: Metadata) -> Self {
        let mut damage = Damage::default();
        missing(path, &paths).into_iter().for_each(|reason| damage.note(reason));
        let length = paths.iter().map(|path| length(path)).sum();
        Self {
            segments: paths.into(),
            current: None,
            salvages: false,
            wanted: None,
            metadata,
            left_out: Damage::default(),
            damage,
            dropped: (0, 0),
            bytes: (0, length),
            scratch: Scratch::default(),
        }
    }

    /// As [`LogReader::open`], for a log that may be damaged: gives every message that is whole, also of a chunk that is
    /// not what was written. Where nobody can tell which of such a chunk's messages are damaged, all are given;
    /// [`LogReader::damage`] names the chunk.
    ///
    /// # Errors
    /// None of its files can be read at all.
    pub fn open_damaged(path: &Path) -> Result<Self, LogError> {
        let paths = segments(path)?;
        let mut opened = paths.iter().map(|path| file::open(path).map_err(|source| (path, source)));
        if let (Some(Err((path, source))), true) = (opened.next(), opened.all(|one| one.is_err())) {
            return Err(LogError::Read { path: path.clone(), source });
        }
        // Each file of a log says it again.
        let mut said = paths.iter().filter_map(|path| Segment::metadata_of_damaged(path).ok());
        let metadata = said.find(|said| *said != Metadata::default()).unwrap_or_default();
        Ok(Self { salvages: true, ..Self::of(path, paths, metadata) })
    }

    /// Nothing outside of `window` is asked for from now on: it may be given, or passed over unread.
    pub fn within(&mut self, window: &Window<'_>) {
        self.wanted = window.bounds();
    }

    /// Where the run came from; empty where the log does not say.
    pub fn metadata(&self) -> &Metadata {
        &self.metadata
    }

    /// Whether the log was read to its proper end, and nothing in it is damaged. False as long as records are left.
    pub fn whole(&self) -> bool {
        self.current.is_none() && self.segments.is_empty() && self.damage.is_empty()
    }

    /// What was found to be damaged or cut short so far, in words; beyond a thousand places the rest is counted.
    pub fn damage(&self) -> Vec<String> {
        self.damage.reasons()
    }

    /// See [`LogReader::damage`].
    pub(crate) fn found(&self) -> &Damage {
        &self.damage
    }

    /// Messages that the logger missed, as far as the log has been read.
    pub fn dropped(&self) -> u64 {
        self.dropped.0 + self.dropped.1
    }

    /// Bytes read, and bytes of all segments.
    pub fn progress(&self) -> (u64, u64) {
        let here = self.current.as_ref().map_or(0, Segment::position);
        (self.bytes.0 + here, self.bytes.1)
    }

    /// Goes on with the first record that was recorded at `time` (s) or later. With an index this costs one chunk; a
    /// segment without one is read up to there.
    pub fn seek(&mut self, index: &Index, time: f64) -> Result<(), LogError> {
        let time = nanoseconds(time);
        let (before, later): (Vec<_>, Vec<_>) =
            index.segments.iter().partition(|segment| segment.end.is_none_or(|end| end < time));
        self.bytes.0 = before.iter().map(|segment| segment.bytes).sum();
        self.segments = later.iter().map(|segment| segment.path.clone()).collect();
        self.current = None;
        if let (Some(path), Some(found)) = (self.segments.pop_front(), later.first()) {
            let mut segment = self.open_segment(&path)?;
            segment.seek(found.chunk_at(time), &found.channels, time)?;
            self.current = Some(segment);
        }
        Ok(())
    }

    /// The next record where it lies, or nothing at the end.
    pub fn next_ref(&mut self) -> Option<Result<RecordRef<'_>, LogError>> {
        match self.advance() {
            Ok(false) => None,
            Ok(true) => self.record(),
            Err(error) => Some(Err(error)),
        }
    }

    /// Finds the next record; whether there is one. What it says is not decoded before [`LogReader::record`].
    pub fn advance(&mut self) -> Result<bool, LogError> {
        let found = self.find();
        if let Err(error) = &found {
            // What cannot be read at all is not tried again; the next segment may be better.
            self.damage.note(error.to_string());
            self.leave_segment();
        }
        found
    }

    fn find(&mut self) -> Result<bool, LogError> {
        loop {
            match self.find_item()? {
                Some(Item::Message) => return Ok(true),
                Some(Item::Other(_)) => {}
                None => return Ok(false),
            }
        }
    }

    /// As [`LogReader::advance`], with what other tools have written beside messages.
    pub(crate) fn next_item(&mut self) -> Option<Item> {
        loop {
            match self.find_item() {
                Ok(item) => return item,
                Err(error) => {
                    self.damage.note(error.to_string());
                    self.leave_segment();
                }
            }
        }
    }

    fn open_segment(&self, path: &Path) -> Result<Segment, LogError> {
        if self.salvages {
            return Segment::open_damaged(path);
        }
        let mut segment = Segment::open(path)?;
        if let Some(times) = &self.wanted {
            segment.want(times.clone());
        }
        Ok(segment)
    }

    fn find_item(&mut self) -> Result<Option<Item>, LogError> {
        loop {
            let Some(segment) = &mut self.current else {
                let Some(path) = self.segments.pop_front() else {
                    return Ok(None);
                };
                self.current = Some(self.open_segment(&path)?);
                continue;
            };
            match segment.next()? {
                Next::Message => return Ok(Some(Item::Message)),
                Next::Other(opcode) => return Ok(Some(Item::Other(opcode))),
                Next::LeftOut(what) => self.left_out.note(what),
                Next::Dropped(total) => self.dropped.1 = total,
                Next::Damage(reason) => self.damage.note(reason),
                Next::End => self.leave_segment(),
            }
        }
    }

    /// Variable, source and time of recording (s, to the nanosecond) of the record that was found last.
    pub fn head(&self) -> Option<(&str, &str, f64)> {
        let (channel, time) = self.current.as_ref()?.head()?;
        Some((&channel.key, &channel.source, seconds(time)))
    }

    /// The segment that the record that was found last lies in.
    pub(crate) fn segment(&self) -> Option<&Segment> {
        self.current.as_ref()
    }

    /// What is right and was too large to be kept so far, in words.
    pub(crate) fn left_out(&self) -> Vec<String> {
        self.left_out.reasons()
    }

    /// The type of the message that was found last, if another tool wrote it and it is neither a number nor a text.
    pub fn unknown_type(&self) -> Option<&str> {
        let (channel, _) = self.current.as_ref()?.foreign()?;
        (!channel.is_understood()).then(|| channel.type_name())
    }

    /// The record that was found last.
    pub fn record(&mut self) -> Option<Result<RecordRef<'_>, LogError>> {
        self.current.as_ref().map(|segment| segment.record(&mut self.scratch))
    }

    fn leave_segment(&mut self) {
        if let Some(segment) = self.current.take() {
            self.bytes.0 += segment.position();
        }
        self.dropped = (self.dropped.0 + self.dropped.1, 0);
    }
}

fn length(path: &Path) -> u64 {
    path.metadata().map_or(0, |metadata| metadata.len())
}

impl Iterator for LogReader {
    type Item = Result<Record, LogError>;

    fn next(&mut self) -> Option<Self::Item> {
        self.next_ref().map(|next| next.map(|record| record.to_record()))
    }
}
