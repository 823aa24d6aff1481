//! The latest values: kept for those who come late, accounted for, and forgotten.

use super::state::Broker;
use super::state::message::{Message, bulk_of};
use super::state::variables::Variables;
use crate::wire::{self, ClientId, RESENT};

impl Variables {
    /// Keeps a message of client `from` as its variable's latest value; `None`: of the broker, or of somebody who is gone.
    pub fn keep_as_latest(&mut self, now: f64, from: Option<ClientId>, message: &Message<'_>) {
        let key = message.header.key;
        // What is sent again after a broker's death is not newer for that.
        let is_older = |latest: &[u8]| wire::first_frame(latest).is_ok_and(|f| f.header.time > message.header.time);
        if message.header.flags & RESENT != 0 && is_older(&self[key].latest) {
            return;
        }
        self.release_latest(key);
        let variable = &mut self.all[key as usize];
        variable.keep(now, from, message);
        self.latest_bytes += variable.latest.len();
        if let Some(bulk) = bulk_of(&variable.latest) {
            self.latest_bulk.insert((bulk.client, bulk.sample, key));
        }
    }

    /// The latest value of a variable is about to go: it no longer counts.
    fn release_latest(&mut self, key: u32) {
        let latest = &self.all[key as usize].latest;
        self.latest_bytes -= latest.len();
        if let Some(bulk) = bulk_of(latest) {
            self.latest_bulk.remove(&(bulk.client, bulk.sample, key));
        }
    }

    /// The latest value of a variable is forgotten.
    pub fn forget_latest(&mut self, key: u32) {
        self.release_latest(key);
        self[key].latest = Vec::new();
    }

    /// What was written to a variable is forgotten, its type with it.
    pub fn forget_value(&mut self, key: u32) {
        self.forget_latest(key);
        self[key].lock = None;
    }

    /// The variables whose latest value is this bulk sample.
    pub fn with_bulk(&self, client: ClientId, sample: u64) -> impl Iterator<Item = u32> {
        self.latest_bulk.range((client, sample, 0)..=(client, sample, u32::MAX)).map(|(.., key)| *key)
    }
}

impl Broker {
    /// The latest value of a variable is about to be another one. Whoever is still owed it is given the new one, and who is
    /// to be given everything the old one as well.
    pub(super) fn settle_owed(&mut self, now: f64, key: u32) {
        let variable = &mut self.variables[key];
        if !std::mem::take(&mut variable.owed) {
            return;
        }
        for client in self.sessions.clients.values_mut() {
            if let Some(flags) = client.mailbox.no_longer_owes(key)
                && client.mailbox.is_lossless()
                && let Some(latest) = variable.latest_message(flags)
            {
                client.mailbox.push(now, &latest, self.config.lossless_patience());
            }
        }
    }

    /// The value of a bulk sample is gone: the variables whose latest value it was have none. Answers their names.
    pub fn forget_latest_bulk(&mut self, client: ClientId, sample: u64) -> Vec<String> {
        let keys: Vec<u32> = self.variables.with_bulk(client, sample).collect();
        keys.iter().for_each(|key| self.variables.forget_latest(*key));
        keys.iter().map(|key| self.names.keys.name(*key).to_owned()).collect()
    }

    /// Whether a bulk sample is some variable's latest value, so that late registrants will want it.
    pub fn is_latest_bulk(&self, client: ClientId, sample: u64) -> bool {
        self.variables.with_bulk(client, sample).next().is_some()
    }
}
