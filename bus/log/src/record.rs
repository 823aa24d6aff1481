//! What a log holds: messages as they crossed the bus, and where the run came from.

use elk_bus::{Mail, Value, ValueRef};

/// A message as it crossed the bus.
#[derive(Debug, Clone, PartialEq)]
pub struct Record {
    /// The variable.
    pub key: String,
    /// The app that published it.
    pub source: String,
    /// What the app says of the origin beyond its name; mostly empty.
    pub source_aux: String,
    /// The community that it was published in.
    pub community: String,
    /// When it was published (s, the community's clock).
    pub time: f64,
    /// Its number among the messages of its source.
    pub sequence: u64,
    /// When it came to the logger (s, the community's clock).
    pub received: f64,
    /// Its position in the broker's order: the logger's count of its mail, from 0. A logger that was started again
    /// counts anew, in the run's next segment.
    pub order: u64,
    /// Tells one life of the broker from the next.
    pub epoch: u64,
    /// What was said.
    pub value: Value,
}

/// A [`Record`] where it lies, so that recording copies each message only once.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct RecordRef<'a> {
    /// See [`Record::key`].
    pub key: &'a str,
    /// See [`Record::source`].
    pub source: &'a str,
    /// See [`Record::source_aux`].
    pub source_aux: &'a str,
    /// See [`Record::community`].
    pub community: &'a str,
    /// See [`Record::time`].
    pub time: f64,
    /// See [`Record::sequence`].
    pub sequence: u64,
    /// See [`Record::received`].
    pub received: f64,
    /// See [`Record::order`].
    pub order: u64,
    /// See [`Record::epoch`].
    pub epoch: u64,
    /// See [`Record::value`].
    pub value: ValueRef<'a>,
}

/// A client's mail as records: in which order it came, and when.
#[derive(Debug, Clone, Copy)]
pub struct Reception {
    messages: u64,
    received: f64,
}

impl Reception {
    /// Mail from now on (s, the community's clock).
    pub fn begun(now: f64) -> Self {
        Self { messages: 0, received: now }
    }

    /// Messages so far: the next one's place in the broker's order.
    pub fn messages(&self) -> u64 {
        self.messages
    }

    /// The record of the next message, in this life of the broker; it is read at `now` (s, the community's clock).
    pub fn record<'a>(&mut self, mail: &Mail<'a>, epoch: u64, now: f64) -> RecordRef<'a> {
        // Mail gathers. A message came at once when it was said, but not before the one ahead of it.
        self.received = mail.time().max(self.received).min(now);
        let order = self.messages;
        self.messages += 1;
        RecordRef {
            key: mail.key(),
            source: mail.source(),
            source_aux: mail.source_aux(),
            community: mail.community(),
            time: mail.time(),
            sequence: mail.sequence(),
            received: self.received,
            order,
            epoch,
            value: mail.value(),
        }
    }
}

impl Record {
    /// The record where it lies.
    pub fn as_ref(&self) -> RecordRef<'_> {
        RecordRef {
            key: &self.key,
            source: &self.source,
            source_aux: &self.source_aux,
            community: &self.community,
            time: self.time,
            sequence: self.sequence,
            received: self.received,
            order: self.order,
            epoch: self.epoch,
            value: self.value.as_ref(),
        }
    }
}

impl RecordRef<'_> {
    /// The same record, owned.
    pub fn to_record(&self) -> Record {
        Record {
            key: self.key.into(),
            source: self.source.into(),
            source_aux: self.source_aux.into(),
            community: self.community.into(),
            time: self.time,
            sequence: self.sequence,
            received: self.received,
            order: self.order,
            epoch: self.epoch,
            value: self.value.to_value(),
        }
    }
}

/// Where a run came from: enough to do it again.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Metadata {
    /// Name of the mission file, without its folder.
    pub mission_name: String,
    /// The mission file as it was run.
    pub mission: String,
    /// Version of the program that ran it.
    pub version: String,
    /// The run's seed.
    pub seed: u64,
    /// The world of a simulated run, as the mission names it; empty: there is none.
    pub world: String,
    /// FNV-1a (64 bits, hexadecimal) of the world's file; empty: there is none, or it is built into the program.
    pub world_checksum: String,
    /// The mission as it ran, defaults and command line included; empty: nobody said.
    pub effective_mission: String,
    /// What the run was made of: version, revision, seed, files and their checksums (JSON); empty: nobody said.
    pub run: String,
    /// When the run was started (s since 1970, UTC).
    pub started: f64,
}
