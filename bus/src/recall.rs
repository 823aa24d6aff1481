//! What the community remembers of an app: its memory is a variable like any other.
//!
//! An app that has to go on where its predecessor stopped publishes what a successor needs, and asks for it when it
//! starts, before anything else ([`Handlers::recall`](crate::Handlers::recall)). The broker gives latest values in the order
//! in which they were asked for, and mail that the predecessor had not handled after them, so memory comes before work. What
//! was never published is not answered at all: once the first message comes that is not memory, there is no more of it. For
//! an app that would otherwise have to wait for work, the broker always has one such message: the mark.

use crate::comms::{Comms, CommsError};
use crate::mail::Mail;
use crate::subscription::{Terms, any};

/// A variable that always has a value, since the broker writes it for every client that it lets in.
const MARK: &str = "DB_CLIENTS";

/// Asks for the mark: it comes behind the latest values of all that was registered for before.
pub(crate) fn ask_for_mark(comms: &mut Comms) -> Result<(), CommsError> {
    comms.register(any(MARK))
}

pub(crate) fn let_go_of_mark(comms: &mut Comms) -> Result<(), CommsError> {
    comms.unregister(any(MARK))
}

/// Whether this message is the mark.
pub(crate) fn is_mark(mail: &Mail<'_>) -> bool {
    mail.key() == MARK
}

/// An app's recollection: what is asked for and not given up yet.
#[derive(Debug, Default)]
pub(crate) struct Recall(Vec<Terms>);

impl Recall {
    /// The recollection of these variables.
    pub fn of(memory: impl Iterator<Item = Terms>) -> Self {
        Self(memory.collect())
    }

    /// Asks for the latest values.
    pub fn ask(&self, comms: &mut Comms) -> Result<(), CommsError> {
        self.0.iter().try_for_each(|terms| comms.register_for(terms))
    }

    /// Whether it is about these very variables.
    pub fn is_for(&self, terms: &Terms) -> bool {
        self.0.iter().any(|one| (&one.keys, &one.sources) == (&terms.keys, &terms.sources))
    }

    /// Whether a message is part of it.
    pub fn fits(&self, mail: &Mail<'_>) -> bool {
        self.0.iter().any(|terms| terms.fits(mail.key(), mail.source()))
    }

    /// Whether nothing is asked for any more.
    pub fn is_over(&self) -> bool {
        self.0.is_empty()
    }

    /// Ends it. From then on what the app publishes does not come back to it. Answers what it was about.
    pub fn end(&mut self, comms: &mut Comms) -> Result<Self, CommsError> {
        self.0.iter().try_for_each(|terms| comms.unregister_from(terms))?;
        Ok(std::mem::take(self))
    }
}
