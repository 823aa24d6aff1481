//! Who is there: joining, leaving, dying, and taking over somebody's session.
//!
//! A **session** is a name with its registrations and its mail. That of a client that dies is **disconnected** and stays
//! for a while, if the client had asked for a lease. Whoever connects under that name is **joining**: what it registers is
//! noted, what it publishes waits, and once it says that it is ready it takes the session over. A successor of a client
//! that still lives is joining in just the same way; when it is ready the holder of the name is asked to retire, and its
//! session is disconnected for one moment. After the death of a broker, the next one begins with disconnected sessions
//! alone. So one mechanism serves a swap, a restart and a recovery.

use super::state::client::{Client, Standing};
use super::state::message::Message;
use super::state::registration::{self, Change, Messages, Registration};
use super::state::sessions::Session;
use super::state::{Broker, BrokerConfig};
use crate::wire::{self, ATTACH, ClientId, Frame, FrameKind, Header};

/// Who wants in, and how.
#[derive(Debug, Clone, Copy)]
pub struct Introduction<'a> {
    /// Its name.
    pub name: &'a str,
    /// Which build of which program it is: for people, where two builds have different versions of a type; empty: not said.
    pub build: &'a str,
    /// How long its session is kept after its death (s, the wall's); 0: not at all.
    pub lease_secs: f64,
    /// It comes to take over the session of the client that has the name.
    pub succeeds: bool,
    /// It was here under the broker before this one.
    pub returns: bool,
    /// It is in the broker's process, and its frames are in the broker's own numbers (see [`Broker::number_for`]).
    pub inside: bool,
}

impl<'a> Introduction<'a> {
    /// A newcomer without any claims.
    pub fn new(name: &'a str) -> Self {
        Self { name, build: "", lease_secs: 0.0, succeeds: false, returns: false, inside: false }
    }

    /// The same, come back after the broker's death.
    pub fn returning(self) -> Self {
        Self { succeeds: false, returns: true, ..self }
    }
}

/// Why a client was not let in.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
pub enum AdmissionError {
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

/// How long those who take over sessions of the dead wait, after a broker's death, for those who live to come back and say
/// again what they know (s, the wall's).
const RETURN_PATIENCE_SECS: f64 = 2.0;

/// The longest that a session is kept (s, the wall's): a day.
const LONGEST_LEASE_SECS: f64 = 86_400.0;

const NAME_SEPARATORS: [char; 3] = [',', '*', '?'];

/// The longest build that is kept (characters): of a longer one its beginning is.
const LONGEST_BUILD: usize = 64;

impl Broker {
    /// A broker that takes over from one that died: it keeps the `sessions` of the clients that were there, each with
    /// whether its process still lives and will return, for `patience` (s, the wall's).
    pub fn recover(
        config: BrokerConfig,
        now: f64,
        sessions: impl IntoIterator<Item = (Session, bool)>,
        patience: f64,
    ) -> Self {
        let mut broker = Self::new(config, now);
        let kept_until = now + broker.config.of_wall(patience);
        broker.time.driver_awaited_until = kept_until;
        broker.sessions.returns_awaited_until = Some(now + broker.config.of_wall(RETURN_PATIENCE_SECS));
        for (session, returns) in sessions {
            let id = broker
                .add_client(now, &Introduction { lease_secs: session.lease_secs, ..Introduction::new(&session.name) });
            let Some(client) = broker.sessions.clients.get_mut(&id) else { continue };
            client.standing = Standing::Disconnected { until: kept_until, returns };
            client.registrations = session.registrations;
            broker.mark_lossless(id);
            broker.sessions.names.insert(session.name, id);
        }
        broker
    }

    /// Lets a client in, or says why not. One that takes over a session is there once it has said that it is ready.
    pub fn connect(&mut self, now: f64, who: &Introduction<'_>) -> Result<ClientId, AdmissionError> {
        let name = who.name;
        let printable = |c: char| !c.is_control() && !NAME_SEPARATORS.contains(&c);
        if name.is_empty() || name.chars().count() > 64 || !name.chars().all(printable) {
            return Err(AdmissionError::BadName(name.into()));
        }
        if self.sessions.clients.len() >= self.config.limits.clients {
            return Err(AdmissionError::Full(self.config.limits.clients));
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
            Some(predecessor) => self.sessions.join(id, predecessor),
            None => {
                self.sessions.names.insert(name.into(), id);
                self.actions.keep_sessions = true;
                self.announce(now, &format!("connected={name}"));
            }
        }
        Ok(id)
    }

    fn may_succeed(&self, holder: ClientId, who: &Introduction<'_>) -> Result<(), AdmissionError> {
        if self.sessions.successor_of(holder).is_some() {
            return Err(AdmissionError::SuccessorTaken(who.name.into()));
        }
        let may = match self.sessions.standing(holder) {
            Some(Standing::Disconnected { returns, .. }) => !returns || who.returns,
            _ => who.succeeds,
        };
        if may { Ok(()) } else { Err(AdmissionError::NameTaken(who.name.into())) }
    }

    fn add_client(&mut self, now: f64, who: &Introduction<'_>) -> ClientId {
        let Introduction { name, build, lease_secs, .. } = *who;
        let lease_secs = if lease_secs.is_finite() { lease_secs.clamp(0.0, LONGEST_LEASE_SECS) } else { 0.0 };
        let build = build.chars().filter(|c| !c.is_control()).take(LONGEST_BUILD).collect();
        let is_inside = who.inside;
        let client = Client { build, is_inside, ..Client::new(name, lease_secs, self.config.mailbox_bytes, now) };
        let id = self.sessions.add(client);
        self.share_out_mail();
        id
    }

    /// Whether a client is on its way to the session of another.
    pub fn is_joining(&self, id: ClientId) -> bool {
        self.sessions.clients.get(&id).is_some_and(Client::is_joining)
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
        let joining = self.sessions.clients.get_mut(&id).and_then(|client| match &mut client.standing {
            Standing::Joining { predecessor, ready } if !*ready => {
                *ready = true;
                Some((*predecessor, client.name.clone()))
            }
            _ => None,
        });
        let Some((predecessor, name)) = joining else {
            self.sessions.returning.remove(&id);
            return;
        };
        match self.sessions.standing(predecessor) {
            Some(Standing::Present) => {
                self.publish_event(now, &format!("ready={name}"));
                self.actions.retire.push_back(predecessor);
            }
            // What it asks for first is what those know who are on their way back.
            _ if self.sessions.awaits_returns(now) && !self.sessions.returning.contains(&id) => {}
            _ => self.take_over(now, id, predecessor),
        }
    }

    /// Gives those their sessions who waited for others to come back.
    pub(super) fn seat_those_who_wait(&mut self, now: f64) {
        if self.sessions.returns_awaited_until.is_none() || self.sessions.awaits_returns(now) {
            return;
        }
        self.sessions.returns_awaited_until = None;
        let waiting = self.sessions.ready_for_the_gone();
        waiting.into_iter().for_each(|(id, predecessor)| self.take_over(now, id, predecessor));
    }

    /// A client is gone. `handled`: how many of the messages that it was ever given it has handled; `goodbye`: it left
    /// in good order. What it published stays; its name is free at once, unless its session is kept.
    pub fn disconnect(&mut self, now: f64, id: ClientId, handled: u64, goodbye: bool) {
        self.let_go_of_clock(now, id);
        self.sessions.returning.remove(&id);
        match self.sessions.standing(id) {
            None | Some(Standing::Disconnected { .. }) => {}
            Some(Standing::Joining { predecessor, .. }) => {
                self.sessions.remove(id);
                self.abandon(now, predecessor);
            }
            Some(Standing::Present) => self.leave(now, id, handled, goodbye),
        }
    }

    fn leave(&mut self, now: f64, id: ClientId, handled: u64, goodbye: bool) {
        let successor = self.sessions.successor_of(id);
        self.note_departure(id);
        let Some(client) = self.sessions.clients.get_mut(&id) else { return };
        let name = client.name.clone();
        if successor.is_some() || (!goodbye && client.lease_secs > 0.0) {
            let lease = self.config.of_wall(client.lease_secs);
            let until = if successor.is_some() { f64::INFINITY } else { now + lease };
            client.standing = Standing::Disconnected { until, returns: false };
            self.sessions.given_bytes -= client.mailbox.given_bytes();
            client.mailbox.take_back(handled);
            self.actions.resolve.insert(id);
        } else {
            self.forget(id);
            self.answer_anew(now);
        }
        self.announce(now, &format!("disconnected={name}"));
        if let Some(successor) = successor
            && let Some(Standing::Joining { ready: true, .. }) = self.sessions.standing(successor)
        {
            self.take_over(now, successor, id);
        }
    }

    /// The successor of `id` is gone before it came.
    fn abandon(&mut self, now: f64, id: ClientId) {
        let Some(client) = self.sessions.clients.get_mut(&id) else { return };
        if let Standing::Disconnected { until, .. } = &mut client.standing {
            *until = until.min(now + self.config.of_wall(client.lease_secs));
        }
    }

    /// Lets go of the sessions that nobody came for.
    pub(super) fn expire_sessions(&mut self, now: f64) {
        let expired = self.sessions.expired(now);
        if !expired.is_empty() {
            expired.into_iter().for_each(|id| self.forget(id));
            self.answer_anew(now);
        }
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
        self.actions.keep_sessions = true;
        self.share_out_mail();
    }

    /// Gives `id` the session of `predecessor`, which is disconnected: first the latest values of what it registered for,
    /// then the predecessor's mail as far as it wants it, then what comes. A latest value that is still among that mail
    /// comes there instead of it, not twice.
    fn take_over(&mut self, now: f64, id: ClientId, predecessor: ClientId) {
        let Some(client) = self.sessions.clients.get_mut(&id) else {
            debug_assert!(false, "client {id} takes a session over and is not there");
            return;
        };
        client.standing = Standing::Present;
        let (name, asked) = (client.name.clone(), std::mem::take(&mut client.asked));
        let mail = self.end_session(predecessor, id);
        self.sessions.names.insert(name.clone(), id);
        self.actions.keep_sessions = true;
        let change = |frame: Frame<'_>| Change::read(&frame, self.expected(id, &frame).ok()?).ok();
        let changes: Vec<Change> = wire::frames(&asked).flatten().filter_map(change).collect();
        let mut registrations = Vec::new();
        changes.iter().for_each(|change| change.apply(&mut registrations));
        let wanted = self.wanted(id, &registrations, &mail);
        let waiting: Messages = wanted.iter().map(|f| (f.header.key, f.header.source, f.header.sequence)).collect();
        for change in changes {
            self.change(now, id, change, &waiting);
        }
        self.answer_anew(now);
        for message in wanted.iter().filter_map(|frame| Message::stored(frame.bytes)) {
            self.deliver(now, id, &message);
        }
        self.note_succession(predecessor, id);
        self.announce(now, &format!("connected={name}"));
        self.publish_held(now, id);
    }

    /// A session is over that `successor` takes: its mail. One that has expired meanwhile has none.
    fn end_session(&mut self, id: ClientId, successor: ClientId) -> Vec<u8> {
        self.variables.end_deliveries(id);
        for client in self.sessions.clients.values_mut() {
            if client.feeds.remove(&id) {
                client.feeds.insert(successor);
            }
        }
        let Some(dead) = self.sessions.remove(id) else { return Vec::new() };
        self.variables.deliveries -= dead.deliveries;
        if let Some(client) = self.sessions.clients.get_mut(&successor) {
            client.mailbox.inherit_dropped(&dead.mailbox);
        }
        dead.mailbox.into_mail()
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
        let Some(client) = self.sessions.clients.get_mut(&id) else { return };
        let held = std::mem::take(&mut client.held);
        for frame in wire::frames(&held).map_while(Result::ok) {
            // It was checked when it was taken; what is wrong with it costs the client only this message.
            let _ = self.notify(now, id, &frame);
        }
    }

    /// Keeps a message of a client that is joining until it has its session.
    pub(super) fn hold(&mut self, id: ClientId, key: u32, frame: &Frame<'_>) -> Result<(), &'static str> {
        debug_assert_eq!(frame.header.kind, FrameKind::Notify);
        if self.sessions.held_bytes() + frame.encoded_len() > self.config.limits.mail_bytes {
            let name = self.names.keys.name(key).to_owned();
            let reason = "too much is said by clients that wait for the session of another";
            return self.refuse(id, &name, frame.header.sequence, reason);
        }
        let client = self.sessions.clients.get_mut(&id).ok_or("the client is not connected")?;
        let header = Header { flags: frame.header.flags & !ATTACH, ..frame.header };
        wire::put(&mut client.held, &header, frame.aux, frame.value);
        Ok(())
    }

    /// The sessions, with their holders' numbers: what has to outlive the broker (see [`super::Action::KeepSessions`]).
    pub fn sessions(&self) -> Vec<(ClientId, Session)> {
        self.sessions.to_keep()
    }
}
