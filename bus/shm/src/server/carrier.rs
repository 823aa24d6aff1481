//! Carries batches from the clients' lanes into the broker, and mail from the broker into the lanes.

use std::collections::BTreeSet;
use std::sync::Arc;
use std::sync::atomic::Ordering::{Acquire, Relaxed, Release, SeqCst};

use elk_moos::gateway::Gateway;
use elk_os::clock::Clock;
use elk_os::tell;
use elk_proto::community::Community;
use elk_proto::host::Host;
use elk_proto::wire::{ClientId, Frame};

use super::bulk_values::{Held, bulk_values_of};
use super::peers::{Peer, Peers};
use crate::page::{BrokerPage, Page};
use crate::{handshake, lane};

/// A batch of mail is closed when it holds this many bytes.
const BATCH_BYTES: usize = 64 << 10;
/// Buffers for batches of mail that are kept for the next ones.
const SPARE_BUFFERS: usize = 16;

/// The broker and its clients' ends.
pub(super) struct Carrier {
    pub community: Community,
    pub clock: Clock,
    pub host: Host,
    pub peers: Peers,
    pub page: Arc<Page<BrokerPage>>,
    /// Where clients of MOOS' come in, if they may.
    pub gateway: Option<Gateway>,
    /// Buffers for batches of mail.
    spare: Vec<Vec<u8>>,
}

impl Carrier {
    /// Nobody has been let in yet.
    pub fn new(
        community: Community,
        clock: Clock,
        host: Host,
        peers: Peers,
        page: Arc<Page<BrokerPage>>,
        gateway: Option<Gateway>,
    ) -> Self {
        Self { community, clock, host, peers, page, gateway, spare: Vec::new() }
    }

    /// What has come over the network.
    pub fn take_in_from_afar(&mut self, now: f64) -> bool {
        self.gateway.as_mut().is_some_and(|gateway| gateway.take_in(now, &mut self.host, &mut self.peers))
    }

    /// One batch from each client that has sent any; whoever has written over its page is let go of.
    pub fn take_batches(&mut self, now: f64) -> bool {
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

    pub fn take_batch(&mut self, now: f64, id: ClientId) -> bool {
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
    pub fn hand_out(&mut self, now: f64) -> bool {
        // Who wants every message (a logger, say) is in no hurry.
        let (leisurely, urgent) = self.host.broker.with_mail().partition(|id| self.host.broker.is_lossless(*id));
        let afar = self.gateway.as_mut().is_some_and(|gateway| gateway.hand_out(now, &mut self.host, &mut self.peers));
        let any = self.hand_out_to_all(now, urgent) | self.hand_out_to_all(now, leisurely) | afar;
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
        let resolve = |frame: &Frame<'_>, batch: &mut Vec<u8>| self.peers.place_bulk((id, peer), largest, frame, batch);
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

    /// What can wait until a round is over.
    pub fn follow_up(&mut self, now: f64) {
        self.note_lost();
        self.host.follow_up(now, &mut self.peers);
    }
}
