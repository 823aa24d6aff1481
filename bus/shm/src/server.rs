//! The broker's process: takes batches from the lanes into the broker, and mail from the broker into the lanes.
//!
//! One thread does all of it; a thread a connection only waits for the client's first word and for its end.

mod admission;
mod bulk_values;
mod carrier;
mod listener;
mod peers;
mod pending;

use std::collections::BTreeMap;
use std::io::ErrorKind;
use std::sync::Arc;
use std::sync::atomic::AtomicBool;
use std::sync::atomic::Ordering::{Relaxed, Release};
use std::sync::mpsc::{Receiver, channel};
use std::time::Duration;

use elk_moos::gateway::{Gateway, Listening, Remotes};
use elk_os::clock::{Clock, Stopwatch, monotonic_nanos};
use elk_os::limits;
use elk_os::{Owner, tell};
use elk_proto::broker::BrokerConfig;
use elk_proto::community::Community;
use elk_proto::host::Host;
use elk_proto::link::LinkError;

use super::bulk::Budget;
use super::folder::FolderError;
use super::handshake;
use super::lane;
use super::namespace::{HeldNamespace, Namespace};
use super::page::{BrokerPage, Page, SENT_AWAY};
use super::{leftovers, scarce, sessions};
use carrier::Carrier;
use listener::Event;
use peers::Peers;

/// The longest that the broker sleeps.
const LONGEST_SLEEP: Duration = Duration::from_secs(1);
/// How long somebody who clears away what is left over may hold a community's namespace.
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
    #[error("community {community} cannot be served: no thread for connections: {source}{}", scarce::remedy(.source))]
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

/// The broker of a community, with its transport.
pub struct Server {
    carrier: Carrier,
    events: Receiver<Event>,
}

impl Server {
    /// Takes the community's name, and over from a broker that died, if there are clients of it that live; otherwise
    /// clears away what crashed runs left. Clients of MOOS' are let in where `moos` listens.
    pub fn start(
        community: Community,
        mut config: BrokerConfig,
        clock: Clock,
        moos: Option<Listening>,
    ) -> Result<Self, ServeError> {
        limits::raise_descriptors();
        limits::let_owner_in();
        let io = |source| ServeError::Io { community: community.clone(), source };
        let unusable = |source| ServeError::Folder { community: community.clone(), source };
        // What is wrong with the namespace is said before anybody can connect: whoever has would hear a mere hanging
        // up.
        scarce::room()?;
        let mut namespace = hold(&community)?;
        // That takes as long as others have left something: before anybody can connect, who has patience for a handshake only.
        leftovers::sweep();
        let listener = handshake::listen(&community).map_err(|source| taken(&community, source))?;
        let found = sessions::read(&namespace);
        if found.is_empty() {
            leftovers::remove(&namespace);
            namespace = hold(&community)?;
        }
        let page = Arc::new(Page::<BrokerPage>::create("elk-broker").map_err(io)?);
        let node = lane::node(&namespace)?;
        namespace.close_folder().map_err(unusable)?;
        leftovers::close_shared_memory(&namespace).map_err(io)?;
        config.time_warp = clock.warp();
        // Those of MOOS' come on top: they take no shared memory.
        config.limits.clients += moos.as_ref().map_or(0, Listening::connections);
        let ring = page.clone();
        let gateway = moos.map(|moos| Gateway::start(moos, community.as_str(), move || ring.bell.ring()));
        let gateway = gateway.transpose().map_err(io)?;
        let (sender, events) = channel();
        let bell = page.clone();
        std::thread::Builder::new()
            .name("listener".into())
            .spawn(move || listener::accept_all(listener, &sender, &bell))
            .map_err(|source| ServeError::NoThread { community: community.clone(), source })?;
        let copies = Budget::of(config.limits.copied_bytes);
        let awaited = found.iter().map(|one| (one.session.name.clone(), one.process)).collect();
        let host = match found.is_empty() {
            true => Host::new(config, clock.now()),
            false => recover(&namespace, config, clock.now(), found),
        };
        let peers = Peers {
            by_id: BTreeMap::new(),
            departed: BTreeMap::new(),
            awaited,
            namespace,
            epoch: monotonic_nanos(),
            node: Some(node),
            copies,
            remotes: Remotes::default(),
        };
        Ok(Self { carrier: Carrier::new(community, clock, host, peers, page, gateway), events })
    }

    /// Serves until `stop`; then sends the clients away and leaves nothing behind.
    pub fn run(&mut self, stop: &AtomicBool) {
        let Self { carrier, events } = self;
        while !stop.load(Relaxed) {
            let rings = carrier.page.bell.rings();
            let now = carrier.clock.now();
            carrier.host.broker.tick(now);
            let moved = carrier.take_events(now, events)
                | carrier.take_batches(now)
                | carrier.take_in_from_afar(now)
                | carrier.let_go_of_the_gone(now)
                | carrier.hand_out(now);
            carrier.follow_up(now);
            if !moved {
                let until_next = carrier.clock.real(carrier.host.broker.next_deadline() - now);
                carrier.page.bell.wait(rings, until_next.min(LONGEST_SLEEP));
            }
        }
        self.part();
    }

    /// Sends everybody away and removes the community's files.
    fn part(&mut self) {
        let Carrier { peers, page, gateway, .. } = &mut self.carrier;
        *gateway = None;
        for peer in peers.by_id.values() {
            peer.page.closed.store(SENT_AWAY, Release);
            peer.page.bell.ring();
        }
        let waited = Stopwatch::start();
        while peers.by_id.values().any(|p| !handshake::hung_up(&p.stream)) && waited.elapsed() < FAREWELL {
            let rings = page.bell.rings();
            page.bell.wait(rings, Duration::from_millis(20));
        }
        peers.by_id.clear();
        peers.node = None;
        leftovers::remove(&peers.namespace);
    }
}

/// A broker in the place of one that died.
fn recover(namespace: &Namespace, config: BrokerConfig, now: f64, found: Vec<sessions::Held>) -> Host {
    let clients = found.len();
    tell(format_args!("elk db: the broker before this one died; the sessions of its {clients} clients are kept"));
    let sessions = found.into_iter().map(|one| {
        let alive = one.is_alive();
        (one.session, alive)
    });
    Host::recover(config, now, sessions, &sessions::read_retained(namespace))
}

/// Holds the community's namespace, unless another broker does.
fn hold(community: &Community) -> Result<HeldNamespace, ServeError> {
    let waited = Stopwatch::start();
    loop {
        let source = match Namespace::make(community) {
            Ok(namespace) => return Ok(namespace),
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
    let other = handshake::connect_now(&community).and_then(|stream| Owner::at_other_end(&stream));
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
    use crate::skip::skip;

    /// Two containers can share the folders, and not the network that the sockets' names belong to.
    #[test]
    fn a_community_whose_folder_somebody_holds_is_not_served_and_keeps_its_files() {
        let community = Community::new(format!("held-{}", std::process::id())).unwrap();
        let first = Namespace::make(&community).unwrap();
        first.folder().write("sessions", b"first").unwrap();
        let start =
            || Server::start(community.clone(), BrokerConfig::new(community.to_string()), Clock::new(1.0), None);
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

    /// What a broker answers to whoever says this first, and the connection.
    fn answer_to(community: &Community, hello: Option<&handshake::Hello>) -> (String, std::os::unix::net::UnixStream) {
        let stream = handshake::connect(community).unwrap();
        hello.iter().for_each(|hello| handshake::send(&stream, hello, &[]).unwrap());
        match handshake::receive(&stream).unwrap() {
            (handshake::Answer::Refused { reason }, _) => (reason, stream),
            (welcome, _) => (format!("{welcome:?}"), stream),
        }
    }

    /// What a client of this name says first.
    fn hello(name: &str) -> handshake::Hello {
        handshake::Hello {
            protocol: handshake::PROTOCOL,
            name: name.into(),
            build: String::new(),
            lease_secs: 0.0,
            succeeds: false,
            returns: false,
        }
    }

    /// Regression: in a storm of clients that come and go at once some were refused for those that had gone.
    #[test]
    fn nobody_is_turned_away_for_a_client_that_has_gone() {
        let community = Community::new(format!("crowded-{}", std::process::id())).unwrap();
        let mut config = BrokerConfig::new(community.to_string());
        config.limits.clients = 1;
        let mut server = Server::start(community.clone(), config, Clock::new(1.0), None).unwrap();
        // What comes of a newcomer while nobody is let go of.
        let mut come = |name: &str| {
            std::thread::scope(|threads| {
                let newcomer = threads.spawn(|| answer_to(&community, Some(&hello(name))));
                while !newcomer.is_finished() {
                    server.carrier.take_events(0.0, &server.events);
                    std::thread::yield_now();
                }
                newcomer.join().unwrap()
            })
        };
        let (first, stays) = come("first");
        assert!(first.starts_with("Welcome"), "{first}");
        assert!(come("second").0.contains("has 1 clients already"));
        drop(stays);
        let (second, _connection) = come("second");
        assert!(second.starts_with("Welcome"), "{second}");
        server.part();
    }

    #[test]
    fn who_speaks_another_protocol_or_is_another_user_is_let_in_by_nobody() {
        let community = Community::new(format!("foreign-{}", std::process::id())).unwrap();
        let config = BrokerConfig::new(community.to_string());
        let mut server = Server::start(community.clone(), config, Clock::new(1.0), None).unwrap();
        let asks = community.clone();
        match as_another_user(move || answer_to(&asks, None).0) {
            Some(said) => assert_eq!(said, format!("this community belongs to user {}", elk_os::own_user())),
            None => {
                let test = "who_speaks_another_protocol_or_is_another_user_is_let_in_by_nobody";
                skip(test, "root", "only root can become another user");
            }
        }
        let hello = handshake::Hello { protocol: handshake::PROTOCOL + 1, ..hello("old") };
        let stop = AtomicBool::new(false);
        let said = std::thread::scope(|threads| {
            let old = threads.spawn(|| {
                let (said, _connection) = answer_to(&community, Some(&hello));
                // The end of the connection wakes the broker.
                stop.store(true, Relaxed);
                said
            });
            server.run(&stop);
            old.join().unwrap()
        });
        assert!(said.contains(&format!("the client {}: build both", hello.protocol)), "{said}");
    }

    #[test]
    fn who_holds_a_community_s_name_is_said_with_what_to_do() {
        let start = |name: &Community| {
            Server::start(name.clone(), BrokerConfig::new(name.to_string()), Clock::new(1.0), None).err()
        };
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
        leftovers::remove(&Namespace::make(&bound).unwrap());

        let squatted = name("squatted");
        let listens = squatted.clone();
        let Some(listener) = as_another_user(move || handshake::listen(&listens).unwrap()) else {
            skip("who_holds_a_community_s_name_is_said_with_what_to_do", "root", "only root can become another user");
            return;
        };
        let holder = format!("process {} of user 54321 has that name; choose another --community", std::process::id());
        let said = start(&squatted).unwrap().to_string();
        assert!(said.contains(&holder), "{said}");
        let who = elk_proto::broker::Introduction::new("reader");
        let said = super::super::connect(&squatted, &who).err().unwrap().to_string();
        assert!(said.contains(&holder), "{said}");
        drop(listener);
        leftovers::remove(&Namespace::make(&squatted).unwrap());
    }
}
