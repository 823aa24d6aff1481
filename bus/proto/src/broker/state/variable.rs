//! A variable of the community: its type, its latest value, and who gets it.

use std::collections::BTreeSet;

use super::message::Message;
use crate::wire::{self, ClientId, Header, RESENT, ValueKind};

/// Room for a latest value that is kept for the next one (bytes), beside twice the present one's.
const SPARE_CAPACITY: usize = 128;

/// A time that can be ordered (s; never NaN here).
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Due(pub f64);

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

/// The type that a variable's first write fixed.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct TypeLock {
    pub kind: ValueKind,
    /// The payload type's number, for binary values; it stands for name and layout.
    pub type_: u32,
}

impl TypeLock {
    /// The type of a message in the broker's numbers.
    pub fn of(header: &Header) -> Self {
        Self { kind: header.value_kind, type_: header.type_ }
    }
}

/// What one client gets of one (variable, source).
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Delivery {
    pub client: ClientId,
    pub min_interval: f64,
    pub lossless: bool,
}

/// Who gets what one source writes to the variable.
#[derive(Debug)]
pub struct Route {
    pub source: u32,
    pub deliveries: Vec<Delivery>,
}

/// When a throttled client last got the variable, and what waits for it.
#[derive(Debug)]
pub struct Throttle {
    pub client: ClientId,
    pub last_sent: f64,
    /// A message, and when its time comes.
    pub pending: Option<(Due, Vec<u8>)>,
}

/// A variable.
#[derive(Debug, Default)]
pub struct Variable {
    /// The broker alone writes it.
    pub is_own: bool,
    /// Some client may be owed the latest value (see [`super::mailbox::Mailbox`]).
    pub owed: bool,
    pub lock: Option<TypeLock>,
    /// The latest frame, in the broker's numbers; empty before the first write.
    pub latest: Vec<u8>,
    /// The client that published it, unless that was in the time of another broker.
    pub latest_from: Option<ClientId>,
    /// The build of that client, as far as it said; it may be gone, and another of its name be of another build.
    pub latest_build: Option<u32>,
    pub writes: u64,
    /// Bytes of all values so far.
    pub bytes: u64,
    pub last_write: f64,
    pub writers: BTreeSet<u32>,
    /// Writes at the last summary, for the rate.
    pub summarised_writes: u64,
    /// Writes per second between the last two summaries.
    pub rate_hz: f64,
    pub routes: Vec<Route>,
    pub throttles: Vec<Throttle>,
}

impl Variable {
    /// Stores the latest message, of client `from`; `None`: of the broker, or of somebody who is gone.
    pub fn keep(&mut self, now: f64, from: Option<ClientId>, message: &Message<'_>) {
        self.latest_from = from;
        self.lock = Some(TypeLock::of(&message.header));
        self.latest.clear();
        if self.latest.capacity() > SPARE_CAPACITY + 2 * message.len() {
            self.latest = Vec::new();
        }
        message.append_to(&mut self.latest);
        self.writes += 1;
        self.bytes = self.bytes.saturating_add(wire::value_bytes(&self.latest));
        self.last_write = now;
    }

    /// The latest value with these flags beside its own, as a message for whoever comes late.
    pub fn latest_message(&self, flags: u16) -> Option<Message<'_>> {
        let frame = wire::first_frame(&self.latest).ok()?;
        let header = Header { flags: frame.header.flags & !RESENT | flags, ..frame.header };
        Some(Message::new(header, &frame))
    }

    /// The source of the latest value.
    pub fn latest_source(&self) -> Option<u32> {
        wire::first_frame(&self.latest).ok().map(|f| f.header.source)
    }

    /// The throttle of a client.
    pub fn throttle(&mut self, client: ClientId) -> &mut Throttle {
        let at = self.throttles.iter().position(|t| t.client == client).unwrap_or_else(|| {
            self.throttles.push(Throttle { client, last_sent: f64::NEG_INFINITY, pending: None });
            self.throttles.len() - 1
        });
        &mut self.throttles[at]
    }

    /// Takes out what waits for a client's time to come.
    pub fn take_pending(&mut self, client: ClientId) -> Option<(Due, Vec<u8>)> {
        self.throttles.iter_mut().find(|t| t.client == client)?.pending.take()
    }
}
