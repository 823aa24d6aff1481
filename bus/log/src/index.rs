//! What is in a log, and where: from the indexes at the ends of its files, without reading what lies between.
//!
//! A file that has no index, because its writer was killed or is still writing, is read through.

use std::collections::BTreeMap;
use std::fs::File;
use std::io::{Read, Seek, SeekFrom};
use std::path::{Path, PathBuf};
use std::sync::Arc;

use mcap::records::{ChunkIndex, Record as McapRecord, op};

use crate::channel::{Channel, ChannelKind};
use crate::container;
use crate::encoding::seconds;
use crate::error::LogError;
use crate::record::Metadata;
use crate::segment::{Next, Segment};
use crate::segments::segments;

/// The footer's record, and the magic behind it (bytes).
const TAIL_BYTES: usize = 9 + 20 + 8;
/// An index that claims to be larger is taken for damaged (bytes).
const MAX_SUMMARY_BYTES: u64 = 256 << 20;

/// Told how far reading has come: bytes read, bytes in all.
pub type OnProgress<'a> = &'a mut dyn FnMut(u64, u64);

/// What is in a log, and where.
#[derive(Debug, Clone)]
pub struct Index {
    pub(crate) segments: Vec<SegmentIndex>,
    /// Where the run came from.
    pub metadata: Metadata,
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
    damage: Vec<String>,
}

/// One variable of a log, from one source.
#[derive(Debug, Clone, PartialEq, Eq, PartialOrd, Ord)]
pub struct Topic {
    /// The variable.
    pub name: String,
    /// Who published it.
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
        let indexes = paths.iter().map(|path| SegmentIndex::read(path, on_progress));
        Ok(Self { segments: indexes.collect::<Result<_, _>>()?, metadata })
    }

    /// The files, in their order.
    pub fn files(&self) -> impl Iterator<Item = &Path> {
        self.segments.iter().map(|segment| segment.path.as_path())
    }

    /// Length of all files (bytes).
    pub fn bytes(&self) -> u64 {
        self.segments.iter().map(|segment| segment.bytes).sum()
    }

    /// Messages of the bus.
    pub fn messages(&self) -> u64 {
        self.topics().iter().map(|topic| topic.count).sum()
    }

    /// When the first message was recorded, and the last (s); nothing: there is none.
    pub fn span(&self) -> Option<(f64, f64)> {
        let start = self.segments.iter().filter_map(|segment| segment.start).min()?;
        let end = self.segments.iter().filter_map(|segment| segment.end).max()?;
        Some((seconds(start), seconds(end)))
    }

    /// Every variable with its sources, by name.
    pub fn topics(&self) -> Vec<Topic> {
        let mut topics: BTreeMap<Topic, u64> = BTreeMap::new();
        for segment in &self.segments {
            for (id, channel) in &segment.channels {
                if matches!(channel.kind, ChannelKind::Value(_)) {
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

    /// Whether every file has its proper end, as far as that can be said without reading it.
    pub fn whole(&self) -> bool {
        self.damage().next().is_none()
    }

    /// What was found to be damaged or cut short, in words.
    pub fn damage(&self) -> impl Iterator<Item = &str> {
        self.segments.iter().flat_map(|segment| segment.damage.iter().map(String::as_str))
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
        let mut file = File::open(path).map_err(read)?;
        let bytes = file.metadata().map_err(read)?.len();
        match summary(&mut file, bytes).map_err(read)? {
            Summary::Found(records) => Self::from_summary(path, bytes, &records, on_progress),
            Summary::Missing => Self::by_reading(path, on_progress),
            Summary::Damaged(reason) => {
                let mut index = Self::by_reading(path, on_progress)?;
                index.damage.push(format!("{}: its index is damaged: {reason}", path.display()));
                Ok(index)
            }
        }
    }

    fn from_summary(path: &Path, bytes: u64, records: &[u8], on_progress: OnProgress<'_>) -> Result<Self, LogError> {
        let mut index = Self { path: path.into(), bytes, ..Self::default() };
        let mut last_drop = None;
        let mut chunks = Vec::new();
        let mut schemas = BTreeMap::new();
        let of_use = |record: &Result<(u8, &[u8]), String>| {
            let wanted = [op::SCHEMA, op::CHANNEL, op::CHUNK_INDEX, op::STATISTICS];
            record.as_ref().map_or(true, |(opcode, _)| wanted.contains(opcode))
        };
        for record in split(records).filter(of_use) {
            match record.and_then(|(opcode, body)| container::parse(opcode, body)) {
                Ok(McapRecord::Schema { header, .. }) => drop(schemas.insert(header.id, header.name)),
                Ok(McapRecord::Channel(channel)) => {
                    let schema = schemas.get(&channel.schema_id).map_or("", String::as_str);
                    let (id, channel) = (channel.id, Channel::announced(channel, schema));
                    index.channels.insert(id, Arc::new(channel));
                }
                Ok(McapRecord::ChunkIndex(chunk)) => chunks.push(chunk),
                Ok(McapRecord::Statistics(said)) => {
                    let (start, end) = (said.message_start_time, said.message_end_time);
                    (index.start, index.end) = ((said.message_count > 0).then_some(start), Some(end));
                    index.end = index.start.and(index.end);
                    index.counts = said.channel_message_counts;
                }
                Ok(_) => {}
                Err(reason) => {
                    let mut read = Self::by_reading(path, on_progress)?;
                    read.damage.push(format!("{}: its index is damaged: {reason}", path.display()));
                    return Ok(read);
                }
            }
        }
        chunks.sort_by_key(|chunk: &ChunkIndex| chunk.chunk_start_offset);
        for chunk in &chunks {
            index.chunks.push((chunk.message_end_time, chunk.chunk_start_offset));
            let drops = |(id, channel): (&u16, &Arc<Channel>)| {
                channel.kind == ChannelKind::Dropped && chunk.message_index_offsets.contains_key(id)
            };
            if index.channels.iter().any(drops) {
                last_drop = Some(chunk.chunk_start_offset);
            }
        }
        if let Some(offset) = last_drop {
            index.dropped = index.read_dropped(offset)?;
        }
        Ok(index)
    }

    /// The last count of losses in the chunk at `offset`, or behind it.
    fn read_dropped(&self, offset: u64) -> Result<u64, LogError> {
        let mut segment = Segment::open(&self.path)?;
        segment.seek(Some(offset), &self.channels, 0)?;
        let mut dropped = 0;
        loop {
            match segment.next()? {
                Next::Dropped(total) => dropped = total,
                Next::End => return Ok(dropped),
                Next::Message | Next::Damage(_) => {}
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
                Next::Damage(reason) => index.damage.push(reason),
                Next::End => break,
            }
            if segment.position() != told {
                told = segment.position();
                on_progress(told, index.bytes);
            }
        }
        index.channels = segment.channels().map(|(id, channel)| (id, channel.clone())).collect();
        Ok(index)
    }

    /// Where the first chunk begins that has a message recorded at `time` (ns) or later; nothing: that is not known.
    pub fn chunk_at(&self, time: u64) -> Option<u64> {
        self.chunks.iter().find(|(end, _)| *end >= time).map(|(_, offset)| *offset)
    }
}

/// The records at the end of a file.
enum Summary {
    Found(Vec<u8>),
    /// The file breaks off before, or was written without.
    Missing,
    Damaged(String),
}

fn summary(file: &mut File, length: u64) -> std::io::Result<Summary> {
    let mut tail = [0; TAIL_BYTES];
    let Some(tail_start) = length.checked_sub(TAIL_BYTES as u64) else {
        return Ok(Summary::Missing);
    };
    file.seek(SeekFrom::Start(tail_start))?;
    file.read_exact(&mut tail)?;
    if tail[0] != op::FOOTER || !tail.ends_with(mcap::MAGIC) {
        return Ok(Summary::Missing);
    }
    let start = u64::from_le_bytes(std::array::from_fn(|i| tail[9 + i]));
    if start == 0 {
        return Ok(Summary::Missing);
    }
    let size = match tail_start.checked_sub(start) {
        Some(size) if size <= MAX_SUMMARY_BYTES => size,
        _ => return Ok(Summary::Damaged(format!("it is said to begin at byte {start} of {length}"))),
    };
    let mut bytes = vec![0; size as usize];
    file.seek(SeekFrom::Start(start))?;
    file.read_exact(&mut bytes)?;
    let mut crc = crc32fast::Hasher::new();
    crc.update(&bytes);
    // The footer up to the checksum itself is part of what it covers.
    crc.update(&tail[..9 + 16]);
    let said = u32::from_le_bytes(std::array::from_fn(|i| tail[9 + 16 + i]));
    match said == 0 || said == crc.finalize() {
        true => Ok(Summary::Found(bytes)),
        false => Ok(Summary::Damaged("it does not agree with its checksum".into())),
    }
}

/// The records in `bytes`, one after the other.
fn split(mut bytes: &[u8]) -> impl Iterator<Item = Result<(u8, &[u8]), String>> {
    std::iter::from_fn(move || {
        let (head, rest) = match bytes.split_first_chunk::<9>() {
            _ if bytes.is_empty() => return None,
            None => (&[0; 9], &[][..]),
            Some(split) => split,
        };
        let length = u64::from_le_bytes(std::array::from_fn(|i| head[1 + i]));
        match usize::try_from(length).ok().and_then(|length| rest.split_at_checked(length)) {
            Some((body, rest)) if head[0] != 0 => {
                bytes = rest;
                Some(Ok((head[0], body)))
            }
            _ => {
                bytes = &[];
                Some(Err("it breaks off in the middle of a record".into()))
            }
        }
    })
}
