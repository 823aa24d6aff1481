//! What the broker wants of whoever carries its mail, in the order in which it has to be done.

use std::collections::{BTreeSet, VecDeque};

use super::reached::Succession;
use crate::wire::ClientId;

/// One thing that has to be done.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Action {
    /// The mail of this client, which is dead, refers to values that their publishers may let go of: they are to be put in
    /// its place, before anything else (see [`crate::broker::Broker::resolve_mail`]).
    Resolve(ClientId),
    /// Whoever waits for the predecessor to handle its mail waits for the successor now.
    Follow(Succession),
    /// A client has opened the memory to which another, or it itself, writes its bulk values.
    Attach {
        /// Who has opened it.
        receiver: ClientId,
        /// Whose memory it is.
        publisher: ClientId,
    },
    /// This holder of a name is to leave at its next message boundary: its successor is ready.
    Retire(ClientId),
    /// The sessions are others than before: they have to outlive the broker (see [`crate::broker::Broker::sessions`]).
    KeepSessions,
    /// Somebody who left latest values has gone: they have to outlive the broker (see [`crate::broker::Broker::retained`]).
    KeepRetained,
}

/// What has to be done and was not asked for yet.
#[derive(Debug, Default)]
pub struct Actions {
    /// Disconnected sessions whose mail refers to values in shared memory.
    pub resolve: BTreeSet<ClientId>,
    pub follow: VecDeque<Succession>,
    /// Receivers and publishers.
    pub attach: VecDeque<(ClientId, ClientId)>,
    pub retire: VecDeque<ClientId>,
    pub keep_sessions: bool,
    pub keep_retained: bool,
}

impl Actions {
    /// The next of them.
    #[inline]
    pub fn next(&mut self) -> Option<Action> {
        if let Some(id) = self.resolve.pop_first() {
            Some(Action::Resolve(id))
        } else if let Some(succession) = self.follow.pop_front() {
            Some(Action::Follow(succession))
        } else if let Some((receiver, publisher)) = self.attach.pop_front() {
            Some(Action::Attach { receiver, publisher })
        } else if let Some(holder) = self.retire.pop_front() {
            Some(Action::Retire(holder))
        } else if std::mem::take(&mut self.keep_sessions) {
            Some(Action::KeepSessions)
        } else {
            std::mem::take(&mut self.keep_retained).then_some(Action::KeepRetained)
        }
    }
}
