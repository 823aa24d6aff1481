//! The clients' endpoints in shared memory: their pages, lanes and bulk values.

use std::collections::BTreeMap;
use std::os::unix::net::UnixStream;
use std::rc::Rc;
use std::sync::Arc;
use std::sync::atomic::Ordering::{Acquire, Relaxed, Release, SeqCst};

use elk_moos::gateway::{Remotes, WithRemotes};
use elk_os::clock::monotonic_nanos;
use elk_os::{ProcessId, tell};
use elk_proto::broker::{Broker, Retained, Session, Succession};
use elk_proto::host::{Endpoints, Progress};
use elk_proto::link::LinkError;
use elk_proto::wire::{self, ATTACH, BULK, BulkRef, ClientId, Frame, LATEST};
use iceoryx2::node::Node;

use super::bulk_values::Held;
use crate::bulk::{Budget, Samples};
use crate::client::lane_name;
use crate::lane::{DEPTH, LaneReader, LaneSample, LaneWriter, Service};
use crate::namespace::HeldNamespace;
use crate::page::{ClientPage, Page};
use crate::{scarce, sessions};

/// A connected client.
pub(super) struct Peer {
    pub name: String,
    pub connection: u64,
    pub process: Option<ProcessId>,
    pub stream: Arc<UnixStream>,
    /// The client is gone; what it sent may still wait in its lane.
    pub hung_up: bool,
    pub page: Page<ClientPage>,
    pub up: LaneReader,
    pub down: LaneWriter,
    /// What the client publishes in bulk, once it does.
    pub bulk: Option<Held>,
    /// The publishers whose bulk service the client has open, and since which generation.
    pub attached: BTreeMap<ClientId, u32>,
}

/// All clients' endpoints, and where what outlives the broker is kept.
pub(super) struct Peers {
    pub by_id: BTreeMap<ClientId, Peer>,
    /// Bulk values of publishers that are gone, as far as they are some variable's latest.
    pub departed: BTreeMap<ClientId, Samples>,
    /// The processes of clients of the broker that died before this one, by name, until they are back.
    pub awaited: BTreeMap<String, Option<ProcessId>>,
    pub namespace: HeldNamespace,
    pub epoch: u64,
    pub node: Option<Node<Service>>,
    /// Room for copies of bulk values.
    pub copies: Rc<Budget>,
    /// Clients that come over the network.
    pub remotes: Remotes,
}

impl Endpoints for Peers {
    fn progress(&self, id: ClientId) -> Option<Progress> {
        self.by_id.get(&id).map(|peer| peer.page.progress()).or_else(|| self.remotes.progress(id))
    }

    fn retire(&mut self, id: ClientId) {
        self.remotes.retire(id);
        if let Some(peer) = self.by_id.get(&id) {
            peer.page.retire.store(1, SeqCst);
            peer.page.bell.ring();
        }
    }

    fn monotonic_nanos(&self) -> u64 {
        monotonic_nanos()
    }

    fn keep_sessions(&mut self, sessions: Vec<(ClientId, Session)>) {
        let process = |holder, name: &str| {
            let here = self.by_id.get(&holder).map(|peer| peer.process);
            here.or_else(|| self.awaited.get(name).copied()).flatten()
        };
        let held = |(holder, session): (ClientId, Session)| sessions::Held {
            process: process(holder, &session.name),
            session,
        };
        // Whoever comes over the network comes back as a stranger, and says all again.
        let stays = |(holder, _): &(ClientId, Session)| self.remotes.progress(*holder).is_none();
        let all: Vec<sessions::Held> = sessions.into_iter().filter(stays).map(held).collect();
        if let Err(error) = sessions::write(&self.namespace, &all) {
            tell(format_args!(
                "elk db: should this broker die, its clients are not known to the next: {error}{}",
                scarce::hint()
            ));
        }
    }

    fn keep_retained(&mut self, retained: Vec<Retained>) {
        if let Err(error) = sessions::write_retained(&self.namespace, &retained) {
            tell(format_args!(
                "elk db: should this broker die, what was left by clients that are gone is lost: {error}"
            ));
        }
    }

    /// It rings when it has handled a batch.
    fn watch(&mut self, id: ClientId) {
        if let Some(peer) = self.by_id.get(&id) {
            peer.page.broker_waits.store(1, SeqCst);
        }
    }

    fn bulk(&self, reference: BulkRef) -> Option<&[u8]> {
        let here = self.by_id.get(&reference.client).and_then(|peer| Some(&peer.bulk.as_ref()?.samples));
        here.or_else(|| self.departed.get(&reference.client))?.get(reference.sample)
    }

    fn attach(&mut self, receiver: ClientId, publisher: ClientId) {
        if receiver == publisher {
            self.open_bulk_of(publisher);
        } else if let Some(page) = self.by_id.get(&publisher).map(|p| &p.page) {
            let generation = page.attachments.fetch_add(1, SeqCst).wrapping_add(1);
            if let Some(peer) = self.by_id.get_mut(&receiver) {
                peer.attached.insert(publisher, generation);
            }
        }
    }

    /// Whoever took over mail with bulk values in it is who has to handle them.
    fn follow(&mut self, succession: &Succession) {
        let held = self.by_id.values_mut().filter_map(|peer| peer.bulk.as_mut());
        held.for_each(|held| held.follow(succession));
    }
}

impl WithRemotes for Peers {
    fn remotes(&mut self) -> &mut Remotes {
        &mut self.remotes
    }
}

impl Peers {
    fn open_bulk_of(&mut self, publisher: ClientId) {
        let (Some(node), Some(peer)) = (&self.node, self.by_id.get_mut(&publisher)) else {
            return;
        };
        let open = || Samples::open(node, &lane_name(self.epoch, "bulk", publisher), &self.copies);
        match scarce::room().and_then(|()| open()) {
            Ok(samples) => peer.bulk = Some(Held::new(samples)),
            // Its values travel in batches then.
            Err(error) => {
                peer.page.bulk_refused.store(1, Release);
                tell(format_args!("elk db: large values of client {} are copied: {error}", peer.name));
            }
        }
        peer.page.attachments.fetch_add(1, SeqCst);
    }

    /// What a client publishes in bulk.
    pub fn held(&mut self, publisher: ClientId) -> Option<&mut Held> {
        self.by_id.get_mut(&publisher)?.bulk.as_mut()
    }

    /// What a receiver can use of a message whose value lies in shared memory: the reference, if the value reached its own
    /// end of the bulk service; else a copy, with the hint to open one.
    pub fn place_bulk(&self, (id, to): (ClientId, &Peer), largest: usize, frame: &Frame<'_>, batch: &mut Vec<u8>) {
        let Some(reference) = BulkRef::from_bytes(frame.value) else {
            return;
        };
        let reached = to.attached.get(&reference.client).is_some_and(|since| *since <= reference.generation);
        let in_place = reached && frame.header.flags & LATEST == 0;
        match self.bulk(reference).filter(|_| !in_place) {
            Some(kept) => {
                // Of a publisher's own service its `Attached` says that it is there.
                let others = reference.client != id && self.by_id.contains_key(&reference.client);
                let tell = others && !to.attached.contains_key(&reference.client);
                let attach = if tell { ATTACH } else { 0 };
                let publisher = reference.client.to_le_bytes();
                let aux: &[u8] = if tell { &publisher } else { frame.aux };
                // No room for a copy: the receiver counts it as missed, and finds the next one in place.
                let (bulk, value) = if kept.len() > largest { (BULK, frame.value) } else { (0, kept) };
                let flags = frame.header.flags & !BULK | bulk | attach;
                wire::put(batch, &wire::Header { flags, ..frame.header }, aux, value);
            }
            // In place; or gone before it could be copied: then the receiver finds nothing behind the reference, and counts.
            None => batch.extend_from_slice(frame.bytes),
        }
    }

    /// Lets go of the bulk values of publishers that are gone, but for those that are some variable's latest; answers those
    /// for which there was no room.
    pub fn tidy_departed(&mut self, broker: &Broker) -> Vec<(ClientId, Vec<(u64, usize)>)> {
        let lost = self.departed.iter_mut().map(|(id, samples)| {
            samples.let_go(u64::MAX, |sample| broker.is_latest_bulk(*id, sample));
            (*id, samples.take_lost())
        });
        let lost = lost.collect();
        self.departed.retain(|_, samples| !samples.is_empty());
        lost
    }
}

/// A batch where it lies: in the lane, or, copied from the page, in a buffer.
pub(super) enum Taken<'a> {
    Small(&'a [u8]),
    Lane(LaneSample),
}

impl std::ops::Deref for Taken<'_> {
    type Target = [u8];
    fn deref(&self) -> &[u8] {
        match self {
            Taken::Small(bytes) => bytes,
            Taken::Lane(sample) => sample.payload(),
        }
    }
}

impl Peer {
    /// The next batch; a small one is copied into `buffer`, since its client could still write to the page.
    pub fn next_batch<'a>(&self, buffer: &'a mut Vec<u8>) -> Result<Option<Taken<'a>>, LinkError> {
        match self.page.up.get(self.page.up_taken.load(Relaxed)) {
            Some(small) => {
                buffer.clear();
                buffer.extend_from_slice(small);
                Ok(Some(Taken::Small(buffer)))
            }
            None => Ok(self.up.receive()?.map(Taken::Lane)),
        }
    }

    /// Who has sent something, or has written over its page, and how.
    pub fn is_due((id, peer): (&ClientId, &Self)) -> Option<(ClientId, Option<&'static str>)> {
        let fault = peer.page.fault();
        (fault.is_some() || peer.has_sent()).then_some((*id, fault))
    }

    pub fn has_sent(&self) -> bool {
        (1..=DEPTH).contains(&self.page.on_the_way_up())
    }

    pub fn has_room(&self) -> bool {
        self.page.on_the_way_down() < DEPTH
    }
}

impl ClientPage {
    /// How far the client is with its mail.
    pub(super) fn progress(&self) -> Progress {
        Progress {
            handled: self.handled.load(Acquire),
            first_handled_at: self.first_handled_at.load(SeqCst),
            last_handled_at: self.last_handled_at.load(Relaxed),
        }
    }
}
