//! The broker as a state machine: no clock, no socket, no thread. It is handed (now, from, batch) and fills mailboxes;
//! a transport carries batches in and mail out.
//!
//! It mirrors the MOOSDB: a star around one table of variables, each with its latest value, which late registrants are
//! given at once. Where MOOS makes its users suffer it differs: a throttled registration delivers the last value of a
//! burst too; wildcards match every (variable, source) pair whenever it first appears; a write of the wrong type is
//! answered to the writer; a mailbox that nobody reads drops its oldest mail and counts.

mod interner;
mod mailbox;
mod message;
mod registration;
mod summary;
pub mod table;
mod variable;

use std::collections::{BTreeMap, BTreeSet};

use crate::wire::{self, BULK, Frame, FrameKind, Header, Named, ValueKind, WireError};
use interner::Interner;
pub use mailbox::Mailbox;
use message::{Message, bulk_of};
use registration::Registration;
use variable::{TypeLock, Variable};

/// The number of a connected client; never given twice.
pub type ClientId = u32;

/// What a broker can be told about itself.
#[derive(Debug, Clone)]
pub struct BrokerConfig {
    /// The community's name: part of the broker's own name and of every message.
    pub community: String,
    /// The most that a client's mailbox holds (bytes); the oldest mail goes first.
    pub mailbox_bytes: usize,
    /// How long publishers wait for a lossless registrant that does not read (s); then its mail is dropped as well.
    pub lossless_patience_secs: f64,
}

impl BrokerConfig {
    /// Mailboxes of 4 MiB, patience of 5 s.
    pub fn new(community: impl Into<String>) -> Self {
        Self { community: community.into(), mailbox_bytes: 4 << 20, lossless_patience_secs: 5.0 }
    }
}

/// Why a client was not let in.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
pub enum Refusal {
    /// Another client has the name.
    #[error("a client named {0:?} is already connected: give this one another name, or stop the other first")]
    NameTaken(String),
    /// The name cannot be one.
    #[error("{0:?} is no name for a client: 1 to 64 printable characters without comma, '*' or '?'")]
    BadName(String),
}

/// The broker's whole state.
pub struct Broker {
    config: BrokerConfig,
    started: f64,
    clients: BTreeMap<ClientId, Client>,
    names: BTreeMap<String, ClientId>,
    next_client: ClientId,
    keys: Interner,
    sources: Interner,
    types: Interner,
    communities: Interner,
    /// By key number.
    variables: Vec<Variable>,
    /// Throttled values that wait for their time: (due, variable, client).
    due: BTreeSet<(Due, u32, ClientId)>,
    /// The bulk samples that are some variable's latest value.
    latest_bulk: BTreeSet<(ClientId, u64)>,
    attached: Vec<(ClientId, ClientId)>,
    own_source: u32,
    own_sequence: u64,
    next_summary: f64,
}

/// A time that can be ordered (s; never NaN here).
#[derive(Debug, Clone, Copy, PartialEq)]
struct Due(f64);

impl Eq for Due {}
impl PartialOrd for Due {
    fn partial_cmp(&self, other: &Self) -> Option<std::cmp::Ordering> {
        Some(self.cmp(other))
    }
}
impl Ord for Due {
    fn cmp(&self, other: &Self) -> std::cmp::Ordering {
        self.0.total_cmp(&other.0)
    }
}

/// A connected client.
struct Client {
    name: String,
    /// The client's numbers, by [`Named`], to the broker's.
    numbers: [Vec<u32>; 4],
    registrations: Vec<Registration>,
    mailbox: Mailbox,
    /// Lossless registrants that this client's messages went to.
    feeds: BTreeSet<ClientId>,
    published: BTreeSet<u32>,
    last_published: Option<u32>,
    latency: summary::Latency,
}

const NAME_SEPARATORS: [char; 3] = [',', '*', '?'];

impl Broker {
    /// A broker without clients or variables, started at `now` (s).
    pub fn new(config: BrokerConfig, now: f64) -> Self {
        let (mut sources, mut communities) = (Interner::default(), Interner::default());
        let own_source = sources.number(&format!("MOOSDB_{}", config.community), 0);
        communities.number(&config.community, 0);
        Self {
            config,
            started: now,
            clients: BTreeMap::new(),
            names: BTreeMap::new(),
            next_client: 1,
            keys: Interner::default(),
            sources,
            types: Interner::default(),
            communities,
            variables: Vec::new(),
            due: BTreeSet::new(),
            latest_bulk: BTreeSet::new(),
            attached: Vec::new(),
            own_source,
            own_sequence: 0,
            next_summary: now,
        }
    }

    /// Lets a client in under its name, or says why not.
    pub fn connect(&mut self, now: f64, name: &str) -> Result<ClientId, Refusal> {
        let printable = |c: char| !c.is_control() && !NAME_SEPARATORS.contains(&c);
        if name.is_empty() || name.chars().count() > 64 || !name.chars().all(printable) {
            return Err(Refusal::BadName(name.into()));
        }
        if self.names.contains_key(name) {
            return Err(Refusal::NameTaken(name.into()));
        }
        let id = self.next_client;
        self.next_client += 1;
        let source = self.sources.number(name, 0);
        let client = Client {
            name: name.into(),
            numbers: [vec![], vec![source], vec![], vec![0]],
            registrations: Vec::new(),
            mailbox: Mailbox::new(self.config.mailbox_bytes, now),
            feeds: BTreeSet::new(),
            published: BTreeSet::new(),
            last_published: None,
            latency: summary::Latency::default(),
        };
        self.clients.insert(id, client);
        self.names.insert(name.into(), id);
        self.announce(now, &format!("connected={name}"));
        Ok(id)
    }

    /// Forgets a client: its registrations and its mail go, its name is free, what it published stays.
    pub fn disconnect(&mut self, now: f64, id: ClientId) {
        let Some(client) = self.clients.remove(&id) else {
            return;
        };
        self.names.remove(&client.name);
        for variable in &mut self.variables {
            variable.forget(id);
        }
        self.due.retain(|(_, _, client)| *client != id);
        for other in self.clients.values_mut() {
            other.feeds.remove(&id);
        }
        self.announce(now, &format!("disconnected={}", client.name));
    }

    fn announce(&mut self, now: f64, event: &str) {
        self.publish_own(now, "DB_EVENT", ValueKind::Text, event.as_bytes());
        self.publish_clients(now);
    }

    /// Takes in a batch of frames from a client. A damaged batch is taken up to the damage; the transport then has to
    /// let go of the client, whose lane can no longer be trusted.
    pub fn receive(&mut self, now: f64, from: ClientId, batch: &[u8]) -> Result<(), WireError> {
        let mut at = 0;
        for frame in wire::frames(batch) {
            let frame = frame?;
            self.frame(now, from, &frame).map_err(|what| WireError { at, what })?;
            at += frame.bytes.len();
        }
        Ok(())
    }

    fn frame(&mut self, now: f64, from: ClientId, frame: &Frame<'_>) -> Result<(), &'static str> {
        match frame.header.kind {
            FrameKind::Notify => self.notify(now, from, frame),
            FrameKind::Define => self.define(from, frame),
            FrameKind::Register => self.register(now, from, frame),
            FrameKind::Unregister => self.unregister(from, frame),
            FrameKind::Attached => {
                self.attached.push((from, frame.header.source));
                Ok(())
            }
            FrameKind::Refused | FrameKind::Dropped => Err("only the broker sends such a frame"),
        }
    }

    fn define(&mut self, from: ClientId, frame: &Frame<'_>) -> Result<(), &'static str> {
        let what = wire::named(frame.header.flags).ok_or("the definition is of no known thing")?;
        let name = std::str::from_utf8(frame.aux).map_err(|_| "the name is not UTF-8")?;
        let number = match what {
            Named::Key => self.keys.number(name, 0),
            Named::Source => self.sources.number(name, 0),
            Named::Type => self.types.number(name, frame.header.sequence),
            Named::Community => self.communities.number(name, 0),
        };
        while self.variables.len() < self.keys.len() {
            self.variables.push(Variable::default());
        }
        let client = self.clients.get_mut(&from).ok_or("the client is not connected")?;
        let numbers = &mut client.numbers[what as usize];
        if numbers.len() != frame.header.key as usize {
            return Err("the definitions are not numbered in order");
        }
        numbers.push(number);
        Ok(())
    }

    fn notify(&mut self, now: f64, from: ClientId, frame: &Frame<'_>) -> Result<(), &'static str> {
        let header = &frame.header;
        let client = self.clients.get_mut(&from).ok_or("the client is not connected")?;
        let translate = |what: Named, number: u32| {
            client.numbers[what as usize].get(number as usize).copied().ok_or("a number was used before its definition")
        };
        let key = translate(Named::Key, header.key)?;
        let source = translate(Named::Source, header.source)?;
        let community = translate(Named::Community, header.community)?;
        let type_ = match header.value_kind {
            ValueKind::Binary => translate(Named::Type, header.type_)?,
            _ => 0,
        };
        if self.keys.name(key) == table::REQUEST {
            self.answer_with_table(now, from);
            return Ok(());
        }
        client.latency.note(now - header.time);
        if client.last_published != Some(key) {
            client.last_published = Some(key);
            if client.published.insert(key) {
                self.variables[key as usize].writers.insert(source);
            }
        }
        let header = Header { flags: header.flags & BULK, key, source, type_, community, ..*header };
        if let Some(reason) = self.type_conflict(key, TypeLock::of(&header)) {
            return self.refuse(from, key, header.sequence, &reason);
        }
        self.store_and_deliver(now, Some(from), &Message::new(header, frame.bytes));
        Ok(())
    }

    fn type_conflict(&self, key: u32, lock: TypeLock) -> Option<String> {
        let locked = self.variables[key as usize].lock?;
        (locked != lock).then(|| {
            let (was, is) = (self.describe(locked), self.describe(lock));
            format!("{} carries {was} since its first write; {is} was refused", self.keys.name(key))
        })
    }

    fn describe(&self, lock: TypeLock) -> String {
        match lock.kind {
            ValueKind::Double => "numbers".into(),
            ValueKind::Text => "texts".into(),
            ValueKind::Binary => {
                format!("{} (layout {:016x})", self.types.name(lock.type_), self.types.layout(lock.type_))
            }
        }
    }

    fn refuse(&mut self, to: ClientId, key: u32, sequence: u64, reason: &str) -> Result<(), &'static str> {
        let name = self.keys.name(key).to_owned();
        let client = self.clients.get_mut(&to).ok_or("the client is not connected")?;
        let header = Header { sequence, ..Header::new(FrameKind::Refused) };
        wire::put(client.mailbox.notices(), &header, name.as_bytes(), reason.as_bytes());
        Ok(())
    }

    fn publish_own(&mut self, now: f64, key: &str, kind: ValueKind, value: &[u8]) {
        let key = self.keys.number(key, 0);
        while self.variables.len() < self.keys.len() {
            self.variables.push(Variable::default());
        }
        if self.type_conflict(key, TypeLock { kind, type_: 0 }).is_some() {
            return; // a client was first with this name, and with another type; it is the client's now
        }
        self.own_sequence += 1;
        let header = Header {
            value_kind: kind,
            key,
            source: self.own_source,
            sequence: self.own_sequence,
            time: now,
            ..Header::new(FrameKind::Notify)
        };
        let mut frame = Vec::new();
        wire::put(&mut frame, &header, &[], value);
        self.variables[key as usize].writers.insert(self.own_source);
        self.store_and_deliver(now, None, &Message::new(header, &frame));
    }

    fn store_and_deliver(&mut self, now: f64, from: Option<ClientId>, message: &Message<'_>) {
        let (key, source) = (message.header.key, message.header.source);
        self.keep_as_latest(now, message);
        let route = self.route(key, source);
        let deliveries = std::mem::take(&mut self.variables[key as usize].routes[route].deliveries);
        for delivery in &deliveries {
            if delivery.lossless
                && let Some(feeder) = from.and_then(|f| self.clients.get_mut(&f))
            {
                feeder.feeds.insert(delivery.client);
            }
            match delivery.min_interval > 0.0 {
                true => self.deliver_throttled(now, delivery.client, delivery.min_interval, message),
                false => self.deliver(now, delivery.client, message),
            }
        }
        self.variables[key as usize].routes[route].deliveries = deliveries;
    }

    fn keep_as_latest(&mut self, now: f64, message: &Message<'_>) {
        let variable = &mut self.variables[message.header.key as usize];
        if let Some(old) = bulk_of(&variable.latest) {
            self.latest_bulk.remove(&(old.client, old.sample));
        }
        variable.keep(now, message);
        if let Some(new) = bulk_of(&variable.latest) {
            self.latest_bulk.insert((new.client, new.sample));
        }
    }

    /// The place of (key, source) in the variable's routes; a pair that is new is matched against all registrations.
    fn route(&mut self, key: u32, source: u32) -> usize {
        if let Some(known) = self.variables[key as usize].routes.iter().position(|r| r.source == source) {
            return known;
        }
        let (key_name, source_name) = (self.keys.name(key), self.sources.name(source));
        let deliveries = self
            .clients
            .iter()
            .filter_map(|(id, c)| registration::combine(*id, &c.registrations, key_name, source_name))
            .collect();
        let routes = &mut self.variables[key as usize].routes;
        routes.push(variable::Route { source, deliveries });
        routes.len() - 1
    }

    fn deliver(&mut self, now: f64, to: ClientId, message: &Message<'_>) {
        let Some(client) = self.clients.get_mut(&to) else { return };
        let header = &message.header;
        let named = [
            (Named::Key, &self.keys, header.key),
            (Named::Source, &self.sources, header.source),
            (Named::Type, &self.types, header.type_),
            (Named::Community, &self.communities, header.community),
        ];
        for (what, names, number) in named {
            let needed = what != Named::Type || header.value_kind == ValueKind::Binary;
            if needed && client.mailbox.learns(what, number) {
                let (name, layout) = (names.name(number), names.layout(number));
                wire::put_definition(client.mailbox.notices(), what, number, name, layout);
            }
        }
        client.mailbox.push(now, message, self.config.lossless_patience_secs);
    }

    fn deliver_throttled(&mut self, now: f64, to: ClientId, interval: f64, message: &Message<'_>) {
        let key = message.header.key;
        let throttle = self.variables[key as usize].throttle(to);
        let due = throttle.last_sent + interval;
        if now >= due && throttle.pending.is_none() {
            throttle.last_sent = now;
            self.deliver(now, to, message);
        } else {
            throttle.pending = Some(message.to_bytes());
            self.due.insert((Due(due), key, to));
        }
    }

    /// Delivers what throttled registrations held back and whose time has come, and refreshes the `DB_*` variables.
    pub fn tick(&mut self, now: f64) {
        while let Some(&(due, key, client)) = self.due.first().filter(|(due, ..)| due.0 <= now) {
            self.due.remove(&(due, key, client));
            let throttle = self.variables[key as usize].throttle(client);
            throttle.last_sent = now;
            if let Some(frame) = throttle.pending.take()
                && let Some(message) = Message::stored(&frame)
            {
                self.deliver(now, client, &message);
            }
        }
        if now >= self.next_summary {
            self.next_summary = now + summary::PERIOD_SECS;
            self.summarise(now);
        }
    }

    /// When [`Broker::tick`] next has something to do (s).
    pub fn next_deadline(&self) -> f64 {
        self.due.first().map_or(self.next_summary, |(due, ..)| due.0.min(self.next_summary))
    }

    /// Whether the client's next batch has to wait for a lossless registrant whose mailbox is full.
    pub fn holds_back(&self, now: f64, from: ClientId) -> bool {
        let patience = self.config.lossless_patience_secs;
        let feeds = self.clients.get(&from).map(|c| &c.feeds);
        feeds.is_some_and(|feeds| {
            feeds.iter().any(|id| self.clients.get(id).is_some_and(|c| c.mailbox.holds_back(now, patience)))
        })
    }

    /// The clients that have mail waiting, or notices.
    pub fn with_mail(&self) -> impl Iterator<Item = ClientId> + '_ {
        self.clients.iter().filter(|(_, c)| !c.mailbox.is_empty()).map(|(id, _)| *id)
    }

    /// Moves a client's mail into `batch` until it holds `max` bytes (a single message may be longer). Messages whose
    /// value lies in shared memory go through `bulk`, which appends what the client can use.
    pub fn take_mail(
        &mut self,
        now: f64,
        id: ClientId,
        max: usize,
        batch: &mut Vec<u8>,
        bulk: impl FnMut(&Frame<'_>, &mut Vec<u8>),
    ) {
        if let Some(client) = self.clients.get_mut(&id) {
            client.mailbox.take(now, max, batch, bulk);
        }
    }

    /// Whether a bulk sample is some variable's latest value, so that late registrants will want it.
    pub fn is_latest_bulk(&self, client: ClientId, sample: u64) -> bool {
        self.latest_bulk.contains(&(client, sample))
    }

    /// The (receiver, publisher) pairs that attached since the last call.
    pub fn take_attached(&mut self) -> Vec<(ClientId, ClientId)> {
        std::mem::take(&mut self.attached)
    }

    /// The lossless registrants that a client's messages went to, each with the position of its newest mail.
    pub fn lossless_positions(&self, publisher: ClientId) -> Vec<(ClientId, u64)> {
        let feeds = self.clients.get(&publisher).into_iter().flat_map(|c| &c.feeds);
        feeds.filter_map(|id| Some((*id, self.clients.get(id)?.mailbox.pushed()))).collect()
    }

    /// The position up to which a client's mail has left its mailbox.
    pub fn mail_taken(&self, id: ClientId) -> u64 {
        self.clients.get(&id).map_or(0, |c| c.mailbox.left())
    }

    /// A connected client's name.
    pub fn client_name(&self, id: ClientId) -> Option<&str> {
        self.clients.get(&id).map(|c| c.name.as_str())
    }

    /// Number of connected clients.
    pub fn clients(&self) -> usize {
        self.clients.len()
    }
}

#[cfg(test)]
mod tests;
