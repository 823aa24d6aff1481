//! One connection: its socket, what has come over it and is not whole yet, and what is on its way out.

use std::io::{self, ErrorKind};
use std::net::{SocketAddr, TcpStream};

use elk_proto::wire::ClientId;

use crate::hello::Hello;
use crate::outgoing::Outgoing;
use crate::packet::Decoder;
use crate::session::Session;

/// A client that was let in.
pub(super) struct Named {
    pub id: ClientId,
    pub name: String,
    pub session: Session,
    /// Of which variables it was said already that something was not taken.
    pub told: Vec<String>,
}

/// A connection.
pub(super) struct Connection {
    pub socket: TcpStream,
    pub from: SocketAddr,
    pub decoder: Decoder,
    /// `None`: it has not said yet who it is.
    pub client: Option<Named>,
    /// What it has said of itself so far, or why that is nothing.
    pub hello: Option<Result<Hello, String>>,
    /// When it was opened, when something came over it last, and when it last took something (ns, monotonic).
    pub opened_at: u64,
    pub heard_at: u64,
    pub took_at: u64,
    /// When it last needed more than usual buffers (ns, monotonic).
    long_at: u64,
    out: Outgoing,
}

/// How often it is read in a look, however little comes at a time.
const READS: usize = 16;
/// A connection's usual buffers (bytes), and how long larger ones are kept for the next long message (ns).
const USUAL_BUFFER: usize = 256 << 10;
const KEPT_FOR: u64 = 3_000_000_000;

/// What a look into a socket brought.
pub(super) enum Look {
    /// Bytes, and perhaps there are more.
    Bytes,
    /// There is nothing now.
    Nothing,
    /// There will be nothing more.
    Over,
}

impl Connection {
    /// A connection that was opened at `now` (ns, monotonic).
    pub fn new(socket: TcpStream, from: SocketAddr, longest: usize, now: u64) -> Self {
        Self {
            socket,
            from,
            decoder: Decoder::of_client(longest),
            client: None,
            hello: None,
            opened_at: now,
            heard_at: now,
            took_at: now,
            long_at: now,
            out: Outgoing::default(),
        }
    }

    /// Takes in what there is, up to `most` bytes, or the rest of a message that has begun.
    pub fn look(&mut self, most: usize) -> Look {
        let mut reads = 0;
        loop {
            match self.decoder.read_from(&self.socket, most) {
                // A long message is heard once all of it is there.
                Ok(1..) if self.decoder.lacking() > 0 && reads < READS => reads += 1,
                Ok(1..) => return Look::Bytes,
                // What stopped it is seen at the next look.
                _ if reads > 0 => return Look::Bytes,
                Err(error) if error.kind() == ErrorKind::Interrupted => {}
                Err(error) if error.kind() == ErrorKind::WouldBlock => return Look::Nothing,
                // Whatever the reason, the other end is gone.
                Ok(0) | Err(_) => return Look::Over,
            }
        }
    }

    /// Something came over it at `now` (ns, monotonic).
    pub fn note_heard(&mut self, now: u64) {
        self.heard_at = now;
        self.note_use(self.decoder.unread(), now);
    }

    fn note_use(&mut self, bytes: usize, now: u64) {
        if bytes > USUAL_BUFFER {
            self.long_at = now;
        }
    }

    /// Where the next packet is written; only once the last one is out.
    pub fn out(&mut self, now: u64) -> &mut Outgoing {
        debug_assert!(self.out.is_empty(), "one packet at a time");
        self.took_at = now;
        &mut self.out
    }

    /// Bytes that wait to be taken.
    pub fn waiting(&self) -> usize {
        self.out.waiting()
    }

    /// Writes what there is room for at `now` (ns, monotonic); whether nothing is left. `mail` is what it was given last.
    ///
    /// # Errors
    /// The other end is gone.
    pub fn flush(&mut self, now: u64, mail: &[u8]) -> io::Result<bool> {
        self.note_use(self.waiting(), now);
        while self.waiting() > 0 {
            match self.out.write_to(&self.socket, mail) {
                Ok(0) => return Err(ErrorKind::WriteZero.into()),
                Ok(_) => self.took_at = now,
                Err(error) if error.kind() == ErrorKind::Interrupted => {}
                Err(error) if error.kind() == ErrorKind::WouldBlock => return Ok(false),
                Err(error) => return Err(error),
            }
        }
        Ok(true)
    }

    /// At `now` (ns, monotonic), gives room back that long messages took and none has needed for a while.
    pub fn tidy(&mut self, now: u64) {
        if now.saturating_sub(self.long_at) < KEPT_FOR {
            return;
        }
        if self.decoder.capacity() > USUAL_BUFFER {
            self.decoder.shrink();
        }
        if self.out.is_empty() && self.out.capacity() > USUAL_BUFFER {
            self.out = Outgoing::default();
        }
    }
}
