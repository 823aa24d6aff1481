//! The broker's process: takes batches from the lanes into the broker, and mail from the broker into the lanes.
//!
//! One thread does all of it; a thread a connection only waits for the client's first word and for its end.

use std::collections::{BTreeMap, BTreeSet, VecDeque};
use std::os::fd::AsFd;
use std::os::unix::net::{UnixListener, UnixStream};
use std::sync::Arc;
use std::sync::atomic::AtomicBool;
use std::sync::atomic::Ordering::{Acquire, Relaxed, Release, SeqCst};
use std::sync::mpsc::{Receiver, Sender, channel};
use std::time::Duration;

use iceoryx2::node::Node;

use super::bulk::{self, BulkReader, BulkSample};
use super::client::lane_name;
use super::handshake::{self, Answer, Hello};
use super::lane::{self, DEPTH, LaneReader, LaneWriter, Service};
use super::leftovers;
use super::page::{BrokerPage, ClientPage, Page};
use crate::broker::{Broker, BrokerConfig, ClientId};
use crate::clock::{Clock, Stopwatch, monotonic_nanos};
use crate::community::Community;
use crate::limits;
use crate::link::LinkError;
use crate::wire::{self, ATTACH, BULK, BulkRef, Frame, LATEST};

/// A batch of mail is closed when it holds this many bytes.
const BATCH_BYTES: usize = 64 << 10;
/// The longest that the broker sleeps.
const LONGEST_SLEEP: Duration = Duration::from_secs(1);
/// How long clients get to leave when the broker stops.
const FAREWELL: Duration = Duration::from_secs(2);

/// Why a broker could not start, or go on.
#[derive(Debug, thiserror::Error)]
pub enum ServeError {
    /// Another broker serves the community.
    #[error(
        "community {community} is already served by process {process} of user {user}: \
         join it, stop that process, or choose another --community"
    )]
    Taken {
        /// The community.
        community: Community,
        /// The other broker's process.
        process: u32,
        /// The other broker's user.
        user: u32,
    },
    /// The operating system refused.
    #[error("community {community} cannot be served: {source}")]
    Io {
        /// The community.
        community: Community,
        /// Why.
        source: std::io::Error,
    },
    /// Shared memory failed.
    #[error(transparent)]
    Link(#[from] LinkError),
}

/// What the connections' threads tell the broker's.
enum Event {
    /// Somebody wants in.
    Hello(u64, UnixStream, Hello),
    /// A connection ended.
    HungUp(u64),
}

/// The broker of a community, with its transport.
pub struct Server {
    community: Community,
    clock: Clock,
    epoch: u64,
    broker: Broker,
    peers: BTreeMap<ClientId, Peer>,
    page: Arc<Page<BrokerPage>>,
    events: Receiver<Event>,
    node: Option<Node<Service>>,
    scratch: Vec<u8>,
}

/// A connected client.
struct Peer {
    connection: u64,
    stream: UnixStream,
    /// The client is gone; what it sent may still wait in its lane.
    hung_up: bool,
    page: Page<ClientPage>,
    up: LaneReader,
    down: LaneWriter,
    /// What the client publishes in bulk, once it does.
    bulk: Option<Held>,
    /// The publishers whose bulk service the client has open, and since which generation.
    attached: BTreeMap<ClientId, u32>,
    /// Mail taken out of the mailbox by the end of each batch under way: (batch, messages).
    under_way: VecDeque<(u64, u64)>,
    /// Messages that the client is done with, or that were dropped.
    done: u64,
}

/// A publisher's bulk values that are still wanted.
struct Held {
    reader: BulkReader,
    samples: BTreeMap<u64, Kept>,
    /// Values that lossless receivers are not done with: (sample, (receiver, position in its mail)).
    unsettled: VecDeque<(u64, Vec<(ClientId, u64)>)>,
}

enum Kept {
    InPlace(BulkSample),
    Copied(Vec<u8>),
}

impl Kept {
    fn bytes(&self) -> &[u8] {
        match self {
            Kept::InPlace(sample) => sample.payload(),
            Kept::Copied(bytes) => bytes,
        }
    }
}

impl Server {
    /// Takes the community's name and clears away what crashed runs left.
    pub fn start(community: Community, config: BrokerConfig, clock: Clock) -> Result<Self, ServeError> {
        limits::raise_descriptors();
        let io = |source| ServeError::Io { community: community.clone(), source };
        let listener = handshake::listen(&community).map_err(|source| taken(&community, source))?;
        leftovers::sweep();
        leftovers::remove(&community);
        let page = Arc::new(Page::<BrokerPage>::create("elk-broker").map_err(io)?);
        let node = lane::node(&community)?;
        let (sender, events) = channel();
        let bell = page.clone();
        std::thread::Builder::new()
            .name("listener".into())
            .spawn(move || accept_all(&listener, &sender, &bell))
            .map_err(io)?;
        let broker = Broker::new(config, clock.now());
        let epoch = monotonic_nanos();
        Ok(Self {
            community,
            clock,
            epoch,
            broker,
            peers: BTreeMap::new(),
            page,
            events,
            node: Some(node),
            scratch: Vec::new(),
        })
    }

    /// Serves until `stop`; then sends the clients away and leaves nothing behind.
    pub fn run(&mut self, stop: &AtomicBool) {
        while !stop.load(Relaxed) {
            let rings = self.page.bell.rings();
            let now = self.clock.now();
            self.broker.tick(now);
            let moved =
                self.take_events(now) | self.take_batches(now) | self.let_go_of_the_gone(now) | self.hand_out(now);
            if !moved {
                let until_next = self.clock.real(self.broker.next_deadline() - now);
                self.page.bell.wait(rings, until_next.min(LONGEST_SLEEP));
            }
        }
        self.part();
    }

    fn take_events(&mut self, now: f64) -> bool {
        let mut any = false;
        while let Ok(event) = self.events.try_recv() {
            any = true;
            match event {
                Event::Hello(connection, stream, hello) => self.let_in(now, connection, stream, &hello),
                Event::HungUp(connection) => {
                    if let Some(id) = self.peers.iter().find(|(_, p)| p.connection == connection).map(|(id, _)| *id) {
                        self.let_go(now, id);
                    }
                }
            }
        }
        any
    }

    fn let_in(&mut self, now: f64, connection: u64, stream: UnixStream, hello: &Hello) {
        self.free_name_of_the_dead(now, &hello.name);
        let admitted = match hello.protocol {
            handshake::PROTOCOL => self.broker.connect(now, &hello.name).map_err(|refusal| refusal.to_string()),
            other => Err(format!(
                "this broker speaks protocol {}, the client {other}: build both from the same version",
                handshake::PROTOCOL
            )),
        };
        let peer = admitted.and_then(|id| {
            self.open_lanes(connection, &stream, id).map(|peer| (id, peer)).map_err(|e| {
                self.broker.disconnect(now, id);
                e.to_string()
            })
        });
        match peer {
            Ok((id, peer)) => {
                let files = [self.page.file().as_fd(), peer.page.file().as_fd()];
                let welcome = Answer::Welcome { id, epoch: self.epoch, warp: self.clock.warp() };
                // Who hung up meanwhile is noticed by the connection's own thread.
                let _ = handshake::send(&stream, &welcome, &files);
                self.peers.insert(id, peer);
            }
            Err(reason) => {
                let _ = handshake::send(&stream, &Answer::Refused { reason }, &[]);
                let _ = stream.shutdown(std::net::Shutdown::Both);
            }
        }
    }

    /// The news of a client's end may come later than its successor: the socket knows.
    fn free_name_of_the_dead(&mut self, now: f64, name: &str) {
        let holder = self.peers.iter().find(|(id, _)| self.broker.client_name(**id) == Some(name));
        if let Some((&id, _)) = holder.filter(|(_, peer)| handshake::hung_up(&peer.stream)) {
            while self.peers.get(&id).is_some_and(Peer::has_sent) && self.take_batch(now, id) {}
            self.let_go(now, id);
        }
    }

    /// Lets go of the clients that are gone and whose last words are taken.
    fn let_go_of_the_gone(&mut self, now: f64) -> bool {
        let gone: Vec<_> = self.peers.iter().filter(|(_, p)| p.hung_up && !p.has_sent()).map(|(id, _)| *id).collect();
        gone.iter().for_each(|id| self.let_go(now, *id));
        !gone.is_empty()
    }

    fn open_lanes(&self, connection: u64, stream: &UnixStream, id: ClientId) -> Result<Peer, LinkError> {
        let Some(node) = &self.node else {
            return Err(LinkError::BrokerGone(self.community.to_string()));
        };
        let system = |e: std::io::Error| LinkError::SharedMemory(e.to_string());
        Ok(Peer {
            connection,
            stream: stream.try_clone().map_err(system)?,
            hung_up: false,
            page: Page::create("elk-client").map_err(system)?,
            up: LaneReader::open(node, &lane_name(self.epoch, "up", id))?,
            down: LaneWriter::open(node, &lane_name(self.epoch, "down", id))?,
            bulk: None,
            attached: BTreeMap::new(),
            under_way: VecDeque::new(),
            done: 0,
        })
    }

    fn let_go(&mut self, now: f64, id: ClientId) {
        self.broker.disconnect(now, id);
        if let Some(peer) = self.peers.remove(&id) {
            let _ = peer.stream.shutdown(std::net::Shutdown::Both);
        }
        if let Some(node) = &self.node {
            node.try_cleanup_dead_nodes();
        }
    }

    /// One batch from each client that has sent any.
    fn take_batches(&mut self, now: f64) -> bool {
        let ids: Vec<ClientId> = self.peers.iter().filter(|(_, p)| p.has_sent()).map(|(id, _)| *id).collect();
        let mut any = false;
        for id in ids {
            if !self.broker.holds_back(now, id) {
                any |= self.take_batch(now, id);
            }
        }
        any
    }

    fn take_batch(&mut self, now: f64, id: ClientId) -> bool {
        let Some(peer) = self.peers.get_mut(&id) else {
            return false;
        };
        let batch = match peer.up.receive() {
            Ok(Some(batch)) => batch,
            // The counter says that there is one: only a segment that its writer took along can be missing.
            Ok(None) if peer.hung_up => {
                peer.page.up_taken.fetch_add(1, SeqCst);
                return true;
            }
            Ok(None) => return false,
            Err(error) => return self.expel(now, id, &error),
        };
        if let Some(held) = &mut peer.bulk {
            held.take_in();
        }
        let newest_before = peer.bulk.as_ref().map_or(0, Held::newest_routed);
        let taken = self.broker.receive(now, id, &batch);
        drop(batch);
        self.note_unsettled(id, newest_before);
        self.attach_all();
        if let Some(peer) = self.peers.get_mut(&id) {
            peer.page.up_taken.fetch_add(1, SeqCst);
            if let Some(held) = &mut peer.bulk {
                held.let_go_of_unwanted(|sample| self.broker.is_latest_bulk(id, sample));
            }
            if peer.page.client_waits.load(SeqCst) != 0 {
                peer.page.bell.ring();
            }
        }
        match taken {
            Ok(()) => true,
            Err(error) => self.expel(now, id, &error),
        }
    }

    fn expel(&mut self, now: f64, id: ClientId, why: &dyn std::fmt::Display) -> bool {
        let name = self.broker.client_name(id).unwrap_or("?").to_owned();
        eprintln!("elk db: letting go of client {name}: {why}");
        self.let_go(now, id);
        true
    }

    /// Notes for each bulk value that just went out where it stands in the mail of those who must not miss it.
    fn note_unsettled(&mut self, publisher: ClientId, newest_before: u64) {
        let waiting = self.broker.lossless_positions(publisher);
        let Some(peer) = self.peers.get_mut(&publisher) else {
            return;
        };
        let Some(held) = &mut peer.bulk else { return };
        if let Some(newest) = held.samples.last_key_value().map(|(n, _)| *n).filter(|n| *n > newest_before) {
            held.unsettled.push_back((newest, waiting));
        }
    }

    fn attach_all(&mut self) {
        for (receiver, publisher) in self.broker.take_attached() {
            if receiver == publisher {
                self.open_bulk_of(publisher);
            } else if let Some(page) = self.peers.get(&publisher).map(|p| &p.page) {
                let generation = page.attachments.fetch_add(1, SeqCst) + 1;
                if let Some(peer) = self.peers.get_mut(&receiver) {
                    peer.attached.insert(publisher, generation);
                }
            }
        }
    }

    fn open_bulk_of(&mut self, publisher: ClientId) {
        let (Some(node), Some(peer)) = (&self.node, self.peers.get_mut(&publisher)) else {
            return;
        };
        match BulkReader::open(node, &lane_name(self.epoch, "bulk", publisher)) {
            Ok(reader) => peer.bulk = Some(Held { reader, samples: BTreeMap::new(), unsettled: VecDeque::new() }),
            // The values will be missed and counted by their receivers; the reason stands in the broker's log.
            Err(error) => eprintln!("elk db: {error}"),
        }
        peer.page.attachments.fetch_add(1, SeqCst);
    }

    /// Mail from the mailboxes into the lanes, as far as there is room.
    fn hand_out(&mut self, now: f64) -> bool {
        let mut any = false;
        let ids: Vec<ClientId> = self.broker.with_mail().collect();
        for id in ids {
            any |= self.hand_out_to(now, id);
        }
        self.settle() | any
    }

    fn hand_out_to(&mut self, now: f64, id: ClientId) -> bool {
        let Some(peer) = self.peers.get(&id).filter(|p| p.page.ready.load(Acquire) != 0) else {
            return false;
        };
        if !peer.has_room() {
            peer.page.broker_waits.store(1, SeqCst);
            if !peer.has_room() {
                return false;
            }
        }
        peer.page.broker_waits.store(0, SeqCst);
        let mut batch = std::mem::take(&mut self.scratch);
        batch.clear();
        let peers = &self.peers;
        let resolve = |frame: &Frame<'_>, batch: &mut Vec<u8>| place_bulk(peers, peer, frame, batch);
        self.broker.take_mail(now, id, BATCH_BYTES, &mut batch, resolve);
        let sent = peer.down.send(&batch);
        self.scratch = batch;
        let position = self.broker.mail_taken(id);
        if let Err(error) = sent {
            return self.expel(now, id, &error);
        }
        if let Some(peer) = self.peers.get_mut(&id) {
            let number = peer.page.down_sent.fetch_add(1, SeqCst) + 1;
            peer.note_done();
            peer.under_way.push_back((number, position));
            peer.page.bell.ring();
        }
        true
    }

    /// Tells publishers of bulk values how far their lossless receivers are; answers whether there may be more to tell.
    fn settle(&mut self) -> bool {
        if self.peers.values().all(|p| p.bulk.as_ref().is_none_or(|held| held.unsettled.is_empty())) {
            return false;
        }
        self.peers.values_mut().for_each(Peer::note_done);
        let done: BTreeMap<ClientId, u64> = self.peers.iter().map(|(id, p)| (*id, p.done)).collect();
        let behind = |(id, position): &(ClientId, u64)| done.get(id).is_some_and(|d| d < position);
        let mut awaited = BTreeSet::new();
        for peer in self.peers.values_mut() {
            let Some(held) = &mut peer.bulk else { continue };
            let mut settled = None;
            while let Some((sample, _)) = held.unsettled.pop_front_if(|(_, waiting)| !waiting.iter().any(behind)) {
                settled = Some(sample);
            }
            awaited.extend(
                held.unsettled.iter().flat_map(|(_, waiting)| waiting).filter(|w| behind(w)).map(|(id, _)| *id),
            );
            if let Some(sample) = settled {
                peer.page.bulk_settled.store(sample, SeqCst);
                if peer.page.client_waits.load(SeqCst) != 0 {
                    peer.page.bell.ring();
                }
            }
        }
        // Those who are behind ring when they have read on; who did so just before this flag is seen at once.
        let awaited: Vec<&Peer> = awaited.iter().filter_map(|id| self.peers.get(id)).collect();
        awaited.iter().for_each(|peer| peer.page.broker_waits.store(1, SeqCst));
        awaited.iter().any(|peer| peer.has_read_on())
    }

    /// Sends everybody away and removes the community's files.
    fn part(&mut self) {
        for peer in self.peers.values() {
            peer.page.closed.store(1, Release);
            peer.page.bell.ring();
        }
        let waited = Stopwatch::start();
        while self.peers.values().any(|p| !handshake::hung_up(&p.stream)) && waited.elapsed() < FAREWELL {
            let rings = self.page.bell.rings();
            self.page.bell.wait(rings, Duration::from_millis(20));
        }
        self.peers.clear();
        self.node = None;
        leftovers::remove(&self.community);
    }
}

/// What a receiver can use of a message whose value lies in shared memory: the reference, if the value reached its own
/// end of the bulk service; else a copy, with the hint to open one.
fn place_bulk(peers: &BTreeMap<ClientId, Peer>, to: &Peer, frame: &Frame<'_>, batch: &mut Vec<u8>) {
    let Some(reference) = BulkRef::from_bytes(frame.value) else {
        return;
    };
    let reached = to.attached.get(&reference.client).is_some_and(|since| *since <= reference.generation);
    let in_place = reached && frame.header.flags & LATEST == 0;
    let kept = || peers.get(&reference.client)?.bulk.as_ref()?.samples.get(&reference.sample);
    match kept().filter(|_| !in_place) {
        Some(kept) => {
            let tell = !to.attached.contains_key(&reference.client);
            let flags = frame.header.flags & !BULK | if tell { ATTACH } else { 0 };
            let publisher = reference.client.to_le_bytes();
            let aux: &[u8] = if tell { &publisher } else { frame.aux };
            wire::put(batch, &wire::Header { flags, ..frame.header }, aux, kept.bytes());
        }
        // In place; or gone before it could be copied: then the receiver finds nothing behind the reference, and counts.
        None => batch.extend_from_slice(frame.bytes),
    }
}

impl Peer {
    fn has_sent(&self) -> bool {
        self.page.up_sent.load(Acquire) > self.page.up_taken.load(Relaxed)
    }

    fn has_room(&self) -> bool {
        self.page.down_sent.load(Relaxed) - self.page.down_taken.load(SeqCst) < DEPTH
    }

    fn has_read_on(&self) -> bool {
        self.under_way.front().is_some_and(|(batch, _)| *batch <= self.page.down_taken.load(SeqCst))
    }

    fn note_done(&mut self) {
        let taken = self.page.down_taken.load(Acquire);
        while let Some((_, position)) = self.under_way.pop_front_if(|(batch, _)| *batch <= taken) {
            self.done = position;
        }
    }
}

impl Held {
    fn take_in(&mut self) {
        while let Some(sample) = self.reader.next() {
            self.samples.insert(*sample.user_header(), Kept::InPlace(sample));
        }
    }

    fn newest_routed(&self) -> u64 {
        self.unsettled.back().map_or(0, |(sample, _)| *sample)
    }

    /// Keeps the newest, those that a lossless receiver is not done with, and those that are a variable's latest value;
    /// of these, too many to hold in place are copied. The fewer are held, the sooner the publisher writes again into
    /// memory that is still in its cache.
    fn let_go_of_unwanted(&mut self, is_latest: impl Fn(u64) -> bool) {
        let newest = self.samples.last_key_value().map_or(0, |(n, _)| *n);
        let unsettled = self.unsettled.front().map_or(newest, |(sample, _)| *sample);
        self.samples.retain(|sample, _| *sample >= unsettled || is_latest(*sample));
        let in_place = self.samples.values().filter(|k| matches!(k, Kept::InPlace(_))).count();
        let old = self.samples.values_mut().filter(|k| matches!(k, Kept::InPlace(_)));
        for kept in old.take(in_place.saturating_sub(bulk::HELD)) {
            *kept = Kept::Copied(kept.bytes().to_vec());
        }
    }
}

fn taken(community: &Community, source: std::io::Error) -> ServeError {
    let other = handshake::dial(community).and_then(|stream| handshake::peer(&stream));
    match other {
        Ok((process, user)) => ServeError::Taken { community: community.clone(), process, user },
        Err(_) => ServeError::Io { community: community.clone(), source },
    }
}

fn accept_all(listener: &UnixListener, events: &Sender<Event>, page: &Arc<Page<BrokerPage>>) {
    for (connection, stream) in (0_u64..).zip(listener.incoming()) {
        let Ok(stream) = stream else { continue };
        let (events, page) = (events.clone(), page.clone());
        let spawned = std::thread::Builder::new().name("connection".into()).stack_size(64 << 10).spawn(move || {
            let tell = |event| {
                // The broker may be gone already; then nobody needs the news.
                let _ = events.send(event);
                page.bell.ring();
            };
            if let Some((stream, hello)) = first_word(stream) {
                let Ok(watched) = stream.try_clone() else {
                    return;
                };
                tell(Event::Hello(connection, stream, hello));
                watch(&watched);
                tell(Event::HungUp(connection));
            }
        });
        if let Err(error) = spawned {
            eprintln!("elk db: a client was turned away, no thread for it: {error}");
        }
    }
}

fn first_word(stream: UnixStream) -> Option<(UnixStream, Hello)> {
    let (_, user) = handshake::peer(&stream).ok()?;
    if user != handshake::own_user() {
        let reason = format!("this community belongs to user {}", handshake::own_user());
        let _ = handshake::send(&stream, &Answer::Refused { reason }, &[]);
        return None;
    }
    stream.set_read_timeout(Some(handshake::PATIENCE)).ok()?;
    let (hello, _) = handshake::receive::<Hello>(&stream).ok()?;
    stream.set_read_timeout(None).ok()?;
    Some((stream, hello))
}

/// Returns when the other end is gone.
fn watch(mut stream: &UnixStream) {
    let mut byte = [0; 1];
    while matches!(std::io::Read::read(&mut stream, &mut byte), Ok(n) if n > 0) {}
}
