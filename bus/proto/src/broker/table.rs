//! The community's table: who is there and what was said, on request.
//!
//! Whoever writes to [`REQUEST`] (anything) is answered with a [`CommunityTable`] under [`TABLE`], it alone, behind all
//! mail and all refusals that came before. So the answer also says that the broker has taken in what the asker sent.
//! Nobody pays for a table that nobody asks for; the `DB_*` summaries for MOOS' tools stay what they are.

use std::collections::BTreeSet;

use super::state::Broker;
use super::state::client::Client;
use super::state::expected::Expected;
use super::state::latency::Latency;
use super::state::message::Message;
use super::state::names::Definition;
use super::state::registration::Registration;
use super::state::variable::{Route, TypeLock, Variable};
use crate::codec;
use crate::key::{Key, Payload};
use crate::payload;
use crate::types::{Type, TypeRef};
use crate::wire::{self, BULK, ClientId, FrameKind, Header, Named, ValueKind};

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

/// Who is in a community and what was said, at one moment.
#[payload]
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
    /// The types that these carry, or that clients expect of them.
    pub types: Vec<TypeEntry>,
    /// Variables that were left out, because the table would be too large with them.
    pub left_out: u64,
}

/// A clock that is driven.
#[payload]
#[derive(Debug, Clone, PartialEq)]
pub struct ClockEntry {
    /// The client that drives it.
    pub driver: String,
    /// The community's time (s).
    pub time: f64,
    /// How fast it runs; 0: it stands still.
    pub rate: f64,
}

/// A client.
#[payload]
#[derive(Debug, Clone, PartialEq)]
pub struct ClientEntry {
    /// Its name.
    pub name: String,
    /// Which build of which program it is, as it says; empty: it has not said.
    pub build: String,
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
#[payload]
#[derive(Debug, Clone, PartialEq)]
pub struct RegistrationEntry {
    /// The pattern of the variables.
    pub key_pattern: String,
    /// The pattern of the sources.
    pub source_pattern: String,
    /// The least time between two messages of a variable (s); 0: all of them.
    #[describe(any)]
    pub min_interval_secs: f64,
    /// Whether publishers wait for it.
    pub lossless: bool,
    /// What the client expects there, if it has said so.
    pub expects: Option<VariableKind>,
}

/// How long messages took (s).
#[payload]
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct LatencyEntry {
    /// The last one.
    #[describe(any)]
    pub recent_secs: f64,
    /// The shortest.
    #[describe(any)]
    pub min_secs: f64,
    /// The longest.
    #[describe(any)]
    pub max_secs: f64,
    /// Their mean.
    #[describe(any)]
    pub mean_secs: f64,
}

/// A variable.
#[payload]
#[derive(Debug, Clone, PartialEq)]
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
#[payload]
#[derive(Debug, Clone, PartialEq, Eq)]
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

/// A type of values.
#[payload]
#[derive(Debug, Clone, PartialEq)]
pub struct TypeEntry {
    /// Its name.
    pub name: String,
    /// The hash of all that decides what its bytes mean.
    pub layout: u64,
    /// What its bytes are (see [`elk_describe::Description::to_text`]); empty: nobody has said.
    pub description: String,
}

impl TypeEntry {
    /// The type.
    pub fn to_type(&self) -> Type {
        // The broker has looked at it.
        let undescribed = || Type::undescribed(&self.name, self.layout);
        Type::from_text(&self.name, self.layout, &self.description).unwrap_or_else(|_| undescribed())
    }
}

impl CommunityTable {
    /// The type of this name and layout, as far as it is described.
    pub fn type_of(&self, name: &str, layout: u64) -> Type {
        let found = self.types.iter().find(|one| one.name == name && one.layout == layout);
        found.map_or_else(|| Type::undescribed(name, layout), TypeEntry::to_type)
    }
}

/// A variable's latest value, as far as it is short.
#[payload]
#[derive(Debug, Clone, PartialEq)]
pub enum LatestValue {
    /// A number.
    Number(#[describe(any)] f64),
    /// A text, or the beginning of a long one.
    Text(String),
    /// A typed value, encoded.
    Typed(Vec<u8>),
    /// A value that is too long for a table.
    Long,
}

/// Who is told what a source writes to a variable.
#[payload]
#[derive(Debug, Clone, PartialEq)]
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
        let key = self.number(Named::Key, Definition::of(TABLE.name()));
        let type_ = self.own_type::<CommunityTable>();
        let sequence = self.own.next();
        let header = Header {
            value_kind: ValueKind::Binary,
            key,
            source: self.own.source,
            type_,
            sequence,
            time: self.time.of_community(now),
            ..Header::new(FrameKind::Notify)
        };
        let mut frame = Vec::new();
        wire::put(&mut frame, &header, &[], &bytes);
        Message::stored(&frame).into_iter().for_each(|message| self.deliver(now, to, &message));
    }

    /// The number of a type that the broker itself writes.
    fn own_type<T: Payload>(&mut self) -> u32 {
        let known = self.names.types.known(T::NAME, T::LAYOUT);
        known.unwrap_or_else(|| self.names.types.number(T::NAME, T::LAYOUT, &TypeRef::of::<T>().text()))
    }

    fn table(&self, now: f64) -> CommunityTable {
        let clients: Vec<ClientEntry> = self.sessions.present().map(|(_, client)| self.client_entry(client)).collect();
        let types = self.type_entries();
        let mut bytes: usize = types.iter().map(|one| one.name.len() + one.description.len()).sum();
        let (mut variables, mut left_out) = (Vec::new(), 0);
        for (key, variable) in (0..).zip(self.variables.iter()) {
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
            started: self.time.started,
            clock: self.clock_entry(now),
            clients,
            variables,
            types,
            left_out,
        }
    }

    /// The types that variables carry and that clients expect.
    fn type_entries(&self) -> Vec<TypeEntry> {
        let carried = self.variables.iter().filter_map(|variable| variable.lock);
        let carried = carried.filter(|lock| lock.kind == ValueKind::Binary).map(|lock| lock.type_);
        let registrations = self.sessions.present().flat_map(|(_, client)| &client.registrations);
        let expected = registrations.filter_map(|registration| match registration.expects.as_ref()? {
            Expected::Values(name, layout) => self.names.types.known(name, *layout),
            Expected::Numbers | Expected::Texts => None,
        });
        let numbers: BTreeSet<u32> = carried.chain(expected).collect();
        let entry = |number| {
            let (name, layout, description) = self.names.types.said(number);
            TypeEntry { name: name.to_owned(), layout, description: description.to_owned() }
        };
        numbers.into_iter().map(entry).collect()
    }

    fn client_entry(&self, client: &Client) -> ClientEntry {
        ClientEntry {
            name: client.name.clone(),
            build: client.build.clone(),
            registrations: client.registrations.iter().map(RegistrationEntry::of).collect(),
            writes: client
                .published
                .iter()
                .take(MOST_WRITES)
                .map(|key| self.names.keys.name(*key).to_owned())
                .collect(),
            messages: client.latency.count(),
            latency: LatencyEntry::of(&client.latency),
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
        let reader = |id: ClientId| self.sessions.clients.get(&id).map(|client| client.name.clone());
        let route = |route: &Route| RouteEntry {
            source: self.names.sources.name(route.source).to_owned(),
            readers: route.deliveries.iter().filter_map(|delivery| reader(delivery.client)).collect(),
        };
        Some(VariableEntry {
            name: self.names.keys.name(key).to_owned(),
            kind,
            messages: variable.writes,
            bytes: variable.bytes,
            rate_hz: variable.rate_hz,
            written: variable.last_write,
            writer: self.names.sources.name(frame.header.source).to_owned(),
            latest: latest(&frame)?,
            latest_bytes: wire::value_bytes(frame.bytes),
            routes: variable.routes.iter().filter(|_| detailed).map(route).collect(),
        })
    }

    fn kind(&self, lock: TypeLock) -> VariableKind {
        match lock.kind {
            ValueKind::Double => VariableKind::Number,
            ValueKind::Text => VariableKind::Text,
            ValueKind::Binary => {
                let (name, layout, _) = self.names.types.said(lock.type_);
                VariableKind::Typed { name: name.to_owned(), layout }
            }
        }
    }
}

impl LatencyEntry {
    fn of(latency: &Latency) -> Self {
        Self { recent_secs: latency.recent, min_secs: latency.min, max_secs: latency.max, mean_secs: latency.mean() }
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

impl RegistrationEntry {
    fn of(registration: &Registration) -> Self {
        Self {
            key_pattern: registration.key_pattern.clone(),
            source_pattern: registration.source_pattern.clone(),
            min_interval_secs: registration.min_interval,
            lossless: registration.lossless,
            expects: registration.expects.as_ref().map(|expected| match expected {
                Expected::Numbers => VariableKind::Number,
                Expected::Texts => VariableKind::Text,
                Expected::Values(name, layout) => VariableKind::Typed { name: name.clone(), layout: *layout },
            }),
        }
    }
}

fn latest(frame: &wire::Frame<'_>) -> Option<LatestValue> {
    Some(match frame.header.value_kind {
        ValueKind::Double => LatestValue::Number(wire::double(frame.value)?),
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
