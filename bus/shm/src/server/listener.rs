//! The connections' threads: each waits for its client's first word, and for its end, and tells the broker's thread.

use std::os::unix::net::{UnixListener, UnixStream};
use std::sync::Arc;
use std::sync::mpsc::Sender;

use elk_os::{Owner, tell};

use super::pending::{Acceptor, PendingConnections};
use crate::handshake::{self, Answer, Hello};
use crate::page::{BrokerPage, Page};
use crate::scarce;

/// What the connections' threads tell the broker's.
pub(super) enum Event {
    /// Somebody wants in.
    Hello(u64, Arc<UnixStream>, Hello),
    /// A connection ended.
    HungUp(u64),
}

/// Lets the connections of all who come have their first word.
pub(super) fn accept_all(listener: UnixListener, events: &Sender<Event>, page: &Arc<Page<BrokerPage>>) {
    let (mut acceptor, pending) = (Acceptor::new(listener), Arc::new(PendingConnections::default()));
    for connection in 0_u64.. {
        let stream = Arc::new(acceptor.next());
        pending.enter(connection, &stream);
        let (events, page, pending) = (events.clone(), page.clone(), pending.clone());
        let serve = {
            let (stream, pending) = (stream.clone(), pending.clone());
            move || {
                let tell = |event| {
                    // The broker may be gone already; then nobody needs the news.
                    let _ = events.send(event);
                    page.bell.ring();
                };
                let hello = first_word(&stream);
                pending.leave(connection);
                if let Some(hello) = hello {
                    tell(Event::Hello(connection, stream.clone(), hello));
                    handshake::wait_for_end(&stream);
                    tell(Event::HungUp(connection));
                }
            }
        };
        let spawned = std::thread::Builder::new().name("connection".into()).stack_size(64 << 10).spawn(serve);
        if let Err(error) = spawned {
            let remedy = scarce::remedy(&error);
            let reason = format!("the broker has no thread for another client: {error}{remedy}");
            tell(format_args!("elk db: a client was turned away: {reason}"));
            let _ = handshake::send(&stream, &Answer::Refused { reason }, &[]);
            pending.leave(connection);
        }
    }
}

fn first_word(stream: &UnixStream) -> Option<Hello> {
    let user = Owner::at_other_end(stream).ok()?.user;
    if user != elk_os::own_user() {
        let reason = format!("this community belongs to user {}", elk_os::own_user());
        let _ = handshake::send(stream, &Answer::Refused { reason }, &[]);
        return None;
    }
    stream.set_read_timeout(Some(handshake::PATIENCE)).ok()?;
    let (hello, _) = handshake::receive::<Hello>(stream).ok()?;
    stream.set_read_timeout(None).ok()?;
    Some(hello)
}
