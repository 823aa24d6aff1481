//! A client of MOOS' that was let in, as the broker sees it: what it says becomes frames, and frames become what it is told.
//! Nothing here reads a clock or a socket.

mod down;
mod refusal;
mod up;
mod wildcard;

use elk_proto::broker::Broker;
use elk_proto::wire::{self, Frame, FrameKind};

use crate::hello::Manner;
use crate::message::{Data, Kind, Message, REQUEST_ID};
use crate::outgoing::{Outgoing, PacketWriter};
use crate::packet::LONGEST_HEAD;
use crate::text::{Forms, Texts};
use down::Down;
pub use down::data_of;
pub use refusal::Refusal;
use up::Up;
pub use up::{BYTES_TYPE, Context};

/// What a client asks the server, in the order in which it is answered.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub enum Request {
    /// All variables with their values.
    All,
    /// The names of all variables.
    Variables,
    /// Who reads and writes what.
    Processes,
}

/// A sign of life that has not been answered.
#[derive(Debug)]
struct Timing {
    id: i32,
    key: Vec<u8>,
    time: f64,
}

/// A client that was let in.
#[derive(Debug)]
pub struct Session {
    manner: Manner,
    up: Up,
    down: Down,
    timing: Option<Timing>,
    /// Packets of a synchronous client that have not been answered.
    replies_due: usize,
    requests: Vec<Request>,
    refusals: Vec<Refusal>,
    /// Messages that the client was ever given.
    given: u64,
}

/// Refusals that wait to be told; further ones are not put down.
const REFUSALS: usize = 64;
/// What stands for a variable that could not be read.
const UNREAD: &str = "unknown";

impl Session {
    /// The session of a client of this name. `life` tells it from those that had the name before it (see
    /// [`wire::first_sequence`]); `any_source`: it may publish under the names of others; `texts` are the variables whose typed
    /// values it hears and says as texts.
    pub fn new(name: &str, manner: Manner, life: u64, any_source: bool, texts: &Texts) -> Self {
        Self {
            manner,
            up: Up::new(name, life, any_source, texts.clone()),
            down: Down::new(texts.clone()),
            timing: None,
            replies_due: 0,
            requests: Vec::new(),
            refusals: Vec::new(),
            given: 0,
        }
    }

    /// How the client talks.
    pub fn manner(&self) -> Manner {
        self.manner
    }

    /// Takes a message of the client's, the `first` of its packet or a later one; what it says to the broker is appended
    /// to `batch`, but for a long value: that one's frame, which comes behind what is in `batch`, is answered, and the value
    /// stays where it lies. Bytes are of the type that their variable carries in the broker.
    pub fn take<'a>(
        &mut self,
        message: &Message<'a>,
        first: bool,
        context: &mut Context<'_>,
        batch: &mut Vec<u8>,
    ) -> Option<Frame<'a>> {
        let mut long = None;
        let said = match message.kind {
            Kind::NOTIFY => self.up.notify(message, context, batch).map(|frame| long = frame),
            Kind::REGISTER => self.up.register(message, FrameKind::Register, batch),
            Kind::UNREGISTER => self.up.register(message, FrameKind::Unregister, batch),
            Kind::WILDCARD_REGISTER => self.up.wildcard(message, FrameKind::Register, batch),
            Kind::WILDCARD_UNREGISTER => self.up.wildcard(message, FrameKind::Unregister, batch),
            Kind::TIMING => {
                if first {
                    self.timing = Some(Timing { id: message.id, key: message.key.to_vec(), time: message.time });
                }
                Ok(())
            }
            Kind::SERVER_REQUEST if message.id == REQUEST_ID => self.note_request(message.key),
            // A request for nothing but a reply, or what MOOS' server passes over as well.
            _ => Ok(()),
        };
        if let Err(refusal) = said {
            self.refuse(refusal);
        }
        long
    }

    /// A packet of the client's is over.
    pub fn end_packet(&mut self) {
        if self.manner == Manner::Synchronous {
            self.replies_due = self.replies_due.saturating_add(1);
        }
    }

    /// A message of the client's was passed over, because it was `bytes` long and `longest` are the most. `key` is its variable,
    /// if that could be read.
    pub fn note_too_long(&mut self, bytes: usize, longest: usize, key: Option<&[u8]>) {
        let mut reason = format!("a message of {bytes} bytes; at most {longest} travel here");
        let key = key.map(String::from_utf8_lossy).unwrap_or_else(|| {
            reason += &format!("; its variable could not be read, its first {LONGEST_HEAD} bytes do not reach to it");
            UNREAD.into()
        });
        self.refuse(Refusal { key: key.into_owned(), reason });
    }

    fn note_request(&mut self, key: &[u8]) -> Result<(), Refusal> {
        let key = String::from_utf8_lossy(key);
        let request = match &*key {
            "ALL" => Request::All,
            key if key.contains("VAR_SUMMARY") => Request::Variables,
            key if key.contains("PROC_SUMMARY") => Request::Processes,
            key if key.contains("DB_CLEAR") => {
                let reason = "the variables are those of a running mission, and one client does not clear them for all";
                return Err(Refusal { key: key.to_owned(), reason: reason.into() });
            }
            // As MOOS' server does.
            _ => return Ok(()),
        };
        // Asked twice before an answer, it is answered once: the asker takes the first answer there is.
        if !self.requests.contains(&request) {
            self.requests.push(request);
        }
        Ok(())
    }

    fn refuse(&mut self, refusal: Refusal) {
        if self.refusals.len() < REFUSALS {
            self.refusals.push(refusal);
        }
    }

    /// What was not taken since this was asked last.
    pub fn take_refusals(&mut self) -> Vec<Refusal> {
        std::mem::take(&mut self.refusals)
    }

    /// Whether the client can be told something now: an asynchronous one always, a synchronous one if it has asked.
    pub fn may_be_told(&self) -> bool {
        self.manner == Manner::Asynchronous || self.replies_due > 0
    }

    /// Whether the client has to be told something, mail or not.
    pub fn is_owed(&self) -> bool {
        self.timing.is_some() || self.replies_due > 0 || (!self.requests.is_empty() && self.may_be_told())
    }

    /// What the client has asked and is about to be answered.
    pub fn take_requests(&mut self) -> Vec<Request> {
        std::mem::take(&mut self.requests)
    }

    /// Messages that the client was ever given.
    pub fn given(&self) -> u64 {
        self.given
    }

    /// Appends the next packet to `out`: the server's clock (`time`, s) if it is owed, then the mail in `batch`, as the
    /// broker gave it, where its long values stay, then `answers`. Whether there is any.
    pub fn put_packet(
        &mut self,
        time: f64,
        batch: &[u8],
        broker: &Broker,
        forms: &mut Forms,
        answers: &mut dyn Answers,
        out: &mut Outgoing,
    ) -> bool {
        let mut packet = PacketWriter::new(out, batch);
        match self.manner {
            Manner::Synchronous => {
                self.replies_due = self.replies_due.saturating_sub(1);
                packet.put(&Message { number: time, ..Message::new(Kind::NULL, Data::DOUBLE) });
            }
            Manner::Asynchronous => {
                if let Some(Timing { id, key, time: asked_at }) = self.timing.take() {
                    // The second number is how long the client is to pause after each packet (s).
                    let answer = Message::new(Kind::TIMING, Data::DOUBLE);
                    packet.put(&Message { id, key: &key, time: asked_at, number: time, second: 0.0, ..answer });
                }
            }
        }
        for frame in wire::frames(batch).map_while(Result::ok) {
            self.tell(&frame, broker, forms, &mut packet);
        }
        answers.put(&mut packet);
        packet.finish()
    }

    fn tell(&mut self, frame: &Frame<'_>, broker: &Broker, forms: &mut Forms, packet: &mut PacketWriter<'_>) {
        match frame.header.kind {
            FrameKind::Notify => {
                self.given += 1;
                if let Err(refusal) = self.down.put_into_text(frame, broker, forms) {
                    self.refuse(refusal);
                }
                if let Some(message) = self.down.message(frame, broker) {
                    packet.put(&message);
                }
            }
            FrameKind::Refused => {
                let [key, reason] = [frame.aux, frame.value].map(|text| String::from_utf8_lossy(text).into_owned());
                self.refuse(Refusal { key, reason });
            }
            // Names are the broker's, what was dropped stands in DB_DROPS, and the community's clock in the signs of life.
            _ => {}
        }
    }
}

/// What a client has asked for, put behind its mail.
pub trait Answers {
    /// Puts all of it.
    fn put(&mut self, packet: &mut PacketWriter<'_>);
}

/// Nothing was asked.
impl Answers for () {
    fn put(&mut self, _: &mut PacketWriter<'_>) {}
}

#[cfg(test)]
mod tests;
