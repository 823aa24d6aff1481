//! A client of the bus: what it says ([`Comms`]) and what it hears ([`Inbox`]), together.

use std::time::Duration;

use crate::comms::{Comms, CommsError};
use crate::community::Community;
use crate::inbox::Inbox;
use crate::link::Link;
use crate::mail::Mail;
use elk_proto::names::Names;

/// A client: both ends together, for programs that are no apps.
pub struct Client {
    /// What it says.
    pub comms: Comms,
    /// What it hears.
    pub inbox: Inbox,
}

impl Client {
    /// Puts a client on a transport's link.
    pub fn over(link: Link, name: &str, community: &Community) -> Self {
        let names = Names::of_reader(name, &link.build);
        let (comms, down) = Comms::new(name, community, link);
        Self { comms, inbox: Inbox::new(down, names) }
    }

    /// See [`Inbox::receive`].
    pub fn receive(&mut self, timeout: Duration, mut on_mail: impl FnMut(&Mail<'_>)) -> Result<usize, CommsError> {
        self.inbox.receive(&mut self.comms, timeout, |_, mail| {
            on_mail(mail);
            Ok(())
        })
    }
}
