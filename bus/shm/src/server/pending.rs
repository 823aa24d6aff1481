//! Connections whose clients have not said yet who they are. There is room for so many; whichever is silent longest
//! is closed when others come. Whoever connects when no descriptor is left is told so.

use std::collections::VecDeque;
use std::fs::File;
use std::io::ErrorKind;
use std::net::Shutdown;
use std::os::unix::net::{UnixListener, UnixStream};
use std::sync::{Arc, Condvar, Mutex, PoisonError};
use std::time::Duration;

use elk_os::clock::Stopwatch;
use elk_os::tell;
use rustix::io::Errno;

use crate::handshake::{self, Answer};

/// How many may be silent at a time.
const ROOM: usize = 64;
/// How long everyone may be silent, even when others want in.
const GRACE: Duration = Duration::from_secs(1);
/// How long it is waited, when connections cannot be taken at all, before the next try.
const PAUSE: Duration = Duration::from_millis(100);

/// How often it is said that nobody can come in.
const COMPLAIN_EVERY: Duration = Duration::from_secs(60);

/// Connections that have not said anything yet.
#[derive(Default)]
pub(super) struct PendingConnections {
    silent: Mutex<VecDeque<Silent>>,
    left: Condvar,
}

struct Silent {
    connection: u64,
    since: Stopwatch,
    stream: Arc<UnixStream>,
}

impl PendingConnections {
    /// Lets a connection in, once there is room.
    pub fn enter(&self, connection: u64, stream: &Arc<UnixStream>) {
        let mut silent = self.silent.lock().unwrap_or_else(PoisonError::into_inner);
        while silent.len() >= ROOM {
            let waited = silent.front().map_or(GRACE, |oldest| oldest.since.elapsed());
            if let Some(left) = GRACE.checked_sub(waited).filter(|left| !left.is_zero()) {
                silent = self.left.wait_timeout(silent, left).unwrap_or_else(PoisonError::into_inner).0;
            } else if let Some(oldest) = silent.pop_front() {
                // Its thread sees the end.
                let _ = oldest.stream.shutdown(Shutdown::Both);
            }
        }
        silent.push_back(Silent { connection, since: Stopwatch::start(), stream: stream.clone() });
    }

    /// A connection has said its word, or is gone.
    pub fn leave(&self, connection: u64) {
        let mut silent = self.silent.lock().unwrap_or_else(PoisonError::into_inner);
        silent.retain(|one| one.connection != connection);
        self.left.notify_one();
    }
}

/// Takes connections as they come, whatever happens.
pub(super) struct Acceptor {
    listener: UnixListener,
    /// A descriptor that is given up to tell somebody that there is none left.
    spare: Option<File>,
    /// Since it was said last that nobody can come in.
    complained: Option<Stopwatch>,
}

impl Acceptor {
    /// That of a listener.
    pub fn new(listener: UnixListener) -> Self {
        Self { listener, spare: spare(), complained: None }
    }

    /// The next connection.
    pub fn next(&mut self) -> UnixStream {
        loop {
            match self.listener.accept() {
                Ok((stream, _)) => return stream,
                Err(error) if matches!(error.kind(), ErrorKind::Interrupted | ErrorKind::ConnectionAborted) => {}
                Err(error) => self.turn_away(&error),
            }
        }
    }

    /// Tells whoever is next that there is nothing left to serve it with. Without a pause, a broker that cannot take a
    /// connection would look for it again at once, and for ever.
    fn turn_away(&mut self, error: &std::io::Error) {
        let reason = format!("the broker cannot take another connection: {error}{}", super::scarce::hint());
        if self.complained.is_none_or(|since| since.elapsed() > COMPLAIN_EVERY) {
            tell(format_args!("elk db: {reason}"));
            self.complained = Some(Stopwatch::start());
        }
        let of_descriptors = [Errno::MFILE, Errno::NFILE].map(|errno| Some(errno.raw_os_error()));
        if of_descriptors.contains(&error.raw_os_error()) && self.spare.take().is_some() {
            if let Ok((stream, _)) = self.listener.accept() {
                let _ = handshake::send(&stream, &Answer::Refused { reason }, &[]);
            }
            self.spare = spare();
        }
        std::thread::sleep(PAUSE);
    }
}

fn spare() -> Option<File> {
    File::open("/dev/null").ok()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn whoever_is_silent_longest_goes_when_others_want_in() {
        let pending = PendingConnections::default();
        let mut ends = Vec::new();
        for connection in 0..ROOM as u64 + 1 {
            let (ours, theirs) = UnixStream::pair().unwrap();
            // The last one has to wait until the first one has had its time.
            pending.enter(connection, &Arc::new(ours));
            ends.push(theirs);
        }
        assert!(handshake::hung_up(&ends[0]));
        assert!(!handshake::hung_up(&ends[1]) && !handshake::hung_up(&ends[ROOM]));
    }

    #[test]
    fn whoever_has_spoken_makes_room_at_once() {
        let pending = PendingConnections::default();
        let mut ends = Vec::new();
        for connection in 0..4 * ROOM as u64 {
            let (ours, theirs) = UnixStream::pair().unwrap();
            pending.enter(connection, &Arc::new(ours));
            pending.leave(connection);
            ends.push(theirs);
        }
        assert!(pending.silent.lock().unwrap().is_empty());
    }
}
