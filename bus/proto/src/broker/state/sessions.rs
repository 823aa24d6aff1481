//! The sessions of a community: who holds which name, and who is awaited.

use std::collections::{BTreeMap, BTreeSet};

use serde::{Deserialize, Serialize};

use super::client::{Client, Standing};
use super::registration::Registration;
use crate::wire::ClientId;

/// What a broker has to know of a client to keep its session after the broker's own death.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Session {
    /// The client's name.
    pub name: String,
    /// How long its session is kept after its death (s).
    pub lease_secs: f64,
    /// What it is registered for.
    pub registrations: Vec<Registration>,
}

/// All clients, those that are gone and have a session included.
pub struct Sessions {
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

    /// A client is on its way to the session of another.
    pub fn join(&mut self, id: ClientId, predecessor: ClientId) {
        if let Some(client) = self.clients.get_mut(&id) {
            client.standing = Standing::Joining { predecessor, ready: false };
        }
    }

    /// Takes a client out, with what it had of what all have together.
    pub fn remove(&mut self, id: ClientId) -> Option<Client> {
        let client = self.clients.remove(&id)?;
        self.numbers -= client.given_numbers();
        self.given_bytes -= client.mailbox.given_bytes();
        Some(client)
    }

    /// A client's name.
    pub fn name(&self, id: ClientId) -> Option<&str> {
        self.clients.get(&id).map(|client| client.name.as_str())
    }

    /// How a client stands to the community; `None`: it is unknown there.
    pub fn standing(&self, id: ClientId) -> Option<Standing> {
        self.clients.get(&id).map(|client| client.standing)
    }

    /// Whether a client is gone and its session is kept.
    pub fn is_disconnected(&self, id: ClientId) -> bool {
        self.clients.get(&id).is_some_and(Client::is_disconnected)
    }

    /// The clients that are there.
    pub fn present(&self) -> impl Iterator<Item = (&ClientId, &Client)> {
        self.clients.iter().filter(|(_, client)| client.standing == Standing::Present)
    }

    /// Who is on the way to a client's session.
    pub fn successor_of(&self, id: ClientId) -> Option<ClientId> {
        let succeeds = |c: &Client| matches!(c.standing, Standing::Joining { predecessor, .. } if predecessor == id);
        self.clients.iter().find(|(_, client)| succeeds(client)).map(|(id, _)| *id)
    }

    /// Whether somebody who lives is still to come back after a broker's death.
    pub fn awaits_returns(&self, now: f64) -> bool {
        let is_to_return = |c: &Client| matches!(c.standing, Standing::Disconnected { returns: true, .. });
        let awaited = !self.returning.is_empty() || self.clients.values().any(is_to_return);
        awaited && self.returns_awaited_until.is_some_and(|until| now < until)
    }

    /// Those who are ready for the sessions of others who are gone, each with whose it takes.
    pub fn ready_for_the_gone(&self) -> Vec<(ClientId, ClientId)> {
        let waits = |(id, c): (&ClientId, &Client)| match c.standing {
            Standing::Joining { predecessor, ready: true } if self.is_disconnected(predecessor) => {
                Some((*id, predecessor))
            }
            _ => None,
        };
        self.clients.iter().filter_map(waits).collect()
    }

    /// The sessions that nobody came for until `now` (s).
    pub fn expired(&self, now: f64) -> Vec<ClientId> {
        let expired = |c: &Client| matches!(c.standing, Standing::Disconnected { until, .. } if until <= now);
        self.clients.iter().filter(|(_, client)| expired(client)).map(|(id, _)| *id).collect()
    }

    /// When the next session expires (s).
    pub fn next_expiry(&self) -> f64 {
        let until =
            |c: &Client| if let Standing::Disconnected { until, .. } = c.standing { until } else { f64::INFINITY };
        self.clients.values().map(until).fold(f64::INFINITY, f64::min)
    }

    /// Bytes of what clients say before they have their sessions.
    pub fn held_bytes(&self) -> usize {
        self.clients.values().map(|client| client.held.len()).sum()
    }

    /// Registrations of all clients that are by pattern.
    pub fn patterns(&self) -> usize {
        self.clients.values().map(|client| client.registered_patterns).sum()
    }

    /// Bytes of the patterns of all registrations.
    pub fn registration_bytes(&self) -> usize {
        self.clients.values().map(|client| client.asked.len() + client.registered_bytes).sum()
    }

    /// What has to outlive the broker, with the holders' numbers.
    pub fn to_keep(&self) -> Vec<(ClientId, Session)> {
        let session = |client: &Client| Session {
            name: client.name.clone(),
            lease_secs: client.lease_secs,
            registrations: client.registrations.clone(),
        };
        self.names.values().filter_map(|id| Some((*id, session(self.clients.get(id)?)))).collect()
    }
}
