//! All variables of a community, and what they hold all together.

use std::collections::BTreeSet;
use std::ops::{Index, IndexMut};

use super::message::Message;
use super::variable::{Due, Variable};
use crate::wire::ClientId;

/// The variables, by the numbers of their keys.
#[derive(Debug, Default)]
pub struct Variables {
    pub all: Vec<Variable>,
    /// Bytes of all latest values.
    pub latest_bytes: usize,
    /// The latest values that lie in shared memory: (publisher, sample, variable).
    pub latest_bulk: BTreeSet<(ClientId, u64, u32)>,
    /// Pairs of a variable and a source.
    pub routes: usize,
    /// Who gets what of these pairs: the entries of all routes.
    pub deliveries: usize,
    /// Bytes of messages that wait until a client's interval is over.
    pub pending_bytes: usize,
    /// When the time of these comes: (due, variable, client).
    pub due: BTreeSet<(Due, u32, ClientId)>,
    /// Whose writes of which type were held against what readers expect: (variable, client, type).
    compared: BTreeSet<(u32, ClientId, u32)>,
}

/// So many of these are remembered.
const COMPARED: usize = 1 << 14;

impl Variables {
    /// Adds the next one.
    pub fn add(&mut self, variable: Variable) {
        self.all.push(variable);
    }

    pub fn len(&self) -> usize {
        self.all.len()
    }

    pub fn get(&self, key: u32) -> Option<&Variable> {
        self.all.get(key as usize)
    }

    pub fn iter(&self) -> impl Iterator<Item = &Variable> {
        self.all.iter()
    }

    pub fn iter_mut(&mut self) -> impl Iterator<Item = &mut Variable> {
        self.all.iter_mut()
    }

    /// Holds a message back until `interval` (s) is over since the last one that client `to` was sent, in place of the one
    /// that waits already; `false`: it is to be sent now. At most `most` bytes wait, of all clients.
    pub fn holds(&mut self, now: f64, to: ClientId, interval: f64, message: &Message<'_>, most: usize) -> bool {
        let Self { all, pending_bytes, due: all_due, .. } = self;
        let key = message.header.key;
        let throttle = all[key as usize].throttle(to);
        let earliest = Due(throttle.last_sent + interval);
        let waiting = throttle.pending.as_ref().map_or(0, |(_, frame)| frame.len());
        let has_room = *pending_bytes - waiting + message.len() <= most;
        *pending_bytes -= waiting;
        match &mut throttle.pending {
            Some((due, frame)) if has_room => {
                if earliest < *due {
                    all_due.remove(&(*due, key, to));
                    all_due.insert((earliest, key, to));
                    *due = earliest;
                }
                frame.clear();
                message.append_to(frame);
            }
            None if has_room && now < earliest.0 => {
                throttle.pending = Some((earliest, message.to_bytes()));
                all_due.insert((earliest, key, to));
            }
            pending => {
                if let Some((due, _)) = pending.take() {
                    all_due.remove(&(due, key, to));
                }
                throttle.last_sent = now;
                return false;
            }
        }
        *pending_bytes += message.len();
        true
    }

    /// What waits for a client's time to come does so no longer; the message that did.
    pub fn end_wait(&mut self, key: u32, client: ClientId) -> Option<Vec<u8>> {
        let (due, frame) = self[key].take_pending(client)?;
        self.pending_bytes -= frame.len();
        self.due.remove(&(due, key, client));
        Some(frame)
    }

    /// Forgets to whom a client's messages went and what it was to get.
    pub fn end_deliveries(&mut self, client: ClientId) {
        for key in 0..self.all.len() as u32 {
            self.end_wait(key, client);
            let variable = &mut self[key];
            variable.routes.iter_mut().for_each(|route| route.deliveries.retain(|d| d.client != client));
            variable.throttles.retain(|t| t.client != client);
        }
    }

    /// The next message that has waited until now.
    pub fn take_due(&mut self, now: f64) -> Option<(ClientId, Vec<u8>)> {
        let (_, key, client) = *self.due.first().filter(|(due, ..)| due.0 <= now)?;
        self.due.pop_first();
        let throttle = self[key].throttle(client);
        throttle.last_sent = now;
        let (_, frame) = throttle.pending.take()?;
        self.pending_bytes -= frame.len();
        Some((client, frame))
    }

    /// Notes that a client's write of a type is held against what the readers of a variable expect; `false`: it was before.
    /// Two clients that write two versions in turn are so looked at once each.
    pub fn note_compared(&mut self, key: u32, client: ClientId, type_: u32) -> bool {
        if self.compared.len() >= COMPARED {
            self.compared.clear();
        }
        self.compared.insert((key, client, type_))
    }

    /// Somebody begins to read a variable: what is written there is looked at again.
    pub fn forget_compared(&mut self, key: u32) {
        let of_key = self.compared.range((key, 0, 0)..=(key, ClientId::MAX, u32::MAX));
        for one in of_key.copied().collect::<Vec<_>>() {
            self.compared.remove(&one);
        }
    }

    /// When the next of these is due (s).
    pub fn next_due(&self) -> f64 {
        self.due.first().map_or(f64::INFINITY, |(due, ..)| due.0)
    }
}

impl Index<u32> for Variables {
    type Output = Variable;
    #[inline]
    fn index(&self, key: u32) -> &Variable {
        &self.all[key as usize]
    }
}

impl IndexMut<u32> for Variables {
    #[inline]
    fn index_mut(&mut self, key: u32) -> &mut Variable {
        &mut self.all[key as usize]
    }
}
