//! What the broker wants of whoever carries its mail, in the order in which it has to be done.

use std::collections::{BTreeSet, VecDeque};

use super::reached::Succession;
use crate::wire::ClientId;

/// One thing that has to be done.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Wish {
    /// The mail of this client, which is dead, refers to values that their publishers may let go of: they are to be put in
    /// its place, before anything else (see [`crate::broker::Broker::resolve_mail`]).
    Resolve(ClientId),
    /// Whoever waits for the predecessor to handle its mail waits for the successor now.
    Follow(Succession),
    /// A client has opened the place in which another, or it itself, writes its bulk values.
    Attach {
        /// Who has opened it.
        receiver: ClientId,
        /// Whose place it is.
        publisher: ClientId,
    },
    /// This holder of a name is to leave at its next message boundary: its successor is ready.
    Retire(ClientId),
    /// The sessions are others than before: they have to outlive the broker (see [`crate::broker::Broker::sessions`]).
    KeepSessions,
    /// Somebody who left latest values has gone: they have to outlive the broker (see [`crate::broker::Broker::retained`]).
    KeepRetained,
}

/// What nobody has asked for yet.
#[derive(Debug, Default)]
pub struct Wishes {
    /// Disconnected sessions whose mail refers to values in shared memory.
    pub resolve: BTreeSet<ClientId>,
    pub follow: VecDeque<Succession>,
    /// Receivers and publishers.
    pub attach: VecDeque<(ClientId, ClientId)>,
    pub retire: VecDeque<ClientId>,
    pub keep_sessions: bool,
    pub keep_retained: bool,
}

impl Wishes {
    /// The next of them.
    #[inline]
    pub fn next(&mut self) -> Option<Wish> {
        if let Some(id) = self.resolve.pop_first() {
            Some(Wish::Resolve(id))
        } else if let Some(succession) = self.follow.pop_front() {
            Some(Wish::Follow(succession))
        } else if let Some((receiver, publisher)) = self.attach.pop_front() {
            Some(Wish::Attach { receiver, publisher })
        } else if let Some(holder) = self.retire.pop_front() {
            Some(Wish::Retire(holder))
        } else if std::mem::take(&mut self.keep_sessions) {
            Some(Wish::KeepSessions)
        } else {
            std::mem::take(&mut self.keep_retained).then_some(Wish::KeepRetained)
        }
    }
}
