//! The broker's process: takes batches from the lanes into the broker, and mail from the broker into the lanes.
//!
//! One thread does all of it; a thread a connection only waits for the client's first word and for its end.

mod admission;
mod bulk_values;
mod lobby;
mod peers;

use std::collections::{BTreeMap, BTreeSet};
use std::io::ErrorKind;
use std::os::unix::net::UnixStream;
use std::sync::Arc;
use std::sync::atomic::AtomicBool;
use std::sync::atomic::Ordering::{Acquire, Relaxed, Release, SeqCst};
use std::sync::mpsc::{Receiver, channel};
use std::time::Duration;

use elk_os::clock::{Clock, Stopwatch, monotonic_nanos};
use elk_os::limits;
use elk_os::{Owner, tell};
use elk_proto::broker::{BrokerConfig, ClientId};
use elk_proto::community::Community;
use elk_proto::host::Host;
use elk_proto::link::LinkError;
use elk_proto::wire::Frame;

use super::bulk::Budget;
use super::folder::FolderError;
use super::handshake::{self, Answer, Hello};
use super::lane;
use super::page::{BrokerPage, Page, SENT_AWAY};
use super::place::{HeldPlace, Place};
use super::{leftovers, scarce, sessions};
use bulk_values::{Held, bulk_values_of, place_bulk};
use peers::{Peer, Peers};

/// A batch of mail is closed when it holds this many bytes.
const BATCH_BYTES: usize = 64 << 10;
/// The longest that the broker sleeps.
const LONGEST_SLEEP: Duration = Duration::from_secs(1);
/// Buffers for batches of mail that are kept for the next ones.
const SPARE_BUFFERS: usize = 16;
/// How long somebody who clears away what is left over may have a community's place.
const MOMENT: Duration = Duration::from_secs(1);
/// How often it is tried again meanwhile.
const AGAIN_EVERY: Duration = Duration::from_millis(3);
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
    /// Another user has the community's name.
    #[error(
        "community {community} cannot be served: process {process} of user {user} has that name; choose another \
         --community, or have that process ended"
    )]
    Foreign {
        /// The community.
        community: Community,
        /// The process that listens there.
        process: u32,
        /// Its user.
        user: u32,
    },
    /// Somebody has the community's name, and lets nobody in.
    #[error(
        "community {community} cannot be served: somebody has that name, and nobody is let in there; choose another \
         --community, or see with `ss -xap` who holds @elk/{community}"
    )]
    Silent {
        /// The community.
        community: Community,
    },
    /// There is no thread to let anybody in.
    #[error("community {community} cannot be served: no thread for its door: {source}{}", scarce::remedy(.source))]
    NoThread {
        /// The community.
        community: Community,
        /// Why.
        source: std::io::Error,
    },
    /// The operating system refused.
    #[error("community {community} cannot be served: {source}{}", scarce::hint())]
    Io {
        /// The community.
        community: Community,
        /// Why.
        source: std::io::Error,
    },
    /// The community's folder is not safe.
    #[error("community {community} cannot be served: {source}")]
    Folder {
        /// The community.
        community: Community,
        /// What is wrong with it.
        source: FolderError,
    },
    /// Shared memory failed.
    #[error(transparent)]
    Link(#[from] LinkError),
}

/// What the connections' threads tell the broker's.
enum Event {
    /// Somebody wants in.
    Hello(u64, Arc<UnixStream>, Hello),
    /// A connection ended.
    HungUp(u64),
}

/// The broker of a community, with its transport.
pub struct Server {
    community: Community,
    clock: Clock,
    host: Host,
    peers: Peers,
    page: Arc<Page<BrokerPage>>,
    events: Receiver<Event>,
    /// Buffers for batches of mail.
    spare: Vec<Vec<u8>>,
}

impl Server {
    /// Takes the community's name, and the place of a broker that died, if there are clients of it that live; otherwise
    /// clears away what crashed runs left.
    pub fn start(community: Community, config: BrokerConfig, clock: Clock) -> Result<Self, ServeError> {
        limits::raise_descriptors();
        limits::let_owner_in();
        let io = |source| ServeError::Io { community: community.clone(), source };
        let unusable = |source| ServeError::Folder { community: community.clone(), source };
        // What is wrong with this place is said before anybody can dial in: whoever has would hear a mere hanging up.
        scarce::room()?;
        let mut place = hold(&community)?;
        let listener = handshake::listen(&community).map_err(|source| taken(&community, source))?;
        leftovers::sweep();
        let found = sessions::read(&place);
        if found.is_empty() {
            leftovers::remove(&place);
            place = hold(&community)?;
        }
        let page = Arc::new(Page::<BrokerPage>::create("elk-broker").map_err(io)?);
        let node = lane::node(&place)?;
        place.close_folder().map_err(unusable)?;
        leftovers::close_shared_memory(&place).map_err(io)?;
        let (sender, events) = channel();
        let bell = page.clone();
        std::thread::Builder::new()
            .name("listener".into())
            .spawn(move || admission::accept_all(listener, &sender, &bell))
            .map_err(|source| ServeError::NoThread { community: community.clone(), source })?;
        let copies = Budget::of(config.limits.copied_bytes);
        let awaited = found.iter().map(|one| (one.session.name.clone(), one.process)).collect();
        let host = match found.is_empty() {
            true => Host::new(config, clock.now()),
            false => admission::recover(&place, config, clock.now(), found),
        };
        let peers = Peers {
            by_id: BTreeMap::new(),
            departed: BTreeMap::new(),
            awaited,
            place,
            epoch: monotonic_nanos(),
            node: Some(node),
            copies,
        };
        Ok(Self { community, clock, host, peers, page, events, spare: Vec::new() })
    }

    /// Serves until `stop`; then sends the clients away and leaves nothing behind.
    pub fn run(&mut self, stop: &AtomicBool) {
        while !stop.load(Relaxed) {
            let rings = self.page.bell.rings();
            let now = self.clock.now();
            self.host.broker.tick(now);
            let moved =
                self.take_events(now) | self.take_batches(now) | self.let_go_of_the_gone(now) | self.hand_out(now);
            self.follow_up(now);
            if !moved {
                let until_next = self.clock.real(self.host.broker.next_deadline() - now);
                self.page.bell.wait(rings, until_next.min(LONGEST_SLEEP));
            }
        }
        self.part();
    }

    /// One batch from each client that has sent any; whoever has written over its page is let go of.
    fn take_batches(&mut self, now: f64) -> bool {
        let mut any = false;
        for (id, fault) in self.peers.by_id.iter().filter_map(Peer::is_due).collect::<Vec<_>>() {
            any |= match fault {
                Some(fault) => self.expel(now, id, &format_args!("its page cannot be true: {fault}")),
                None => !self.host.broker.holds_back(now, id) && self.take_batch(now, id),
            };
            self.give_up_the_late(now, id);
        }
        any
    }

    fn take_batch(&mut self, now: f64, id: ClientId) -> bool {
        let Some(peer) = self.peers.by_id.get_mut(&id) else {
            return false;
        };
        let mut small = self.spare.pop().unwrap_or_default();
        let batch = match peer.next_batch(&mut small) {
            Ok(Some(batch)) => batch,
            // The counter says that there is one: only a segment that its writer took along can be missing.
            Ok(None) if peer.hung_up => {
                peer.page.up_taken.fetch_add(1, SeqCst);
                return true;
            }
            Ok(None) => return self.expel(now, id, &lane::lost()),
            Err(error) => return self.expel(now, id, &error),
        };
        if let Some(held) = &mut peer.bulk {
            held.samples.take_in();
        }
        let taken = self.host.receive(now, id, &batch, &mut self.peers);
        let bulk = bulk_values_of(&batch, id).last();
        drop(batch);
        self.spare.push(small);
        if let Some(sample) = bulk {
            self.note_under_way(id, sample);
        }
        let mut lost = Vec::new();
        if let Some(peer) = self.peers.by_id.get_mut(&id) {
            peer.page.up_taken.fetch_add(1, SeqCst);
            if let Some(held) = &mut peer.bulk {
                held.let_go_of_unwanted(|sample| self.host.broker.is_latest_bulk(id, sample));
                lost = held.samples.take_lost();
            }
            if peer.page.client_waits.load(SeqCst) != 0 {
                peer.page.bell.ring();
            }
        }
        self.forget(id, lost);
        match taken {
            Ok(()) => true,
            Err(error) => self.expel(now, id, &error),
        }
    }

    /// Latest values of publishers that are gone for which there was no room.
    fn note_lost(&mut self) {
        let lost = self.peers.tidy_departed(&self.host.broker);
        lost.into_iter().for_each(|(id, lost)| self.forget(id, lost));
    }

    fn forget(&mut self, publisher: ClientId, lost: Vec<(u64, usize)>) {
        for (sample, bytes) in lost {
            for name in self.host.broker.forget_latest_bulk(publisher, sample) {
                tell(format_args!(
                    "elk db: the latest value of {name}, of {bytes} bytes, is let go of: there is room for {} bytes of \
                     such copies",
                    self.peers.copies.limit()
                ));
            }
        }
    }

    fn expel(&mut self, now: f64, id: ClientId, why: &dyn std::fmt::Display) -> bool {
        let gone = |peer: &&mut Peer| !peer.hung_up && handshake::hung_up(&peer.stream);
        if let Some(peer) = self.peers.by_id.get_mut(&id).filter(gone) {
            // That is why; its last words are taken before it is let go of.
            peer.hung_up = true;
            return true;
        }
        let name = self.host.broker.client_name(id).unwrap_or("?").to_owned();
        tell(format_args!("elk db: letting go of client {name}: {why}"));
        self.let_go(now, id);
        true
    }

    /// Notes for the bulk value that just went out where it stands in the mail of those who got it.
    fn note_under_way(&mut self, publisher: ClientId, sample: u64) {
        let reached = self.host.broker.reached();
        if let Some(held) = self.peers.held(publisher) {
            held.note_under_way(sample, reached);
        }
    }

    /// Gives up those who are far behind with a publisher's bulk values. They may be dead, and the news of that still to
    /// come: then their mail is given the values first. Not in the midst of a batch, since it may take others.
    fn give_up_the_late(&mut self, now: f64, publisher: ClientId) {
        let Some(Peer { bulk: Some(held), .. }) = self.peers.by_id.get(&publisher) else { return };
        for behind in held.far_behind(&self.host.broker) {
            self.let_go_if_dead(now, behind);
        }
        let (peers, broker) = (&mut self.peers, &self.host.broker);
        if let Some(held) = peers.held(publisher)
            && held.make_room()
        {
            held.let_go_of_unwanted(|sample| broker.is_latest_bulk(publisher, sample));
        }
    }

    /// Mail from the mailboxes into the lanes, as far as there is room.
    fn hand_out(&mut self, now: f64) -> bool {
        // Who wants every message (a logger, say) is in no hurry.
        let (leisurely, urgent) = self.host.broker.with_mail().partition(|id| self.host.broker.is_lossless(*id));
        let any = self.hand_out_to_all(now, urgent) | self.hand_out_to_all(now, leisurely);
        self.settle(now) | any
    }

    fn hand_out_to_all(&mut self, now: f64, ids: Vec<ClientId>) -> bool {
        let given: Vec<ClientId> = ids.into_iter().filter(|id| self.hand_out_to(now, *id)).collect();
        // To wake somebody takes longer than all the rest.
        given.iter().filter_map(|id| self.peers.by_id.get(id)).for_each(|peer| peer.page.bell.ring());
        !given.is_empty()
    }

    fn hand_out_to(&mut self, now: f64, id: ClientId) -> bool {
        let Some(peer) = self.peers.by_id.get(&id).filter(|p| p.page.ready.load(Acquire) != 0) else {
            return false;
        };
        if !peer.has_room() {
            peer.page.broker_waits.store(1, SeqCst);
            if !peer.has_room() {
                return false;
            }
        }
        self.host.broker.note_handled(now, id, peer.page.handled.load(Acquire), &mut self.spare);
        if !self.host.broker.may_give(id) {
            peer.page.broker_waits.store(1, SeqCst);
            self.host.broker.note_handled(now, id, peer.page.handled.load(SeqCst), &mut self.spare);
            if !self.host.broker.may_give(id) {
                return false;
            }
        }
        peer.page.broker_waits.store(0, SeqCst);
        let mut batch = self.spare.pop().unwrap_or_default();
        batch.clear();
        // Copies for those who come late wait here until they are read.
        let largest = self.peers.copies.limit().saturating_sub(self.host.broker.given_bytes());
        let resolve =
            |frame: &Frame<'_>, batch: &mut Vec<u8>| place_bulk(&self.peers, (id, peer), largest, frame, batch);
        self.host.broker.take_mail(id, BATCH_BYTES, &mut batch, resolve);
        let number = peer.page.down_sent.load(Relaxed);
        let sent = if peer.page.down.put(number, &batch) { Ok(()) } else { peer.down.send(&batch) };
        self.host.broker.keep_given(id, batch);
        self.spare.retain(|buffer| buffer.capacity() <= 2 * BATCH_BYTES);
        self.spare.truncate(SPARE_BUFFERS);
        if let Err(error) = sent {
            return self.expel(now, id, &error);
        }
        peer.page.down_sent.fetch_add(1, SeqCst);
        true
    }

    /// Tells publishers how far their mail is handled, and those of bulk values how far their lossless receivers are;
    /// answers whether there may be more to tell.
    fn settle(&mut self, now: f64) -> bool {
        for (id, peer) in &self.peers.by_id {
            self.host.broker.note_handled(now, *id, peer.page.handled.load(Acquire), &mut self.spare);
            self.host.broker.note_missed(*id, peer.page.missed.load(Relaxed));
        }
        for (id, peer) in &self.peers.by_id {
            peer.page.up_handled.store(self.host.broker.handled_batches(*id), Release);
        }
        if self.peers.by_id.values().all(|p| p.bulk.as_ref().is_none_or(Held::is_settled)) {
            return false;
        }
        let mut awaited = BTreeSet::new();
        for peer in self.peers.by_id.values_mut() {
            let Some(held) = &mut peer.bulk else { continue };
            let settled = held.settled(now, &self.host.broker, &mut awaited);
            if let Some(sample) = settled.filter(|sample| *sample > peer.page.bulk_settled.load(Relaxed)) {
                peer.page.bulk_settled.store(sample, SeqCst);
                if peer.page.client_waits.load(SeqCst) != 0 {
                    peer.page.bell.ring();
                }
            }
        }
        // Those who are behind ring when they have read on; who did so just before this flag is seen at once.
        let awaited: Vec<_> = awaited.iter().filter_map(|id| Some((*id, self.peers.by_id.get(id)?))).collect();
        awaited.iter().for_each(|(_, peer)| peer.page.broker_waits.store(1, SeqCst));
        let has_read_on = |(id, peer): &(ClientId, &Peer)| {
            peer.page.down_taken.load(SeqCst); // stored after `handled`: who sees it sees that, too
            self.host.broker.would_settle(*id, peer.page.handled.load(Acquire))
        };
        awaited.iter().any(has_read_on)
    }

    /// Sends everybody away and removes the community's files.
    fn part(&mut self) {
        for peer in self.peers.by_id.values() {
            peer.page.closed.store(SENT_AWAY, Release);
            peer.page.bell.ring();
        }
        let waited = Stopwatch::start();
        while self.peers.by_id.values().any(|p| !handshake::hung_up(&p.stream)) && waited.elapsed() < FAREWELL {
            let rings = self.page.bell.rings();
            self.page.bell.wait(rings, Duration::from_millis(20));
        }
        self.peers.by_id.clear();
        self.peers.node = None;
        leftovers::remove(&self.peers.place);
    }
}

/// Takes the community's place, unless another broker has it.
fn hold(community: &Community) -> Result<HeldPlace, ServeError> {
    let waited = Stopwatch::start();
    loop {
        let source = match Place::make(community) {
            Ok(place) => return Ok(place),
            Err(source) => source,
        };
        let held = matches!(source, FolderError::Held { .. });
        if held && !handshake::nobody_listens(community) {
            return Err(taken(community, ErrorKind::AddrInUse.into()));
        }
        if !held || waited.elapsed() >= MOMENT {
            return Err(ServeError::Folder { community: community.clone(), source });
        }
        // Whoever clears away what is left over has it for a moment.
        std::thread::sleep(AGAIN_EVERY);
    }
}

fn taken(community: &Community, source: std::io::Error) -> ServeError {
    let community = community.clone();
    let other = handshake::knock(&community).and_then(|stream| Owner::at_other_end(&stream));
    match other {
        Ok(Owner { process, user }) if user != elk_os::own_user() => ServeError::Foreign { community, process, user },
        Ok(Owner { process, user }) => ServeError::Taken { community, process, user },
        Err(full) if full.kind() == ErrorKind::WouldBlock => ServeError::Io { community, source: full },
        // Bound, and not listened at; or its holder has ended this moment.
        Err(_) if source.kind() == ErrorKind::AddrInUse => ServeError::Silent { community },
        Err(_) => ServeError::Io { community, source },
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Two containers can share the folders, and not the network that the sockets' names belong to.
    #[test]
    fn a_community_whose_folder_somebody_holds_is_not_served_and_keeps_its_files() {
        let community = Community::new(format!("held-{}", std::process::id())).unwrap();
        let first = Place::make(&community).unwrap();
        first.folder().write("sessions", b"first").unwrap();
        let start = || Server::start(community.clone(), BrokerConfig::new(community.to_string()), Clock::new(1.0));
        let error = start().err().unwrap();
        assert!(matches!(&error, ServeError::Folder { source: FolderError::Held { .. }, .. }), "{error}");
        assert_eq!(first.folder().read("sessions").unwrap(), b"first");
        // With a listening broker behind it, that one is named.
        let listener = handshake::listen(&community).unwrap();
        assert!(matches!(start().err(), Some(ServeError::Taken { .. })));
        drop(listener);
        leftovers::remove(&first);
        assert!(!first.folder().path().exists());
    }

    /// What another user's thread makes of a name's socket; `None`: only root can become another user.
    fn as_another_user<T: Send + 'static>(make: impl FnOnce() -> T + Send + 'static) -> Option<T> {
        let other = rustix::process::Uid::from_raw(54_321);
        let thread = std::thread::spawn(move || {
            rustix::thread::set_thread_res_uid(other, other, other).ok()?;
            Some(make())
        });
        thread.join().unwrap()
    }

    #[test]
    fn who_holds_a_community_s_name_is_said_with_what_to_do() {
        let start =
            |name: &Community| Server::start(name.clone(), BrokerConfig::new(name.to_string()), Clock::new(1.0)).err();
        let name = |what: &str| Community::new(format!("{what}-{}", std::process::id())).unwrap();

        let bound = name("bound");
        let address = format!("elk/{bound}");
        let address = rustix::net::SocketAddrUnix::new_abstract_name(address.as_bytes()).unwrap();
        let socket =
            rustix::net::socket(rustix::net::AddressFamily::UNIX, rustix::net::SocketType::STREAM, None).unwrap();
        rustix::net::bind(&socket, &address).unwrap();
        let said = start(&bound).unwrap().to_string();
        assert!(said.contains("somebody has that name") && said.contains("choose another --community"), "{said}");
        drop(socket);
        leftovers::remove(&Place::make(&bound).unwrap());

        let squatted = name("squatted");
        let listens = squatted.clone();
        let Some(listener) = as_another_user(move || handshake::listen(&listens).unwrap()) else {
            println!("who_holds_a_community_s_name_…: skipped in part, only root can become another user");
            return;
        };
        let holder = format!("process {} of user 54321 has that name; choose another --community", std::process::id());
        let said = start(&squatted).unwrap().to_string();
        assert!(said.contains(&holder), "{said}");
        let who = elk_proto::broker::Introduction::new("reader");
        let said = super::super::connect(&squatted, &who).err().unwrap().to_string();
        assert!(said.contains(&holder), "{said}");
        drop(listener);
        leftovers::remove(&Place::make(&squatted).unwrap());
    }
}
