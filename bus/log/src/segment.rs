//! One file of a log, message by message.

use std::collections::{BTreeMap, BTreeSet};
use std::ops::{Range, RangeInclusive};
use std::path::{Path, PathBuf};
use std::sync::Arc;

use mcap::records::{self, ChunkIndex, Record as McapRecord, Statistics, op};

use elk_outside::file;

use crate::again::{self, SaidChannel};
use crate::channel::{Channel, ChannelKind};
use crate::container::{self, Container, Found, read_error};
use crate::encoding::{self, Decoded, Scratch, seconds};
use crate::error::LogError;
use crate::extras::{ExtraKind, Extras};
use crate::foreign::Schema;
use crate::head::{Head, MESSAGE_HEAD};
use crate::record::{Metadata, RecordRef};
use crate::resync::RecordFinder;
use crate::said::{Garbled, text};
use crate::salvage::Salvage;
use crate::summary::Summary;

/// Names, sources and types of all channels of a file take at most so many bytes; what is announced beyond is not known.
const MAX_NAMES_BYTES: usize = 64 << 20;

/// One file of a log.
pub(crate) struct Segment {
    path: PathBuf,
    records: Records,
    schemas: BTreeMap<u16, Arc<Schema>>,
    channels: Vec<Option<Arc<Channel>>>,
    /// Bytes of all names that were kept.
    names_bytes: usize,
    /// Whether all channels are known before the first message.
    knows_channels: bool,
    /// Channels of messages that were never announced, each of which is said once.
    unknown: BTreeSet<u16>,
    messages: u64,
    /// Messages that were recorded before are passed over (ns).
    from: u64,
    metadata: Metadata,
    /// Its number among the files of its log, as it says itself.
    number: Option<u64>,
    /// What was found beside the messages so far.
    extras: Extras,
    /// Whose file it is, as its first record says: `elk`, `ros2`, …
    profile: String,
}

/// The records of a file, as long as they are right, or as far as they can be had.
enum Records {
    Right(Box<Container>),
    Salvaged(Box<Salvage>),
}

/// Calls a method that both kinds of records have.
macro_rules! either {
    ($records:expr, $found:ident => $call:expr) => {
        match $records {
            Records::Right($found) => $call,
            Records::Salvaged($found) => $call,
        }
    };
}

impl Records {
    fn next(&mut self) -> Result<Found, LogError> {
        either!(self, it => it.next())
    }

    fn body(&self) -> &[u8] {
        either!(self, it => it.body())
    }

    fn in_chunk(&self) -> bool {
        either!(self, it => it.in_chunk())
    }

    fn position(&self) -> u64 {
        either!(self, it => it.position())
    }

    fn length(&self) -> u64 {
        either!(self, it => it.length())
    }
}

/// What the end of a file says of it.
pub(crate) enum Said {
    /// A chunk, and whether it tells of losses.
    Chunk(ChunkIndex, bool),
    /// All messages.
    Statistics(Statistics),
    /// An attachment or metadata: its kind, name, media type and length (bytes).
    Extra(ExtraKind, String, String, u64),
}

impl Said {
    fn statistics(self) -> Option<Statistics> {
        if let Self::Statistics(said) = self { Some(said) } else { None }
    }
}

/// What comes next in a segment.
pub(crate) enum Next {
    /// A message of the bus.
    Message,
    /// The logger's note that so many messages are missing by now.
    Dropped(u64),
    /// A record of another tool, of this kind: metadata, an attachment, or one of its own.
    Other(u8),
    /// Something that is too large to be kept, in words.
    LeftOut(String),
    /// Something that cannot be read, in words; the rest may be.
    Damage(String),
    /// Nothing.
    End,
}

impl Segment {
    /// Opens a file. Its channels are known from its end, if it has one.
    pub fn open(path: &Path) -> Result<Self, LogError> {
        let mut segment = Self::at_the_beginning(path)?;
        if let Some(range) = Self::find_summary(path)? {
            let mut counted = None;
            // What is wrong with it the index says; the channels may be announced once more.
            let read = segment.summary(range, |said| counted = said.statistics().or(counted.take()))?;
            segment.knows_channels = read.is_ok() && counted.is_some_and(|counted| segment.names_all(&counted));
            segment.go_to(mcap::MAGIC.len() as u64)?;
        }
        Ok(segment)
    }

    /// Opens a file without a look at its end: its channels are known as they come, or by [`Segment::seek`].
    pub fn at_the_beginning(path: &Path) -> Result<Self, LogError> {
        Ok(Self::of(path, Records::Right(Box::new(Container::open(path)?))))
    }

    /// Whether all channels that the end of the file counts are known, and all of its messages are theirs. The end of a
    /// file need not repeat the channels, nor count the messages of each: then only the data know.
    pub fn names_all(&self, counted: &Statistics) -> bool {
        let counts = &counted.channel_message_counts;
        self.channels().count() as u64 >= u64::from(counted.channel_count)
            && counts.keys().all(|id| self.channel(*id).is_some())
            && counts.values().fold(0_u64, |all, count| all.saturating_add(*count)) == counted.message_count
    }

    /// From now on chunks may be passed over that have no message recorded at one of these times (ns), where no channel is
    /// announced only there.
    pub fn want(&mut self, times: RangeInclusive<u64>) {
        if let Records::Right(container) = &mut self.records
            && self.knows_channels
        {
            container.want(times);
        }
    }

    /// Opens a file that may be damaged: all that is a record in it is found. Channels are known from its end, else from
    /// all of it.
    pub fn open_damaged(path: &Path) -> Result<Self, LogError> {
        let mut segment = Self::of(path, Records::Salvaged(Box::new(Salvage::open(path)?)));
        let mut counted = None;
        if let Some(range) = Self::find_summary(path)? {
            let mut known = Self::of(path, Records::Right(Box::new(Container::unchecked(path)?)));
            let read = known.summary(range, |said| counted = said.statistics().or(counted.take()))?;
            counted = counted.filter(|counted| read.is_ok() && known.names_all(counted) && counted.message_count > 0);
            if counted.is_some() {
                (segment.schemas, segment.channels) = (known.schemas, known.channels);
                segment.names_bytes = known.names_bytes;
            }
        }
        let times = match counted {
            Some(counted) => Some(counted.message_start_time..=counted.message_end_time),
            None => segment.learn()?,
        };
        let channels = segment.channels().map(|(id, _)| id).collect();
        if let Records::Salvaged(salvage) = &mut segment.records {
            salvage.begin(RecordFinder { channels, times });
        }
        Ok(segment)
    }

    /// Reads all of the file for its channels, and for when its messages were recorded (ns).
    fn learn(&mut self) -> Result<Option<RangeInclusive<u64>>, LogError> {
        let (mut channels, mut times) = (Vec::new(), None);
        loop {
            match self.records.next()? {
                Found::Record(op::MESSAGE) => times = self.times_with(times),
                // A channel may come before the schema that it names, where that is said again.
                Found::Record(op::CHANNEL) if channels.len() < usize::from(u16::MAX) => {
                    channels.push(self.records.body().to_vec());
                }
                // What is wrong with any of them is said when they are read once more. Channels that are said again
                // have a checksum of their own, and come first.
                Found::Record(opcode @ (op::SCHEMA | op::METADATA)) => drop(self.note(opcode)?),
                Found::End => break,
                _ => {}
            }
        }
        channels.iter().for_each(|body| drop(self.note_channel(body)));
        Ok(times)
    }

    /// The times with that of the message that was found last, if it can be relied on.
    fn times_with(&self, times: Option<RangeInclusive<u64>>) -> Option<RangeInclusive<u64>> {
        let certain = matches!(&self.records, Records::Salvaged(salvage) if salvage.is_certain());
        match (head(self.records.body()).filter(|_| certain), times) {
            (None, times) => times,
            (Some((_, time)), None) => Some(time..=time),
            (Some((_, time)), Some(times)) => Some(time.min(*times.start())..=time.max(*times.end())),
        }
    }

    fn find_summary(path: &Path) -> Result<Option<Range<u64>>, LogError> {
        let found = file::open(path).and_then(|file| Summary::find(&file));
        match found.map_err(|source| read_error(path, source))? {
            Summary::Found(range) => Ok(Some(range)),
            Summary::Missing | Summary::Damaged(_) => Ok(None),
        }
    }

    fn of(path: &Path, records: Records) -> Self {
        Self {
            path: path.into(),
            records,
            schemas: BTreeMap::new(),
            channels: Vec::new(),
            names_bytes: 0,
            knows_channels: false,
            unknown: BTreeSet::new(),
            messages: 0,
            from: 0,
            metadata: Metadata::default(),
            number: None,
            extras: Extras::default(),
            profile: String::new(),
        }
    }

    fn go_to(&mut self, offset: u64) -> Result<(), LogError> {
        match &mut self.records {
            Records::Right(container) => container.seek(offset),
            Records::Salvaged(_) => Ok(()), // it is read from end to end
        }
    }

    /// Whose file it is, as far as it was read.
    pub fn profile(&self) -> &str {
        &self.profile
    }

    /// What was found beside the messages so far.
    pub fn extras(&self) -> &Extras {
        &self.extras
    }

    /// Where the run came from, as far as a file says so before its first message.
    pub fn metadata_of(path: &Path) -> Result<Metadata, LogError> {
        Ok(Self::at_the_beginning(path)?.read_metadata()?.metadata)
    }

    /// The file's number among those of its log, from 0, as it says itself; nothing: it does not say.
    pub fn number_of(path: &Path) -> Result<Option<u64>, LogError> {
        Ok(Self::at_the_beginning(path)?.read_metadata()?.number)
    }

    /// As [`Segment::metadata_of`], of a file that may be damaged.
    pub fn metadata_of_damaged(path: &Path) -> Result<Metadata, LogError> {
        // What it says of the run needs no channels: all of the file is not read for them.
        Ok(Self::of(path, Records::Salvaged(Box::new(Salvage::open(path)?))).read_metadata()?.metadata)
    }

    /// Reads what stands before the first message.
    fn read_metadata(mut self) -> Result<Self, LogError> {
        loop {
            match self.records.next()? {
                Found::Record(_) if self.records.in_chunk() => break,
                // What is wrong with it is said when the log is read.
                Found::Record(opcode) => drop(self.note(opcode)?),
                Found::Damaged(_) | Found::LeftOut(_) => {}
                Found::Cut(_) | Found::End => break,
            }
        }
        Ok(self)
    }

    /// Goes on at the record that begins at `offset`, among `channels`, with the first message recorded at `from` (ns).
    pub fn seek(
        &mut self,
        offset: Option<u64>,
        channels: &BTreeMap<u16, Arc<Channel>>,
        from: u64,
    ) -> Result<(), LogError> {
        for (id, channel) in channels {
            self.announce(*id, channel.clone());
        }
        self.from = from;
        offset.map_or(Ok(()), |offset| self.go_to(offset))
    }

    /// Reads what the end of the file, at `range`, says of it; channels are announced as ever. The inner error is what
    /// is wrong with it.
    pub fn summary(&mut self, range: Range<u64>, mut said: impl FnMut(Said)) -> Result<Result<(), String>, LogError> {
        self.go_to(range.start)?;
        while self.records.position() < range.end {
            let opcode = match self.records.next()? {
                Found::Record(opcode) if !self.records.in_chunk() => opcode,
                Found::Record(_) | Found::LeftOut(_) | Found::End => return Ok(Err("it holds data".into())),
                Found::Damaged(reason) | Found::Cut(reason) => return Ok(Err(reason)),
            };
            let noted = match opcode {
                op::CHUNK_INDEX | op::STATISTICS | op::ATTACHMENT_INDEX | op::METADATA_INDEX => {
                    self.read_said(opcode).map(&mut said)
                }
                // Its schema need not be repeated: then only the data say what the channel's messages are.
                op::CHANNEL if !self.knows_schema_of(self.records.body()) => Ok(()),
                _ => self.note(opcode)?.map(drop),
            };
            if let Err(reason) = noted {
                return Ok(Err(reason));
            }
        }
        Ok(Ok(()))
    }

    fn knows_schema_of(&self, channel: &[u8]) -> bool {
        let schema = channel.get(2..).and_then(<[u8]>::first_chunk).map_or(0, |id| u16::from_le_bytes(*id));
        schema == 0 || self.schemas.contains_key(&schema)
    }

    fn read_said(&self, opcode: u8) -> Result<Said, String> {
        match container::parse(opcode, self.records.body())? {
            McapRecord::ChunkIndex(chunk) => {
                let tells = |id: &u16| self.channel(*id).is_some_and(|channel| channel.kind == ChannelKind::Dropped);
                let drops = chunk.message_index_offsets.keys().any(tells);
                Ok(Said::Chunk(chunk, drops))
            }
            McapRecord::Statistics(said) => Ok(Said::Statistics(said)),
            McapRecord::AttachmentIndex(said) => {
                Ok(Said::Extra(ExtraKind::Attachment, said.name, said.media_type, said.data_size))
            }
            McapRecord::MetadataIndex(said) => {
                Ok(Said::Extra(ExtraKind::Metadata, said.name, String::new(), said.length))
            }
            _ => Err(format!("a record of kind {opcode} is another one")),
        }
    }

    /// How much of the file has been read (bytes).
    pub fn position(&self) -> u64 {
        self.records.position()
    }

    /// Length of the file when it was opened (bytes).
    pub fn length(&self) -> u64 {
        self.records.length()
    }

    /// The channels that were announced so far.
    pub fn channels(&self) -> impl Iterator<Item = (u16, &Arc<Channel>)> {
        (0..).zip(&self.channels).filter_map(|(id, channel)| Some((id, channel.as_ref()?)))
    }

    /// The channel and the time of recording (ns) of the message that was found last.
    pub fn found(&self) -> (u16, u64) {
        head(self.records.body()).unwrap_or_default()
    }

    /// The channel of the message that was found last, and when it was recorded (ns).
    pub fn head(&self) -> Option<(&Channel, u64)> {
        let (id, time) = head(self.records.body())?;
        Some((self.channel(id)?, time))
    }

    /// Finds the next message of the bus.
    pub fn next(&mut self) -> Result<Next, LogError> {
        loop {
            match self.records.next()? {
                Found::Record(op::MESSAGE) => {
                    if let Some(next) = self.message() {
                        return Ok(next);
                    }
                }
                Found::Record(opcode) => match self.note(opcode)? {
                    Err(reason) => return Ok(Next::Damage(self.of_this_file(&reason))),
                    Ok(true) => {}
                    Ok(false) => return Ok(Next::Other(opcode)),
                },
                Found::LeftOut(what) => return Ok(Next::LeftOut(self.of_this_file(&what))),
                Found::Damaged(reason) | Found::Cut(reason) => return Ok(Next::Damage(self.of_this_file(&reason))),
                Found::End => return Ok(Next::End),
            }
        }
    }

    fn of_this_file(&self, reason: &str) -> String {
        format!("{}: {reason}", self.path.display())
    }

    /// What a message is; nothing: one that is passed over.
    fn message(&mut self) -> Option<Next> {
        let number = self.messages;
        self.messages += 1;
        let Some((id, log_time)) = head(self.records.body()) else {
            return Some(Next::Damage(self.of_this_file(&format!("message {number} is too short"))));
        };
        match self.channel(id).map(|channel| &channel.kind) {
            _ if log_time < self.from => None,
            Some(ChannelKind::Value(_) | ChannelKind::Foreign(_)) => Some(Next::Message),
            Some(ChannelKind::Dropped) => Some(match encoding::decode_dropped(&self.records.body()[MESSAGE_HEAD..]) {
                Ok(total) => Next::Dropped(total),
                Err(reason) => Next::Damage(self.of_this_file(&format!("message {number}: {reason}"))),
            }),
            None => self.unknown.insert(id).then(|| {
                let reason = format!("the channel {id} of message {number} was never announced; it is passed over");
                Next::Damage(self.of_this_file(&reason))
            }),
        }
    }

    fn channel(&self, id: u16) -> Option<&Arc<Channel>> {
        self.channels.get(usize::from(id))?.as_ref()
    }

    /// The message that was found last.
    pub fn record<'a>(&'a self, scratch: &'a mut Scratch) -> Result<RecordRef<'a>, LogError> {
        let number = self.messages.saturating_sub(1);
        let wrong = |reason| LogError::Message { path: self.path.clone(), number, reason };
        let body = self.records.body();
        let channel = head(body).and_then(|(id, _)| self.channel(id));
        let Some(channel) = channel else {
            return Err(wrong("its channel was never announced".into()));
        };
        let kind = match &channel.kind {
            ChannelKind::Value(kind) => kind,
            ChannelKind::Foreign(foreign) => {
                let word = |at: usize| crate::head::word(&body[at..]);
                return Ok(RecordRef {
                    key: &channel.key,
                    source: &channel.source,
                    source_aux: "",
                    community: &channel.community,
                    time: seconds(word(14)),
                    sequence: word(2) & 0xffff_ffff,
                    received: seconds(word(6)),
                    order: number,
                    epoch: channel.epoch,
                    value: foreign.value(&body[MESSAGE_HEAD..], &mut scratch.text),
                });
            }
            ChannelKind::Dropped => return Err(wrong("it is no message of the bus".into())),
        };
        let Decoded { value, envelope } = kind.decode(&body[MESSAGE_HEAD..], scratch).map_err(wrong)?;
        Ok(RecordRef {
            key: &channel.key,
            source: &channel.source,
            source_aux: envelope.source_aux,
            community: &channel.community,
            time: envelope.time,
            sequence: envelope.sequence,
            received: envelope.received,
            order: envelope.order,
            epoch: channel.epoch,
            value,
        })
    }

    /// Takes note of any other record: whether it is the log's own; the inner error is what is wrong with it.
    fn note(&mut self, opcode: u8) -> Result<Result<bool, String>, LogError> {
        if opcode >= 0x80 {
            return Ok(Ok(false));
        }
        if !matches!(opcode, op::HEADER | op::SCHEMA | op::CHANNEL | op::METADATA | op::ATTACHMENT) {
            return Ok(Ok(true));
        }
        if opcode == op::CHANNEL {
            let body = self.records.body().to_vec();
            return Ok(self.note_channel(&body).map(|()| true));
        }
        let record = match container::parse(opcode, self.records.body()) {
            Ok(record) => record,
            Err(reason) => return Ok(Err(reason)),
        };
        self.note_extra(&record);
        match record {
            McapRecord::Header(header) => self.profile = header.profile,
            McapRecord::Schema { header, data } => return Ok(self.note_schema(header, &data).map(|()| true)),
            McapRecord::Metadata(metadata) if metadata.name == encoding::ELK => {
                return Ok(self.note_metadata(&metadata)?.map(|()| true));
            }
            McapRecord::Metadata(metadata) if metadata.name == again::NAME => {
                let said = again::channels(&metadata);
                return Ok(said.into_iter().try_for_each(|channel| self.note_said(channel)).map(|()| true));
            }
            McapRecord::Attachment { header, data, crc } => {
                if crc != 0 && crc != attachment_crc(self.records.body()) {
                    return Ok(Err(format!("the attachment {} does not agree with its checksum", header.name)));
                }
                let is_mission = !header.name.is_empty() && header.name == self.metadata.mission_name;
                if is_mission {
                    self.metadata.mission = String::from_utf8_lossy(&data).into_owned();
                }
                return Ok(Ok(is_mission));
            }
            _ => return Ok(Ok(false)),
        }
        Ok(Ok(true))
    }

    /// Takes note of what stands beside the messages.
    fn note_extra(&mut self, record: &McapRecord<'_>) {
        match record {
            McapRecord::Attachment { header, data, .. } => {
                self.extras.note(ExtraKind::Attachment, &header.name, &header.media_type, data.len() as u64);
            }
            McapRecord::Metadata(metadata) => {
                let bytes = (Head::BYTES + self.records.body().len()) as u64;
                self.extras.note(ExtraKind::Metadata, &metadata.name, "", bytes);
            }
            _ => {}
        }
    }

    fn note_schema(&mut self, header: records::SchemaHeader, data: &[u8]) -> Result<(), String> {
        let records::SchemaHeader { id, name, encoding } = header;
        // What is said again is not kept again.
        if self.schemas.get(&id).is_some_and(|known| known.name == name && known.data == data) {
            return Ok(());
        }
        self.keep_names(name.len() + encoding.len() + data.len())?;
        self.schemas.insert(id, Arc::new(Schema { name, encoding, data: data.into() }));
        Ok(())
    }

    fn note_channel(&mut self, body: &[u8]) -> Result<(), String> {
        let McapRecord::Channel(channel) = container::parse(op::CHANNEL, body)? else {
            return Err("a channel is none".into());
        };
        let schema = self.schemas.get(&channel.schema_id).cloned();
        self.note_announced(channel, schema.as_ref())
    }

    /// Takes note of a channel that is said again.
    fn note_said(&mut self, said: SaidChannel) -> Result<(), String> {
        let SaidChannel { id, topic, schema, encoding: message_encoding, metadata } = said;
        let schema = Arc::new(Schema { name: schema, ..Schema::default() });
        self.note_announced(records::Channel { id, schema_id: 0, topic, message_encoding, metadata }, Some(&schema))
    }

    /// Takes note of a channel, if it is not known yet.
    fn note_announced(&mut self, channel: records::Channel, schema: Option<&Arc<Schema>>) -> Result<(), String> {
        let id = channel.id;
        if self.channel(id).is_some() {
            return Ok(());
        }
        let mut garbled = Garbled::default();
        let channel = Channel::announced(channel, schema, &mut garbled);
        self.keep_names(channel.names_bytes())?;
        let named = format!("channel {:?}", channel.key);
        self.announce(id, Arc::new(channel));
        garbled.said().map_err(|reason| format!("{named}: {reason}"))
    }

    /// The message that was found last as another tool wrote it, if one did.
    pub fn foreign(&self) -> Option<(&Arc<Channel>, &[u8])> {
        let body = self.records.body();
        let channel = self.channel(head(body)?.0)?;
        matches!(channel.kind, ChannelKind::Foreign(_)).then_some((channel, body))
    }

    /// Whether the message that was found last lies in a chunk that is not what was written.
    pub fn is_doubtful(&self) -> bool {
        matches!(&self.records, Records::Salvaged(salvage) if salvage.is_doubtful())
    }

    /// The bytes of the record that was found last.
    pub fn body(&self) -> &[u8] {
        self.records.body()
    }

    /// Whether names of so many bytes more can be kept.
    fn keep_names(&mut self, bytes: usize) -> Result<(), String> {
        let all = self.names_bytes.saturating_add(bytes);
        if all > MAX_NAMES_BYTES {
            return Err(format!("the names of its channels take more than {MAX_NAMES_BYTES} bytes; no more are kept"));
        }
        self.names_bytes = all;
        Ok(())
    }

    fn announce(&mut self, id: u16, channel: Arc<Channel>) {
        let index = usize::from(id);
        if self.channels.len() <= index {
            self.channels.resize(index + 1, None);
        }
        self.channels[index].get_or_insert(channel);
    }

    /// Takes what is said of the run. A log of a later format is not read; of a damaged one nobody knows whether that
    /// is its format or its damage, and what can be had of it is wanted: there it is said.
    fn note_metadata(&mut self, said: &records::Metadata) -> Result<Result<(), String>, LogError> {
        let text = |name: &str| text(&said.metadata, name);
        let (format, known) = (text("format"), encoding::FORMAT);
        let newer = format.parse::<u32>().map_or(true, |format| format > known);
        if newer && matches!(self.records, Records::Right(_)) {
            return Err(LogError::Newer { path: self.path.clone(), found: format, known });
        }
        let mut garbled = Garbled::default();
        self.number = text("segment").parse().ok();
        self.metadata = Metadata {
            mission_name: text("mission_name"),
            version: text("version"),
            seed: garbled.number(&said.metadata, "seed"),
            started: garbled.number(&said.metadata, "started"),
            world: text("world"),
            world_checksum: text("world_checksum"),
            effective_mission: text("effective_mission"),
            run: text("run"),
            mission: std::mem::take(&mut self.metadata.mission),
        };
        if newer {
            garbled.note(format!("its format is said to be {format:?}; it is read as format {known}"));
        }
        Ok(garbled.said())
    }
}

/// A message's channel, and when it was recorded (ns).
fn head(body: &[u8]) -> Option<(u16, u64)> {
    let head = body.get(..MESSAGE_HEAD)?;
    let log_time = u64::from_le_bytes(std::array::from_fn(|i| head[6 + i]));
    Some((u16::from_le_bytes([head[0], head[1]]), log_time))
}

/// The checksum of an attachment: over everything before the checksum itself.
fn attachment_crc(body: &[u8]) -> u32 {
    crc32fast::hash(&body[..body.len().saturating_sub(4)])
}
