//! A client of MOOS' that says bytes and hears packets, with nothing between.

use std::io::{ErrorKind, Read, Write};
use std::net::TcpStream;

use elk_bus::moos::hello::{Hello, Manner};
use elk_bus::moos::message::{Data, Kind, Message, REQUEST_ID};
use elk_bus::moos::outgoing::{Outgoing, PacketWriter};
use elk_bus::moos::packet::{HEADER, greeting};

use crate::common::events::Patience;
use crate::server::{Heard, MOMENT, Served};

/// A connection, and what of a packet has come over it.
pub struct Wire {
    socket: TcpStream,
    bytes: Vec<u8>,
}

impl Wire {
    /// A connection that has said nothing.
    pub fn silent(served: &Served) -> Self {
        let socket = TcpStream::connect(served.address).unwrap();
        socket.set_nodelay(true).unwrap();
        socket.set_read_timeout(Some(MOMENT)).unwrap();
        Self { socket, bytes: Vec::new() }
    }

    /// A client that was welcomed.
    pub fn open(served: &Served, name: &str, manner: Manner) -> Self {
        let mut said = greeting().to_vec();
        Hello { name: name.to_owned(), manner, time: 0.0 }.put(&mut said);
        let mut wire = Self::silent(served);
        wire.write(&said);
        assert_eq!(wire.packet("a welcome")[0].kind, Kind::WELCOME);
        wire
    }

    /// Says these bytes.
    pub fn write(&mut self, bytes: &[u8]) {
        self.socket.write_all(bytes).unwrap();
    }

    /// Says messages as one packet.
    pub fn say(&mut self, messages: &[Message<'_>]) {
        self.write(&packet(messages));
    }

    /// The next packet; `None`: the connection has ended. Of every packet there is, it is seen that it is what the server may send.
    pub fn next(&mut self, what: &str) -> Option<Vec<Heard>> {
        if !self.has(4, what) {
            assert!(self.bytes.is_empty(), "the connection ended within a packet");
            return None;
        }
        let len = i32_at(&self.bytes, 0) as usize;
        assert!(self.has(len, what), "the connection ended within a packet");
        let packet: Vec<u8> = self.bytes.drain(..len).collect();
        let (mut rest, mut heard) = (&packet[HEADER..], Vec::new());
        while !rest.is_empty() {
            let (message, behind) = rest.split_at(i32_at(rest, 0) as usize);
            heard.push(Heard::of(&Message::read(message).unwrap()));
            rest = behind;
        }
        assert_eq!(i32_at(&packet, 4) as usize, heard.len(), "the number of messages is that of messages");
        assert!(!heard.is_empty(), "a MOOS client looks at the first message unasked");
        assert_eq!(packet[8], 0, "nothing is compressed");
        let comes_first = |one: &Heard| [Kind::TIMING, Kind::NULL].contains(&one.kind);
        assert!(!heard[1..].iter().any(comes_first), "the server's clock comes first, and once: {heard:?}");
        Some(heard)
    }

    /// The next packet.
    pub fn packet(&mut self, what: &str) -> Vec<Heard> {
        self.next(what).unwrap_or_else(|| panic!("the connection ended before {what}"))
    }

    /// All that came until everything that this client has said was taken in: it asks a question, and what was said before it was
    /// answered before it. With that the answer, the names of all variables.
    pub fn settled(&mut self) -> (Vec<Heard>, Vec<String>) {
        self.say(&[request("VAR_SUMMARY")]);
        let mut heard = Vec::new();
        while heard.last().is_none_or(|one: &Heard| one.id != REQUEST_ID) {
            heard.extend(self.packet("the names of all variables"));
        }
        let names = heard.pop().map(|one| one.text().split(',').map(str::to_owned).collect());
        (heard, names.unwrap())
    }

    /// Of what came until then the numbers of this variable.
    pub fn numbers(&mut self, key: &str) -> Vec<f64> {
        let (heard, _) = self.settled();
        heard.iter().filter(|one| one.key == key).map(|one| one.number).collect()
    }

    /// Whether so many bytes have come; the connection may end before.
    fn has(&mut self, len: usize, what: &str) -> bool {
        let (patience, mut buffer) = (Patience::new(), [0; 4096]);
        while self.bytes.len() < len {
            patience.left(what);
            match self.socket.read(&mut buffer) {
                Ok(0) => return false,
                Ok(count) => self.bytes.extend_from_slice(&buffer[..count]),
                Err(error) if matches!(error.kind(), ErrorKind::WouldBlock | ErrorKind::TimedOut) => {}
                Err(error) if error.kind() == ErrorKind::Interrupted => {}
                // However it ends.
                Err(_) => return false,
            }
        }
        true
    }
}

fn i32_at(bytes: &[u8], at: usize) -> i32 {
    i32::from_le_bytes(bytes[at..at + 4].try_into().unwrap())
}

/// The bytes of one packet.
pub fn packet(messages: &[Message<'_>]) -> Vec<u8> {
    let mut out = Outgoing::default();
    let mut packet = PacketWriter::new(&mut out, b"");
    messages.iter().for_each(|message| packet.put(message));
    packet.finish();
    std::mem::take(out.bytes())
}

/// A number that is published.
pub fn number(key: &str, number: f64) -> Message<'_> {
    Message { key: key.as_bytes(), number, time: 5.0, ..Message::new(Kind::NOTIFY, Data::DOUBLE) }
}

/// A text that is published.
pub fn text<'a>(key: &'a str, value: &'a str) -> Message<'a> {
    Message { data: Data::STRING, value: value.as_bytes(), ..number(key, -1.0) }
}

/// A registration, a message every `period` s at most.
pub fn register(key: &str, period: f64) -> Message<'_> {
    Message { key: key.as_bytes(), number: period, ..Message::new(Kind::REGISTER, Data::DOUBLE) }
}

/// Its end.
pub fn unregister(key: &str) -> Message<'_> {
    Message { kind: Kind::UNREGISTER, ..register(key, -1.0) }
}

/// A registration by patterns: `AppPattern=..,VarPattern=..,Interval=..`.
pub fn wildcard(said: &str) -> Message<'_> {
    Message { value: said.as_bytes(), ..Message::new(Kind::WILDCARD_REGISTER, Data::STRING) }
}

/// A question to the server.
pub fn request(key: &str) -> Message<'_> {
    Message { id: REQUEST_ID, key: key.as_bytes(), ..Message::new(Kind::SERVER_REQUEST, Data::STRING) }
}

/// A sign of life, at this time of the client's.
pub fn timing(time: f64) -> Message<'static> {
    Message { key: b"_async_timing", time, number: 0.0, ..Message::new(Kind::TIMING, Data::DOUBLE) }
}
