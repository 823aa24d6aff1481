//! What a transport carries to the clients, and what it says of how that went.

use super::state::Broker;
use super::state::client::Client;
use super::state::mailbox::Table;
use super::state::message::Message;
use super::state::names::Names;
use super::state::variables::Variables;
use crate::wire::{self, BulkRef, ClientId, Frame, Named};

/// What a mailbox has to tell of names and values.
struct Told<'a> {
    names: &'a Names,
    variables: &'a Variables,
}

impl Table for Told<'_> {
    fn define(&self, what: Named, number: u32, batch: &mut Vec<u8>) {
        let (name, layout, description) = self.names.said(what, number);
        wire::put_definition(batch, what, number, name, layout, description);
    }

    fn latest(&self, key: u32, flags: u16) -> Option<Message<'_>> {
        self.variables.get(key)?.latest_message(flags)
    }
}

impl Broker {
    /// Whether the client's next batch has to wait: for a lossless registrant whose mailbox is full, or until the client
    /// has the session that it came for.
    pub fn holds_back(&self, now: f64, from: ClientId) -> bool {
        let patience = self.config.lossless_patience();
        let full = |id: &ClientId| self.sessions.clients.get(id).is_some_and(|c| c.mailbox.holds_back(now, patience));
        let client = self.sessions.clients.get(&from);
        client.is_some_and(|client| client.waits_for_its_session() || client.feeds.iter().any(full))
    }

    /// Whether publishers wait until a client has read what they sent it. One that has stopped reading is waited for with
    /// limited patience; one that died, as long as its session is kept.
    pub fn waits_for(&self, now: f64, id: ClientId) -> bool {
        let patience = self.config.lossless_patience();
        let reads = |c: &Client| c.mailbox.is_waited_for(now, patience);
        self.sessions.is_disconnected(id) || self.sessions.clients.get(&id).is_some_and(reads)
    }

    /// The clients that have mail waiting, or notices, and are there to take it.
    pub fn with_mail(&self) -> impl Iterator<Item = ClientId> + '_ {
        self.sessions.clients.iter().filter(|(_, c)| !c.mailbox.is_empty() && !c.is_disconnected()).map(|(id, _)| *id)
    }

    /// Moves a client's mail into `batch` until it holds `max` bytes (a single message may be longer). Messages whose
    /// value lies in shared memory go through `bulk`, which appends what the client can use.
    pub fn take_mail(
        &mut self,
        id: ClientId,
        max: usize,
        batch: &mut Vec<u8>,
        bulk: impl FnMut(&Frame<'_>, &mut Vec<u8>),
    ) {
        let Self { sessions, names, variables, .. } = self;
        let told = Told { names, variables };
        if let Some(client) = sessions.clients.get_mut(&id) {
            client.mailbox.take(max, batch, &told, bulk);
        }
    }

    /// Whether a client may be given more mail: only so much of what it has not handled is kept.
    pub fn may_give(&self, id: ClientId) -> bool {
        self.sessions.clients.get(&id).is_some_and(|client| client.mailbox.may_give())
    }

    /// Puts values in the place of references in the mail of a client that is dead and may have a successor: until that one
    /// comes, the values could be gone. `bulk` finds what there is. See [`super::Action::Resolve`].
    pub fn resolve_mail<'a>(&mut self, id: ClientId, bulk: impl Fn(BulkRef) -> Option<&'a [u8]>) {
        if let Some(client) = self.sessions.clients.get_mut(&id) {
            client.mailbox.resolve(bulk);
        }
    }

    /// Keeps the batch that [`Broker::take_mail`] has filled until the client has handled it: should it die before that,
    /// its successor is given what is left.
    pub fn keep_given(&mut self, id: ClientId, batch: Vec<u8>) {
        if let Some(client) = self.sessions.clients.get_mut(&id) {
            self.sessions.given_bytes += batch.len();
            client.mailbox.keep_given(batch);
        }
    }

    /// The batch that a client was given last, until it has handled it.
    pub fn last_given(&self, id: ClientId) -> Option<&[u8]> {
        self.sessions.clients.get(&id)?.mailbox.last_given()
    }

    /// Bytes of all batches that clients were given and have not handled.
    pub fn given_bytes(&self) -> usize {
        self.sessions.given_bytes
    }

    /// A client has handled so many of the messages that it was ever given; the buffers of batches that are done with
    /// go to `spare`.
    pub fn note_handled(&mut self, now: f64, id: ClientId, messages: u64, spare: &mut Vec<Vec<u8>>) {
        if let Some(client) = self.sessions.clients.get_mut(&id) {
            let before = client.mailbox.given_bytes();
            spare.extend(client.mailbox.handled(now, messages));
            self.sessions.given_bytes -= before - client.mailbox.given_bytes();
        }
    }

    /// A client came too late to read so many of the bulk values that it was ever given references to.
    pub fn note_missed(&mut self, id: ClientId, values: u64) {
        if let Some(client) = self.sessions.clients.get_mut(&id) {
            client.mailbox.note_missed(values);
        }
    }

    /// Whether [`Broker::note_handled`] with so many messages would bring any news.
    pub fn would_settle(&self, id: ClientId, messages: u64) -> bool {
        self.sessions.clients.get(&id).is_some_and(|c| c.mailbox.would_settle(messages))
    }

    /// Whether nothing waits for a client, and nothing is under way to it.
    pub fn is_idle(&self, id: ClientId) -> bool {
        self.sessions.clients.get(&id).is_some_and(|c| c.mailbox.is_idle())
    }

    /// Whether publishers wait for this client.
    pub fn is_lossless(&self, id: ClientId) -> bool {
        self.sessions.clients.get(&id).is_some_and(|c| c.mailbox.is_lossless())
    }
}
