//! A client of the bus: what it says ([`Comms`]) and what it hears ([`Inbox`]), together.

use std::io;
use std::os::fd::BorrowedFd;
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

    /// A descriptor that is readable when there is something for [`Client::receive`]: mail, the broker's end, or a successor
    /// that is ready. It may be readable for nothing, too. Receiving, with a timeout of zero, is what makes it unreadable
    /// again; while more is there than one call hands out it stays readable. It is the same one for this client's whole life,
    /// through a broker's death and the next one.
    ///
    /// What is published leaves with the next [`Comms::flush`](crate::Comms::flush) or receive, as ever; that waits if the
    /// broker is behind, and a receive that finds the broker dead waits for the next one.
    ///
    /// # Errors
    /// There is no descriptor, or no thread to listen to the bell.
    pub fn wake_fd(&mut self) -> io::Result<BorrowedFd<'_>> {
        self.inbox.wake_fd()
    }
}
