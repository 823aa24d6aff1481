//! Whom a message has reached, and who has taken over from whom.

use crate::wire::ClientId;

/// A client that got mail, and where the newest of it stands in its mailbox.
#[derive(Debug, Clone, Copy)]
pub struct Reached {
    /// The client.
    pub client: ClientId,
    /// The position (see [`crate::broker::Broker::mail_done`]).
    pub position: u64,
    /// Whether publishers wait for it.
    pub lossless: bool,
}

/// A client that has taken over another's session, with its mail.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Succession {
    /// Whose session it was.
    pub predecessor: ClientId,
    /// Whose it is.
    pub successor: ClientId,
    /// Where the newest message that it took over stands in its own mailbox.
    pub position: u64,
}

impl Reached {
    /// Whoever has the mail now.
    pub fn follow(&mut self, succession: &Succession) {
        if self.client == succession.predecessor {
            (self.client, self.position) = (succession.successor, succession.position);
        }
    }
}
