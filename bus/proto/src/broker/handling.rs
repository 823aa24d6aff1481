//! Who has handled what: a publisher's batch is done with once all who got mail from it have handled that mail.

use super::state::Broker;
use super::state::reached::{Reached, Succession};
use crate::wire::ClientId;

/// Batches that a broker remembers as not handled by everybody. Older ones count as handled: their publisher has let go
/// of them long before.
const UNHANDLED_BATCHES: usize = 4096;

/// Bytes that it takes to remember who got mail from a batch.
fn bytes_of(reached: &[Reached]) -> usize {
    size_of::<(u64, Box<[Reached]>)>() + size_of_val(reached)
}

impl Broker {
    /// Remembers whose mail has to be handled before the batch that was just taken counts as handled.
    pub(super) fn note_unhandled(&mut self, from: ClientId) {
        let reached = self.reached();
        let share = self.config.limits.unhandled_bytes / self.sessions.clients.len().max(1);
        let Some(client) = self.sessions.clients.get_mut(&from) else { return };
        client.taken += 1;
        if !reached.is_empty() {
            client.unhandled_bytes += bytes_of(&reached);
            client.unhandled.push_back((client.taken, reached.into()));
        }
        while client.unhandled.len() > UNHANDLED_BATCHES || client.unhandled_bytes > share {
            let Some((_, oldest)) = client.unhandled.pop_front() else { return };
            client.unhandled_bytes -= bytes_of(&oldest);
        }
    }

    /// Who got mail from the batch that was taken in last.
    pub fn reached(&self) -> Vec<Reached> {
        let reached = |id: &ClientId| {
            let mailbox = &self.sessions.clients.get(id)?.mailbox;
            Some(Reached { client: *id, position: mailbox.pushed(), lossless: mailbox.is_lossless() })
        };
        self.reached.iter().filter_map(reached).collect()
    }

    /// The batch of a client up to which everybody has handled what they were to get of it; what it published until
    /// then will not be asked for again, should the broker die.
    pub fn handled_batches(&mut self, id: ClientId) -> u64 {
        let Some(client) = self.sessions.clients.get(&id) else { return 0 };
        let behind = |r: &Reached| self.mail_done(r.client).is_some_and(|done| done < r.position);
        let handled = |(_, reached): &&(u64, Box<[Reached]>)| !reached.iter().any(behind);
        let count = client.unhandled.iter().take_while(handled).count();
        let Some(client) = self.sessions.clients.get_mut(&id) else { return 0 };
        client.unhandled_bytes -= client.unhandled.drain(..count).map(|(_, reached)| bytes_of(&reached)).sum::<usize>();
        client.unhandled.front().map_or(client.taken, |(batch, _)| batch - 1)
    }

    /// The position up to which a client is done with its mail; `None`: there is no such client.
    pub fn mail_done(&self, id: ClientId) -> Option<u64> {
        self.sessions.clients.get(&id).map(|c| c.mailbox.done())
    }

    /// Whoever waits for the predecessor to handle its mail waits for the successor now.
    pub(super) fn note_succession(&mut self, predecessor: ClientId, successor: ClientId) {
        let Some(client) = self.sessions.clients.get(&successor) else { return };
        let succession = Succession { predecessor, successor, position: client.mailbox.pushed() };
        for client in self.sessions.clients.values_mut() {
            let reached = client.unhandled.iter_mut().flat_map(|(_, reached)| reached);
            reached.for_each(|reached| reached.follow(&succession));
        }
        self.actions.follow.push_back(succession);
    }
}
