//! What the broker wants of whoever carries its mail, in the order in which it has to be done.

use std::collections::{BTreeSet, VecDeque};

use super::{Broker, ClientId, Succession};

/// One thing that has to be done.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Action {
    /// The mail of this client, which is dead, refers to values that their publishers may let go of: the values are to
    /// be copied into it before anything else (see [`Broker::resolve_mail`]).
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
    /// The sessions are others than before: they have to outlive the broker (see [`Broker::sessions`]).
    KeepSessions,
    /// Somebody who left latest values has gone: they have to outlive the broker (see [`Broker::retained`]).
    KeepRetained,
}

/// What has to be done and was not asked for yet.
#[derive(Debug, Default)]
pub(super) struct Actions {
    /// Disconnected sessions whose mail refers to values in shared memory.
    pub resolve: BTreeSet<ClientId>,
    pub follow: VecDeque<Succession>,
    /// Receivers and publishers.
    pub attach: VecDeque<(ClientId, ClientId)>,
    pub retire: VecDeque<ClientId>,
    pub keep_sessions: bool,
    pub keep_retained: bool,
}

impl Broker {
    /// The next thing that the broker wants done, if there is any. Whoever has it take something in, or lets somebody come
    /// or go, asks until there is none.
    #[inline]
    pub fn poll(&mut self) -> Option<Action> {
        let actions = &mut self.actions;
        if let Some(id) = actions.resolve.pop_first() {
            Some(Action::Resolve(id))
        } else if let Some(succession) = actions.follow.pop_front() {
            Some(Action::Follow(succession))
        } else if let Some((receiver, publisher)) = actions.attach.pop_front() {
            Some(Action::Attach { receiver, publisher })
        } else if let Some(holder) = actions.retire.pop_front() {
            Some(Action::Retire(holder))
        } else if std::mem::take(&mut actions.keep_sessions) {
            Some(Action::KeepSessions)
        } else {
            std::mem::take(&mut actions.keep_retained).then_some(Action::KeepRetained)
        }
    }
}
