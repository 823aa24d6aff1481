//! The community's table: who is there and what was said, on request.
//!
//! Whoever writes to [`REQUEST`] (anything) is answered with a [`CommunityTable`] under [`TABLE`], it alone, behind all
//! mail and all refusals that came before. So the answer also says that the broker has taken in what the asker sent.
//! Nobody pays for a table that nobody asks for; the `DB_*` summaries for MOOS' tools stay what they are.

use serde::{Deserialize, Serialize};

use super::message::Message;
use super::registration::Registration;
use super::variable::{TypeLock, Variable};
use super::{Broker, Client, ClientId};
use crate::codec;
use crate::key::{Key, Payload};
use crate::wire::{self, BULK, FrameKind, Header, Named, ValueKind};

/// Write to it (any value) to be answered with the table. It is a question and no variable: nobody else hears of it.
pub const REQUEST: &str = "DB_TABLE_REQUEST";
/// The answer.
pub const TABLE: Key<CommunityTable> = Key::new("DB_TABLE");

/// The longest value that stands in the table (bytes); of a longer text its beginning does.
pub const LONGEST_VALUE: usize = 1024;
/// The largest table (bytes, about): of more variables it says how many it leaves out.
const LARGEST: usize = 16 << 20;
/// Variables that stand in the table as a client's.
const MOST_WRITES: usize = 1 << 13;

crate::payload! {
    /// Who is in a community and what was said, at one moment.
    #[derive(Debug, Clone, PartialEq)]
    pub struct CommunityTable {
        /// The community's name.
        pub community: String,
        /// When this was so (s, the clock's own time: nobody drives it).
        pub time: f64,
        /// When the broker started (s, likewise).
        pub started: f64,
        /// Who drives the community's clock, if anybody does.
        pub clock: Option<ClockEntry>,
        /// The clients, in the order in which they came.
        pub clients: Vec<ClientEntry>,
        /// The variables that were ever written, in the order in which they were first named.
        pub variables: Vec<VariableEntry>,
        /// Variables that were left out, because the table would be too large with them.
        pub left_out: u64,
    }
}

/// A clock that is driven.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct ClockEntry {
    /// The client that drives it.
    pub driver: String,
    /// The community's time (s).
    pub time: f64,
    /// How fast it runs; 0: it stands still.
    pub rate: f64,
}

/// A client.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct ClientEntry {
    /// Its name.
    pub name: String,
    /// What it has registered for.
    pub registrations: Vec<RegistrationEntry>,
    /// The variables that it has written; of very many, the first ones.
    pub writes: Vec<String>,
    /// Messages that came from it.
    pub messages: u64,
    /// How long these took from it to the broker.
    pub latency: LatencyEntry,
    /// Messages that were put into its mailbox.
    pub mail: u64,
    /// Of these, those that were dropped because it did not read, or that it read too late.
    pub dropped: u64,
    /// Messages that it was sent and has not handled, as far as it has said: it says so batch by batch.
    pub unhandled: u64,
    /// Bytes of mail that wait for it.
    pub waiting_bytes: u64,
}

/// What a client has registered for.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct RegistrationEntry {
    /// The pattern of the variables.
    pub key_pattern: String,
    /// The pattern of the sources.
    pub source_pattern: String,
    /// The least time between two messages of a variable (s); 0: all of them.
    pub min_interval_secs: f64,
    /// Whether publishers wait for it.
    pub lossless: bool,
}

/// How long messages took (s).
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct LatencyEntry {
    /// The last one.
    pub recent_secs: f64,
    /// The shortest.
    pub min_secs: f64,
    /// The longest.
    pub max_secs: f64,
    /// Their mean.
    pub mean_secs: f64,
}

/// A variable.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct VariableEntry {
    /// Its name.
    pub name: String,
    /// What it carries.
    pub kind: VariableKind,
    /// Messages so far.
    pub messages: u64,
    /// Bytes of their values, those in shared memory included.
    pub bytes: u64,
    /// Messages per second, over the last two seconds that the broker has summed up.
    pub rate_hz: f64,
    /// When it was last written (s, as the table's time).
    pub written: f64,
    /// Who wrote last.
    pub writer: String,
    /// The latest value.
    pub latest: LatestValue,
    /// Bytes of the latest value.
    pub latest_bytes: u64,
    /// Who writes it, and who is told.
    pub routes: Vec<RouteEntry>,
}

/// What a variable carries since its first write.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
pub enum VariableKind {
    /// Numbers.
    Number,
    /// Texts.
    Text,
    /// Values of a type.
    Typed {
        /// The type's name.
        name: String,
        /// The hash of its fields.
        layout: u64,
    },
}

/// A variable's latest value, as far as it is short.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub enum LatestValue {
    /// A number.
    Number(f64),
    /// A text, or the beginning of a long one.
    Text(String),
    /// A typed value, encoded.
    Typed(Vec<u8>),
    /// A value that is too long for a table.
    Long,
}

/// Who is told what a source writes to a variable.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct RouteEntry {
    /// The source; it need not be there any more.
    pub source: String,
    /// The clients that get it.
    pub readers: Vec<String>,
}

impl Broker {
    /// Gives a client the table.
    pub(super) fn answer_with_table(&mut self, now: f64, to: ClientId) {
        let mut bytes = Vec::new();
        if codec::encode_onto(&self.table(now), &mut bytes).is_err() {
            return; // names and numbers can always be encoded
        }
        let key = self.number(Named::Key, TABLE.name(), 0);
        self.own_sequence += 1;
        let header = Header {
            value_kind: ValueKind::Binary,
            key,
            source: self.own_source,
            type_: self.types.number(CommunityTable::NAME, CommunityTable::LAYOUT),
            sequence: self.own_sequence,
            time: self.time(now),
            ..Header::new(FrameKind::Notify)
        };
        let mut frame = Vec::new();
        wire::put(&mut frame, &header, &[], &bytes);
        Message::stored(&frame).into_iter().for_each(|message| self.deliver(now, to, &message));
    }

    fn table(&self, now: f64) -> CommunityTable {
        let clients: Vec<ClientEntry> = self.present().map(|(_, client)| self.client_entry(client)).collect();
        let mut bytes = 0;
        let (mut variables, mut left_out) = (Vec::new(), 0);
        for (key, variable) in (0..).zip(&self.variables) {
            let Some(entry) = self.variable_entry(key, variable, bytes < LARGEST) else { continue };
            bytes += entry.size();
            match bytes <= LARGEST {
                true => variables.push(entry),
                false => left_out += 1,
            }
        }
        CommunityTable {
            community: self.config.community.clone(),
            time: now,
            started: self.started,
            clock: self.clock_entry(now),
            clients,
            variables,
            left_out,
        }
    }

    fn client_entry(&self, client: &Client) -> ClientEntry {
        ClientEntry {
            name: client.name.clone(),
            registrations: client.registrations.iter().map(Registration::entry).collect(),
            writes: client.published.iter().take(MOST_WRITES).map(|key| self.keys.name(*key).to_owned()).collect(),
            messages: client.latency.count(),
            latency: client.latency.entry(),
            mail: client.mailbox.pushed(),
            dropped: client.mailbox.lost(),
            unhandled: client.mailbox.pushed() - client.mailbox.done(),
            waiting_bytes: client.mailbox.waiting() as u64,
        }
    }

    /// A variable as the table has it; one that is left out anyway needs no details.
    fn variable_entry(&self, key: u32, variable: &Variable, detailed: bool) -> Option<VariableEntry> {
        let kind = self.kind(variable.lock?);
        let frame = wire::first_frame(&variable.latest).ok()?;
        let reader = |id: ClientId| self.clients.get(&id).map(|client| client.name.clone());
        let route = |route: &super::variable::Route| RouteEntry {
            source: self.sources.name(route.source).to_owned(),
            readers: route.deliveries.iter().filter_map(|delivery| reader(delivery.client)).collect(),
        };
        Some(VariableEntry {
            name: self.keys.name(key).to_owned(),
            kind,
            messages: variable.writes,
            bytes: variable.bytes,
            rate_hz: variable.rate_hz,
            written: variable.last_write,
            writer: self.sources.name(frame.header.source).to_owned(),
            latest: latest(&frame)?,
            latest_bytes: wire::value_bytes(frame.bytes),
            routes: variable.routes.iter().filter(|_| detailed).map(route).collect(),
        })
    }

    fn kind(&self, lock: TypeLock) -> VariableKind {
        match lock.kind {
            ValueKind::Double => VariableKind::Number,
            ValueKind::Text => VariableKind::Text,
            ValueKind::Binary => VariableKind::Typed {
                name: self.types.name(lock.type_).to_owned(),
                layout: self.types.layout(lock.type_),
            },
        }
    }
}

impl VariableEntry {
    /// About how many bytes it takes in the table.
    fn size(&self) -> usize {
        let route = |route: &RouteEntry| {
            32 + route.source.len() + route.readers.iter().map(|reader| 32 + reader.len()).sum::<usize>()
        };
        let latest = match &self.latest {
            LatestValue::Text(text) => text.len(),
            LatestValue::Typed(bytes) => bytes.len(),
            LatestValue::Number(_) | LatestValue::Long => 8,
        };
        size_of::<Self>() + self.name.len() + self.writer.len() + latest + self.routes.iter().map(route).sum::<usize>()
    }
}

impl Registration {
    fn entry(&self) -> RegistrationEntry {
        RegistrationEntry {
            key_pattern: self.key_pattern.clone(),
            source_pattern: self.source_pattern.clone(),
            min_interval_secs: self.min_interval,
            lossless: self.lossless,
        }
    }
}

fn latest(frame: &wire::Frame<'_>) -> Option<LatestValue> {
    Some(match frame.header.value_kind {
        ValueKind::Double => LatestValue::Number(f64::from_le_bytes(frame.value.try_into().ok()?)),
        ValueKind::Text if frame.header.flags & BULK != 0 => LatestValue::Long,
        ValueKind::Text => {
            let start = &frame.value[..frame.value.len().min(LONGEST_VALUE)];
            LatestValue::Text(String::from_utf8_lossy(start).into_owned())
        }
        ValueKind::Binary if frame.header.flags & BULK == 0 && frame.value.len() <= LONGEST_VALUE => {
            LatestValue::Typed(frame.value.to_vec())
        }
        ValueKind::Binary => LatestValue::Long,
    })
}
