//! The latest values: kept for those who come late, accounted for, and forgotten.

use super::message::{Message, bulk_of};
use super::{Broker, ClientId};
use crate::wire::{self, RESENT};

impl Broker {
    pub(super) fn keep_as_latest(&mut self, now: f64, from: Option<ClientId>, message: &Message<'_>) {
        let variable = &mut self.variables[message.header.key as usize];
        // What is sent again after a broker's death is not newer for that.
        let resent = message.header.flags & RESENT != 0;
        if resent && wire::first_frame(&variable.latest).is_ok_and(|f| f.header.time > message.header.time) {
            return;
        }
        if let Some(old) = bulk_of(&variable.latest) {
            self.latest_bulk.remove(&(old.client, old.sample));
        }
        self.latest_bytes += message.len();
        self.latest_bytes -= variable.latest.len();
        variable.keep(now, from, message);
        if let Some(new) = bulk_of(&variable.latest) {
            self.latest_bulk.insert((new.client, new.sample));
        }
    }

    /// The latest value of a variable is about to be another one. Whoever is still owed it is given the new one, and who is
    /// to be given everything the old one as well.
    pub(super) fn settle_owed(&mut self, now: f64, key: u32) {
        let variable = &mut self.variables[key as usize];
        if !std::mem::take(&mut variable.owed) {
            return;
        }
        for client in self.clients.values_mut() {
            if let Some(flags) = client.mailbox.no_longer_owes(key)
                && client.mailbox.is_lossless()
                && let Some(latest) = variable.latest_message(flags)
            {
                client.mailbox.push(now, &latest, self.config.lossless_patience_secs);
            }
        }
    }

    /// The value of a bulk sample is gone: the variables whose latest value it was have none. Answers their names.
    pub fn forget_latest_bulk(&mut self, client: ClientId, sample: u64) -> Vec<String> {
        if !self.latest_bulk.remove(&(client, sample)) {
            return Vec::new();
        }
        let mut names = Vec::new();
        for (key, variable) in (0..).zip(&mut self.variables) {
            if bulk_of(&variable.latest).is_some_and(|bulk| (bulk.client, bulk.sample) == (client, sample)) {
                self.latest_bytes -= variable.latest.len();
                variable.latest = Vec::new();
                names.push(self.keys.name(key).to_owned());
            }
        }
        names
    }

    /// Whether a bulk sample is some variable's latest value, so that late registrants will want it.
    pub fn is_latest_bulk(&self, client: ClientId, sample: u64) -> bool {
        self.latest_bulk.contains(&(client, sample))
    }

    /// What was written to a variable is forgotten, its type with it.
    pub(super) fn forget_value(&mut self, key: u32) {
        let variable = &mut self.variables[key as usize];
        if let Some(bulk) = bulk_of(&variable.latest) {
            self.latest_bulk.remove(&(bulk.client, bulk.sample));
        }
        self.latest_bytes -= variable.latest.len();
        (variable.lock, variable.latest) = (None, Vec::new());
    }
}
