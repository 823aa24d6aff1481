//! The sockets of MOOS' clients, in the broker's process: whoever drives the broker has the gateway take in what has come,
//! and hand out what waits, once a round. Another thread only waits for the sockets, and rings.
//!
//! What a client can do to others is bounded: it has so long to say who it is, so many bytes of it are taken in a round, a
//! message is so long, and of what it does not read a packet is kept here and the rest in its mailbox, which drops.

mod address;
mod answers;
mod connection;
mod poller;
mod remotes;

use std::collections::{BTreeMap, BTreeSet};
use std::io::{self, ErrorKind};
use std::net::{SocketAddr, TcpListener};
use std::os::fd::OwnedFd;

use elk_os::clock::monotonic_nanos;
use elk_os::limits::above_others;
use elk_os::tell;
use elk_proto::broker::{AdmissionError, Introduction};
use elk_proto::host::Host;
use elk_proto::wire::{self, ClientId, Frame, FrameKind, Header, WireError};

use crate::hello::{Hello, Welcome, name_taken, put_poison};
use crate::message::{Kind, SHORTEST};
use crate::packet::{Event, StreamError};
use crate::session::{Context, Session};
use crate::text::Forms;
pub use address::{Address, AddressError, CONNECTIONS, GatewayError, GatewayOptions, MOST_CONNECTIONS, Network};
use answers::Answering;
use connection::{Connection, Look, Named};
use poller::{Poller, Token};
pub use remotes::{Remotes, WithRemotes};

/// The longest message that is taken from a client (bytes): one that the broker takes, and its names.
const LONGEST_MESSAGE: usize = wire::MAX_MESSAGE + SHORTEST + 4 * wire::MAX_NAME;
/// Bytes that are read of one connection in a round; of a message that has begun and is longer, all that is there.
const READ_BYTES: usize = 64 << 10;
/// A batch for the broker, and a packet for a client, is closed when it holds so many bytes.
const BATCH_BYTES: usize = 64 << 10;
/// Packets that a client is given in a round.
const PACKETS_A_ROUND: usize = 4;
/// Connections that are taken in a round.
const ACCEPTED_A_ROUND: usize = 32;
/// Connections that have not said who they are; whichever has had its time goes when others come.
const UNNAMED: usize = 64;
/// The longest bulk value that is given to a client, and the most that all together wait for (bytes).
const LONGEST_BULK: usize = 16 << 20;
const MOST_WAITING: usize = 128 << 20;
/// Refused variables of a client that are said.
const TOLD: usize = 64;

const SECOND: u64 = 1_000_000_000;
/// How long a connection has to say who it is, and how long of that it has in any case.
const HELLO_PATIENCE: u64 = 5 * SECOND;
const HELLO_GRACE: u64 = SECOND;
/// A client that says nothing for so long is gone, as MOOS' server has it; one whose name somebody wants, earlier: MOOS'
/// clients give a sign of life every 1.3 s.
const SILENCE: u64 = 5 * SECOND;
const SILENCE_OF_A_HOLDER: u64 = 2 * SECOND;
/// A client that takes nothing of a packet for so long is gone, as MOOS' server has it.
const SEND_PATIENCE: u64 = 6 * SECOND;
/// How often it is looked who is gone.
const LOOK_EVERY: u64 = SECOND / 4;
/// Who was not served for longer than this was silent for want of somebody who listened.
const STALL: u64 = 2 * SECOND;
/// How often it is said that somebody is turned away.
const COMPLAIN_EVERY: u64 = 60 * SECOND;

/// The socket that new connections come to.
const LISTENER: Token = 0;

/// A socket that listens, and nobody has been let in.
pub struct Listening {
    listener: TcpListener,
    options: GatewayOptions,
}

impl Listening {
    /// Listens: what is wrong with an address is said before a broker serves anybody.
    ///
    /// # Errors
    /// See [`GatewayError`].
    pub fn at(options: GatewayOptions) -> Result<Self, GatewayError> {
        Ok(Self { listener: address::listen(&options)?, options })
    }

    /// Where it listens: the port too, if any was right.
    ///
    /// # Errors
    /// The operating system does not say.
    pub fn address(&self) -> io::Result<SocketAddr> {
        self.listener.local_addr()
    }

    /// The most clients at a time.
    pub fn connections(&self) -> usize {
        self.options.connections
    }
}

/// The clients of MOOS', and whoever is about to be one.
pub struct Gateway {
    listener: TcpListener,
    options: GatewayOptions,
    community: String,
    hostname: String,
    poller: Poller,
    next_token: Token,
    connections: BTreeMap<Token, Connection>,
    by_client: BTreeMap<ClientId, Token>,
    /// There may be connections to be taken.
    knocked: bool,
    /// There may be something to be read, and something to be said.
    readable: BTreeSet<Token>,
    owed: BTreeSet<Token>,
    looked_at: u64,
    complained_at: Option<u64>,
    batch: Vec<u8>,
    spare: Vec<Vec<u8>>,
    /// What types are as texts, for all clients.
    forms: Forms,
}

/// Why a connection ends.
enum End {
    /// Its client has hung up, or it was said to it why.
    Plain,
    /// For this reason, which is told.
    For(String),
}

impl From<StreamError> for End {
    fn from(error: StreamError) -> Self {
        Self::For(error.to_string())
    }
}

impl From<WireError> for End {
    fn from(error: WireError) -> Self {
        Self::For(error.to_string())
    }
}

/// A round of the broker's, at `now` (s).
struct Round<'a, E> {
    now: f64,
    host: &'a mut Host,
    endpoints: &'a mut E,
}

impl<E: WithRemotes> Round<'_, E> {
    /// The community's time (s), which somebody may drive.
    fn time(&self) -> f64 {
        self.host.broker.clock_setting().map_or(self.now, |setting| setting.time(self.now))
    }

    /// Takes a client's words into the broker.
    fn receive(&mut self, from: ClientId, batch: &[u8]) -> Result<(), End> {
        Ok(self.host.receive(self.now, from, batch, self.endpoints)?)
    }

    /// Takes one message of a client's into the broker.
    fn receive_message(&mut self, from: ClientId, message: &Frame<'_>) -> Result<(), End> {
        Ok(self.host.receive_message(self.now, from, message, self.endpoints)?)
    }

    /// Says on `DB_EVENT`, and where the broker has its words, what of a client was not taken: once of each variable. MOOS
    /// has no word for it.
    fn say_refusals(&mut self, client: &mut Named) {
        for refusal in client.session.take_refusals() {
            if client.told.len() >= TOLD || client.told.contains(&refusal.key) {
                continue;
            }
            let said = format!("refused={} variable={} reason={}", client.name, refusal.key, refusal.reason);
            tell(format_args!("elk db: {said}"));
            self.host.broker.publish_event(self.now, &said);
            client.told.push(refusal.key);
        }
    }
}

impl Gateway {
    /// Begins to wait for clients of `community`; `ring` is called whenever there is something to do.
    ///
    /// # Errors
    /// The operating system has no thread or descriptor left.
    pub fn start(listening: Listening, community: &str, ring: impl Fn() + Send + 'static) -> io::Result<Self> {
        let Listening { listener, options } = listening;
        // MOOS' clients connect again at once when they lose their server, and stop for good if that one ends within the
        // handshake.
        let listener = TcpListener::from(above_others(OwnedFd::from(listener)));
        let poller = Poller::start(ring)?;
        poller.add(&listener, LISTENER)?;
        let hostname = std::fs::read_to_string("/proc/sys/kernel/hostname").unwrap_or_default();
        Ok(Self {
            listener,
            options,
            community: community.to_owned(),
            hostname: hostname.trim().to_owned(),
            poller,
            next_token: LISTENER + 1,
            connections: BTreeMap::new(),
            by_client: BTreeMap::new(),
            knocked: false,
            readable: BTreeSet::new(),
            owed: BTreeSet::new(),
            looked_at: monotonic_nanos(),
            complained_at: None,
            batch: Vec::new(),
            spare: Vec::new(),
            forms: Forms::default(),
        })
    }

    /// Takes in what has come since the last round; whether there was anything.
    pub fn take_in<E: WithRemotes>(&mut self, now: f64, host: &mut Host, endpoints: &mut E) -> bool {
        let mut round = Round { now, host, endpoints };
        for token in self.poller.take() {
            self.knocked |= token == LISTENER;
            self.readable.insert(token);
            self.owed.insert(token);
        }
        let mut moved = self.accept();
        for token in self.readable.iter().copied().collect::<Vec<_>>() {
            moved |= self.read(token, &mut round);
        }
        self.let_go_of_the_gone(&mut round);
        moved
    }

    fn accept(&mut self) -> bool {
        for count in 0..ACCEPTED_A_ROUND {
            if !self.knocked {
                return count > 0;
            }
            let at = monotonic_nanos();
            if !self.has_room_for_another(at) {
                return count > 0;
            }
            match self.listener.accept() {
                Ok((socket, from)) if self.options.admits(from.ip()) => {
                    let token = self.next_token;
                    let set_up = socket.set_nonblocking(true).and_then(|()| socket.set_nodelay(true));
                    match set_up.and_then(|()| self.poller.add(&socket, token)) {
                        Ok(()) => {
                            self.next_token += 1;
                            if self.connections.is_empty() {
                                self.looked_at = at;
                            }
                            self.connections.insert(token, Connection::new(socket, from, LONGEST_MESSAGE, at));
                            self.readable.insert(token);
                        }
                        Err(error) => self.complain(at, &format!("a client of MOOS' is turned away: {error}")),
                    }
                }
                Ok((_, from)) => {
                    let said =
                        format!("a client of MOOS' at {} is turned away: it is of no network that may come", from);
                    self.complain(at, &said);
                }
                Err(error) if error.kind() == ErrorKind::WouldBlock => self.knocked = false,
                Err(error) if matches!(error.kind(), ErrorKind::Interrupted | ErrorKind::ConnectionAborted) => {}
                Err(error) => {
                    // It is tried again in a later round: whoever waits does so in the kernel's queue.
                    self.complain(at, &format!("no client of MOOS' can be taken: {error}"));
                    return count > 0;
                }
            }
        }
        true
    }

    /// Whether another connection can be taken; the one that has been silent longest goes, once it has had its time.
    fn has_room_for_another(&mut self, at: u64) -> bool {
        let unnamed = || self.connections.iter().filter(|(_, connection)| connection.client.is_none());
        if unnamed().count() < UNNAMED {
            return true;
        }
        let oldest = unnamed().min_by_key(|(_, connection)| connection.opened_at);
        match oldest.map(|(token, connection)| (*token, connection.opened_at)) {
            Some((token, opened_at)) if at.saturating_sub(opened_at) >= HELLO_GRACE => {
                self.connections.remove(&token);
                true
            }
            _ => false,
        }
    }

    fn complain(&mut self, at: u64, what: &str) {
        if self.complained_at.is_none_or(|last| at.saturating_sub(last) >= COMPLAIN_EVERY) {
            self.complained_at = Some(at);
            tell(format_args!("elk db: {what}"));
        }
    }

    /// Takes in what a connection has to say, of which a round has its share; whether there was anything.
    fn read<E: WithRemotes>(&mut self, token: Token, round: &mut Round<'_, E>) -> bool {
        // It is out of the table while it is served, so that who takes its client's name finds all others there.
        let Some(mut connection) = self.connections.remove(&token) else {
            self.readable.remove(&token);
            return false;
        };
        let client = connection.client.as_ref();
        if client.is_some_and(|client| round.host.broker.holds_back(round.now, client.id)) {
            self.connections.insert(token, connection);
            return false;
        }
        let (moved, end) = match connection.look(READ_BYTES) {
            // The poller says when there is more.
            Look::Nothing => {
                self.readable.remove(&token);
                (false, None)
            }
            Look::Over => (true, Some(End::Plain)),
            Look::Bytes => {
                connection.note_heard(monotonic_nanos());
                (true, self.understand(token, &mut connection, round).err())
            }
        };
        match end {
            Some(end) => self.let_go(connection, end, round),
            None => _ = self.connections.insert(token, connection),
        }
        moved
    }

    /// What has come of a connection so far, as far as it is whole.
    fn understand<E: WithRemotes>(
        &mut self,
        token: Token,
        connection: &mut Connection,
        round: &mut Round<'_, E>,
    ) -> Result<(), End> {
        if connection.client.is_none() {
            let Some(hello) = hello(connection)? else { return Ok(()) };
            self.let_in(token, connection, hello, round)?;
        }
        let Connection { decoder, client: Some(client), .. } = connection else { return Ok(()) };
        let mut batch = std::mem::take(&mut self.batch);
        let mut taken = Ok(());
        while taken.is_ok() {
            match decoder.next_event() {
                Ok(Some(Event::Message { message, first })) => {
                    let broker = &mut round.host.broker;
                    if first && message.kind == Kind::TIMING {
                        broker.note_sign_of_life(round.now, client.id, message.time);
                    }
                    let mut context = Context { id: client.id, broker, forms: &mut self.forms };
                    if let Some(long) = client.session.take(&message, first, &mut context, &mut batch) {
                        taken = round.receive(client.id, &batch).and_then(|()| round.receive_message(client.id, &long));
                        batch.clear();
                    }
                }
                Ok(Some(Event::End)) => client.session.end_packet(),
                Ok(Some(Event::TooLong { bytes, key })) => client.session.note_too_long(bytes, LONGEST_MESSAGE, key),
                Ok(Some(Event::Greeting)) => {}
                Ok(None) => break,
                Err(error) => taken = Err(End::from(error)),
            }
            if batch.len() >= BATCH_BYTES {
                taken = taken.and(round.receive(client.id, &batch));
                batch.clear();
            }
        }
        if !batch.is_empty() {
            taken = taken.and(round.receive(client.id, &batch));
            batch.clear();
        }
        self.batch = batch;
        round.say_refusals(client);
        if client.session.is_owed() {
            self.owed.insert(token);
        }
        taken
    }

    /// Lets a client in that has said who it is, or tells it why not.
    fn let_in<E: WithRemotes>(
        &mut self,
        token: Token,
        connection: &mut Connection,
        hello: Hello,
        round: &mut Round<'_, E>,
    ) -> Result<(), End> {
        self.free_name(&hello.name, round);
        let at = monotonic_nanos();
        let who = Introduction { build: "a client of MOOS'", inside: true, ..Introduction::new(&hello.name) };
        let admitted = match self.by_client.len() >= self.options.connections {
            true => Err(AdmissionError::Full(self.options.connections).to_string()),
            false => round.host.join(round.now, &who, round.endpoints).map_err(|refused| match refused {
                AdmissionError::NameTaken(name) => name_taken(&name),
                other => other.to_string(),
            }),
        };
        let id = match admitted {
            Ok(id) => id,
            Err(reason) => {
                put_poison(&reason, connection.out(at).bytes());
                // Who does not take it, now that nothing else is on its way, is gone.
                let _ = connection.flush(at, &[]);
                let _ = connection.socket.shutdown(std::net::Shutdown::Write);
                return Err(End::Plain);
            }
        };
        round.endpoints.remotes().enter(id);
        self.by_client.insert(id, token);
        let (community, hostname) = (self.community.as_str(), self.hostname.as_str());
        Welcome { community, hostname, time: round.time() }.put(hello.time, connection.out(at).bytes());
        let life = (round.now.max(0.0) * 1e3) as u64;
        let session = Session::new(&hello.name, hello.manner, life, self.options.any_source, &self.options.texts);
        connection.client = Some(Named { id, name: hello.name, session, told: Vec::new() });
        self.owed.insert(token);
        // Whoever is given the session of one that died has nothing to say before it.
        let mut ready = Vec::new();
        wire::put(&mut ready, &Header::new(FrameKind::Ready), &[], &[]);
        round.receive(id, &ready)
    }

    /// A name's holder that has hung up, or given no sign of life, makes room for the next: who comes back at once finds its
    /// name free, however late the news of its end would come.
    fn free_name<E: WithRemotes>(&mut self, name: &str, round: &mut Round<'_, E>) {
        let Some(token) = round.host.broker.client_named(name).and_then(|id| self.by_client.get(&id).copied()) else {
            return;
        };
        self.readable.insert(token);
        while self.readable.contains(&token) && self.read(token, round) {}
        let silent_for = |connection: &Connection| monotonic_nanos().saturating_sub(connection.heard_at);
        if self.connections.get(&token).is_some_and(|connection| silent_for(connection) > SILENCE_OF_A_HOLDER)
            && let Some(connection) = self.connections.remove(&token)
        {
            let why = "it has given no sign of life, and another client comes under its name".to_owned();
            self.let_go(connection, End::For(why), round);
        }
    }

    /// Hands out what waits, as far as clients take it; whether there was anything.
    pub fn hand_out<E: WithRemotes>(&mut self, now: f64, host: &mut Host, endpoints: &mut E) -> bool {
        if self.connections.is_empty() {
            self.owed.clear();
            return false;
        }
        let mut round = Round { now, host, endpoints };
        for id in round.endpoints.remotes().take_retiring() {
            if let Some(connection) = self.by_client.get(&id).and_then(|token| self.connections.remove(token)) {
                self.let_go(connection, End::Plain, &mut round);
            }
        }
        let with_mail = round.host.broker.with_mail().filter_map(|id| self.by_client.get(&id));
        self.owed.extend(with_mail);
        let mut moved = false;
        for token in std::mem::take(&mut self.owed) {
            let Some(mut connection) = self.connections.remove(&token) else { continue };
            match self.give(token, &mut connection, &mut round) {
                Ok(given) => {
                    moved |= given;
                    self.connections.insert(token, connection);
                }
                // The other end is gone.
                Err(_) => self.let_go(connection, End::Plain, &mut round),
            }
        }
        moved
    }

    fn give<E: WithRemotes>(
        &mut self,
        token: Token,
        connection: &mut Connection,
        round: &mut Round<'_, E>,
    ) -> io::Result<bool> {
        for packets in 0..PACKETS_A_ROUND {
            let at = monotonic_nanos();
            let mail = connection.client.as_ref().and_then(|client| round.host.broker.last_given(client.id));
            if !connection.flush(at, mail.unwrap_or_default())? {
                // Once there is room, the poller says so.
                return Ok(packets > 0);
            }
            let Some(client) = &mut connection.client else { return Ok(false) };
            let (id, given) = (client.id, client.session.given());
            round.endpoints.remotes().note_handled(id, given, at);
            round.host.broker.note_handled(round.now, id, given, &mut self.spare);
            self.spare.truncate(PACKETS_A_ROUND);
            if !client.session.may_be_told() {
                return Ok(packets > 0);
            }
            let mut batch = self.spare.pop().unwrap_or_default();
            batch.clear();
            let waiting = || self.connections.values().map(Connection::waiting).sum::<usize>();
            if round.host.broker.may_give(id) {
                let copy =
                    |frame: &Frame<'_>, batch: &mut Vec<u8>| copy_bulk(frame, waiting(), &*round.endpoints, batch);
                round.host.broker.take_mail(id, BATCH_BYTES, &mut batch, copy);
            }
            if batch.is_empty() && !client.session.is_owed() {
                return Ok(packets > 0);
            }
            let mut requests = client.session.take_requests();
            if !requests.is_empty() && waiting() > MOST_WAITING {
                // As what the server does not know: the asker waits for 2 s, and asks again.
                requests.clear();
            }
            let answering = Answering { broker: &round.host.broker, texts: &self.options.texts, requests };
            let time = round.time();
            let mut out = std::mem::take(connection.out(at));
            let Connection { client: Some(client), .. } = connection else { return Ok(false) };
            let broker = &round.host.broker;
            client.session.put_packet(time, &batch, broker, &mut self.forms, &mut { answering }, &mut out);
            round.say_refusals(client);
            *connection.out(at) = out;
            if !batch.is_empty() {
                round.host.broker.keep_given(id, batch);
            }
        }
        // There is more, and others have their turn first.
        self.owed.insert(token);
        Ok(true)
    }

    /// Lets go of connections that are silent, or take nothing.
    fn let_go_of_the_gone<E: WithRemotes>(&mut self, round: &mut Round<'_, E>) {
        if self.connections.is_empty() {
            return;
        }
        let at = monotonic_nanos();
        let since = at.saturating_sub(self.looked_at);
        if since < LOOK_EVERY {
            return;
        }
        self.looked_at = at;
        if since > STALL {
            // Nobody has listened to them meanwhile.
            self.connections.values_mut().for_each(|connection| (connection.heard_at, connection.took_at) = (at, at));
            return;
        }
        for token in self.connections.keys().copied().collect::<Vec<_>>() {
            let Some(connection) = self.connections.get_mut(&token) else { continue };
            connection.tidy(at);
            if let Some(why) = overdue(connection, at)
                && let Some(connection) = self.connections.remove(&token)
            {
                self.let_go(connection, End::For(why), round);
            }
        }
    }

    fn let_go<E: WithRemotes>(&mut self, connection: Connection, end: End, round: &mut Round<'_, E>) {
        let Some(client) = connection.client else {
            if let End::For(why) = end {
                let said = format!("letting go of a connection from {}, and of others like it: {why}", connection.from);
                self.complain(monotonic_nanos(), &said);
            }
            return;
        };
        if let End::For(why) = end {
            tell(format_args!("elk db: letting go of {}, a client of MOOS': {why}", client.name));
        }
        self.by_client.remove(&client.id);
        let progress = round.endpoints.remotes().leave(client.id);
        round.host.leave(round.now, client.id, progress, true, round.endpoints);
    }
}

/// Who a connection is of, once it has said so in a whole packet.
fn hello(connection: &mut Connection) -> Result<Option<Hello>, End> {
    loop {
        match connection.decoder.next_event()? {
            None => return Ok(None),
            Some(Event::Message { message, first: true }) => connection.hello = Some(Hello::read(&message)),
            Some(Event::End) => break,
            Some(_) => {}
        }
    }
    let at = connection.opened_at;
    let reason = match connection.hello.take() {
        Some(Ok(hello)) => return Ok(Some(hello)),
        Some(Err(reason)) => reason,
        None => "its first packet is empty".to_owned(),
    };
    put_poison(&reason, connection.out(at).bytes());
    // It is let go of all the same.
    let _ = connection.flush(at, &[]);
    Err(End::For(reason))
}

/// Puts a copy in the place of a value that lies in shared memory; one that is gone, or for which there is no room, goes as
/// it is: its reader counts it as missed.
fn copy_bulk(frame: &Frame<'_>, waiting: usize, endpoints: &impl WithRemotes, batch: &mut Vec<u8>) {
    let room = LONGEST_BULK.min(MOST_WAITING.saturating_sub(waiting));
    let value = wire::BulkRef::from_bytes(frame.value).and_then(|reference| endpoints.bulk(reference));
    match value.filter(|value| value.len() <= room) {
        Some(value) => {
            let header = Header { flags: frame.header.flags & !wire::BULK, ..frame.header };
            wire::put(batch, &header, frame.aux, value);
        }
        None => batch.extend_from_slice(frame.bytes),
    }
}

/// Why a connection is given up, if it is, at `at` (ns, monotonic).
fn overdue(connection: &Connection, at: u64) -> Option<String> {
    let since = |moment: u64| at.saturating_sub(moment);
    let secs = |nanos: u64| nanos / SECOND;
    if connection.client.is_none() {
        let said = format!("it has not said in {} s who it is", secs(HELLO_PATIENCE));
        (since(connection.opened_at) > HELLO_PATIENCE).then_some(said)
    } else if since(connection.heard_at) > SILENCE {
        Some(format!("it has said nothing for {} s", secs(SILENCE)))
    } else if connection.waiting() > 0 && since(connection.took_at) > SEND_PATIENCE {
        Some(format!("it has read nothing for {} s", secs(SEND_PATIENCE)))
    } else {
        None
    }
}
