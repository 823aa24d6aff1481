//! What is in a log, and where: from the indexes at the ends of its files, without reading what lies between.
//!
//! A file that has no index, because its writer was killed or is still writing, is read through.

use std::collections::BTreeMap;
use std::ops::Range;
use std::path::{Path, PathBuf};
use std::sync::Arc;

use elk_outside::file;

use crate::channel::{Channel, ChannelKind};
use crate::damage::Damage;
use crate::encoding::seconds;
use crate::error::LogError;
use crate::extras::Extras;
pub use crate::extras::{Extra, ExtraKind};
use crate::record::Metadata;
use crate::segment::{Next, Said, Segment};
use crate::segments::{missing, segments};
use crate::summary::Summary;

/// Told how far reading has come: bytes read, bytes in all.
pub type OnProgress<'a> = &'a mut dyn FnMut(u64, u64);

/// What is in a log, and where.
#[derive(Debug, Clone)]
pub struct Index {
    pub(crate) segments: Vec<SegmentIndex>,
    /// Where the run came from.
    pub metadata: Metadata,
    /// Which files are not there, in words.
    missing: Vec<String>,
}

/// What is in one file.
#[derive(Debug, Clone, Default)]
pub(crate) struct SegmentIndex {
    pub path: PathBuf,
    pub bytes: u64,
    pub channels: BTreeMap<u16, Arc<Channel>>,
    counts: BTreeMap<u16, u64>,
    /// First and last time of recording (ns); none: there is no message.
    start: Option<u64>,
    pub end: Option<u64>,
    /// When each chunk's last message was recorded (ns), and where in the file it begins.
    chunks: Vec<(u64, u64)>,
    dropped: u64,
    /// What stands beside the messages.
    extras: Extras,
    /// What was found where the file had to be read.
    damage: Damage,
    /// Why its own index is not relied on.
    index_damage: Option<String>,
}

/// One variable of a log, from one source.
#[derive(Debug, Clone, PartialEq, Eq, PartialOrd, Ord)]
pub struct Topic {
    /// The variable.
    pub name: String,
    /// Who published it; empty: another tool, which does not say.
    pub source: String,
    /// What it carries: `double`, `text`, or the type's name.
    pub type_name: String,
    /// How it is stored, as viewers call it.
    pub schema: String,
    /// Messages.
    pub count: u64,
}

impl Index {
    /// The index of the log at `path`, a file or a run's folder; `on_progress` is told how far a file without one has
    /// been read.
    ///
    /// # Errors
    /// A file cannot be opened, or is no log of this program.
    pub fn read(path: &Path, on_progress: OnProgress<'_>) -> Result<Self, LogError> {
        let paths = segments(path)?;
        let metadata = match paths.first() {
            Some(first) => Segment::metadata_of(first)?,
            None => Metadata::default(),
        };
        let missing = missing(path, &paths);
        let indexes = paths.iter().map(|path| SegmentIndex::read(path, on_progress));
        Ok(Self { segments: indexes.collect::<Result<_, _>>()?, metadata, missing })
    }

    /// The files, in their order.
    pub fn files(&self) -> impl Iterator<Item = &Path> {
        self.segments.iter().map(|segment| segment.path.as_path())
    }

    /// Length of all files (bytes).
    pub fn bytes(&self) -> u64 {
        self.segments.iter().map(|segment| segment.bytes).sum()
    }

    /// Messages, also those of other tools.
    pub fn messages(&self) -> u64 {
        self.topics().iter().map(|topic| topic.count).sum()
    }

    /// When the first message was recorded, and the last (s); nothing: there is none.
    pub fn span(&self) -> Option<(f64, f64)> {
        let start = self.segments.iter().filter_map(|segment| segment.start).min()?;
        let end = self.segments.iter().filter_map(|segment| segment.end).max()?;
        // A file may say that its last message came before its first.
        Some((seconds(start), seconds(end.max(start))))
    }

    /// Every variable with its sources, by name.
    pub fn topics(&self) -> Vec<Topic> {
        let mut topics: BTreeMap<Topic, u64> = BTreeMap::new();
        for segment in &self.segments {
            for (id, channel) in &segment.channels {
                if channel.kind != ChannelKind::Dropped {
                    let count = segment.counts.get(id).copied().unwrap_or_default();
                    *topics.entry(topic(channel)).or_default() += count;
                }
            }
        }
        topics.into_iter().map(|(topic, count)| Topic { count, ..topic }).collect()
    }

    /// Messages that the logger missed, as it says itself.
    pub fn dropped(&self) -> u64 {
        self.segments.iter().map(|segment| segment.dropped).sum()
    }

    /// Attachments and metadata, by kind and name; and how many more there are beyond the first thousand of each file.
    pub fn extras(&self) -> (Vec<Extra>, u64) {
        let mut all = Extras::default();
        self.segments.iter().for_each(|segment| all.merge(&segment.extras));
        (all.told().collect(), all.more())
    }

    /// Whether every file is there and has its proper end, as far as that can be said without reading it.
    pub fn whole(&self) -> bool {
        self.missing.is_empty()
            && self.segments.iter().all(|segment| segment.damage.is_empty() && segment.index_damage.is_none())
    }

    /// What was found to be damaged or cut short, in words; beyond a thousand places the rest is counted.
    pub fn damage(&self) -> Vec<String> {
        let mut all = Damage::default();
        self.missing.iter().for_each(|reason| all.note(reason.clone()));
        self.segments.iter().for_each(|segment| all.merge(&segment.damage));
        self.index_damage().for_each(|reason| all.note(reason.to_owned()));
        all.reasons()
    }

    /// Which files' own indexes are not relied on, and why: what nobody sees who only reads the messages.
    pub(crate) fn index_damage(&self) -> impl Iterator<Item = &str> {
        self.segments.iter().filter_map(|segment| segment.index_damage.as_deref())
    }
}

/// A channel's topic, its messages not counted yet.
fn topic(channel: &Channel) -> Topic {
    Topic {
        name: channel.key.clone(),
        source: channel.source.clone(),
        type_name: channel.type_name().into(),
        schema: channel.schema.clone(),
        count: 0,
    }
}

impl SegmentIndex {
    fn read(path: &Path, on_progress: OnProgress<'_>) -> Result<Self, LogError> {
        let read = |source| LogError::Read { path: path.into(), source };
        let file = file::open(path).map_err(read)?;
        let reason = match Summary::find(&file).map_err(read)? {
            Summary::Missing => return Self::by_reading(path, on_progress),
            Summary::Found(range) => match Self::from_summary(path, range)? {
                Ok(Some(index)) => return Ok(index),
                Ok(None) => return Self::by_reading(path, on_progress),
                Err(reason) => reason,
            },
            Summary::Damaged(reason) => reason,
        };
        let index_damage = Some(format!("{}: its index is damaged: {reason}", path.display()));
        Ok(Self { index_damage, ..Self::by_reading(path, on_progress)? })
    }

    /// What the records at the end of the file say, in the bytes `range`, or nothing where they leave out channels or
    /// counts, as they may; else what is wrong with them.
    fn from_summary(path: &Path, range: Range<u64>) -> Result<Result<Option<Self>, String>, LogError> {
        let mut segment = Segment::at_the_beginning(path)?;
        let mut index = Self { path: path.into(), bytes: segment.length(), ..Self::default() };
        let (mut last_drop, mut counted, mut indexed) = (None, None, (0_u64, 0_u64));
        if let Err(reason) = segment.summary(range, |record| match record {
            Said::Chunk(chunk, drops) => {
                index.chunks.push((chunk.message_end_time, chunk.chunk_start_offset));
                last_drop = last_drop.max(drops.then_some(chunk.chunk_start_offset));
            }
            Said::Statistics(said) => counted = Some(said),
            Said::Extra(kind, name, media_type, bytes) => {
                let count = if kind == ExtraKind::Attachment { &mut indexed.0 } else { &mut indexed.1 };
                *count += 1;
                index.extras.note(kind, &name, &media_type, bytes);
            }
        })? {
            return Ok(Err(reason));
        }
        let Some(counted) = counted.filter(|counted| segment.names_all(counted)) else {
            return Ok(Ok(None));
        };
        if indexed != (u64::from(counted.attachment_count), u64::from(counted.metadata_count)) {
            return Ok(Ok(None)); // what stands beside the messages need not be indexed either
        }
        if counted.message_count > 0 {
            (index.start, index.end) = (Some(counted.message_start_time), Some(counted.message_end_time));
        }
        if index.chunks.len() as u64 != u64::from(counted.chunk_count) {
            index.chunks.clear(); // where what lies the data say
        }
        index.counts = counted.channel_message_counts;
        index.channels = segment.channels().map(|(id, channel)| (id, channel.clone())).collect();
        index.chunks.sort_by_key(|(_, start)| *start);
        let tells = |id: &u16| index.channels.get(id).is_some_and(|channel| channel.kind == ChannelKind::Dropped);
        if last_drop.is_none() && index.counts.keys().any(tells) {
            return Ok(Ok(None)); // of losses that no index leads to
        }
        if let Some(offset) = last_drop {
            index.dropped = index.read_dropped(offset)?;
        }
        Ok(Ok(Some(index)))
    }

    /// The last count of losses in the chunk at `offset`, or behind it.
    fn read_dropped(&self, offset: u64) -> Result<u64, LogError> {
        let mut segment = Segment::at_the_beginning(&self.path)?;
        segment.seek(Some(offset), &self.channels, 0)?;
        let mut dropped = 0;
        loop {
            match segment.next()? {
                Next::Dropped(total) => dropped = total,
                Next::End => return Ok(dropped),
                Next::Message | Next::Damage(_) | Next::Other(_) | Next::LeftOut(_) => {}
            }
        }
    }

    fn by_reading(path: &Path, on_progress: OnProgress<'_>) -> Result<Self, LogError> {
        let mut segment = Segment::open(path)?;
        let mut index = Self { path: path.into(), bytes: segment.length(), ..Self::default() };
        let mut told = 0;
        loop {
            match segment.next()? {
                Next::Message => {
                    let (id, time) = segment.found();
                    *index.counts.entry(id).or_default() += 1;
                    index.start = Some(index.start.map_or(time, |start| start.min(time)));
                    index.end = Some(index.end.map_or(time, |end| end.max(time)));
                }
                Next::Dropped(total) => index.dropped = total,
                Next::Damage(reason) => index.damage.note(reason),
                Next::Other(_) => {}
                Next::LeftOut(_) => index.extras.note_unknown(),
                Next::End => break,
            }
            if segment.position() != told {
                told = segment.position();
                on_progress(told, index.bytes);
            }
        }
        index.channels = segment.channels().map(|(id, channel)| (id, channel.clone())).collect();
        index.extras.merge(segment.extras());
        Ok(index)
    }

    /// Where the first chunk begins that has a message recorded at `time` (ns) or later; nothing: that is not known.
    pub fn chunk_at(&self, time: u64) -> Option<u64> {
        self.chunks.iter().find(|(end, _)| *end >= time).map(|(_, offset)| *offset)
    }
}
