//! One connection: its socket, what has come over it and is not whole yet, and what is on its way out.

use std::io::{self, ErrorKind, Write};
use std::net::{SocketAddr, TcpStream};

use elk_proto::wire::ClientId;

use crate::hello::Hello;
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
    out: Vec<u8>,
    written: usize,
}

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
            out: Vec::new(),
            written: 0,
        }
    }

    /// Takes in what there is, up to `most` bytes.
    pub fn look(&mut self, most: usize) -> Look {
        match self.decoder.read_from(&self.socket, most) {
            // What stopped it is seen at the next look.
            (1.., _) => Look::Bytes,
            (0, Err(error)) if error.kind() == ErrorKind::WouldBlock => Look::Nothing,
            // Whatever the reason, the other end is gone.
            (0, _) => Look::Over,
        }
    }

    /// Where the next packet is written; only once the last one is out.
    pub fn out(&mut self, now: u64) -> &mut Vec<u8> {
        debug_assert!(self.out.is_empty(), "one packet at a time");
        self.took_at = now;
        &mut self.out
    }

    /// Bytes that wait to be taken.
    pub fn waiting(&self) -> usize {
        self.out.len() - self.written
    }

    /// Writes what there is room for at `now` (ns, monotonic); whether nothing is left.
    ///
    /// # Errors
    /// The other end is gone.
    pub fn flush(&mut self, now: u64) -> io::Result<bool> {
        while self.waiting() > 0 {
            match self.socket.write(&self.out[self.written..]) {
                Ok(0) => return Err(ErrorKind::WriteZero.into()),
                Ok(bytes) => {
                    self.written += bytes;
                    self.took_at = now;
                }
                Err(error) if error.kind() == ErrorKind::Interrupted => {}
                Err(error) if error.kind() == ErrorKind::WouldBlock => return Ok(false),
                Err(error) => return Err(error),
            }
        }
        self.out.clear();
        self.written = 0;
        Ok(true)
    }

    /// Gives room back that a long message took.
    pub fn tidy(&mut self, usual: usize) {
        if self.decoder.capacity() > usual {
            self.decoder.shrink();
        }
        if self.out.is_empty() && self.out.capacity() > usual {
            self.out = Vec::new();
        }
    }
}
