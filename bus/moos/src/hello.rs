//! The handshake: a client greets and says its name, and is welcomed or refused.

use crate::message::{Data, Kind, Message};
use crate::packet::put_packet;

/// What the key of an asynchronous client's first message is, and the value of the server's welcome.
const ASYNCHRONOUS: &[u8] = b"asynchronous";

/// How a client talks.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Manner {
    /// It says what it wants when it wants, and is sent mail as it comes.
    Asynchronous,
    /// It waits for one packet after each of its own, and is never sent another.
    Synchronous,
}

/// A client's first message.
#[derive(Debug, Clone, PartialEq)]
pub struct Hello {
    /// Its name.
    pub name: String,
    /// How it talks.
    pub manner: Manner,
    /// The time that it shows (s).
    pub time: f64,
}

impl Hello {
    /// What a first message says.
    ///
    /// # Errors
    /// It is none; in words that the client is refused with.
    pub fn read(message: &Message<'_>) -> Result<Self, String> {
        if message.kind != Kind::DATA {
            return Err("Failed to read receive client's name".into());
        }
        let manner = match message.key {
            ASYNCHRONOUS => Manner::Asynchronous,
            _ => Manner::Synchronous,
        };
        let name = String::from_utf8(message.value.to_vec()).map_err(|_| "a client's name is UTF-8".to_owned())?;
        Ok(Self { name, manner, time: message.time })
    }

    /// Appends the packet that says this.
    pub fn put(&self, out: &mut Vec<u8>) {
        let key = match self.manner {
            Manner::Asynchronous => ASYNCHRONOUS,
            Manner::Synchronous => b"",
        };
        let (time, value) = (self.time, self.name.as_bytes());
        put_packet(out, &Message { key, time, value, ..Message::new(Kind::DATA, Data::STRING) });
    }
}

/// What a client is told when it is let in.
#[derive(Debug, Clone, Copy)]
pub struct Welcome<'a> {
    /// The community.
    pub community: &'a str,
    /// The name of the server's machine: a client on the same one does without a correction of its clock.
    pub hostname: &'a str,
    /// The server's time (s).
    pub time: f64,
}

impl Welcome<'_> {
    /// Appends the packet that says this to a client that showed `client_time` (s).
    pub fn put(&self, client_time: f64, out: &mut Vec<u8>) {
        let aux = format!("hostname={}", self.hostname);
        let message = Message {
            source_aux: aux.as_bytes(),
            community: self.community.as_bytes(),
            time: self.time,
            number: self.time - client_time,
            value: ASYNCHRONOUS,
            ..Message::new(Kind::WELCOME, Data::DOUBLE)
        };
        put_packet(out, &message);
    }
}

/// Appends the packet that refuses a client.
pub fn put_poison(reason: &str, out: &mut Vec<u8>) {
    put_packet(out, &Message { value: reason.as_bytes(), ..Message::new(Kind::POISON, Data::STRING) });
}

/// Why a client is refused whose name somebody has: MOOS' own words.
pub fn name_taken(name: &str) -> String {
    format!("A client of this name (\"{name}\") already exists")
}
