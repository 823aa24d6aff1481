//! The broker as a state machine: no clock, no socket, no thread. It is handed (now, from, batch) and fills mailboxes;
//! a transport carries batches in and mail out.
//!
//! It mirrors the MOOSDB: a star around one table of variables, each with its latest value, which late registrants are
//! given at once. Where MOOS makes its users suffer it differs: a throttled registration delivers the last value of a
//! burst too; wildcards match every (variable, source) pair whenever it first appears; a write of the wrong type is
//! answered to the writer; a mailbox that nobody reads drops its oldest mail and counts.

mod expectation;
mod interner;
mod legacy;
mod limits;
mod mailbox;
mod membership;
mod message;
mod naming;
mod registration;
mod summary;
pub mod table;
mod time;
mod variable;

use std::collections::{BTreeMap, BTreeSet, VecDeque};

use crate::wire::{self, BULK, Frame, FrameKind, Header, Named, RESENT, ValueKind, WireError};
pub use expectation::Expected;
use interner::Interner;
pub use legacy::Legacy;
pub use limits::Limits;
use limits::{REFUSED, UNNAMED};
pub use mailbox::Mailbox;
use membership::Standing;
pub use membership::{Introduction, Place, Refusal};
use message::{Message, bulk_of};
use naming::{Names, OWN_PREFIX};
pub use registration::Registration;
pub use time::CLOCK;
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
    /// What clients can make it hold.
    pub limits: Limits,
}

impl BrokerConfig {
    /// Mailboxes of 4 MiB, patience of 5 s.
    pub fn new(community: impl Into<String>) -> Self {
        Self {
            community: community.into(),
            mailbox_bytes: 4 << 20,
            lossless_patience_secs: 5.0,
            limits: Limits::default(),
        }
    }

    /// The same with mailboxes of so many bytes, and with room for eight that are full.
    pub fn with_mailboxes_of(self, mailbox_bytes: usize) -> Self {
        let limits = Limits { mail_bytes: mailbox_bytes.saturating_mul(8), ..self.limits };
        Self { mailbox_bytes, limits, ..self }
    }
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
    /// Bytes of all latest values; pairs of a variable and a source.
    latest_bytes: usize,
    routes: usize,
    /// Throttled values that wait for their time: (due, variable, client).
    due: BTreeSet<(Due, u32, ClientId)>,
    /// The bulk samples that are some variable's latest value.
    latest_bulk: BTreeSet<(ClientId, u64)>,
    attached: Vec<(ClientId, ClientId)>,
    /// Orphans whose mail refers to values in shared memory.
    to_resolve: BTreeSet<ClientId>,
    /// Who got mail from the batch that is being taken in.
    reached: Vec<ClientId>,
    /// Holders of a name that are to make room for their successor.
    retiring: Vec<ClientId>,
    /// Who has taken whose place, and up to where its mail is the one that it took over.
    successions: Vec<Succession>,
    /// Somebody who left something has gone since that was last asked for.
    legacies_changed: bool,
    /// The places of clients are others than when they were last asked for.
    places_changed: bool,
    own_source: u32,
    own_sequence: u64,
    next_summary: f64,
    driver: Option<time::Driver>,
    /// Clients that have come back after a broker's death and have not yet said again all that they have to.
    returning: BTreeSet<ClientId>,
    /// Until then (s) nobody new takes a place before they have.
    returns_awaited_until: Option<f64>,
    /// Until then (s), whoever drove the clock under the broker before this one may come back and go on.
    driver_awaited_until: f64,
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

/// A client.
struct Client {
    name: String,
    standing: Standing,
    /// How long its place is kept after its death (s).
    lease_secs: f64,
    /// The client's numbers, by [`Named`], to the broker's.
    numbers: [Vec<u32>; 4],
    /// Names that nobody had brought before it.
    brought: usize,
    registrations: Vec<Registration>,
    registered_bytes: usize,
    mailbox: Mailbox,
    /// What it registered and took back, and what it published, before it had its place.
    asked: Vec<u8>,
    held: Vec<u8>,
    /// Batches taken from it.
    taken: u64,
    /// Those whose mail not everybody has handled: (batch, who got mail from it).
    unhandled: VecDeque<(u64, Vec<Reached>)>,
    /// Lossless registrants that this client's messages went to.
    feeds: BTreeSet<ClientId>,
    published: BTreeSet<u32>,
    last_published: Option<u32>,
    latency: summary::Latency,
}

/// A client that got mail, and where the newest of it stands in its mailbox.
#[derive(Debug, Clone, Copy)]
pub struct Reached {
    /// The client.
    pub client: ClientId,
    /// The position (see [`Broker::mail_done`]).
    pub position: u64,
    /// Whether publishers wait for it.
    pub lossless: bool,
}

/// A client that has taken another's place, with its mail.
#[derive(Debug, Clone, Copy)]
pub struct Succession {
    /// Whose place it was.
    pub predecessor: ClientId,
    /// Whose it is.
    pub successor: ClientId,
    /// Where the newest message that it took over stands in its own mailbox.
    pub position: u64,
}

impl Reached {
    /// Whoever has the mail now.
    pub fn follow(&mut self, succession: &Succession) {
        if self.client == succession.predecessor {
            (self.client, self.position) = (succession.successor, succession.position);
        }
    }
}

/// Batches that a broker remembers as not handled by everybody. Older ones count as handled: their publisher has let go
/// of them long before.
const UNHANDLED_BATCHES: usize = 4096;

impl Client {
    fn new(name: &str, lease_secs: f64, mailbox_bytes: usize, now: f64) -> Self {
        Self {
            name: name.into(),
            standing: Standing::Present,
            lease_secs,
            numbers: [vec![], vec![UNNAMED], vec![], vec![0]],
            brought: 0,
            registrations: Vec::new(),
            registered_bytes: 0,
            mailbox: Mailbox::new(mailbox_bytes, now),
            asked: Vec::new(),
            held: Vec::new(),
            taken: 0,
            unhandled: VecDeque::new(),
            feeds: BTreeSet::new(),
            published: BTreeSet::new(),
            last_published: None,
            latency: summary::Latency::default(),
        }
    }

    fn is_joining(&self) -> bool {
        matches!(self.standing, Standing::Joining { .. })
    }
}

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
            // Numbers of clients of a broker that died are not to be taken for those of this one.
            next_client: ((now.max(0.0) * 1e3) as u64 & 0x0fff_ffff) as ClientId + 1,
            keys: Interner::default(),
            sources,
            types: Interner::default(),
            communities,
            variables: Vec::new(),
            latest_bytes: 0,
            routes: 0,
            due: BTreeSet::new(),
            latest_bulk: BTreeSet::new(),
            attached: Vec::new(),
            to_resolve: BTreeSet::new(),
            reached: Vec::new(),
            retiring: Vec::new(),
            successions: Vec::new(),
            legacies_changed: false,
            places_changed: false,
            own_source,
            // A broker that takes another's place is not to be taken for it.
            own_sequence: wire::first_sequence((now.max(0.0) * 1e3) as u64),
            next_summary: now,
            driver: None,
            returning: BTreeSet::new(),
            returns_awaited_until: None,
            driver_awaited_until: f64::INFINITY,
        }
    }

    fn announce(&mut self, now: f64, event: &str) {
        self.publish_event(now, event);
        self.publish_clients(now);
    }

    /// Says on `DB_EVENT` what happened.
    pub fn publish_event(&mut self, now: f64, event: &str) {
        self.publish_own(now, "DB_EVENT", ValueKind::Text, event.as_bytes());
    }

    /// Takes in a batch of frames from a client. A damaged batch is taken up to the damage; the transport then has to
    /// let go of the client, whose lane can no longer be trusted.
    pub fn receive(&mut self, now: f64, from: ClientId, batch: &[u8]) -> Result<(), WireError> {
        self.reached.clear();
        let taken = self.take_in(now, from, batch);
        self.on_much_said(now, from);
        self.note_unhandled(from);
        taken
    }

    fn take_in(&mut self, now: f64, from: ClientId, batch: &[u8]) -> Result<(), WireError> {
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
            FrameKind::Register | FrameKind::Unregister => self.change_registration(now, from, frame),
            FrameKind::Attached => {
                self.attached.push((from, frame.header.source));
                Ok(())
            }
            FrameKind::Ready => {
                self.on_ready(now, from);
                Ok(())
            }
            FrameKind::Clock => self.set_clock(now, from, wire::dial(frame)?),
            FrameKind::Refused | FrameKind::Dropped => Err("only the broker sends such a frame"),
        }
    }

    /// Remembers whose mail has to be handled before the batch that was just taken counts as handled.
    fn note_unhandled(&mut self, from: ClientId) {
        let reached = self.reached();
        let Some(client) = self.clients.get_mut(&from) else { return };
        client.taken += 1;
        if !reached.is_empty() {
            client.unhandled.push_back((client.taken, reached));
        }
        if client.unhandled.len() > UNHANDLED_BATCHES {
            client.unhandled.pop_front();
        }
    }

    /// Who got mail from the batch that was taken in last.
    pub fn reached(&self) -> Vec<Reached> {
        let reached = |id: &ClientId| {
            let mailbox = &self.clients.get(id)?.mailbox;
            Some(Reached { client: *id, position: mailbox.pushed(), lossless: mailbox.is_lossless() })
        };
        self.reached.iter().filter_map(reached).collect()
    }

    /// The batch of a client up to which everybody has handled what they were to get of it; what it published until
    /// then will not be asked for again, should the broker die.
    pub fn handled_batches(&mut self, id: ClientId) -> u64 {
        let Some(client) = self.clients.get(&id) else { return 0 };
        let behind = |r: &Reached| self.mail_done(r.client).is_some_and(|done| done < r.position);
        let handled = |(_, reached): &&(u64, Vec<Reached>)| !reached.iter().any(behind);
        let count = client.unhandled.iter().take_while(handled).count();
        let Some(client) = self.clients.get_mut(&id) else { return 0 };
        client.unhandled.drain(..count);
        client.unhandled.front().map_or(client.taken, |(batch, _)| batch - 1)
    }

    fn notify(&mut self, now: f64, from: ClientId, frame: &Frame<'_>) -> Result<(), &'static str> {
        let header = &frame.header;
        let client = self.clients.get_mut(&from).ok_or("the client is not connected")?;
        let translate = |what: Named, number: u32| {
            client.numbers[what as usize].get(number as usize).copied().ok_or("a number was used before its definition")
        };
        let key = translate(Named::Key, header.key)?;
        let mut source = translate(Named::Source, header.source)?;
        let community = translate(Named::Community, header.community)?;
        let type_ = match header.value_kind {
            ValueKind::Binary => translate(Named::Type, header.type_)?,
            _ => 0,
        };
        if [key, source, community, type_].contains(&REFUSED) {
            return Ok(()); // the client was told when it named it
        }
        if client.is_joining() {
            Self::hold(client, frame);
            return Ok(());
        }
        if self.keys.name(key) == table::REQUEST {
            self.answer_with_table(now, from);
            return Ok(());
        }
        if source == UNNAMED {
            source = self.name_source(from)?;
        }
        let client = self.clients.get_mut(&from).ok_or("the client is not connected")?;
        // A driven clock, which may have been set meanwhile, tells nothing of how long a message took.
        client.latency.note(self.driver.is_none().then_some(now - header.time));
        if client.last_published != Some(key) {
            client.last_published = Some(key);
            if client.published.insert(key) {
                self.variables[key as usize].writers.insert(source);
            }
        }
        let header = Header { flags: header.flags & (BULK | RESENT), key, source, type_, community, ..*header };
        if let Some(reason) = self.refusal(&header, frame.bytes.len()) {
            let name = self.keys.name(key).to_owned();
            return self.refuse(from, &name, header.sequence, &reason);
        }
        let is_as_before = self.variables[key as usize].lock == Some(TypeLock::of(&header));
        self.store_and_deliver(now, Some(from), &Message::new(header, frame.bytes));
        if !is_as_before {
            self.tell_those_who_expect_else(key);
        }
        Ok(())
    }

    /// Why a client's message of so many bytes is not taken, if so.
    fn refusal(&self, header: &Header, bytes: usize) -> Option<String> {
        let variable = &self.variables[header.key as usize];
        if variable.is_own {
            return Some(format!("{OWN_PREFIX}* are written by the broker alone"));
        }
        if bytes > self.config.limits.message_bytes {
            return Some(format!(
                "a message of {bytes} bytes; at most {} travel in a batch",
                self.config.limits.message_bytes
            ));
        }
        let is_new =
            self.routes >= self.config.limits.routes && !variable.routes.iter().any(|r| r.source == header.source);
        if is_new {
            return Some(format!("the community has {} pairs of variable and source already", self.routes));
        }
        let lock = TypeLock::of(header);
        match variable.lock {
            None => self.contradicts_readers(header.key, lock),
            Some(_) => self.type_conflict(header.key, lock).filter(|_| !self.changes_over(header.key, lock)),
        }
        .or_else(|| self.latest_refusal(variable.latest.len(), bytes))
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

    /// Tells a client what of its own was not taken, and why.
    fn refuse(&mut self, to: ClientId, name: &str, sequence: u64, reason: &str) -> Result<(), &'static str> {
        if self.is_full_of_refusals(to) {
            return Ok(());
        }
        // A name that is too long is refused under its beginning.
        let name = &name[..name.floor_char_boundary(wire::MAX_NAME)];
        let client = self.clients.get_mut(&to).ok_or("the client is not connected")?;
        let header = Header { sequence, ..Header::new(FrameKind::Refused) };
        wire::put(client.mailbox.notices(), &header, name.as_bytes(), reason.as_bytes());
        Ok(())
    }

    fn publish_own(&mut self, now: f64, key: &str, kind: ValueKind, value: &[u8]) {
        let key = self.number(Named::Key, key, 0);
        self.own_sequence += 1;
        let header = Header {
            value_kind: kind,
            key,
            source: self.own_source,
            sequence: self.own_sequence,
            time: self.time(now),
            ..Header::new(FrameKind::Notify)
        };
        let mut frame = Vec::new();
        wire::put(&mut frame, &header, &[], value);
        self.variables[key as usize].writers.insert(self.own_source);
        self.store_and_deliver(now, None, &Message::new(header, &frame));
    }

    fn store_and_deliver(&mut self, now: f64, from: Option<ClientId>, message: &Message<'_>) {
        let (key, source) = (message.header.key, message.header.source);
        self.settle_owed(now, key);
        self.keep_as_latest(now, from, message);
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

    fn keep_as_latest(&mut self, now: f64, from: Option<ClientId>, message: &Message<'_>) {
        let variable = &mut self.variables[message.header.key as usize];
        // What is sent again after a broker's death is not newer for that.
        let resent = message.header.flags & RESENT != 0;
        if resent && wire::first_frame(&variable.latest).is_ok_and(|f| f.header.time > message.header.time) {
            return;
        }
        if let Some(old) = bulk_of(&variable.latest) {
            self.latest_bulk.remove(&(old.client, old.sample));
        }
        self.latest_bytes += message.len();
        self.latest_bytes -= variable.latest.len();
        variable.keep(now, from, message);
        if let Some(new) = bulk_of(&variable.latest) {
            self.latest_bulk.insert((new.client, new.sample));
        }
    }

    /// The latest value of a variable is about to be another one. Whoever is still owed it is given the new one, and who is
    /// to be given everything the old one as well.
    fn settle_owed(&mut self, now: f64, key: u32) {
        let variable = &mut self.variables[key as usize];
        if !std::mem::take(&mut variable.owed) {
            return;
        }
        for client in self.clients.values_mut() {
            if let Some(flags) = client.mailbox.no_longer_owes(key)
                && client.mailbox.is_lossless()
                && let Some(latest) = variable.latest_message(flags)
            {
                client.mailbox.push(now, &latest, self.config.lossless_patience_secs);
            }
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
            .filter(|(_, c)| !c.is_joining())
            .filter_map(|(id, c)| registration::combine(*id, &c.registrations, key_name, source_name))
            .collect();
        let routes = &mut self.variables[key as usize].routes;
        self.routes += 1;
        routes.push(variable::Route { source, deliveries });
        routes.len() - 1
    }

    fn deliver(&mut self, now: f64, to: ClientId, message: &Message<'_>) {
        let Some(client) = self.clients.get_mut(&to) else { return };
        if !self.reached.contains(&to) {
            self.reached.push(to);
        }
        if message.header.flags & BULK != 0 && matches!(client.standing, Standing::Orphan { .. }) {
            self.to_resolve.insert(to);
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

    /// Delivers what throttled registrations held back and whose time has come, lets go of places that nobody came for,
    /// and refreshes the `DB_*` variables.
    pub fn tick(&mut self, now: f64) {
        self.expire_orphans(now);
        self.await_driver(now);
        self.seat_those_who_wait(now);
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
        let due = self.due.first().map_or(f64::INFINITY, |(due, ..)| due.0);
        let returns = self.returns_awaited_until.unwrap_or(f64::INFINITY);
        due.min(self.next_summary).min(self.next_expiry()).min(self.driver_awaited_until).min(returns)
    }

    /// Whether the client's next batch has to wait: for a lossless registrant whose mailbox is full, or until the client
    /// has the place that it came for.
    pub fn holds_back(&self, now: f64, from: ClientId) -> bool {
        let patience = self.config.lossless_patience_secs;
        let full = |id: &ClientId| self.clients.get(id).is_some_and(|c| c.mailbox.holds_back(now, patience));
        let client = self.clients.get(&from);
        client.is_some_and(|client| Self::waits_for_its_place(client) || client.feeds.iter().any(full))
    }

    /// Whether publishers wait until a client has read what they sent it. One that has stopped reading is waited for with
    /// limited patience; one that died, as long as its place is kept.
    pub fn waits_for(&self, now: f64, id: ClientId) -> bool {
        let patience = self.config.lossless_patience_secs;
        let reads = |c: &Client| c.mailbox.is_waited_for(now, patience);
        self.is_orphan(id) || self.clients.get(&id).is_some_and(reads)
    }

    /// The clients that have mail waiting, or notices, and are there to take it.
    pub fn with_mail(&self) -> impl Iterator<Item = ClientId> + '_ {
        let present = |c: &Client| !matches!(c.standing, Standing::Orphan { .. });
        self.clients.iter().filter(move |(_, c)| !c.mailbox.is_empty() && present(c)).map(|(id, _)| *id)
    }

    /// Moves a client's mail into `batch` until it holds `max` bytes (a single message may be longer). Messages whose
    /// value lies in shared memory go through `bulk`, which appends what the client can use.
    pub fn take_mail(
        &mut self,
        id: ClientId,
        max: usize,
        batch: &mut Vec<u8>,
        bulk: impl FnMut(&Frame<'_>, &mut Vec<u8>),
    ) {
        let Self { clients, keys, sources, types, communities, variables, .. } = self;
        let table = Names { keys, sources, types, communities, variables };
        if let Some(client) = clients.get_mut(&id) {
            client.mailbox.take(max, batch, &table, bulk);
        }
    }

    /// Whether a client may be given more mail: only so much of what it has not handled is kept.
    pub fn may_give(&self, id: ClientId) -> bool {
        self.clients.get(&id).is_some_and(|client| client.mailbox.may_give())
    }

    /// Puts values in the place of references in the mail of those who are dead and may have a successor: until that one
    /// comes, the values could be gone. `bulk` appends what there is.
    pub fn resolve_mail(&mut self, mut bulk: impl FnMut(&Frame<'_>, &mut Vec<u8>)) {
        for id in std::mem::take(&mut self.to_resolve) {
            if let Some(client) = self.clients.get_mut(&id) {
                client.mailbox.resolve(&mut bulk);
            }
        }
    }

    /// The value of a bulk sample is gone: the variables whose latest value it was have none. Answers their names.
    pub fn forget_latest_bulk(&mut self, client: ClientId, sample: u64) -> Vec<String> {
        if !self.latest_bulk.remove(&(client, sample)) {
            return Vec::new();
        }
        let mut names = Vec::new();
        for (key, variable) in (0..).zip(&mut self.variables) {
            if bulk_of(&variable.latest).is_some_and(|bulk| (bulk.client, bulk.sample) == (client, sample)) {
                self.latest_bytes -= variable.latest.len();
                variable.latest = Vec::new();
                names.push(self.keys.name(key).to_owned());
            }
        }
        names
    }

    /// Keeps the batch that [`Broker::take_mail`] has filled until the client has handled it: should it die before that,
    /// its successor is given what is left.
    pub fn keep_given(&mut self, id: ClientId, batch: Vec<u8>) {
        if let Some(client) = self.clients.get_mut(&id) {
            client.mailbox.keep_given(batch);
        }
    }

    /// A client has handled so many of the messages that it was ever given; the buffers of batches that are done with
    /// go to `spare`.
    pub fn note_handled(&mut self, now: f64, id: ClientId, messages: u64, spare: &mut Vec<Vec<u8>>) {
        if let Some(client) = self.clients.get_mut(&id) {
            spare.extend(client.mailbox.handled(now, messages));
        }
    }

    /// A client came too late to read so many of the bulk values that it was ever given references to.
    pub fn note_missed(&mut self, id: ClientId, values: u64) {
        if let Some(client) = self.clients.get_mut(&id) {
            client.mailbox.note_missed(values);
        }
    }

    /// Who has taken whose place since the last call.
    pub fn take_successions(&mut self) -> Vec<Succession> {
        std::mem::take(&mut self.successions)
    }

    /// Whether [`Broker::note_handled`] with so many messages would bring any news.
    pub fn would_settle(&self, id: ClientId, messages: u64) -> bool {
        self.clients.get(&id).is_some_and(|c| c.mailbox.would_settle(messages))
    }

    /// Whether nothing waits for a client, and nothing is under way to it.
    pub fn is_idle(&self, id: ClientId) -> bool {
        self.clients.get(&id).is_some_and(|c| c.mailbox.is_idle())
    }

    /// Whether publishers wait for this client.
    pub fn is_lossless(&self, id: ClientId) -> bool {
        self.clients.get(&id).is_some_and(|c| c.mailbox.is_lossless())
    }

    /// Whether a bulk sample is some variable's latest value, so that late registrants will want it.
    pub fn is_latest_bulk(&self, client: ClientId, sample: u64) -> bool {
        self.latest_bulk.contains(&(client, sample))
    }

    /// The (receiver, publisher) pairs that attached since the last call.
    pub fn take_attached(&mut self) -> Vec<(ClientId, ClientId)> {
        std::mem::take(&mut self.attached)
    }

    /// The position up to which a client is done with its mail; `None`: there is no such client.
    pub fn mail_done(&self, id: ClientId) -> Option<u64> {
        self.clients.get(&id).map(|c| c.mailbox.done())
    }

    /// A connected client's name.
    pub fn client_name(&self, id: ClientId) -> Option<&str> {
        self.clients.get(&id).map(|c| c.name.as_str())
    }

    /// The client that is there under a name.
    pub fn client_named(&self, name: &str) -> Option<ClientId> {
        self.names.get(name).copied().filter(|id| self.standing(*id) == Some(Standing::Present))
    }

    /// Number of connected clients.
    pub fn clients(&self) -> usize {
        self.clients.values().filter(|c| c.standing == Standing::Present).count()
    }
}

#[cfg(test)]
mod tests;
