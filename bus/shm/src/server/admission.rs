//! Who comes and goes: first words, ends, sessions kept, handovers.

use std::os::fd::AsFd;
use std::os::unix::net::{UnixListener, UnixStream};
use std::sync::Arc;
use std::sync::atomic::Ordering::{Acquire, SeqCst};
use std::sync::mpsc::Sender;

use elk_os::{Owner, ProcessId, tell};
use elk_proto::broker::Introduction;
use elk_proto::host::{Host, Progress};

use super::lobby::{Door, Lobby};
use super::peers::Peer;
use super::{
    Answer, BTreeMap, BrokerConfig, BrokerPage, ClientId, Event, Hello, LinkError, Page, Place, SENT_AWAY, Server,
    handshake, leftovers, scarce, sessions,
};
use crate::client::lane_name;
use crate::lane::{LaneReader, LaneWriter};
use crate::page::ClientPage;
use sessions::Held;

/// A broker in the place of one that died.
pub(super) fn recover(place: &Place, config: BrokerConfig, now: f64, found: Vec<Held>) -> Host {
    let clients = found.len();
    tell(format_args!("elk db: the broker before this one died; the sessions of its {clients} clients are kept"));
    let sessions = found.into_iter().map(|one| {
        let alive = one.is_alive();
        (one.session, alive)
    });
    Host::recover(config, now, sessions, &sessions::read_retained(place))
}

impl Server {
    pub(super) fn take_events(&mut self, now: f64) -> bool {
        let mut any = false;
        while let Ok(event) = self.events.try_recv() {
            any = true;
            match event {
                Event::Hello(connection, stream, hello) => self.let_in(now, connection, stream, &hello),
                Event::HungUp(connection) => {
                    if let Some(peer) = self.peers.by_id.values_mut().find(|p| p.connection == connection) {
                        peer.hung_up = true;
                    }
                }
            }
        }
        any
    }

    fn let_in(&mut self, now: f64, connection: u64, stream: Arc<UnixStream>, hello: &Hello) {
        self.free_name_of_the_dead(now, &hello.name);
        let Hello { protocol, name, build, lease_secs, succeeds, returns } = hello;
        let who = Introduction { name, build, lease_secs: *lease_secs, succeeds: *succeeds, returns: *returns };
        let admitted = match *protocol {
            handshake::PROTOCOL => self.host.join(now, &who, &mut self.peers).map_err(|refusal| refusal.to_string()),
            other => Err(format!(
                "this broker speaks protocol {}, the client {other}: build both from the same version",
                handshake::PROTOCOL
            )),
        };
        let peer = admitted.and_then(|id| {
            self.open_lanes(name, connection, &stream, id).map(|peer| (id, peer)).map_err(|e| {
                self.host.leave(now, id, Progress::default(), true, &mut self.peers);
                e.to_string()
            })
        });
        match peer {
            Ok((id, peer)) => {
                let files = [self.page.file().as_fd(), peer.page.file().as_fd()];
                let (warp, dial) = (self.clock.warp(), self.host.broker.dial());
                let folder = self.peers.place.folder().path().to_owned();
                let welcome = Answer::Welcome { id, epoch: self.peers.epoch, warp, dial, folder };
                // Who hung up meanwhile is noticed by the connection's own thread.
                let _ = handshake::send(&stream, &welcome, &files);
                self.peers.by_id.insert(id, peer);
                self.peers.awaited.remove(name);
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
        let holder = self.peers.by_id.iter().find(|(_, peer)| peer.name == name).map(|(id, _)| *id);
        if let Some(holder) = holder {
            self.let_go_if_dead(now, holder);
        }
        if self.peers.awaited.get(name).is_some_and(|process| !process.is_some_and(|process| process.lives())) {
            self.peers.awaited.remove(name);
            self.host.broker.expect_no_return(name);
        }
    }

    /// Takes a client's last words and lets go of it, if it has hung up.
    pub(super) fn let_go_if_dead(&mut self, now: f64, id: ClientId) {
        if self.peers.by_id.get(&id).is_some_and(|peer| handshake::hung_up(&peer.stream)) {
            while self.peers.by_id.get(&id).is_some_and(Peer::has_sent) && self.take_batch(now, id) {}
            self.let_go(now, id);
        }
    }

    /// Lets go of the clients that are gone and whose last words are taken.
    pub(super) fn let_go_of_the_gone(&mut self, now: f64) -> bool {
        let done =
            |(id, peer): &(&ClientId, &Peer)| peer.hung_up && (!peer.has_sent() || self.host.broker.is_joining(**id));
        let gone: Vec<_> = self.peers.by_id.iter().filter(done).map(|(id, _)| *id).collect();
        gone.iter().for_each(|id| self.let_go(now, *id));
        !gone.is_empty()
    }

    fn open_lanes(
        &self,
        name: &str,
        connection: u64,
        stream: &Arc<UnixStream>,
        id: ClientId,
    ) -> Result<Peer, LinkError> {
        let Some(node) = &self.peers.node else {
            return Err(LinkError::BrokerGone(self.community.to_string()));
        };
        scarce::room()?;
        let system = |e: std::io::Error| LinkError::SharedMemory(format!("{e}{}", scarce::hint()));
        let peer = Peer {
            name: name.to_owned(),
            connection,
            process: ProcessId::of(Owner::at_other_end(stream).map_err(system)?.process as i32),
            stream: stream.clone(),
            hung_up: false,
            page: Page::<ClientPage>::create("elk-client").map_err(system)?,
            up: LaneReader::open(node, &lane_name(self.peers.epoch, "up", id))?,
            down: LaneWriter::open(node, &lane_name(self.peers.epoch, "down", id))?,
            bulk: None,
            attached: BTreeMap::new(),
        };
        leftovers::close_shared_memory(&self.peers.place).map_err(system)?;
        Ok(peer)
    }

    pub(super) fn let_go(&mut self, now: f64, id: ClientId) {
        if let Some(mut peer) = self.peers.by_id.remove(&id) {
            if let Some(mut held) = peer.bulk.take() {
                held.samples.part(|sample| self.host.broker.is_latest_bulk(id, sample));
                self.peers.departed.insert(id, held.samples);
            }
            let page = &peer.page;
            let goodbye = page.goodbye.load(Acquire) != 0;
            self.host.leave(now, id, page.progress(), goodbye, &mut self.peers);
            page.closed.store(SENT_AWAY, SeqCst);
            let _ = peer.stream.shutdown(std::net::Shutdown::Both);
        }
        if let Some(node) = &self.peers.node {
            node.try_cleanup_dead_nodes();
        }
    }

    /// What can wait until a round is over.
    pub(super) fn follow_up(&mut self, now: f64) {
        self.note_lost();
        self.host.follow_up(now, &mut self.peers);
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
    let user = Owner::at_other_end(stream).ok()?.user;
    if user != elk_os::own_user() {
        let reason = format!("this community belongs to user {}", elk_os::own_user());
        let _ = handshake::send(stream, &Answer::Refused { reason }, &[]);
        return None;
    }
    stream.set_read_timeout(Some(handshake::PATIENCE)).ok()?;
    let (hello, _) = handshake::receive::<Hello>(stream).ok()?;
    stream.set_read_timeout(None).ok()?;
    Some(hello)
}
