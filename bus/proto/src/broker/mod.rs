//! The broker as a state machine: no clock, no socket, no thread. It is handed (now, from, batch) and fills mailboxes;
//! a transport carries batches in and mail out.
//!
//! It mirrors the MOOSDB: a star around one table of variables, each with its latest value, which late registrants are
//! given at once. Where MOOS makes its users suffer it differs: a throttled registration delivers the last value of a
//! burst too; wildcards match every (variable, source) pair whenever it first appears; a write of the wrong type is
//! answered to the writer; a mailbox that nobody reads drops its oldest mail and counts.

mod bounds;
mod clock;
mod delivery;
mod expectation;
mod handling;
mod intake;
mod latest;
mod membership;
mod naming;
mod outgoing;
mod registering;
mod retained;
mod state;
mod summary;
mod survey;
pub mod table;
mod wanted;

pub use clock::CLOCK;
pub use membership::{AdmissionError, Introduction};
pub use retained::Retained;
pub use state::client::ITSELF;
pub use state::expected::Expected;
pub use state::reached::{Reached, Succession};
pub use state::registration::Registration;
pub use state::sessions::Session;
pub use state::{Action, Broker, BrokerConfig, Limits};
pub use survey::{Carried, Surveyed};
pub use wanted::WANTED;

use crate::wire::{self, ClientId, Frame, FrameKind, WireError};
use state::client::Standing;

impl Broker {
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

    /// Takes in one message of a client's, whose parts need not lie in a batch; what cannot be is damage, as in one.
    pub fn receive_message(&mut self, now: f64, from: ClientId, message: &Frame<'_>) -> Result<(), WireError> {
        self.reached.clear();
        let taken = match message.header.kind {
            FrameKind::Notify => self.notify(now, from, message),
            _ => Err("what is no message travels in a batch"),
        };
        let taken = taken.map_err(|what| WireError { at: 0, what });
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
            .min(self.sessions.next_expiry())
            .min(self.time.driver_awaited_until)
            .min(returns)
    }

    /// The next thing that the broker wants done, if there is any. Whoever has it take something in, or lets somebody come
    /// or go, asks until there is none.
    #[inline]
    pub fn poll(&mut self) -> Option<Action> {
        self.actions.next()
    }

    /// A connected client's name.
    pub fn client_name(&self, id: ClientId) -> Option<&str> {
        self.sessions.name(id)
    }

    /// The client that is there under a name.
    pub fn client_named(&self, name: &str) -> Option<ClientId> {
        self.sessions.names.get(name).copied().filter(|id| self.sessions.standing(*id) == Some(Standing::Present))
    }

    /// Number of connected clients.
    pub fn clients(&self) -> usize {
        self.sessions.present().count()
    }
}

#[cfg(test)]
mod tests;
