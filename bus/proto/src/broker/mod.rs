//! The broker as a state machine: no clock, no socket, no thread. It is handed (now, from, batch) and fills mailboxes;
//! a transport carries batches in and mail out.
//!
//! It mirrors the MOOSDB: a star around one table of variables, each with its latest value, which late registrants are
//! given at once. Where MOOS makes its users suffer it differs: a throttled registration delivers the last value of a
//! burst too; wildcards match every (variable, source) pair whenever it first appears; a write of the wrong type is
//! answered to the writer; a mailbox that nobody reads drops its oldest mail and counts.

mod actions;
mod client;
mod delivery;
mod expectation;
mod handling;
mod intake;
mod interner;
mod latest;
mod limits;
mod mailbox;
mod membership;
mod message;
mod naming;
mod outgoing;
mod registration;
mod retained;
mod sessions;
mod summary;
pub mod table;
mod time;
mod types;
mod variable;
mod variables;

pub use actions::Action;
use actions::Actions;
use client::Client;
pub use expectation::Expected;
pub use handling::{Reached, Succession};
pub use limits::Limits;
pub use mailbox::Mailbox;
use membership::Standing;
pub use membership::{Introduction, Refusal, Session};
use naming::Names;
pub use registration::Registration;
pub use retained::Retained;
use sessions::Sessions;
pub use time::CLOCK;
use time::Time;
use variables::Variables;

use crate::wire::{self, Frame, FrameKind, WireError};

/// The number of a connected client; never given twice.
pub type ClientId = u32;

/// What a broker can be told about itself.
#[derive(Debug, Clone)]
pub struct BrokerConfig {
    /// The community's name: part of the broker's own name and of every message.
    pub community: String,
    /// The most that a client's mailbox holds (bytes); the oldest mail goes first.
    pub mailbox_bytes: usize,
    /// How long publishers wait for a lossless registrant that does not read (s); then its mail is dropped as well.
    pub lossless_patience_secs: f64,
    /// What clients can make it hold.
    pub limits: Limits,
}

impl BrokerConfig {
    /// Mailboxes of 4 MiB, patience of 5 s.
    pub fn new(community: impl Into<String>) -> Self {
        Self {
            community: community.into(),
            mailbox_bytes: 4 << 20,
            lossless_patience_secs: 5.0,
            limits: Limits::default(),
        }
    }

    /// The same with mailboxes of so many bytes, and with room for eight that are full.
    pub fn with_mailboxes_of(self, mailbox_bytes: usize) -> Self {
        let limits = Limits { mail_bytes: mailbox_bytes.saturating_mul(8), ..self.limits };
        Self { mailbox_bytes, limits, ..self }
    }
}

/// The broker's whole state.
pub struct Broker {
    config: BrokerConfig,
    sessions: Sessions,
    names: Names,
    variables: Variables,
    time: Time,
    own: Own,
    /// Who got mail from the batch that is being taken in.
    reached: Vec<ClientId>,
    actions: Actions,
}

/// The broker as a source of messages.
struct Own {
    source: u32,
    sequence: u64,
}

impl Own {
    /// The sequence of its next message.
    fn next(&mut self) -> u64 {
        self.sequence += 1;
        self.sequence
    }
}

impl Broker {
    /// A broker without clients or variables, started at `now` (s).
    pub fn new(config: BrokerConfig, now: f64) -> Self {
        let mut names = Names::default();
        let source = names.sources.number(&format!("MOOSDB_{}", config.community));
        names.communities.number(&config.community);
        let millis = (now.max(0.0) * 1e3) as u64;
        Self {
            config,
            // Numbers of clients of a broker that died are not to be taken for those of this one.
            sessions: Sessions::new((millis & 0x0fff_ffff) as ClientId + 1),
            names,
            variables: Variables::default(),
            time: Time::new(now),
            // A broker that takes over from another is not to be taken for it.
            own: Own { source, sequence: wire::first_sequence(millis) },
            reached: Vec::new(),
            actions: Actions::default(),
        }
    }

    fn announce(&mut self, now: f64, event: &str) {
        self.publish_event(now, event);
        self.publish_clients(now);
    }

    /// Takes in a batch of frames from a client. A damaged batch is taken up to the damage; the transport then has to
    /// let go of the client, whose lane can no longer be trusted.
    pub fn receive(&mut self, now: f64, from: ClientId, batch: &[u8]) -> Result<(), WireError> {
        self.reached.clear();
        let taken = self.take_in(now, from, batch);
        self.on_much_said(now, from);
        self.note_unhandled(from);
        taken
    }

    fn take_in(&mut self, now: f64, from: ClientId, batch: &[u8]) -> Result<(), WireError> {
        let mut at = 0;
        for frame in wire::frames(batch) {
            let frame = frame?;
            self.frame(now, from, &frame).map_err(|what| WireError { at, what })?;
            at += frame.bytes.len();
        }
        Ok(())
    }

    fn frame(&mut self, now: f64, from: ClientId, frame: &Frame<'_>) -> Result<(), &'static str> {
        match frame.header.kind {
            FrameKind::Notify => self.notify(now, from, frame),
            // Before anything of it is copied.
            _ if frame.bytes.len() > wire::MAX_MESSAGE => {
                Err("a frame that is no message is longer than messages may be")
            }
            FrameKind::Define => self.define(from, frame),
            FrameKind::Register | FrameKind::Unregister => self.change_registration(now, from, frame),
            FrameKind::Attached => {
                self.actions.attach.push_back((from, frame.header.source));
                Ok(())
            }
            FrameKind::Ready => {
                self.on_ready(now, from);
                Ok(())
            }
            FrameKind::Clock => self.set_clock(now, from, wire::clock_setting(frame)?),
            FrameKind::Refused | FrameKind::Dropped => Err("only the broker sends such a frame"),
        }
    }

    /// Delivers what throttled registrations held back and whose time has come, lets go of sessions that nobody came for,
    /// and refreshes the `DB_*` variables.
    pub fn tick(&mut self, now: f64) {
        self.expire_sessions(now);
        self.await_driver(now);
        self.seat_those_who_wait(now);
        self.deliver_due(now);
        if now >= self.time.next_summary {
            self.time.next_summary = now + summary::PERIOD_SECS;
            self.summarise(now);
        }
    }

    /// When [`Broker::tick`] next has something to do (s).
    pub fn next_deadline(&self) -> f64 {
        let returns = self.sessions.returns_awaited_until.unwrap_or(f64::INFINITY);
        self.variables
            .next_due()
            .min(self.time.next_summary)
            .min(self.next_expiry())
            .min(self.time.driver_awaited_until)
            .min(returns)
    }

    /// A connected client's name.
    pub fn client_name(&self, id: ClientId) -> Option<&str> {
        self.sessions.clients.get(&id).map(|c| c.name.as_str())
    }

    /// The client that is there under a name.
    pub fn client_named(&self, name: &str) -> Option<ClientId> {
        self.sessions.names.get(name).copied().filter(|id| self.standing(*id) == Some(Standing::Present))
    }

    /// Number of connected clients.
    pub fn clients(&self) -> usize {
        self.sessions.clients.values().filter(|c| c.standing == Standing::Present).count()
    }
}

#[cfg(test)]
mod tests;
