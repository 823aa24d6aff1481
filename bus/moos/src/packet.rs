//! Packets: what travels at a time, many messages mostly. A stream of bytes is cut into its messages as they come, so that
//! nobody's announced length makes anybody hold more than one message.
//!
//! ```text
//! i32 length of the packet, this header included   i32 number of messages   u8 0   the messages
//! ```

use std::io::{self, Read};

use crate::message::{Message, MessageError, SHORTEST};

/// Length of a packet's header (bytes).
pub const HEADER: usize = 9;
/// How many bytes a client says before anything else.
pub const GREETING_LEN: usize = 32;
/// What it says, filled up with zeros; in either case.
const GREETING: &[u8] = b"ELKS CAN'T DANCE 2/8/10";
/// Room that a stream's next bytes have in any case (bytes).
const LEAST_ROOM: usize = 4 << 10;

/// A client's first bytes.
pub fn greeting() -> [u8; GREETING_LEN] {
    let mut bytes = [0; GREETING_LEN];
    bytes[..GREETING.len()].copy_from_slice(GREETING);
    bytes
}

/// The header of a packet of `len` bytes, itself included.
pub(crate) fn header(len: usize, messages: i32) -> [u8; HEADER] {
    let mut header = [0; HEADER];
    header[..4].copy_from_slice(&(len as i32).to_le_bytes());
    header[4..8].copy_from_slice(&messages.to_le_bytes());
    header
}

/// Appends a packet with this one message.
pub fn put_packet(out: &mut Vec<u8>, message: &Message<'_>) {
    out.extend_from_slice(&header(HEADER + message.encoded_len(), 1));
    message.put(out);
}

/// Of a message that is too long its variable is looked for in so many bytes: names of the length that the bus allows have room
/// in it.
pub const LONGEST_HEAD: usize = 2048;

/// What comes next in a stream.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Event<'a> {
    /// The greeting, whole and right.
    Greeting,
    /// A message; `first`: of its packet.
    Message {
        /// The message.
        message: Message<'a>,
        /// Whether its packet begins with it.
        first: bool,
    },
    /// A message that is too long was passed over.
    TooLong {
        /// How long it was (bytes).
        bytes: usize,
        /// The variable, if it stands in the message's first [`LONGEST_HEAD`] bytes.
        key: Option<&'a [u8]>,
    },
    /// The packet is over.
    End,
}

/// Bytes that are no stream of packets. What comes behind them cannot be understood.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
pub enum StreamError {
    /// Who speaks something else.
    #[error("it does not greet as MOOS' clients do")]
    Greeting,
    /// The header of a packet cannot be true.
    #[error("a packet of {len} bytes with {messages} messages cannot be")]
    Packet {
        /// The length that it says (bytes).
        len: i32,
        /// The number that it says.
        messages: i32,
    },
    /// A message is longer than what is left of its packet, or shorter than any.
    #[error("a message of {len} bytes in a packet with {left} left for {messages} messages cannot be")]
    Length {
        /// The length that it says (bytes).
        len: i32,
        /// What is left of the packet (bytes).
        left: usize,
        /// Messages that are still to come, this one among them.
        messages: usize,
    },
    /// A message is none.
    #[error(transparent)]
    Message(#[from] MessageError),
}

#[derive(Debug, Clone, Copy)]
enum Stage {
    Greeting,
    Header,
    /// Within a packet: bytes and messages that are left of it.
    Messages {
        left: usize,
        messages: usize,
        first: bool,
    },
    /// Within a message that is too long: bytes that are left of it, and of its packet behind it.
    Skipping {
        skip: usize,
        bytes: usize,
        left: usize,
        messages: usize,
    },
}

/// Cuts a stream of bytes into messages, whatever pieces it comes in.
#[derive(Debug)]
pub struct Decoder {
    /// What has come and has not been read lies at `at..end`; behind it is room.
    bytes: Vec<u8>,
    at: usize,
    end: usize,
    /// Bytes that came last.
    came: usize,
    stage: Stage,
    longest: usize,
    /// The variable of the message that is passed over, if it was found.
    passed_key: Option<Vec<u8>>,
}

impl Decoder {
    /// The decoder of what a client says, from its greeting on; messages of more than `longest` bytes are passed over.
    pub fn of_client(longest: usize) -> Self {
        Self { bytes: Vec::new(), at: 0, end: 0, came: 0, stage: Stage::Greeting, longest, passed_key: None }
    }

    /// The decoder of what a server says.
    pub fn of_server(longest: usize) -> Self {
        Self { stage: Stage::Header, ..Self::of_client(longest) }
    }

    /// Takes in the next bytes of the stream.
    pub fn extend(&mut self, bytes: &[u8]) {
        self.room(bytes.len()).copy_from_slice(bytes);
        self.end += bytes.len();
    }

    /// Takes in what a stream has to give at once: `most` bytes, or the rest of a message that has begun and is longer. Room
    /// is made by what has come, twice as much: who announces much and says little takes none. Answers how many bytes came;
    /// 0: there will be no more.
    ///
    /// # Errors
    /// Those of the stream.
    pub fn read_from(&mut self, mut stream: impl Read, most: usize) -> io::Result<usize> {
        let have = self.unread();
        let of_a_message = self.lacking().min(have.max(self.bytes.len() - have));
        let wanted = of_a_message.max((2 * self.came).max(LEAST_ROOM).min(most));
        self.came = stream.read(self.room(wanted))?;
        self.end += self.came;
        Ok(self.came)
    }

    /// Bytes of the message that has begun, as far as it is kept, that have not come yet.
    pub fn lacking(&self) -> usize {
        let have = self.unread();
        match self.stage {
            Stage::Messages { left, messages, .. } if messages > 0 && have >= 4 => {
                let bytes = message_len(i32_at(&self.bytes, self.at), left, messages).unwrap_or(0);
                if bytes > self.longest { 0 } else { bytes.saturating_sub(have) }
            }
            _ => 0,
        }
    }

    /// Bytes that have come and have not been read.
    pub fn unread(&self) -> usize {
        self.end - self.at
    }

    /// Room for so many bytes behind what has not been read.
    fn room(&mut self, bytes: usize) -> &mut [u8] {
        if self.bytes.len() - self.end < bytes {
            self.drop_what_was_read();
        }
        let needed = self.end + bytes;
        if self.bytes.len() < needed {
            self.bytes.resize(needed, 0);
        }
        &mut self.bytes[self.end..needed]
    }

    fn drop_what_was_read(&mut self) {
        self.bytes.copy_within(self.at..self.end, 0);
        (self.at, self.end) = (0, self.unread());
    }

    /// Bytes that it holds room for.
    pub fn capacity(&self) -> usize {
        self.bytes.capacity()
    }

    /// Gives room back that nothing lies in.
    pub fn shrink(&mut self) {
        self.drop_what_was_read();
        self.bytes.truncate(self.end);
        self.bytes.shrink_to_fit();
    }

    /// What comes next; `None`: that needs more bytes.
    ///
    /// # Errors
    /// See [`StreamError`]; there is nothing to be had of this stream any more.
    pub fn next_event(&mut self) -> Result<Option<Event<'_>>, StreamError> {
        loop {
            let have = self.unread();
            match self.stage {
                Stage::Greeting => {
                    let Some(greeting) = self.take(GREETING_LEN) else { return Ok(None) };
                    let (said, rest) = greeting.split_at(GREETING.len());
                    if !said.eq_ignore_ascii_case(GREETING) || rest[0] != 0 {
                        return Err(StreamError::Greeting);
                    }
                    self.stage = Stage::Header;
                    return Ok(Some(Event::Greeting));
                }
                Stage::Header => {
                    let Some(header) = self.take(HEADER) else { return Ok(None) };
                    self.stage = packet(header)?;
                }
                Stage::Messages { left: 0, messages: 0, .. } => {
                    self.stage = Stage::Header;
                    return Ok(Some(Event::End));
                }
                Stage::Messages { left, messages, first } => {
                    if have < 4 {
                        return Ok(None);
                    }
                    let len = i32_at(&self.bytes, self.at);
                    let bytes = message_len(len, left, messages)?;
                    let (left, messages) = (left - bytes, messages - 1);
                    if bytes > self.longest {
                        let head = bytes.min(LONGEST_HEAD);
                        if have < head {
                            return Ok(None);
                        }
                        self.passed_key = Message::key_in(&self.bytes[self.at..self.at + head]).map(<[u8]>::to_vec);
                        self.stage = Stage::Skipping { skip: bytes, bytes, left, messages };
                        continue;
                    }
                    if have < bytes {
                        return Ok(None);
                    }
                    self.stage = Stage::Messages { left, messages, first: false };
                    let start = self.at;
                    self.at += bytes;
                    let message = Message::read(&self.bytes[start..start + bytes])?;
                    return Ok(Some(Event::Message { message, first }));
                }
                Stage::Skipping { skip: 0, bytes, left, messages } => {
                    self.stage = Stage::Messages { left, messages, first: false };
                    return Ok(Some(Event::TooLong { bytes, key: self.passed_key.as_deref() }));
                }
                Stage::Skipping { skip, bytes, left, messages } => {
                    let passed = skip.min(have);
                    if passed == 0 {
                        return Ok(None);
                    }
                    self.at += passed;
                    self.stage = Stage::Skipping { skip: skip - passed, bytes, left, messages };
                }
            }
        }
    }

    fn take(&mut self, len: usize) -> Option<&[u8]> {
        let taken = self.bytes[self.at..self.end].get(..len)?;
        self.at += len;
        Some(taken)
    }
}

/// What a packet's header says is to come.
fn packet(header: &[u8]) -> Result<Stage, StreamError> {
    let (len, messages) = (i32_at(header, 0), i32_at(header, 4));
    let bad = StreamError::Packet { len, messages };
    let (Ok(bytes), Ok(count)) = (usize::try_from(len), usize::try_from(messages)) else { return Err(bad) };
    let left = bytes.checked_sub(HEADER);
    let left = left.filter(|left| count.saturating_mul(SHORTEST) <= *left && (count > 0 || *left == 0));
    Ok(Stage::Messages { left: left.ok_or(bad)?, messages: count, first: true })
}

/// The length of a message that says `len`, with `left` bytes for so many `messages`.
fn message_len(len: i32, left: usize, messages: usize) -> Result<usize, StreamError> {
    let bad = StreamError::Length { len, left, messages };
    let bytes = usize::try_from(len).ok().filter(|bytes| (SHORTEST..=left).contains(bytes)).ok_or(bad.clone())?;
    let (rest, others) = (left - bytes, messages.saturating_sub(1));
    let is_sound = if others == 0 { rest == 0 } else { others.saturating_mul(SHORTEST) <= rest };
    if is_sound { Ok(bytes) } else { Err(bad) }
}

fn i32_at(bytes: &[u8], at: usize) -> i32 {
    i32::from_le_bytes([bytes[at], bytes[at + 1], bytes[at + 2], bytes[at + 3]])
}
