//! Who is there: joining, leaving, dying, and taking over somebody's session.
//!
//! A **session** is a name with its registrations and its mail. That of a client that dies is **disconnected** and stays
//! for a while, if the client had asked for a lease. Whoever connects under that name is **joining**: what it registers is
//! noted, what it publishes waits, and once it says that it is ready it takes the session over. A successor of a client
//! that still lives is joining in just the same way; when it is ready the holder of the name is asked to retire, and its
//! session is disconnected for one moment. After the death of a broker, the next one begins with disconnected sessions
//! alone. So one mechanism serves a swap, a restart and a recovery.

use serde::{Deserialize, Serialize};

use super::message::Message;
use super::registration::{self, Change, Messages, Registration};
use super::{Broker, BrokerConfig, Client, ClientId};
use crate::wire::{self, ATTACH, Frame, FrameKind, Header};

/// Who wants in, and how.
#[derive(Debug, Clone, Copy)]
pub struct Introduction<'a> {
    /// Its name.
    pub name: &'a str,
    /// Which build of which program it is: for people, where two builds have different versions of a type; empty: not said.
    pub build: &'a str,
    /// How long its session is kept after its death (s); 0: not at all.
    pub lease_secs: f64,
    /// It comes to take over the session of the client that has the name.
    pub succeeds: bool,
    /// It was here under the broker before this one.
    pub returns: bool,
}

impl<'a> Introduction<'a> {
    /// A newcomer without any claims.
    pub fn new(name: &'a str) -> Self {
        Self { name, build: "", lease_secs: 0.0, succeeds: false, returns: false }
    }

    /// The same, come back after the broker's death.
    pub fn returning(self) -> Self {
        Self { succeeds: false, returns: true, ..self }
    }
}

/// Why a client was not let in.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
pub enum Refusal {
    /// Another client has the name.
    #[error("a client named {0:?} is already connected: give this one another name, or stop the other first")]
    NameTaken(String),
    /// Another successor was first.
    #[error("a successor of {0:?} is already on its way: wait for it, or stop it first")]
    SuccessorTaken(String),
    /// There are too many already.
    #[error("the community has {0} clients already, and no more are allowed")]
    Full(usize),
    /// The name cannot be one.
    #[error("{0:?} is no name for a client: 1 to 64 printable characters without comma, '*' or '?'")]
    BadName(String),
}

/// How a client stands to the community.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) enum Standing {
    /// It is there.
    Present,
    /// Its process is gone; its session is kept until then (s). `returns`: a client that lives and will be back.
    Disconnected { until: f64, returns: bool },
    /// It will take over the session of `predecessor`. `ready`: as soon as that one makes room.
    Joining { predecessor: ClientId, ready: bool },
}

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

/// How long those who take over sessions of the dead wait, after a broker's death, for those who live to come back and say
/// again what they know (s).
const RETURN_PATIENCE_SECS: f64 = 2.0;

/// The longest that a session is kept (s): a day.
const LONGEST_LEASE_SECS: f64 = 86_400.0;

const NAME_SEPARATORS: [char; 3] = [',', '*', '?'];

/// The longest build that is kept (characters): of a longer one its beginning is.
const LONGEST_BUILD: usize = 64;

impl Broker {
    /// A broker that takes the place of one that died: it keeps the `sessions` of the clients that were there, each with
    /// whether its process still lives and will return, for `patience` (s).
    pub fn recover(
        config: BrokerConfig,
        now: f64,
        sessions: impl IntoIterator<Item = (Session, bool)>,
        patience: f64,
    ) -> Self {
        let mut broker = Self::new(config, now);
        broker.time.driver_awaited_until = now + patience;
        broker.sessions.returns_awaited_until = Some(now + RETURN_PATIENCE_SECS);
        for (session, returns) in sessions {
            let id = broker
                .add_client(now, &Introduction { lease_secs: session.lease_secs, ..Introduction::new(&session.name) });
            let Some(client) = broker.sessions.clients.get_mut(&id) else { continue };
            client.standing = Standing::Disconnected { until: now + patience, returns };
            client.registrations = session.registrations;
            broker.mark_lossless(id);
            broker.sessions.names.insert(session.name, id);
        }
        broker
    }

    /// Lets a client in, or says why not. One that takes over a session is there once it has said that it is ready.
    pub fn connect(&mut self, now: f64, who: &Introduction<'_>) -> Result<ClientId, Refusal> {
        let name = who.name;
        let printable = |c: char| !c.is_control() && !NAME_SEPARATORS.contains(&c);
        if name.is_empty() || name.chars().count() > 64 || !name.chars().all(printable) {
            return Err(Refusal::BadName(name.into()));
        }
        if self.sessions.clients.len() >= self.config.limits.clients {
            return Err(Refusal::Full(self.config.limits.clients));
        }
        let holder = self.sessions.names.get(name).copied();
        if let Some(holder) = holder {
            self.may_succeed(holder, who)?;
        }
        let id = self.add_client(now, who);
        if who.returns {
            self.sessions.returning.insert(id);
        }
        match holder {
            Some(predecessor) => self.set_standing(id, Standing::Joining { predecessor, ready: false }),
            None => {
                self.sessions.names.insert(name.into(), id);
                self.wishes.keep_sessions = true;
                self.announce(now, &format!("connected={name}"));
            }
        }
        Ok(id)
    }

    fn may_succeed(&self, holder: ClientId, who: &Introduction<'_>) -> Result<(), Refusal> {
        if self.successor_of(holder).is_some() {
            return Err(Refusal::SuccessorTaken(who.name.into()));
        }
        let may = match self.standing(holder) {
            Some(Standing::Disconnected { returns, .. }) => !returns || who.returns,
            _ => who.succeeds,
        };
        if may { Ok(()) } else { Err(Refusal::NameTaken(who.name.into())) }
    }

    fn add_client(&mut self, now: f64, who: &Introduction<'_>) -> ClientId {
        let Introduction { name, build, lease_secs, .. } = *who;
        let lease_secs = if lease_secs.is_finite() { lease_secs.clamp(0.0, LONGEST_LEASE_SECS) } else { 0.0 };
        let build = build.chars().filter(|c| !c.is_control()).take(LONGEST_BUILD).collect();
        let client = Client { build, ..Client::new(name, lease_secs, self.config.mailbox_bytes, now) };
        let id = self.sessions.add(client);
        self.share_out_mail();
        id
    }

    pub(super) fn standing(&self, id: ClientId) -> Option<Standing> {
        self.sessions.clients.get(&id).map(|client| client.standing)
    }

    fn set_standing(&mut self, id: ClientId, standing: Standing) {
        if let Some(client) = self.sessions.clients.get_mut(&id) {
            client.standing = standing;
        }
    }

    fn successor_of(&self, id: ClientId) -> Option<ClientId> {
        let succeeds = |c: &Client| matches!(c.standing, Standing::Joining { predecessor, .. } if predecessor == id);
        self.sessions.clients.iter().find(|(_, client)| succeeds(client)).map(|(id, _)| *id)
    }

    /// Whether a client is on its way to the session of another.
    pub fn is_joining(&self, id: ClientId) -> bool {
        self.sessions.clients.get(&id).is_some_and(Client::is_joining)
    }

    /// Whether a client is gone and its session is kept.
    pub(super) fn is_disconnected(&self, id: ClientId) -> bool {
        matches!(self.standing(id), Some(Standing::Disconnected { .. }))
    }

    /// Whether somebody is on the way to the session of a name, or may still come for it.
    pub fn is_expected(&self, name: &str) -> bool {
        self.sessions.names.contains_key(name)
    }

    /// The client of this name that was to return will not: anybody may come for its session.
    pub fn expect_no_return(&mut self, name: &str) {
        let client = self.sessions.names.get(name).and_then(|id| self.sessions.clients.get_mut(id));
        if let Some(Standing::Disconnected { returns, .. }) = client.map(|client| &mut client.standing) {
            *returns = false;
        }
    }

    /// Whether the client's next batch has to wait until it has the session that it came for.
    pub(super) fn waits_for_its_session(client: &Client) -> bool {
        matches!(client.standing, Standing::Joining { ready: true, .. })
    }

    /// Whoever has said more than a mailbox holds has said enough to be ready.
    pub(super) fn on_much_said(&mut self, now: f64, id: ClientId) {
        let has_said_enough = |client: &Client| client.held.len() + client.asked.len() >= client.mailbox.limit();
        if self.sessions.clients.get(&id).is_some_and(has_said_enough) {
            self.on_ready(now, id);
        }
    }

    /// The client has said all that has to be said before its mail may flow; one that was here under the broker before this
    /// one says so a second time when it has said again what not everybody had heard.
    pub(super) fn on_ready(&mut self, now: f64, id: ClientId) {
        let Some(Standing::Joining { predecessor, ready: false }) = self.standing(id) else {
            self.sessions.returning.remove(&id);
            return;
        };
        self.set_standing(id, Standing::Joining { predecessor, ready: true });
        match self.standing(predecessor) {
            Some(Standing::Present) => {
                let name = self.client_name(id).unwrap_or_default().to_owned();
                self.publish_event(now, &format!("ready={name}"));
                self.wishes.retire.push_back(predecessor);
            }
            // What it asks for first is what those know who are on their way back.
            _ if self.awaits_returns(now) && !self.sessions.returning.contains(&id) => {}
            _ => self.take_over(now, id, predecessor),
        }
    }

    fn awaits_returns(&self, now: f64) -> bool {
        let is_to_return = |c: &Client| matches!(c.standing, Standing::Disconnected { returns: true, .. });
        let awaited = !self.sessions.returning.is_empty() || self.sessions.clients.values().any(is_to_return);
        awaited && self.sessions.returns_awaited_until.is_some_and(|until| now < until)
    }

    /// Gives those their sessions who waited for others to come back.
    pub(super) fn seat_those_who_wait(&mut self, now: f64) {
        if self.sessions.returns_awaited_until.is_none() || self.awaits_returns(now) {
            return;
        }
        self.sessions.returns_awaited_until = None;
        let waits = |(id, c): (&ClientId, &Client)| match c.standing {
            Standing::Joining { predecessor, ready: true } if self.is_disconnected(predecessor) => {
                Some((*id, predecessor))
            }
            _ => None,
        };
        let waiting: Vec<_> = self.sessions.clients.iter().filter_map(waits).collect();
        waiting.into_iter().for_each(|(id, predecessor)| self.take_over(now, id, predecessor));
    }

    /// A client is gone. `handled`: how many of the messages that it was ever given it has handled; `goodbye`: it left
    /// in good order. What it published stays; its name is free at once, unless its session is kept.
    pub fn disconnect(&mut self, now: f64, id: ClientId, handled: u64, goodbye: bool) {
        self.let_go_of_clock(now, id);
        self.sessions.returning.remove(&id);
        match self.standing(id) {
            None | Some(Standing::Disconnected { .. }) => {}
            Some(Standing::Joining { predecessor, .. }) => {
                self.sessions.remove(id);
                self.abandon(now, predecessor);
            }
            Some(Standing::Present) => self.leave(now, id, handled, goodbye),
        }
    }

    fn leave(&mut self, now: f64, id: ClientId, handled: u64, goodbye: bool) {
        let successor = self.successor_of(id);
        self.note_departure(id);
        let Some(client) = self.sessions.clients.get_mut(&id) else { return };
        let name = client.name.clone();
        if successor.is_some() || (!goodbye && client.lease_secs > 0.0) {
            let until = if successor.is_some() { f64::INFINITY } else { now + client.lease_secs };
            client.standing = Standing::Disconnected { until, returns: false };
            self.sessions.given_bytes -= client.mailbox.given_bytes();
            client.mailbox.take_back(handled);
            self.wishes.resolve.insert(id);
        } else {
            self.forget(id);
        }
        self.announce(now, &format!("disconnected={name}"));
        if let Some(successor) = successor
            && let Some(Standing::Joining { ready: true, .. }) = self.standing(successor)
        {
            self.take_over(now, successor, id);
        }
    }

    /// The successor of `id` is gone before it came.
    fn abandon(&mut self, now: f64, id: ClientId) {
        let Some(client) = self.sessions.clients.get_mut(&id) else { return };
        if let Standing::Disconnected { until, .. } = &mut client.standing {
            *until = until.min(now + client.lease_secs);
        }
    }

    /// Lets go of the sessions that nobody came for.
    pub(super) fn expire_sessions(&mut self, now: f64) {
        let expired = |c: &Client| matches!(c.standing, Standing::Disconnected { until, .. } if until <= now);
        let ids: Vec<ClientId> = self.sessions.clients.iter().filter(|(_, c)| expired(c)).map(|(id, _)| *id).collect();
        ids.into_iter().for_each(|id| self.forget(id));
    }

    /// When the next session expires (s).
    pub(super) fn next_expiry(&self) -> f64 {
        let until =
            |c: &Client| if let Standing::Disconnected { until, .. } = c.standing { until } else { f64::INFINITY };
        self.sessions.clients.values().map(until).fold(f64::INFINITY, f64::min)
    }

    fn forget(&mut self, id: ClientId) {
        let Some(client) = self.sessions.remove(id) else { return };
        if self.sessions.names.get(&client.name) == Some(&id) {
            self.sessions.names.remove(&client.name);
        }
        self.variables.deliveries -= client.deliveries;
        self.variables.end_deliveries(id);
        for other in self.sessions.clients.values_mut() {
            other.feeds.remove(&id);
        }
        self.wishes.keep_sessions = true;
        self.share_out_mail();
    }

    /// Gives `id` the session of `predecessor`, which is disconnected: first the latest values of what it registered for,
    /// then the predecessor's mail as far as it wants it, then what comes. A latest value that is still among that mail
    /// comes in its place there, not twice.
    fn take_over(&mut self, now: f64, id: ClientId, predecessor: ClientId) {
        let name = self.client_name(id).unwrap_or_default().to_owned();
        let dead = self.sessions.remove(predecessor);
        if let (Some(dead), Some(client)) = (&dead, self.sessions.clients.get_mut(&id)) {
            client.mailbox.inherit_dropped(&dead.mailbox);
        }
        self.variables.deliveries -= dead.as_ref().map_or(0, |dead| dead.deliveries);
        let mail = dead.map(|dead| dead.mailbox.into_mail()).unwrap_or_default();
        self.variables.end_deliveries(predecessor);
        for other in self.sessions.clients.values_mut() {
            if other.feeds.remove(&predecessor) {
                other.feeds.insert(id);
            }
        }
        self.sessions.names.insert(name.clone(), id);
        self.set_standing(id, Standing::Present);
        self.wishes.keep_sessions = true;
        let asked =
            self.sessions.clients.get_mut(&id).map(|client| std::mem::take(&mut client.asked)).unwrap_or_default();
        let change = |frame: Frame<'_>| Change::read(&frame, self.expected(id, &frame).ok()?).ok();
        let changes: Vec<Change> = wire::frames(&asked).flatten().filter_map(change).collect();
        let mut registrations = Vec::new();
        changes.iter().for_each(|change| change.apply(&mut registrations));
        let wanted = self.wanted(id, &registrations, &mail);
        let waiting: Messages = wanted.iter().map(|f| (f.header.key, f.header.source, f.header.sequence)).collect();
        for change in changes {
            self.change(now, id, change, &waiting);
        }
        for message in wanted.iter().filter_map(|frame| Message::stored(frame.bytes)) {
            self.deliver(now, id, &message);
        }
        self.note_succession(predecessor, id);
        self.announce(now, &format!("connected={name}"));
        self.publish_held(now, id);
    }

    /// The messages of `mail` that `registrations` ask for.
    fn wanted<'a>(&self, id: ClientId, registrations: &[Registration], mail: &'a [u8]) -> Vec<Frame<'a>> {
        let wants = |frame: &Frame<'_>| {
            let (key, source) = (self.names.keys.name(frame.header.key), self.names.sources.name(frame.header.source));
            registration::combine(id, registrations, key, source).is_some()
        };
        wire::frames(mail).map_while(Result::ok).filter(wants).collect()
    }

    /// What the client published before it had its session.
    fn publish_held(&mut self, now: f64, id: ClientId) {
        let held =
            self.sessions.clients.get_mut(&id).map(|client| std::mem::take(&mut client.held)).unwrap_or_default();
        for frame in wire::frames(&held).map_while(Result::ok) {
            // It was checked when it was taken; what is wrong with it costs the client only this message.
            let _ = self.notify(now, id, &frame);
        }
    }

    /// Keeps a message of a client that is joining until it has its session.
    pub(super) fn hold(&mut self, id: ClientId, key: u32, frame: &Frame<'_>) -> Result<(), &'static str> {
        debug_assert_eq!(frame.header.kind, FrameKind::Notify);
        if self.held_bytes() + frame.bytes.len() > self.config.limits.mail_bytes {
            let name = self.names.keys.name(key).to_owned();
            let reason = "too much is said by clients that wait for the session of another";
            return self.refuse(id, &name, frame.header.sequence, reason);
        }
        let client = self.sessions.clients.get_mut(&id).ok_or("the client is not connected")?;
        let header = Header { flags: frame.header.flags & !ATTACH, ..frame.header };
        wire::put(&mut client.held, &header, frame.aux, frame.value);
        Ok(())
    }

    /// The sessions, with their holders' numbers: what has to outlive the broker (see [`super::Wish::KeepSessions`]).
    pub fn sessions(&self) -> Vec<(ClientId, Session)> {
        let session = |client: &Client| Session {
            name: client.name.clone(),
            lease_secs: client.lease_secs,
            registrations: client.registrations.clone(),
        };
        self.sessions.names.values().filter_map(|id| Some((*id, session(self.sessions.clients.get(id)?)))).collect()
    }
}
