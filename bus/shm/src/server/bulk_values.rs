//! Which bulk values of a publisher are still wanted.

use std::collections::{BTreeSet, VecDeque};

use elk_proto::broker::{Broker, Reached, Succession};
use elk_proto::wire::{self, BulkRef, ClientId};

use crate::bulk::Samples;

/// Bulk values of a publisher that are kept for those who have not handled them; more are kept for lossless receivers
/// only, who are never so far behind.
const UNDER_WAY: usize = 8;

/// A publisher's bulk values that are still wanted.
pub(super) struct Held {
    pub samples: Samples,
    /// Values that not all who got them have handled: (sample, who).
    under_way: VecDeque<(u64, Vec<Reached>)>,
    /// The newest value that was referred to.
    routed: u64,
}

impl Held {
    /// Nothing of it has gone out yet.
    pub fn new(samples: Samples) -> Self {
        Self { samples, under_way: VecDeque::new(), routed: 0 }
    }

    /// Notes who has a value in its mail.
    pub fn note_under_way(&mut self, sample: u64, reached: Vec<Reached>) {
        self.routed = sample;
        self.under_way.push_back((sample, reached));
    }

    /// Gives up waiting for those who are far behind; whether there were any.
    pub fn make_room(&mut self) -> bool {
        let surplus = self.under_way.len().saturating_sub(UNDER_WAY);
        self.under_way.drain(..surplus);
        surplus > 0
    }

    /// Who would be given up on.
    pub fn far_behind(&self, broker: &Broker) -> Vec<ClientId> {
        let oldest = self.under_way.front().filter(|_| self.under_way.len() > UNDER_WAY);
        let reached = oldest.into_iter().flat_map(|(_, reached)| reached);
        reached.filter(|reached| is_behind(broker, reached)).map(|reached| reached.client).collect()
    }

    /// Notes who has taken over somebody's mail.
    pub fn follow(&mut self, succession: &Succession) {
        let reached = self.under_way.iter_mut().flat_map(|(_, reached)| reached);
        reached.for_each(|reached| reached.follow(succession));
    }

    /// Whether nobody is behind with any of it.
    pub fn is_settled(&self) -> bool {
        self.under_way.is_empty()
    }

    /// The sample up to which nobody is behind whom publishers wait for; those who are go to `awaited`.
    pub fn settled(&mut self, now: f64, broker: &Broker, awaited: &mut BTreeSet<ClientId>) -> Option<u64> {
        let behind = |r: &Reached| is_behind(broker, r);
        let mut settled = None;
        while let Some((sample, _)) = self.under_way.pop_front_if(|(_, reached)| !reached.iter().any(behind)) {
            settled = Some(sample);
        }
        let waited_for = |r: &&Reached| r.lossless && behind(r) && broker.waits_for(now, r.client);
        let rest = self.under_way.iter().take_while(|(_, reached)| !reached.iter().any(|r| waited_for(&r))).last();
        let waiting = self.under_way.iter().flat_map(|(_, reached)| reached).filter(waited_for);
        awaited.extend(waiting.map(|r| r.client));
        rest.map(|(sample, _)| *sample).or(settled)
    }

    /// Keeps the newest, those that not everybody is done with, and those that are a variable's latest value.
    pub fn let_go_of_unwanted(&mut self, is_latest: impl Fn(u64) -> bool) {
        // What has come and is not referred to yet stays as well.
        // As its publisher says, who may say what is not so.
        let next = self.routed.saturating_add(1);
        let oldest = self.under_way.front().map_or(next, |(sample, _)| *sample);
        self.samples.let_go(oldest, is_latest);
    }
}

/// Whether somebody whom a value reached has not handled it.
fn is_behind(broker: &Broker, reached: &Reached) -> bool {
    broker.mail_done(reached.client).is_some_and(|done| done < reached.position)
}

/// The client's own bulk values that a batch of it refers to. (The newest that has come may belong to a batch that has
/// not.)
pub(super) fn bulk_values_of(batch: &[u8], client: ClientId) -> impl Iterator<Item = u64> + '_ {
    let frames = wire::frames(batch).map_while(Result::ok).filter(|frame| wire::is_bulk(frame.bytes));
    let references = frames.filter_map(|frame| BulkRef::from_bytes(frame.value));
    references.filter(move |reference| reference.client == client).map(|reference| reference.sample)
}
