//! What a client says, in the broker's words: names become numbers that it has introduced before.

use std::collections::HashMap;

use elk_proto::broker::{Broker, Carried};
use elk_proto::types::Type;
use elk_proto::wire::{self, FrameKind, Header, Named, ValueKind};

use super::refusal::Refusal;
use super::wildcard::Wildcard;
use crate::message::{Data, Message, NO_NUMBER};
use crate::text::{Form, LONGEST_VALUE, Read, Texts};

/// The type of bytes of which MOOS says nothing more.
pub const BYTES_TYPE: &str = "MOOS binary";

/// Names that a session gives numbers to, of one kind; beyond them the broker has long refused more.
const MOST_NAMES: usize = 1 << 16;

/// The numbers that a client's names have on its way up.
#[derive(Debug)]
pub struct Up {
    name: String,
    /// The sequence of a message that its publisher has not numbered.
    unnumbered: u64,
    any_source: bool,
    keys: Numbers,
    sources: Numbers,
    communities: Numbers,
    /// Types by their numbers, with their layouts: two versions of one are two, and a client publishes few.
    types: Vec<(Box<str>, u64)>,
    /// Variables whose typed values the client says as texts, and what types of such texts are.
    texts: Texts,
    forms: Vec<TextType>,
}

/// A type whose values come as texts.
#[derive(Debug)]
struct TextType {
    name: Box<str>,
    layout: u64,
    form: Form,
}

/// Names of one kind, by their numbers.
#[derive(Debug)]
struct Numbers {
    what: Named,
    known: HashMap<Box<[u8]>, u32>,
    /// The number of the first name: those before it are given without one.
    first: u32,
    /// The last one that was asked for: a publisher says the same name again and again.
    last: Option<(Box<[u8]>, u32)>,
}

impl Numbers {
    fn new(what: Named, first: u32) -> Self {
        Self { what, known: HashMap::new(), first, last: None }
    }

    /// The number of a name; a new one is introduced in `batch`.
    fn number(&mut self, name: &[u8], batch: &mut Vec<u8>) -> Result<u32, Refusal> {
        if let Some((_, number)) = self.last.as_ref().filter(|(last, _)| **last == *name) {
            return Ok(*number);
        }
        let number = match self.known.get(name) {
            Some(number) => *number,
            None => self.introduce(name, batch)?,
        };
        self.last = Some((name.into(), number));
        Ok(number)
    }

    fn introduce(&mut self, name: &[u8], batch: &mut Vec<u8>) -> Result<u32, Refusal> {
        let text = text(name, name)?;
        if text.len() > wire::MAX_NAME {
            let reason = format!("a name of {} bytes; at most {} are allowed", text.len(), wire::MAX_NAME);
            return Err(Refusal { key: shown(name), reason });
        }
        if self.known.len() >= MOST_NAMES {
            let reason = format!("this client has used {MOST_NAMES} names already, and no more are allowed");
            return Err(Refusal { key: shown(name), reason });
        }
        let number = self.first + self.known.len() as u32;
        wire::put_definition(batch, self.what, number, text, 0, "");
        self.known.insert(name.into(), number);
        Ok(number)
    }
}

impl Up {
    /// That of a client of this name.
    pub fn new(name: &str, life: u64, any_source: bool, texts: Texts) -> Self {
        Self {
            name: name.to_owned(),
            unnumbered: wire::first_sequence(life),
            any_source,
            keys: Numbers::new(Named::Key, 0),
            // 0 is the client itself, and the broker's own community.
            sources: Numbers::new(Named::Source, 1),
            communities: Numbers::new(Named::Community, 1),
            types: Vec::new(),
            texts,
            forms: Vec::new(),
        }
    }

    /// A message that the client publishes.
    pub fn notify(&mut self, message: &Message<'_>, broker: &Broker, batch: &mut Vec<u8>) -> Result<(), Refusal> {
        let refused = |reason: &str| Err(Refusal { key: shown(message.key), reason: reason.to_owned() });
        if !message.time.is_finite() {
            return refused("its time is no number");
        }
        if message.data == Data::STRING && std::str::from_utf8(message.value).is_err() {
            return refused("its text is not UTF-8: right is UTF-8, or binary data (NotifyBinary)");
        }
        let read = if message.data == Data::STRING { self.read(message, broker)? } else { None };
        let number = number_of(message);
        let (value_kind, value) = match (message.data, &read) {
            (_, Some((_, read))) => (ValueKind::Binary, read.bytes.as_slice()),
            (Data::DOUBLE, _) => (ValueKind::Double, &number[..number_len(message)]),
            (Data::STRING, _) => (ValueKind::Text, message.value),
            (Data::BINARY, _) => (ValueKind::Binary, message.value),
            _ => return refused("it carries neither a number, nor a text, nor bytes"),
        };
        text(message.source_aux, message.key)?;
        let key = self.keys.number(message.key, batch)?;
        let type_ = match (value_kind, &read) {
            (_, Some((form, _))) => {
                let TextType { name, layout, .. } = &self.forms[*form];
                number_of_type(&mut self.types, name, *layout, batch)
            }
            (ValueKind::Binary, None) => self.type_of(message.key, broker, batch)?,
            _ => 0,
        };
        let community = match message.community {
            b"" => 0,
            other => self.communities.number(other, batch)?,
        };
        let (source, aux) = self.source(message, batch)?;
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
        wire::put(batch, &header, aux, value);
        Ok(())
    }

    /// Under whose name a message goes out, with what is said of that one. A name that the client may not publish under
    /// stands there, unless it says something else there.
    fn source<'a>(&mut self, message: &Message<'a>, batch: &mut Vec<u8>) -> Result<(u32, &'a [u8]), Refusal> {
        let Message { source, source_aux, .. } = *message;
        if source.is_empty() || source == self.name.as_bytes() {
            return Ok((0, source_aux));
        }
        if self.any_source {
            return Ok((self.sources.number(source, batch)?, source_aux));
        }
        text(source, message.key)?;
        Ok((0, if source_aux.is_empty() { source } else { source_aux }))
    }

    /// The type of bytes: that of the variable, if it has one.
    fn type_of(&mut self, key: &[u8], broker: &Broker, batch: &mut Vec<u8>) -> Result<u32, Refusal> {
        let (name, layout) = match broker.carried(text(key, key)?) {
            Some(Carried::Typed { name, layout, .. }) => (name, layout),
            _ => (BYTES_TYPE, 0),
        };
        Ok(number_of_type(&mut self.types, name, layout, batch))
    }

    /// What a text says, and in which form, if it is of a variable whose typed values come as texts.
    fn read(&mut self, message: &Message<'_>, broker: &Broker) -> Result<Option<(usize, Read)>, Refusal> {
        if self.texts.is_empty() {
            return Ok(None);
        }
        let (variable, said) = (text(message.key, message.key)?, text(message.value, message.key)?);
        if self.texts.poses(variable).is_none() {
            return Ok(None);
        }
        let refused = |reason: String| Refusal { key: shown(message.key), reason };
        let (name, layout, description) = match broker.carried(variable).or_else(|| broker.read_as(variable)) {
            Some(Carried::Plain) => return Ok(None),
            Some(Carried::Typed { name, layout, description }) => (name, layout, description),
            None => {
                let reason = "nobody has written it or reads it by its name, so that nobody knows its type";
                return Err(refused(reason.to_owned()));
            }
        };
        let form = self.form(name, layout, description).map_err(refused)?;
        let read = self.forms[form].form.read(variable, said).map_err(refused)?;
        match read.bytes.len() > LONGEST_VALUE {
            true => {
                Err(refused(format!("its value has {} bytes; at most {LONGEST_VALUE} are taken", read.bytes.len())))
            }
            false => Ok(Some((form, read))),
        }
    }

    /// The place of a type's form.
    fn form(&mut self, name: &str, layout: u64, description: &str) -> Result<usize, String> {
        let is_same = |one: &TextType| *one.name == *name && one.layout == layout;
        if let Some(place) = self.forms.iter().position(is_same) {
            return Ok(place);
        }
        let form = Form::of(Type::from_text(name, layout, description)?)?;
        self.forms.push(TextType { name: name.into(), layout, form });
        Ok(self.forms.len() - 1)
    }

    /// A subscription to a variable, or its end.
    pub fn register(&mut self, message: &Message<'_>, kind: FrameKind, batch: &mut Vec<u8>) -> Result<(), Refusal> {
        let key = text(message.key, message.key)?;
        put_registration(batch, kind, key, "*", message.number);
        Ok(())
    }

    /// A subscription to patterns, or its end.
    pub fn wildcard(&mut self, message: &Message<'_>, kind: FrameKind, batch: &mut Vec<u8>) -> Result<(), Refusal> {
        let Wildcard { sources, keys, interval } = Wildcard::read(text(message.value, message.value)?);
        put_registration(batch, kind, &keys, &sources, interval);
        Ok(())
    }
}

/// The number of a type; a new one is introduced in `batch`.
fn number_of_type(types: &mut Vec<(Box<str>, u64)>, name: &str, layout: u64, batch: &mut Vec<u8>) -> u32 {
    let known = types.iter().position(|(known, version)| **known == *name && *version == layout);
    known.unwrap_or_else(|| {
        wire::put_definition(batch, Named::Type, types.len() as u32, name, layout, "");
        types.push((name.into(), layout));
        types.len() - 1
    }) as u32
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
