//! Reading a log, from its first message to where it ends or breaks off.

use std::collections::BTreeMap;
use std::fs::File;
use std::io::{ErrorKind, Read};
use std::path::{Path, PathBuf};

use elk_bus::Value;
use mcap::records::Record as McapRecord;
use mcap::sans_io::linear_reader::{LinearReadEvent, LinearReader, LinearReaderOptions};

use crate::encoding::{self, Envelope};
use crate::error::LogError;
use crate::record::{Metadata, Record};

/// Bytes that are read from the file at once.
const READ_BYTES: usize = 1 << 20;

/// Gives the records of a log in the order in which they were recorded.
///
/// A log whose writer was killed has no end: all its whole chunks are given, then the iteration stops and
/// [`LogReader::whole`] stays false. The same holds for a log that was cut or damaged. Channels that are not elk's (other
/// tools may add theirs) are passed over.
pub struct LogReader {
    path: PathBuf,
    file: File,
    format: LinearReader,
    schemas: BTreeMap<u16, Schema>,
    channels: BTreeMap<u16, Channel>,
    metadata: Metadata,
    ahead: Option<Result<Record, LogError>>,
    end: Option<End>,
    messages: u64,
}

/// How the reading ended.
enum End {
    Whole,
    Broken(String),
}

struct Schema {
    name: String,
    encoding: String,
}

struct Channel {
    key: String,
    source: String,
    community: String,
    kind: Kind,
}

enum Kind {
    Double,
    Text,
    Binary { type_name: String, layout: u64 },
    Foreign,
}

/// What one step of reading brought.
enum Step {
    Message(Record),
    Other,
    End(End),
}

impl LogReader {
    /// Opens a log and reads where it came from.
    pub fn open(path: &Path) -> Result<Self, LogError> {
        let read = |source| LogError::Read { path: path.into(), source };
        let file = File::open(path).map_err(read)?;
        let length = file.metadata().map_err(read)?.len();
        check_magic(&file, path)?;
        // Nothing in the file is longer than the file: a corrupt length is seen as one before memory is set aside.
        let options = LinearReaderOptions::default()
            .with_skip_start_magic(true)
            .with_prevalidate_chunk_crcs(true)
            .with_record_length_limit(usize::try_from(length).unwrap_or(usize::MAX));
        let mut log = Self {
            path: path.into(),
            file,
            format: LinearReader::new_with_options(options),
            schemas: BTreeMap::new(),
            channels: BTreeMap::new(),
            metadata: Metadata::default(),
            ahead: None,
            end: None,
            messages: 0,
        };
        log.ahead = log.read_on().transpose();
        Ok(log)
    }

    /// Where the run came from; empty where the log does not say.
    pub fn metadata(&self) -> &Metadata {
        &self.metadata
    }

    /// Whether the log was read to its proper end. False as long as records are left, and for good if it breaks off.
    pub fn whole(&self) -> bool {
        matches!(self.end, Some(End::Whole)) && self.ahead.is_none()
    }

    /// Why the log breaks off, once that has been found.
    pub fn broken(&self) -> Option<&str> {
        match &self.end {
            Some(End::Broken(reason)) => Some(reason),
            _ => None,
        }
    }

    /// The next record, or nothing at the end.
    fn read_on(&mut self) -> Result<Option<Record>, LogError> {
        while self.end.is_none() {
            match self.step()? {
                Step::Message(record) => return Ok(Some(record)),
                Step::End(end) => self.end = Some(end),
                Step::Other => {}
            }
        }
        Ok(None)
    }

    fn step(&mut self) -> Result<Step, LogError> {
        let parsed = match self.format.next_event() {
            None => return Ok(Step::End(End::Whole)),
            Some(Err(error)) => return Ok(Step::End(End::Broken(error.to_string()))),
            Some(Ok(LinearReadEvent::ReadRequest(wanted))) => return self.feed(wanted),
            Some(Ok(LinearReadEvent::Record { data, opcode })) => {
                mcap::parse_record(opcode, data).map(McapRecord::into_owned)
            }
        };
        match parsed {
            Ok(record) => self.take(record),
            Err(error) => Ok(Step::End(End::Broken(error.to_string()))),
        }
    }

    /// Hands the next bytes of the file to the format, never more than a piece at a time: what a corrupt length asks for
    /// is not set aside.
    fn feed(&mut self, wanted: usize) -> Result<Step, LogError> {
        let room = self.format.insert(wanted.clamp(1, READ_BYTES));
        let count = loop {
            match self.file.read(room) {
                Err(error) if error.kind() == ErrorKind::Interrupted => {}
                Err(source) => {
                    self.end = Some(End::Broken(source.to_string()));
                    return Err(LogError::Read { path: self.path.clone(), source });
                }
                Ok(count) => break count,
            }
        };
        self.format.notify_read(count);
        Ok(Step::Other)
    }

    fn take(&mut self, record: McapRecord<'static>) -> Result<Step, LogError> {
        match record {
            McapRecord::Schema { header, .. } => {
                self.schemas.insert(header.id, Schema { name: header.name, encoding: header.encoding });
            }
            McapRecord::Channel(channel) => {
                let id = channel.id;
                let channel = self.channel(channel);
                self.channels.entry(id).or_insert(channel);
            }
            McapRecord::Metadata(metadata) if metadata.name == encoding::ELK => self.note(&metadata.metadata),
            McapRecord::Attachment { header, data, .. } if header.name == self.metadata.mission_name => {
                self.metadata.mission = String::from_utf8_lossy(&data).into_owned();
            }
            McapRecord::Message { header, data } => return self.message(header.channel_id, &data),
            _ => {}
        }
        Ok(Step::Other)
    }

    fn channel(&self, channel: mcap::records::Channel) -> Channel {
        let said = |name: &str| channel.metadata.get(name).cloned().unwrap_or_default();
        let kind = match self.schemas.get(&channel.schema_id) {
            Some(schema) => kind(schema, &channel.message_encoding, &said("layout")),
            None => Kind::Foreign,
        };
        Channel { source: said("source"), community: said("community"), key: channel.topic, kind }
    }

    fn note(&mut self, said: &BTreeMap<String, String>) {
        let text = |name: &str| said.get(name).cloned().unwrap_or_default();
        self.metadata = Metadata {
            mission_name: text("mission_name"),
            version: text("version"),
            seed: text("seed").parse().unwrap_or_default(),
            started: text("started").parse().unwrap_or_default(),
            mission: std::mem::take(&mut self.metadata.mission),
        };
    }

    fn message(&mut self, channel: u16, bytes: &[u8]) -> Result<Step, LogError> {
        let number = self.messages;
        self.messages += 1;
        let wrong = |reason| LogError::Message { path: self.path.clone(), number, reason };
        let channel =
            self.channels.get(&channel).ok_or_else(|| wrong(format!("its channel {channel} was never announced")))?;
        let decoded = match &channel.kind {
            Kind::Foreign => return Ok(Step::Other),
            Kind::Double => encoding::decode_double(bytes),
            Kind::Text => encoding::decode_text(bytes),
            Kind::Binary { type_name, layout } => encoding::decode_binary(bytes, type_name, *layout),
        };
        let (value, envelope) = decoded.map_err(wrong)?;
        Ok(Step::Message(record(channel, value, envelope)))
    }
}

fn check_magic(mut file: &File, path: &Path) -> Result<(), LogError> {
    let no_log = |reason: &str| LogError::NoLog { path: path.into(), reason: reason.into() };
    let mut magic = [0; 8];
    match file.read_exact(&mut magic) {
        Ok(()) if magic == mcap::MAGIC => Ok(()),
        Ok(()) => Err(no_log("it does not begin as an MCAP file does")),
        Err(error) if error.kind() == ErrorKind::UnexpectedEof => Err(no_log("it is empty, or ends within 8 bytes")),
        Err(source) => Err(LogError::Read { path: path.into(), source }),
    }
}

fn kind(schema: &Schema, message_encoding: &str, layout: &str) -> Kind {
    match (message_encoding, schema.name.as_str()) {
        (encoding::JSON, encoding::DOUBLE) => Kind::Double,
        (encoding::JSON, encoding::TEXT) => Kind::Text,
        (encoding::ELK, name) if schema.encoding == encoding::ELK => match u64::from_str_radix(layout, 16) {
            Ok(layout) => Kind::Binary { type_name: name.into(), layout },
            Err(_) => Kind::Foreign,
        },
        _ => Kind::Foreign,
    }
}

fn record(channel: &Channel, value: Value, envelope: Envelope) -> Record {
    Record {
        key: channel.key.clone(),
        source: channel.source.clone(),
        source_aux: envelope.source_aux,
        community: channel.community.clone(),
        time: envelope.time,
        sequence: envelope.sequence,
        received: envelope.received,
        value,
    }
}

impl Iterator for LogReader {
    type Item = Result<Record, LogError>;

    fn next(&mut self) -> Option<Self::Item> {
        let next = self.ahead.take();
        self.ahead = self.read_on().transpose();
        next
    }
}
