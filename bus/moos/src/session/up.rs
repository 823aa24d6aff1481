//! What a client says, in the broker's words: names become the broker's numbers.

use elk_proto::broker::{Broker, Carried, ITSELF};
use elk_proto::wire::{self, ClientId, Frame, FrameKind, Header, Named, ValueKind};

use super::refusal::Refusal;
use super::wildcard::Wildcard;
use crate::message::{Data, Message, NO_NUMBER};
use crate::outgoing::LONG;
use crate::text::{Forms, LONGEST_VALUE, Read, Texts};

/// The type of bytes of which MOOS says nothing more.
pub const BYTES_TYPE: &str = "MOOS binary";

/// Why a message without a key is not taken.
const NO_NAME: &str = "it names no variable";

/// What a session works with: its client in the broker of this process, and what that one's types are as texts.
pub struct Context<'a> {
    /// The client.
    pub id: ClientId,
    /// The broker.
    pub broker: &'a mut Broker,
    /// Forms that all sessions share.
    pub forms: &'a mut Forms,
}

impl Context<'_> {
    /// The broker's number of a name, in a message of `key`.
    fn number(&mut self, what: Named, name: &[u8], key: &[u8]) -> Result<u32, Refusal> {
        let refused = |reason| Refusal { key: shown(name), reason };
        self.broker.number_for(self.id, what, text(name, key)?, 0).map_err(refused)
    }

    fn type_number(&mut self, name: &str, layout: u64, key: &[u8]) -> Result<u32, Refusal> {
        let refused = |reason| Refusal { key: shown(key), reason };
        self.broker.number_for(self.id, Named::Type, name, layout).map_err(refused)
    }

    /// The type of bytes: that of the variable, if it has one.
    fn type_of(&mut self, key: &[u8]) -> Result<u32, Refusal> {
        match self.broker.carried(text(key, key)?) {
            Some(Carried::Typed { name, layout, .. }) => {
                let name = name.to_owned();
                self.type_number(&name, layout, key)
            }
            _ => self.type_number(BYTES_TYPE, 0, key),
        }
    }
}

/// What a client says, on its way up.
#[derive(Debug)]
pub struct Up {
    name: String,
    /// The sequence of a message that its publisher has not numbered.
    unnumbered: u64,
    any_source: bool,
    /// Variables whose typed values the client says as texts.
    texts: Texts,
}

impl Up {
    /// That of a client of this name.
    pub fn new(name: &str, life: u64, any_source: bool, texts: Texts) -> Self {
        Self { name: name.to_owned(), unnumbered: wire::first_sequence(life), any_source, texts }
    }

    /// A message that the client publishes; its frame, if its value is so long that it stays where it lies.
    pub fn notify<'a>(
        &self,
        message: &Message<'a>,
        context: &mut Context<'_>,
        batch: &mut Vec<u8>,
    ) -> Result<Option<Frame<'a>>, Refusal> {
        let refused = |reason: &str| Err(Refusal { key: shown(message.key), reason: reason.to_owned() });
        if message.key.is_empty() {
            return refused(NO_NAME);
        }
        if !message.time.is_finite() {
            return refused("its time is no number");
        }
        if message.data == Data::STRING && std::str::from_utf8(message.value).is_err() {
            return refused("its text is not UTF-8: right is UTF-8, or binary data (NotifyBinary)");
        }
        let read = if message.data == Data::STRING { self.read(message, context)? } else { None };
        let number = number_of(message);
        let (value_kind, value) = match (message.data, &read) {
            (_, Some((_, read))) => (ValueKind::Binary, read.bytes.as_slice()),
            (Data::DOUBLE, _) => (ValueKind::Double, &number[..number_len(message)]),
            (Data::STRING, _) => (ValueKind::Text, message.value),
            (Data::BINARY, _) => (ValueKind::Binary, message.value),
            _ => return refused("it carries neither a number, nor a text, nor bytes"),
        };
        text(message.source_aux, message.key)?;
        let key = context.number(Named::Key, message.key, message.key)?;
        let type_ = match (value_kind, &read) {
            (_, Some((type_, _))) => *type_,
            (ValueKind::Binary, None) => context.type_of(message.key)?,
            _ => 0,
        };
        let community = match message.community {
            b"" => 0,
            other => context.number(Named::Community, other, message.key)?,
        };
        let (source, aux) = self.source(message, context)?;
        let header = Header {
            value_kind,
            key,
            source,
            type_,
            community,
            // MOOS counts from 0, and -1 is no count.
            sequence: self.unnumbered + u64::try_from(message.id).map_or(0, |id| id + 1),
            time: read.as_ref().and_then(|(_, read)| read.time).unwrap_or(message.time),
            ..Header::new(FrameKind::Notify)
        };
        if value_kind != ValueKind::Double && read.is_none() && message.value.len() >= LONG {
            return Ok(Some(Frame::apart(header, aux, message.value)));
        }
        wire::put(batch, &header, aux, value);
        Ok(None)
    }

    /// Under whose name a message goes out, with what is said of that one. A name that the client may not publish under
    /// stands there, unless it says something else there.
    fn source<'a>(&self, message: &Message<'a>, context: &mut Context<'_>) -> Result<(u32, &'a [u8]), Refusal> {
        let Message { source, source_aux, .. } = *message;
        if source.is_empty() || source == self.name.as_bytes() {
            return Ok((ITSELF, source_aux));
        }
        if self.any_source {
            return Ok((context.number(Named::Source, source, message.key)?, source_aux));
        }
        text(source, message.key)?;
        Ok((ITSELF, if source_aux.is_empty() { source } else { source_aux }))
    }

    /// The type of what a text says, and what it says, if it is of a variable whose typed values come as texts.
    fn read(&self, message: &Message<'_>, context: &mut Context<'_>) -> Result<Option<(u32, Read)>, Refusal> {
        if self.texts.is_empty() {
            return Ok(None);
        }
        let (variable, said) = (text(message.key, message.key)?, text(message.value, message.key)?);
        if self.texts.poses(variable).is_none() {
            return Ok(None);
        }
        let refused = |reason: String| Refusal { key: shown(message.key), reason };
        let broker: &Broker = context.broker;
        let (name, layout) = match broker.carried(variable).or_else(|| broker.read_as(variable)) {
            Some(Carried::Plain) => return Ok(None),
            Some(Carried::Typed { name, layout, .. }) => (name.to_owned(), layout),
            None => {
                let reason = "nobody has written it or reads it by its name, so that nobody knows its type";
                return Err(refused(reason.to_owned()));
            }
        };
        let type_ = context.type_number(&name, layout, message.key)?;
        let form = context.forms.of(type_, context.broker).map_err(refused)?;
        let read = form.read(variable, said).map_err(refused)?;
        match read.bytes.len() > LONGEST_VALUE {
            true => {
                Err(refused(format!("its value has {} bytes; at most {LONGEST_VALUE} are taken", read.bytes.len())))
            }
            false => Ok(Some((type_, read))),
        }
    }

    /// A subscription to a variable, or its end.
    pub fn register(&self, message: &Message<'_>, kind: FrameKind, batch: &mut Vec<u8>) -> Result<(), Refusal> {
        let key = text(message.key, message.key)?;
        if key.is_empty() {
            return Err(Refusal { key: String::new(), reason: NO_NAME.to_owned() });
        }
        put_registration(batch, kind, key, "*", message.number);
        Ok(())
    }

    /// A subscription to patterns, or its end.
    pub fn wildcard(&self, message: &Message<'_>, kind: FrameKind, batch: &mut Vec<u8>) -> Result<(), Refusal> {
        let refused = |reason: &str| Refusal { key: shown(message.value), reason: reason.to_owned() };
        let Wildcard { sources, keys, interval } =
            Wildcard::read(text(message.value, message.value)?).map_err(refused)?;
        put_registration(batch, kind, &keys, &sources, interval);
        Ok(())
    }
}

fn put_registration(batch: &mut Vec<u8>, kind: FrameKind, keys: &str, sources: &str, interval: f64) {
    let header = Header { time: interval, ..Header::new(kind) };
    wire::put(batch, &header, keys.as_bytes(), sources.as_bytes());
}

/// A number's bytes, and those of the second.
fn number_of(message: &Message<'_>) -> [u8; 16] {
    let mut bytes = [0; 16];
    bytes[..8].copy_from_slice(&message.number.to_le_bytes());
    bytes[8..].copy_from_slice(&message.second.to_le_bytes());
    bytes
}

/// How many of them travel: the second number only if there is one.
fn number_len(message: &Message<'_>) -> usize {
    if message.second == NO_NUMBER { 8 } else { 16 }
}

/// Bytes that have to be a text; `key` is what they are said of.
fn text<'a>(bytes: &'a [u8], key: &[u8]) -> Result<&'a str, Refusal> {
    let not_utf8 = |_| Refusal { key: shown(key), reason: "a name is not UTF-8".to_owned() };
    std::str::from_utf8(bytes).map_err(not_utf8)
}

fn shown(name: &[u8]) -> String {
    String::from_utf8_lossy(&name[..name.len().min(wire::MAX_NAME)]).into_owned()
}
