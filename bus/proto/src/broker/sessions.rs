//! The sessions of a community: who holds which name, and who is awaited.

use std::collections::{BTreeMap, BTreeSet};

use super::{Client, ClientId};

/// All clients, those that are gone and have a session included.
pub(super) struct Sessions {
    pub clients: BTreeMap<ClientId, Client>,
    /// The holders of names.
    pub names: BTreeMap<String, ClientId>,
    pub next_client: ClientId,
    /// Bytes of all batches that clients were given and have not handled.
    pub given_bytes: usize,
    /// Numbers that all clients together have given to names.
    pub numbers: usize,
    /// Clients that have come back after a broker's death and have not yet said again all that they have to.
    pub returning: BTreeSet<ClientId>,
    /// Until then (s) nobody new takes over a session before they have.
    pub returns_awaited_until: Option<f64>,
}

impl Sessions {
    /// Nobody is there; the first client will have the number `next_client`.
    pub fn new(next_client: ClientId) -> Self {
        Self {
            clients: BTreeMap::new(),
            names: BTreeMap::new(),
            next_client,
            given_bytes: 0,
            numbers: 0,
            returning: BTreeSet::new(),
            returns_awaited_until: None,
        }
    }

    /// Adds a client, under the next number.
    pub fn add(&mut self, client: Client) -> ClientId {
        let id = self.next_client;
        self.next_client += 1;
        self.numbers += client.given_numbers();
        self.clients.insert(id, client);
        id
    }

    /// Takes a client out, with what it had of what all have together.
    pub fn remove(&mut self, id: ClientId) -> Option<Client> {
        let client = self.clients.remove(&id)?;
        self.numbers -= client.given_numbers();
        self.given_bytes -= client.mailbox.given_bytes();
        Some(client)
    }
}
