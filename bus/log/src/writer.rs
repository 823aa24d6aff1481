//! Writing a log.

use std::borrow::Cow;
use std::collections::{BTreeMap, HashMap};
use std::fs::File;
use std::path::{Path, PathBuf};
use std::sync::Arc;

use elk_bus::{Type, ValueRef};
use mcap::records::{AttachmentHeader, MessageHeader, Record as McapRecord};
use mcap::write::NoSeek;
use mcap::{Attachment, WriteOptions, Writer};

use crate::again::{self, SaidChannel};
use crate::channel as announced;
use crate::chunk;
use crate::container;
use crate::encoding::{self, Announcement, nanoseconds};
use crate::error::LogError;
use crate::head::{MAX_RECORD_BYTES, MESSAGE_HEAD, word};
use crate::record::{Metadata, RecordRef};
use crate::schema;
use crate::segments;
use crate::shown;
use crate::spatial::Shape;
use crate::staging::Staging;

/// What may wait in memory for a disk that takes nothing before records are refused (bytes).
pub const MAX_STAGED_BYTES: usize = 64 << 20;

/// The profile of elk's own logs.
const OWN_PROFILE: &str = "elk";

/// A chunk is closed when it is this large (bytes), or when the log is flushed.
const CHUNK_BYTES: u64 = 1 << 20;

/// Channels are said again when the file has grown by so much since the last one of them was announced (bytes): a hole
/// of some pages does not reach from there to here. Then whenever it is four times as long.
const AGAIN_BYTES: u64 = 64 << 10;
/// Channels that take more (bytes) are not said again: no reader would take a record as long, head and names included.
const LONGEST_AGAIN: u64 = MAX_RECORD_BYTES - (1 << 10);

/// How chunks are compressed. A chunk that is flushed is compressed by itself, so nothing waits longer for it.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum Compression {
    /// Not at all: the least work.
    #[default]
    None,
    /// LZ4: little work, little gain.
    Lz4,
    /// Zstandard: more of both.
    Zstd,
}

impl Compression {
    fn of_format(self) -> Option<mcap::Compression> {
        match self {
            Compression::None => None,
            Compression::Lz4 => Some(mcap::Compression::Lz4),
            Compression::Zstd => Some(mcap::Compression::Zstd),
        }
    }
}

/// How a log is written.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct LogOptions {
    /// How chunks are compressed.
    pub compression: Compression,
    /// A new segment begins when the file has this many bytes; `None`: never.
    pub rotate_bytes: Option<u64>,
    /// A new segment begins when so much time has been recorded (s, the community's clock); `None`: never.
    pub rotate_secs: Option<f64>,
}

/// Writes a log: every record once, in the order of [`LogWriter::append`].
pub struct LogWriter {
    /// The log's first segment.
    path: PathBuf,
    options: LogOptions,
    metadata: Metadata,
    /// Whose files these are, as their first records say.
    profile: String,
    segment: Segment,
    buffer: Vec<u8>,
}

/// The file that is being written.
struct Segment {
    path: PathBuf,
    number: u64,
    compression: Compression,
    file: File,
    staging: Staging,
    format: Writer<NoSeek<Staging>>,
    channels: HashMap<String, Vec<Channel>>,
    /// What was announced, and how long the file is when it is said again (bytes).
    said: Vec<SaidChannel>,
    again_at: u64,
    /// Channels of other tools, by the address of their announcement, which is kept for that.
    foreign: HashMap<usize, (Arc<announced::Channel>, u16)>,
    /// The channel of the logger's losses.
    losses: Option<u16>,
    /// Messages that are missing from this segment.
    dropped: u64,
    /// When its first record was recorded.
    started: Option<f64>,
    /// Bytes that the file has.
    bytes: u64,
}

/// A channel that is announced in the file.
struct Channel {
    id: u16,
    source: String,
    community: String,
    epoch: u64,
    kind: ChannelKind,
}

#[derive(PartialEq)]
enum ChannelKind {
    Double,
    Text,
    /// Values of a type, as it is said to be: who describes it, or has it drawn as something else, has another channel; so
    /// has what is too long to be stored with its fields.
    Binary {
        type_: Type,
        is_described: bool,
        drawn: Option<Shape>,
        has_fields: bool,
    },
}

impl Channel {
    fn carries(&self, record: &RecordRef<'_>) -> bool {
        let same_kind = match (&self.kind, record.value) {
            (ChannelKind::Double, ValueRef::Double(_)) | (ChannelKind::Text, ValueRef::Text(_)) => true,
            (
                ChannelKind::Binary { type_: carried, is_described, drawn, has_fields },
                ValueRef::Binary { type_, bytes },
            ) => {
                let is_said_so = *is_described == type_.is_described() && *drawn == Shape::of(type_);
                carried.as_ref() == type_ && is_said_so && *has_fields == encoding::has_fields(type_, bytes)
            }
            _ => false,
        };
        same_kind && self.source == record.source && self.community == record.community && self.epoch == record.epoch
    }
}

impl LogWriter {
    /// As [`LogWriter::create_with`], without compression or rotation.
    pub fn create(path: &Path, metadata: &Metadata) -> Result<Self, LogError> {
        Self::create_with(path, metadata, LogOptions::default())
    }

    /// Creates the log at `path`, with `metadata` on the disk when this returns. A log that is there stays: this one goes
    /// on in the next segment (see [`segments`](crate::segments())).
    pub fn create_with(path: &Path, metadata: &Metadata, options: LogOptions) -> Result<Self, LogError> {
        Self::create_for(path, metadata, options, OWN_PROFILE)
    }

    /// As [`LogWriter::create_with`], for a log of another tool, whose readers go by its profile.
    pub(crate) fn create_for(
        path: &Path,
        metadata: &Metadata,
        options: LogOptions,
        profile: &str,
    ) -> Result<Self, LogError> {
        let segment = Segment::create(path, 0, metadata, options.compression, profile)?;
        let (metadata, profile) = (metadata.clone(), profile.to_owned());
        Ok(Self { path: path.into(), options, metadata, profile, segment, buffer: Vec::new() })
    }

    /// The file that is being written.
    pub fn segment(&self) -> &Path {
        &self.segment.path
    }

    /// Records a message. It is on the disk after the next [`LogWriter::flush`] that succeeds. An error means that this
    /// message is not recorded; the log goes on.
    pub fn append(&mut self, record: &RecordRef<'_>) -> Result<(), LogError> {
        if self.rotation_is_due(record.received) && self.rotate(self.segment.compression).is_err() {
            // The next flush says what is wrong with the disk. Until then this segment is written on, and the next
            // rotation is a segment away.
            (self.segment.started, self.segment.bytes) = (None, 0);
        }
        self.segment.has_room()?;
        self.buffer.clear();
        shown::encode(record, &mut self.buffer)?;
        let message = std::mem::take(&mut self.buffer);
        let rotated = self.see_that_it_is_believed(&message);
        self.buffer = message;
        rotated?;
        self.segment.append(record, &self.buffer).map_err(|error| LogError::Record {
            key: record.key.into(),
            source_name: record.source.into(),
            reason: error.to_string(),
        })
    }

    /// Writes a message of another tool as it is: `body` is its record, `channel` what it was announced by.
    pub(crate) fn append_foreign(&mut self, channel: &Arc<announced::Channel>, body: &[u8]) -> Result<(), LogError> {
        let refused = |error: mcap::McapError| LogError::Record {
            key: channel.key.clone(),
            source_name: channel.source.clone(),
            reason: error.to_string(),
        };
        self.segment.has_room()?;
        self.see_that_it_is_believed(body)?;
        self.segment.append_foreign(channel, body).map_err(refused)
    }

    /// Sees to it that readers will believe the chunk that `message` comes into: one that packs too tightly is not packed.
    fn see_that_it_is_believed(&mut self, message: &[u8]) -> Result<(), LogError> {
        match self.segment.compression == Compression::Zstd && packs_too_tightly(message) {
            true => self.rotate(Compression::None),
            false => Ok(()),
        }
    }

    /// Writes an attachment, metadata, or a record of another tool's own; answers whether it is one of these.
    pub(crate) fn append_record(&mut self, opcode: u8, body: &[u8]) -> Result<bool, LogError> {
        let written = self.segment.append_record(opcode, body);
        written.map_err(|error| self.segment.write_error(std::io::Error::other(error)))
    }

    /// Notes in the log itself that `newly` more messages are missing from it.
    pub fn note_dropped(&mut self, newly: u64, received: f64) -> Result<(), LogError> {
        let noted = self.segment.note_dropped(newly, received);
        noted.map_err(|error| self.segment.write_error(std::io::Error::other(error)))
    }

    fn rotation_is_due(&self, now: f64) -> bool {
        let large = self.options.rotate_bytes.is_some_and(|most| self.segment.bytes >= most);
        let old = self.options.rotate_secs.zip(self.segment.started).is_some_and(|(most, start)| now - start >= most);
        large || old
    }

    /// Ends this segment and begins the next one, packed with `compression`. An error means that there is no room for it:
    /// this segment is the one that is written on.
    fn rotate(&mut self, compression: Compression) -> Result<(), LogError> {
        self.segment.flush()?;
        let next = Segment::create(&self.path, self.segment.number + 1, &self.metadata, compression, &self.profile)?;
        // If the disk does not take its end, a segment is readable up to its last flush, which was just now.
        let _ = std::mem::replace(&mut self.segment, next).finish();
        Ok(())
    }

    /// Closes the chunk and writes all that waits: the file is readable up to here, whatever happens to this process.
    /// If the disk refuses, nothing is lost: the rest waits for the next flush.
    pub fn flush(&mut self) -> Result<(), LogError> {
        self.segment.flush()
    }

    /// Flushes, and waits until the disk itself has all of it: it survives the machine.
    pub fn sync(&mut self) -> Result<(), LogError> {
        self.segment.flush()?;
        self.segment.sync()
    }

    /// Ends the file with its index and brings it onto the disk itself.
    pub fn finish(self) -> Result<(), LogError> {
        self.segment.finish()
    }

    /// Bytes that wait in memory for the disk.
    pub fn waiting(&self) -> usize {
        self.segment.staging.len()
    }
}

/// Whether Zstandard makes so little of a large message that no reader would believe what it unpacks to. Such a message,
/// and all that follow, are written as they are, in the next segment.
fn packs_too_tightly(message: &[u8]) -> bool {
    let large = message.len() as u64 + 2 * CHUNK_BYTES > chunk::ALWAYS_BYTES;
    let mut packed = Counter(0);
    // The fastest level packs least; twice as tightly is left to the one that chunks are packed with.
    large
        && zstd::stream::copy_encode(message, &mut packed, 1).is_ok()
        && packed.0.saturating_mul(chunk::MAX_RATIO / 2) < message.len() as u64
}

/// Counts what is written to it.
struct Counter(u64);

impl std::io::Write for Counter {
    fn write(&mut self, bytes: &[u8]) -> std::io::Result<usize> {
        self.0 += bytes.len() as u64;
        Ok(bytes.len())
    }

    fn flush(&mut self) -> std::io::Result<()> {
        Ok(())
    }
}

impl Segment {
    fn create(
        path: &Path,
        from: u64,
        metadata: &Metadata,
        compression: Compression,
        profile: &str,
    ) -> Result<Self, LogError> {
        let (file, path, number) = segments::create(path, from)?;
        let created =
            |error: mcap::McapError| LogError::Create { path: path.clone(), source: std::io::Error::other(error) };
        let staging = Staging::default();
        let format = WriteOptions::new()
            .compression(compression.of_format())
            .profile(profile)
            .library(concat!("elk-log ", env!("CARGO_PKG_VERSION")))
            .chunk_size(Some(CHUNK_BYTES))
            .disable_seeking(true)
            .create(NoSeek::new(staging.clone()))
            .map_err(created)?;
        let mut segment = Self {
            path,
            number,
            compression,
            file,
            staging,
            format,
            channels: HashMap::new(),
            said: Vec::new(),
            again_at: u64::MAX,
            foreign: HashMap::new(),
            losses: None,
            dropped: 0,
            started: None,
            bytes: 0,
        };
        // Another tool's log has nothing to say of a run of elk's.
        let is_of_a_run = profile == OWN_PROFILE || *metadata != Metadata::default();
        let written = if is_of_a_run { segment.write_metadata(metadata) } else { Ok(()) };
        written
            .map_err(|error| LogError::Create { path: segment.path.clone(), source: std::io::Error::other(error) })?;
        segment.flush()?;
        Ok(segment)
    }

    fn write_metadata(&mut self, metadata: &Metadata) -> mcap::McapResult<()> {
        self.format.write_metadata(&mcap::records::Metadata {
            name: encoding::ELK.into(),
            metadata: BTreeMap::from([
                ("format".into(), encoding::FORMAT.to_string()),
                ("segment".into(), self.number.to_string()),
                ("mission_name".into(), metadata.mission_name.clone()),
                ("version".into(), metadata.version.clone()),
                ("seed".into(), metadata.seed.to_string()),
                ("started".into(), metadata.started.to_string()),
                ("world".into(), metadata.world.clone()),
                ("world_checksum".into(), metadata.world_checksum.clone()),
                ("effective_mission".into(), metadata.effective_mission.clone()),
                ("run".into(), metadata.run.clone()),
            ]),
        })?;
        if metadata.mission_name.is_empty() {
            return Ok(());
        }
        self.format.attach(&Attachment {
            log_time: nanoseconds(metadata.started),
            create_time: nanoseconds(metadata.started),
            name: metadata.mission_name.clone(),
            media_type: "application/xml".into(),
            data: Cow::Borrowed(metadata.mission.as_bytes()),
        })
    }

    /// Whether more may wait for the disk.
    fn has_room(&self) -> Result<(), LogError> {
        let waiting = self.staging.len();
        if waiting > MAX_STAGED_BYTES {
            return Err(LogError::Full { path: self.path.clone(), waiting });
        }
        Ok(())
    }

    /// Takes `record`, whose message is `bytes`. A chunk that this closes goes to the disk at once; if the disk refuses, it
    /// waits for the next flush, which reports the failure.
    fn append(&mut self, record: &RecordRef<'_>, bytes: &[u8]) -> mcap::McapResult<()> {
        let header = MessageHeader {
            channel_id: self.channel(record)?,
            sequence: record.sequence as u32, // MCAP has 32 bits; the whole number is in the message
            log_time: nanoseconds(record.received),
            publish_time: nanoseconds(record.time),
        };
        let waited = self.staging.len();
        self.format.write_to_known_channel(&header, bytes)?;
        self.started.get_or_insert(record.received);
        if self.staging.len() > waited {
            let _ = self.drain();
        }
        Ok(())
    }

    fn append_foreign(&mut self, channel: &Arc<announced::Channel>, body: &[u8]) -> mcap::McapResult<()> {
        let Some((head, bytes)) = body.split_at_checked(MESSAGE_HEAD) else {
            return Ok(());
        };
        let Some(channel_id) = self.foreign_channel(channel)? else {
            return Ok(());
        };
        let (log_time, publish_time) = (word(&head[6..]), word(&head[14..]));
        let sequence = word(&head[2..]) as u32;
        let header = MessageHeader { channel_id, sequence, log_time, publish_time };
        let waited = self.staging.len();
        self.format.write_to_known_channel(&header, bytes)?;
        if self.staging.len() > waited {
            let _ = self.drain();
        }
        Ok(())
    }

    /// The channel in this file for another tool's; nothing: it is not another tool's.
    fn foreign_channel(&mut self, channel: &Arc<announced::Channel>) -> mcap::McapResult<Option<u16>> {
        if let Some((_, id)) = self.foreign.get(&Arc::as_ptr(channel).addr()) {
            return Ok(Some(*id));
        }
        let announced::ChannelKind::Foreign(foreign) = &channel.kind else {
            return Ok(None);
        };
        // What another file of the same log has announced is found again by what it says.
        let schema = match &foreign.schema {
            Some(schema) => self.format.add_schema(&schema.name, &schema.encoding, &schema.data)?,
            None => 0,
        };
        let id = self.format.add_channel(schema, &channel.key, &foreign.message_encoding, &foreign.metadata)?;
        self.foreign.insert(Arc::as_ptr(channel).addr(), (channel.clone(), id));
        Ok(Some(id))
    }

    fn append_record(&mut self, opcode: u8, body: &[u8]) -> mcap::McapResult<bool> {
        match container::parse(opcode, body) {
            _ if opcode >= 0x80 => {
                self.format.write_private_record(opcode, body, Default::default())?;
            }
            Ok(McapRecord::Attachment { header, data, .. }) => {
                let AttachmentHeader { log_time, create_time, name, media_type } = header;
                self.format.attach(&Attachment { log_time, create_time, name, media_type, data })?;
            }
            Ok(McapRecord::Metadata(metadata)) => self.format.write_metadata(&metadata)?,
            _ => return Ok(false),
        }
        Ok(true)
    }

    fn drain(&mut self) -> std::io::Result<()> {
        let waited = self.staging.len();
        let drained = self.staging.drain_into(&mut self.file);
        self.bytes += (waited - self.staging.len()) as u64;
        drained
    }

    fn channel(&mut self, record: &RecordRef<'_>) -> mcap::McapResult<u16> {
        let known = self.channels.get(record.key).and_then(|c| c.iter().find(|c| c.carries(record)));
        match known {
            Some(channel) => Ok(channel.id),
            None => self.announce(record),
        }
    }

    fn announce(&mut self, record: &RecordRef<'_>) -> mcap::McapResult<u16> {
        let said = Announcement::of(&record.value);
        let schema = self.format.add_schema(&said.schema_name, said.schema_encoding, &said.schema)?;
        let mut metadata = BTreeMap::from([
            ("source".into(), record.source.into()),
            ("community".into(), record.community.into()),
            ("epoch".into(), record.epoch.to_string()),
        ]);
        let carried = match record.value {
            ValueRef::Double(_) => ChannelKind::Double,
            ValueRef::Text(_) => ChannelKind::Text,
            ValueRef::Binary { type_, bytes } => {
                metadata.insert("type".into(), type_.name().into());
                metadata.insert("layout".into(), format!("{:016x}", type_.layout()));
                if let Some(description) = type_.description() {
                    metadata.insert("description".into(), description.to_text());
                }
                // Which type it is, name and layout say: its description need not be kept once more.
                ChannelKind::Binary {
                    type_: Type::undescribed(type_.name(), type_.layout()),
                    is_described: type_.is_described(),
                    drawn: Shape::of(type_),
                    has_fields: encoding::has_fields(type_, bytes),
                }
            }
        };
        let id = self.format.add_channel(schema, record.key, said.message_encoding, &metadata)?;
        self.say_again(SaidChannel {
            id,
            topic: record.key.into(),
            schema: said.schema_name,
            encoding: said.message_encoding.into(),
            metadata,
        });
        let RecordRef { source, community, epoch, .. } = *record;
        let channel = Channel { id, source: source.into(), community: community.into(), epoch, kind: carried };
        self.channels.entry(record.key.into()).or_default().push(channel);
        Ok(id)
    }

    fn note_dropped(&mut self, newly: u64, received: f64) -> mcap::McapResult<()> {
        let channel_id = match self.losses {
            Some(id) => id,
            None => {
                let schema = schema::DROPPED.as_bytes();
                let schema = self.format.add_schema(encoding::DROPPED, encoding::JSON_SCHEMA, schema)?;
                let id = self.format.add_channel(schema, encoding::DROPPED, encoding::JSON, &BTreeMap::new())?;
                let (topic, schema) = (encoding::DROPPED.to_owned(), encoding::DROPPED.to_owned());
                let metadata = BTreeMap::new();
                self.say_again(SaidChannel { id, topic, schema, encoding: encoding::JSON.into(), metadata });
                id
            }
        };
        self.losses = Some(channel_id);
        self.dropped += newly;
        let time = nanoseconds(received);
        let header = MessageHeader { channel_id, sequence: 0, log_time: time, publish_time: time };
        self.format.write_to_known_channel(&header, encoding::dropped(self.dropped, received).as_bytes())
    }

    /// Notes a channel that was announced just now.
    fn say_again(&mut self, channel: SaidChannel) {
        self.said.push(channel);
        self.again_at = self.bytes + AGAIN_BYTES;
    }

    fn flush(&mut self) -> Result<(), LogError> {
        let closed = self.format.flush().map_err(std::io::Error::other);
        let written = closed.and_then(|()| self.drain()).and_then(|()| self.put_channels());
        written.map_err(|source| self.write_error(source))
    }

    /// Says all channels again, if that is due.
    fn put_channels(&mut self) -> std::io::Result<()> {
        if self.bytes < self.again_at {
            return Ok(());
        }
        self.again_at = 4 * self.bytes;
        let record = again::record(&self.said)?;
        if record.metadata.values().map(|text| text.len() as u64).sum::<u64>() > LONGEST_AGAIN {
            self.again_at = u64::MAX;
            return Ok(());
        }
        self.format.write_metadata(&record).map_err(std::io::Error::other)?;
        self.drain()
    }

    fn finish(mut self) -> Result<(), LogError> {
        let ended = self.format.finish().map(|_| ()).map_err(std::io::Error::other);
        ended.and_then(|()| self.drain()).map_err(|source| self.write_error(source))?;
        self.sync()
    }

    fn sync(&self) -> Result<(), LogError> {
        self.file.sync_data().map_err(|source| LogError::Sync { path: self.path.clone(), source })
    }

    fn write_error(&self, source: std::io::Error) -> LogError {
        LogError::Write { path: self.path.clone(), source, waiting: self.staging.len() }
    }
}
