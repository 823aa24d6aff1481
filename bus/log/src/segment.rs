//! One file of a log, message by message.

use std::collections::{BTreeMap, BTreeSet};
use std::ops::Range;
use std::path::{Path, PathBuf};
use std::sync::Arc;

use mcap::records::{self, ChunkIndex, Record as McapRecord, Statistics, op};

use crate::channel::{Channel, ChannelKind, text};
use crate::container::{self, Container, Found};
use crate::encoding::{self, Decoded, Scratch};
use crate::error::LogError;
use crate::head::MESSAGE_HEAD;
use crate::record::{Metadata, RecordRef};

/// Names, sources and types of all channels of a file take at most so many bytes; what is announced beyond is not known.
const MAX_NAMES_BYTES: usize = 64 << 20;

/// One file of a log.
pub(crate) struct Segment {
    path: PathBuf,
    container: Container,
    schemas: BTreeMap<u16, String>,
    channels: Vec<Option<Arc<Channel>>>,
    /// Bytes of all names that were kept.
    names_bytes: usize,
    /// Channels of messages that were never announced, each of which is said once.
    unknown: BTreeSet<u16>,
    messages: u64,
    /// Messages that were recorded before are passed over (ns).
    from: u64,
    metadata: Metadata,
}

/// What the end of a file says of it.
pub(crate) enum Said {
    /// A chunk, and whether it tells of losses.
    Chunk(ChunkIndex, bool),
    /// All messages.
    Statistics(Statistics),
}

/// What comes next in a segment.
pub(crate) enum Next {
    /// A message of the bus.
    Message,
    /// The logger's note that so many messages are missing by now.
    Dropped(u64),
    /// Something that cannot be read, in words; the rest may be.
    Damage(String),
    /// Nothing.
    End,
}

impl Segment {
    /// Opens a file.
    pub fn open(path: &Path) -> Result<Self, LogError> {
        let container = Container::open(path)?;
        Ok(Self {
            path: path.into(),
            container,
            schemas: BTreeMap::new(),
            channels: Vec::new(),
            names_bytes: 0,
            unknown: BTreeSet::new(),
            messages: 0,
            from: 0,
            metadata: Metadata::default(),
        })
    }

    /// Where the run came from, as far as a file says so before its first message.
    pub fn metadata_of(path: &Path) -> Result<Metadata, LogError> {
        let mut segment = Self::open(path)?;
        while let Found::Record(opcode) = segment.container.next()? {
            if segment.container.in_chunk() {
                break;
            }
            // What is wrong with it is said when the log is read.
            let _ = segment.note(opcode)?;
        }
        Ok(segment.metadata)
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
        offset.map_or(Ok(()), |offset| self.container.seek(offset))
    }

    /// Reads what the end of the file, at `place`, says of it; channels are announced as ever. The inner error is what is
    /// wrong with it.
    pub fn summary(&mut self, place: Range<u64>, mut said: impl FnMut(Said)) -> Result<Result<(), String>, LogError> {
        self.container.seek(place.start)?;
        while self.container.position() < place.end {
            let opcode = match self.container.next()? {
                Found::Record(opcode) if !self.container.in_chunk() => opcode,
                Found::Record(_) | Found::End => return Ok(Err("it holds data".into())),
                Found::Damaged(reason) | Found::Cut(reason) => return Ok(Err(reason)),
            };
            let noted = match opcode {
                op::CHUNK_INDEX | op::STATISTICS => self.read_said(opcode).map(&mut said),
                _ => self.note(opcode)?,
            };
            if let Err(reason) = noted {
                return Ok(Err(reason));
            }
        }
        Ok(Ok(()))
    }

    fn read_said(&self, opcode: u8) -> Result<Said, String> {
        match container::parse(opcode, self.container.body())? {
            McapRecord::ChunkIndex(chunk) => {
                let tells = |id: &u16| self.channel(*id).is_some_and(|channel| channel.kind == ChannelKind::Dropped);
                let drops = chunk.message_index_offsets.keys().any(tells);
                Ok(Said::Chunk(chunk, drops))
            }
            McapRecord::Statistics(said) => Ok(Said::Statistics(said)),
            _ => Err(format!("a record of kind {opcode} is another one")),
        }
    }

    /// How much of the file has been read (bytes).
    pub fn position(&self) -> u64 {
        self.container.position()
    }

    /// Length of the file when it was opened (bytes).
    pub fn length(&self) -> u64 {
        self.container.length()
    }

    /// The channels that were announced so far.
    pub fn channels(&self) -> impl Iterator<Item = (u16, &Arc<Channel>)> {
        (0..).zip(&self.channels).filter_map(|(id, channel)| Some((id, channel.as_ref()?)))
    }

    /// The channel and the time of recording (ns) of the message that was found last.
    pub fn found(&self) -> (u16, u64) {
        head(self.container.body()).unwrap_or_default()
    }

    /// The channel of the message that was found last, and when it was recorded (ns).
    pub fn head(&self) -> Option<(&Channel, u64)> {
        let (id, time) = head(self.container.body())?;
        Some((self.channel(id)?, time))
    }

    /// Finds the next message of the bus.
    pub fn next(&mut self) -> Result<Next, LogError> {
        loop {
            match self.container.next()? {
                Found::Record(op::MESSAGE) => {
                    if let Some(next) = self.message() {
                        return Ok(next);
                    }
                }
                Found::Record(opcode) => {
                    if let Err(reason) = self.note(opcode)? {
                        return Ok(Next::Damage(self.of_this_file(&reason)));
                    }
                }
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
        let Some((id, log_time)) = head(self.container.body()) else {
            return Some(Next::Damage(self.of_this_file(&format!("message {number} is too short"))));
        };
        match self.channel(id).map(|channel| &channel.kind) {
            _ if log_time < self.from => None,
            Some(ChannelKind::Value(_)) => Some(Next::Message),
            Some(ChannelKind::Foreign) => None,
            Some(ChannelKind::Dropped) => {
                Some(match encoding::decode_dropped(&self.container.body()[MESSAGE_HEAD..]) {
                    Ok(total) => Next::Dropped(total),
                    Err(reason) => Next::Damage(self.of_this_file(&format!("message {number}: {reason}"))),
                })
            }
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
        let body = self.container.body();
        let channel = head(body).and_then(|(id, _)| self.channel(id));
        let Some(channel) = channel else {
            return Err(wrong("its channel was never announced".into()));
        };
        let ChannelKind::Value(kind) = &channel.kind else {
            return Err(wrong("it is no message of the bus".into()));
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

    /// Takes note of any other record; the inner error is what is wrong with it.
    fn note(&mut self, opcode: u8) -> Result<Result<(), String>, LogError> {
        if !matches!(opcode, op::SCHEMA | op::CHANNEL | op::METADATA | op::ATTACHMENT) {
            return Ok(Ok(()));
        }
        let record = match container::parse(opcode, self.container.body()) {
            Ok(record) => record,
            Err(reason) => return Ok(Err(reason)),
        };
        match record {
            // What is said again is not kept again.
            McapRecord::Schema { header, .. } if self.schemas.get(&header.id) == Some(&header.name) => {}
            McapRecord::Schema { header, .. } => {
                if let Err(reason) = self.keep_names(header.name.len()) {
                    return Ok(Err(reason));
                }
                self.schemas.insert(header.id, header.name);
            }
            McapRecord::Channel(channel) if self.channel(channel.id).is_some() => {}
            McapRecord::Channel(channel) => {
                let schema = self.schemas.get(&channel.schema_id).map_or("", String::as_str);
                let id = channel.id;
                let channel = Channel::announced(channel, schema);
                if let Err(reason) = self.keep_names(channel.names_bytes()) {
                    return Ok(Err(reason));
                }
                self.announce(id, Arc::new(channel));
            }
            McapRecord::Metadata(metadata) if metadata.name == encoding::ELK => self.note_metadata(&metadata)?,
            McapRecord::Attachment { header, data, crc } if header.name == self.metadata.mission_name => {
                if crc != 0 && crc != attachment_crc(self.container.body()) {
                    return Ok(Err(format!("the attachment {} does not agree with its checksum", header.name)));
                }
                self.metadata.mission = String::from_utf8_lossy(&data).into_owned();
            }
            _ => {}
        }
        Ok(Ok(()))
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
        let place = usize::from(id);
        if self.channels.len() <= place {
            self.channels.resize(place + 1, None);
        }
        self.channels[place].get_or_insert(channel);
    }

    fn note_metadata(&mut self, said: &records::Metadata) -> Result<(), LogError> {
        let text = |name: &str| text(&said.metadata, name);
        let format = text("format");
        if format.parse::<u32>().map_or(true, |format| format > encoding::FORMAT) {
            return Err(LogError::Newer { path: self.path.clone(), found: format, known: encoding::FORMAT });
        }
        self.metadata = Metadata {
            mission_name: text("mission_name"),
            version: text("version"),
            seed: text("seed").parse().unwrap_or_default(),
            started: text("started").parse().unwrap_or_default(),
            world: text("world"),
            world_checksum: text("world_checksum"),
            effective_mission: text("effective_mission"),
            run: text("run"),
            mission: std::mem::take(&mut self.metadata.mission),
        };
        Ok(())
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
