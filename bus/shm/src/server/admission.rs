//! Who comes and goes: first words, ends, sessions kept, handovers.

use std::os::fd::AsFd;
use std::os::unix::net::{UnixListener, UnixStream};
use std::sync::Arc;
use std::sync::atomic::Ordering::{Acquire, Relaxed, SeqCst};
use std::sync::mpsc::Sender;

use super::Place;
use super::lobby::{Door, Lobby};
use super::{
    Answer, BTreeMap, Broker, BrokerConfig, BrokerPage, ClientId, ClientPage, Event, Hello, LaneReader, LaneWriter,
    LinkError, Page, Peer, SENT_AWAY, Server, handshake, lane_name, leftovers, monotonic_nanos, scarce, sessions,
};
use elk_os::ProcessId;
use elk_os::tell;
use elk_proto::broker::Introduction;
use elk_proto::wire::BulkRef;
use sessions::Held;

/// How long the sessions of the clients of a broker that died are kept (s).
const SESSIONS_KEPT_SECS: f64 = 10.0;

/// A handover on its way: from the moment that its holder was asked to retire.
#[derive(Debug)]
pub(super) struct Handover {
    holder: ClientId,
    name: String,
    /// When the holder was asked to retire, or had handled its last message, if that was later (ns, monotonic).
    stopped_at: u64,
    /// The holder is gone.
    vacant: bool,
}

/// A broker in the place of one that died.
pub(super) fn recover(place: &Place, config: BrokerConfig, now: f64, found: Vec<Held>) -> Broker {
    let clients = found.len();
    tell(format_args!("elk db: the broker before this one died; the sessions of its {clients} clients are kept"));
    let sessions = found.into_iter().map(|one| {
        let alive = one.is_alive();
        (one.session, alive)
    });
    let mut broker = Broker::recover(config, now, sessions, SESSIONS_KEPT_SECS);
    broker.inherit(now, &sessions::read_retained(place));
    broker
}

impl Server {
    pub(super) fn take_events(&mut self, now: f64) -> bool {
        let mut any = false;
        while let Ok(event) = self.events.try_recv() {
            any = true;
            match event {
                Event::Hello(connection, stream, hello) => self.let_in(now, connection, stream, &hello),
                Event::HungUp(connection) => {
                    if let Some(peer) = self.peers.values_mut().find(|p| p.connection == connection) {
                        peer.hung_up = true;
                    }
                }
            }
        }
        any
    }

    fn let_in(&mut self, now: f64, connection: u64, stream: Arc<UnixStream>, hello: &Hello) {
        self.free_name_of_the_dead(now, &hello.name);
        let Hello { protocol, name, lease_secs, succeeds, returns } = hello;
        let who = Introduction { name, lease_secs: *lease_secs, succeeds: *succeeds, returns: *returns };
        let admitted = match *protocol {
            handshake::PROTOCOL => self.broker.connect(now, &who).map_err(|refusal| refusal.to_string()),
            other => Err(format!(
                "this broker speaks protocol {}, the client {other}: build both from the same version",
                handshake::PROTOCOL
            )),
        };
        let peer = admitted.and_then(|id| {
            self.open_lanes(connection, &stream, id).map(|peer| (id, peer)).map_err(|e| {
                self.broker.disconnect(now, id, 0, true);
                e.to_string()
            })
        });
        match peer {
            Ok((id, peer)) => {
                let files = [self.page.file().as_fd(), peer.page.file().as_fd()];
                let (warp, dial) = (self.clock.warp(), self.broker.dial());
                let folder = self.place.folder().path().to_owned();
                let welcome = Answer::Welcome { id, epoch: self.epoch, warp, dial, folder };
                // Who hung up meanwhile is noticed by the connection's own thread.
                let _ = handshake::send(&stream, &welcome, &files);
                self.peers.insert(id, peer);
                self.awaited.remove(name);
            }
            Err(reason) => {
                let _ = handshake::send(&stream, &Answer::Refused { reason }, &[]);
                let _ = stream.shutdown(std::net::Shutdown::Both);
            }
        }
    }

    /// The news of a client's end may come later than its successor: the socket knows. And a client that was to return
    /// after the broker's death may have died meanwhile.
    fn free_name_of_the_dead(&mut self, now: f64, name: &str) {
        let holder = self.peers.keys().find(|id| self.broker.client_name(**id) == Some(name)).copied();
        if let Some(holder) = holder {
            self.let_go_if_dead(now, holder);
        }
        if self.awaited.get(name).is_some_and(|process| !process.is_some_and(|process| process.lives())) {
            self.awaited.remove(name);
            self.broker.expect_no_return(name);
        }
    }

    /// Takes a client's last words and lets go of it, if it has hung up.
    pub(super) fn let_go_if_dead(&mut self, now: f64, id: ClientId) {
        if self.peers.get(&id).is_some_and(|peer| handshake::hung_up(&peer.stream)) {
            while self.peers.get(&id).is_some_and(Peer::has_sent) && self.take_batch(now, id) {}
            self.let_go(now, id);
        }
    }

    /// Lets go of the clients that are gone and whose last words are taken.
    pub(super) fn let_go_of_the_gone(&mut self, now: f64) -> bool {
        let done = |(id, peer): &(&ClientId, &Peer)| peer.hung_up && (!peer.has_sent() || self.broker.is_joining(**id));
        let gone: Vec<_> = self.peers.iter().filter(done).map(|(id, _)| *id).collect();
        gone.iter().for_each(|id| self.let_go(now, *id));
        !gone.is_empty()
    }

    fn open_lanes(&self, connection: u64, stream: &Arc<UnixStream>, id: ClientId) -> Result<Peer, LinkError> {
        let Some(node) = &self.node else {
            return Err(LinkError::BrokerGone(self.community.to_string()));
        };
        scarce::room()?;
        let system = |e: std::io::Error| LinkError::SharedMemory(format!("{e}{}", scarce::hint()));
        let peer = Peer {
            connection,
            process: ProcessId::of(handshake::peer(stream).map_err(system)?.0 as i32),
            stream: stream.clone(),
            hung_up: false,
            page: Page::<ClientPage>::create("elk-client").map_err(system)?,
            up: LaneReader::open(node, &lane_name(self.epoch, "up", id))?,
            down: LaneWriter::open(node, &lane_name(self.epoch, "down", id))?,
            bulk: None,
            attached: BTreeMap::new(),
        };
        leftovers::close_shared_memory(&self.place).map_err(system)?;
        Ok(peer)
    }

    pub(super) fn let_go(&mut self, now: f64, id: ClientId) {
        if let Some(mut peer) = self.peers.remove(&id) {
            if let Some(mut held) = peer.bulk.take() {
                held.samples.part(|sample| self.broker.is_latest_bulk(id, sample));
                self.departed.insert(id, held.samples);
            }
            let page = &peer.page;
            for handover in self.handovers.iter_mut().filter(|handover| handover.holder == id) {
                handover.vacant = true;
                handover.stopped_at = handover.stopped_at.max(page.last_handled_at.load(Relaxed));
            }
            self.broker.disconnect(now, id, page.handled.load(Acquire), page.goodbye.load(Acquire) != 0);
            self.resolve_mail_of_the_dead();
            self.note_successions();
            page.closed.store(SENT_AWAY, SeqCst);
            let _ = peer.stream.shutdown(std::net::Shutdown::Both);
        }
        if let Some(node) = &self.node {
            node.try_cleanup_dead_nodes();
        }
    }

    /// What the broker's decisions mean for processes and files.
    pub(super) fn follow_up(&mut self, now: f64) {
        for holder in self.broker.take_retiring() {
            let Some(peer) = self.peers.get(&holder) else { continue };
            let name = self.broker.client_name(holder).unwrap_or_default().to_owned();
            self.handovers.push(Handover { holder, name, stopped_at: monotonic_nanos(), vacant: false });
            peer.page.retire.store(1, SeqCst);
            peer.page.bell.ring();
        }
        self.finish_handovers(now);
        self.departed.retain(|id, samples| {
            samples.let_go(u64::MAX, |sample| self.broker.is_latest_bulk(*id, sample));
            !samples.is_empty()
        });
        self.note_lost();
        if let Some(sessions) = self.broker.take_sessions() {
            self.write_sessions(sessions);
        }
        let bulk = |reference: BulkRef| self.departed.get(&reference.client)?.get(reference.sample);
        if let Some(retained) = self.broker.take_retained(bulk)
            && let Err(error) = sessions::write_retained(&self.place, &retained)
        {
            tell(format_args!(
                "elk db: should this broker die, what was left by clients that are gone is lost: {error}"
            ));
        }
    }

    /// Says how long nobody handled the mail of a name that was handed over, once its successor has begun.
    fn finish_handovers(&mut self, now: f64) {
        let mut pending = Vec::new();
        for handover in std::mem::take(&mut self.handovers) {
            let successor = self.broker.client_named(&handover.name);
            let peer = successor.and_then(|id| self.peers.get(&id));
            let (true, Some(peer)) = (handover.vacant, peer) else {
                // A name that nobody has or will have was not handed over.
                if !handover.vacant || self.broker.is_expected(&handover.name) {
                    pending.push(handover);
                }
                continue;
            };
            // Rung when it has handled a batch.
            peer.page.broker_waits.store(1, SeqCst);
            let begun_at = match peer.page.first_handled_at.load(SeqCst) {
                0 if successor.is_some_and(|id| self.broker.is_idle(id)) => monotonic_nanos(),
                begun_at => begun_at,
            };
            if begun_at == 0 {
                pending.push(handover);
                continue;
            }
            let gap_ms = begun_at.saturating_sub(handover.stopped_at) as f64 * 1e-6;
            self.broker.publish_event(now, &format!("handover={} gap_ms={gap_ms:.3}", handover.name));
        }
        self.handovers = pending;
    }

    fn write_sessions(&self, sessions: Vec<elk_proto::broker::Session>) {
        let process = |name: &str| {
            let holder = self.broker.client_named(name).and_then(|id| self.peers.get(&id));
            holder.map(|peer| peer.process).or_else(|| self.awaited.get(name).copied()).flatten()
        };
        let held = |session: elk_proto::broker::Session| Held { process: process(&session.name), session };
        let all: Vec<Held> = sessions.into_iter().map(held).collect();
        if let Err(error) = sessions::write(&self.place, &all) {
            tell(format_args!(
                "elk db: should this broker die, its clients are not known to the next: {error}{}",
                scarce::hint()
            ));
        }
    }
}

/// Lets the connections of all who dial in have their first word.
pub(super) fn accept_all(listener: UnixListener, events: &Sender<Event>, page: &Arc<Page<BrokerPage>>) {
    let (mut door, lobby) = (Door::new(listener), Arc::new(Lobby::default()));
    for connection in 0_u64.. {
        let stream = Arc::new(door.next());
        lobby.enter(connection, &stream);
        let (events, page, lobby) = (events.clone(), page.clone(), lobby.clone());
        let serve = {
            let (stream, lobby) = (stream.clone(), lobby.clone());
            move || {
                let tell = |event| {
                    // The broker may be gone already; then nobody needs the news.
                    let _ = events.send(event);
                    page.bell.ring();
                };
                let hello = first_word(&stream);
                lobby.leave(connection);
                if let Some(hello) = hello {
                    tell(Event::Hello(connection, stream.clone(), hello));
                    handshake::wait_for_end(&stream);
                    tell(Event::HungUp(connection));
                }
            }
        };
        let spawned = std::thread::Builder::new().name("connection".into()).stack_size(64 << 10).spawn(serve);
        if let Err(error) = spawned {
            let remedy = scarce::remedy(&error);
            let reason = format!("the broker has no thread for another client: {error}{remedy}");
            tell(format_args!("elk db: a client was turned away: {reason}"));
            let _ = handshake::send(&stream, &Answer::Refused { reason }, &[]);
            lobby.leave(connection);
        }
    }
}

fn first_word(stream: &UnixStream) -> Option<Hello> {
    let (_, user) = handshake::peer(stream).ok()?;
    if user != handshake::own_user() {
        let reason = format!("this community belongs to user {}", handshake::own_user());
        let _ = handshake::send(stream, &Answer::Refused { reason }, &[]);
        return None;
    }
    stream.set_read_timeout(Some(handshake::PATIENCE)).ok()?;
    let (hello, _) = handshake::receive::<Hello>(stream).ok()?;
    stream.set_read_timeout(None).ok()?;
    Some(hello)
}
