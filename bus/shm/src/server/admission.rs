//! Who comes and goes: clients are let in, and let go of when they are gone.

use std::collections::BTreeMap;
use std::os::fd::AsFd;
use std::os::unix::net::UnixStream;
use std::sync::Arc;
use std::sync::atomic::Ordering::{Acquire, SeqCst};
use std::sync::mpsc::Receiver;

use elk_os::{Owner, ProcessId};
use elk_proto::broker::{AdmissionError, Introduction};
use elk_proto::host::Progress;
use elk_proto::link::LinkError;
use elk_proto::wire::ClientId;

use super::carrier::Carrier;
use super::listener::Event;
use super::peers::Peer;
use crate::client::lane_name;
use crate::handshake::{self, Answer, Hello};
use crate::lane::{LaneReader, LaneWriter};
use crate::page::{ClientPage, Page, SENT_AWAY};
use crate::{leftovers, scarce};

impl Carrier {
    /// Lets in who dialled, and notes who has hung up.
    pub(super) fn take_events(&mut self, now: f64, events: &Receiver<Event>) -> bool {
        let mut any = false;
        while let Ok(event) = events.try_recv() {
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
        let claims = Introduction { succeeds: *succeeds, returns: *returns, ..Introduction::new(name) };
        let who = Introduction { build, lease_secs: *lease_secs, ..claims };
        let admitted = match *protocol {
            handshake::PROTOCOL => self.admit(now, &who).map_err(|refusal| refusal.to_string()),
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
                let (warp, clock_setting) = (self.clock.warp(), self.host.broker.clock_setting());
                let folder = self.peers.namespace.folder().path().to_owned();
                let welcome = Answer::Welcome { id, epoch: self.peers.epoch, warp, clock_setting, folder };
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

    /// Nobody is turned away for clients that have gone: the news of their end may come later than who takes their place.
    fn admit(&mut self, now: f64, who: &Introduction<'_>) -> Result<ClientId, AdmissionError> {
        match self.host.join(now, who, &mut self.peers) {
            Err(AdmissionError::Full(_)) => {
                let all: Vec<ClientId> = self.peers.by_id.keys().copied().collect();
                all.into_iter().for_each(|id| self.let_go_if_dead(now, id));
                self.host.join(now, who, &mut self.peers)
            }
            admitted => admitted,
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
        leftovers::close_shared_memory(&self.peers.namespace).map_err(system)?;
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
}
