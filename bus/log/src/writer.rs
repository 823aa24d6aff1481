//! Writing a log.

use std::borrow::Cow;
use std::collections::{BTreeMap, HashMap};
use std::fs::File;
use std::path::{Path, PathBuf};

use elk_bus::ValueRef;
use mcap::records::MessageHeader;
use mcap::write::NoSeek;
use mcap::{Attachment, WriteOptions, Writer};

use crate::encoding::{self, nanoseconds};
use crate::error::LogError;
use crate::record::{Metadata, RecordRef};
use crate::staging::Staging;

/// What may wait in memory for a disk that takes nothing before records are refused (bytes).
pub const MAX_STAGED_BYTES: usize = 64 << 20;

/// A chunk is closed when it is this large (bytes), or when the log is flushed.
const CHUNK_BYTES: u64 = 1 << 20;

/// Writes a log: every record once, in the order of [`LogWriter::append`].
pub struct LogWriter {
    path: PathBuf,
    file: File,
    staging: Staging,
    format: Writer<NoSeek<Staging>>,
    channels: HashMap<String, Vec<Channel>>,
    buffer: Vec<u8>,
}

/// A channel that is announced in the file.
struct Channel {
    id: u16,
    source: String,
    community: String,
    kind: ChannelKind,
}

#[derive(PartialEq)]
enum ChannelKind {
    Double,
    Text,
    Binary { type_name: String, layout: u64 },
}

impl Channel {
    fn carries(&self, record: &RecordRef<'_>) -> bool {
        let same_kind = match (&self.kind, record.value) {
            (ChannelKind::Double, ValueRef::Double(_)) | (ChannelKind::Text, ValueRef::Text(_)) => true,
            (ChannelKind::Binary { type_name, layout }, ValueRef::Binary { type_name: name, layout: l, .. }) => {
                type_name == name && *layout == l
            }
            _ => false,
        };
        same_kind && self.source == record.source && self.community == record.community
    }
}

impl LogWriter {
    /// Creates the log at `path`, replacing a file that is there, with `metadata` on the disk when this returns.
    pub fn create(path: &Path, metadata: &Metadata) -> Result<Self, LogError> {
        let create = |source: std::io::Error| LogError::Create { path: path.into(), source };
        let file = File::create(path).map_err(create)?;
        let staging = Staging::default();
        let format = WriteOptions::new()
            .compression(None)
            .profile("elk")
            .library(concat!("elk-log ", env!("CARGO_PKG_VERSION")))
            .chunk_size(Some(CHUNK_BYTES))
            .disable_seeking(true)
            .create(NoSeek::new(staging.clone()))
            .map_err(|error| create(std::io::Error::other(error)))?;
        let mut log = Self { path: path.into(), file, staging, format, channels: HashMap::new(), buffer: Vec::new() };
        log.write_metadata(metadata).map_err(|error| create(std::io::Error::other(error)))?;
        log.flush()?;
        Ok(log)
    }

    fn write_metadata(&mut self, metadata: &Metadata) -> mcap::McapResult<()> {
        self.format.write_metadata(&mcap::records::Metadata {
            name: encoding::ELK.into(),
            metadata: BTreeMap::from([
                ("mission_name".into(), metadata.mission_name.clone()),
                ("version".into(), metadata.version.clone()),
                ("seed".into(), metadata.seed.to_string()),
                ("started".into(), metadata.started.to_string()),
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

    /// Records a message. It is on the disk after the next [`LogWriter::flush`] that succeeds. An error means that this
    /// message is not recorded; the log goes on.
    pub fn append(&mut self, record: &RecordRef<'_>) -> Result<(), LogError> {
        let waiting = self.waiting();
        if waiting > MAX_STAGED_BYTES {
            return Err(LogError::Full { path: self.path.clone(), waiting });
        }
        let refused =
            |reason: String| LogError::Record { key: record.key.into(), source_name: record.source.into(), reason };
        self.buffer.clear();
        encoding::encode(record, &mut self.buffer).map_err(refused)?;
        let header = MessageHeader {
            channel_id: self.channel(record).map_err(|error| refused(error.to_string()))?,
            sequence: record.sequence as u32, // MCAP has 32 bits; the whole number is in the message
            log_time: nanoseconds(record.received),
            publish_time: nanoseconds(record.time),
        };
        self.format.write_to_known_channel(&header, &self.buffer).map_err(|error| refused(error.to_string()))?;
        self.drain_closed_chunk(waiting);
        Ok(())
    }

    /// A chunk that has just been closed goes to the disk at once. If the disk refuses it waits for the next flush,
    /// which reports the failure.
    fn drain_closed_chunk(&mut self, waited: usize) {
        if self.waiting() > waited {
            let _ = self.staging.drain_into(&mut self.file);
        }
    }

    fn channel(&mut self, record: &RecordRef<'_>) -> mcap::McapResult<u16> {
        let known = self.channels.get(record.key).and_then(|c| c.iter().find(|c| c.carries(record)));
        match known {
            Some(channel) => Ok(channel.id),
            None => self.announce(record),
        }
    }

    fn announce(&mut self, record: &RecordRef<'_>) -> mcap::McapResult<u16> {
        let mut metadata =
            BTreeMap::from([("source".into(), record.source.into()), ("community".into(), record.community.into())]);
        let (kind, schema, message_encoding) = match record.value {
            ValueRef::Double(_) => {
                let schema = encoding::json_schema("number", "not finite: its bits as 16 hexadecimal digits");
                let id = self.format.add_schema(encoding::DOUBLE, encoding::JSON_SCHEMA, schema.as_bytes())?;
                (ChannelKind::Double, id, encoding::JSON)
            }
            ValueRef::Text(_) => {
                let schema = encoding::json_schema("string", "");
                let id = self.format.add_schema(encoding::TEXT, encoding::JSON_SCHEMA, schema.as_bytes())?;
                (ChannelKind::Text, id, encoding::JSON)
            }
            ValueRef::Binary { type_name, layout, .. } => {
                let hash = format!("{layout:016x}");
                let id = self.format.add_schema(type_name, encoding::ELK, hash.as_bytes())?;
                metadata.insert("layout".into(), hash);
                (ChannelKind::Binary { type_name: type_name.into(), layout }, id, encoding::ELK)
            }
        };
        let id = self.format.add_channel(schema, record.key, message_encoding, &metadata)?;
        let channel = Channel { id, source: record.source.into(), community: record.community.into(), kind };
        self.channels.entry(record.key.into()).or_default().push(channel);
        Ok(id)
    }

    /// Closes the chunk and writes all that waits: the file is readable up to here, whatever happens to this process.
    /// If the disk refuses, nothing is lost: the rest waits for the next flush.
    pub fn flush(&mut self) -> Result<(), LogError> {
        let closed = self.format.flush().map_err(std::io::Error::other);
        closed.and_then(|()| self.staging.drain_into(&mut self.file)).map_err(|source| self.write_error(source))
    }

    /// Ends the file with its index and brings it onto the disk itself.
    pub fn finish(mut self) -> Result<(), LogError> {
        let ended = self.format.finish().map(|_| ()).map_err(std::io::Error::other);
        ended
            .and_then(|()| self.staging.drain_into(&mut self.file))
            .and_then(|()| self.file.sync_data())
            .map_err(|source| self.write_error(source))
    }

    fn write_error(&self, source: std::io::Error) -> LogError {
        LogError::Write { path: self.path.clone(), source, waiting: self.waiting() }
    }

    /// Bytes that wait in memory for the disk.
    pub fn waiting(&self) -> usize {
        self.staging.len()
    }
}
