//! What a client is told: numbers become the names again that they stand for.

use elk_proto::types::Type;
use elk_proto::wire::{self, BULK, Frame, LATEST, Named, ValueKind};

use super::refusal::Refusal;
use crate::message::{Data, Kind, Message, NO_ID, NO_NUMBER};
use crate::text::{Form, Poses, Texts};

/// What the broker's numbers stand for, by kind, as far as it has said so.
#[derive(Debug)]
pub struct Down {
    names: [Vec<Box<[u8]>>; 4],
    /// Variables whose typed values the client hears as texts; which of the broker's they are and how their poses are told, and
    /// what its types of such texts are, or why they are none.
    texts: Texts,
    poses: Vec<Option<Poses>>,
    forms: Vec<Result<Form, String>>,
    /// The text of the message that is told next, if it is told as one.
    text: Option<String>,
}

impl Down {
    /// For a client that hears the typed values of these variables as texts.
    pub fn new(texts: Texts) -> Self {
        Self { names: Default::default(), texts, poses: Vec::new(), forms: Vec::new(), text: None }
    }

    /// Takes in a definition. The broker, which is here in this process, gives numbers in order, so none is far off.
    pub fn define(&mut self, frame: &Frame<'_>) {
        let (Some(what), number) = (wire::named(frame.header.flags), frame.header.key as usize) else { return };
        match what {
            // The name of a type is nothing that MOOS has a place for.
            Named::Type if self.texts.is_empty() => return,
            Named::Type => {
                put_at(&mut self.forms, number, form_of(frame), || Err("nobody has said what it is".to_owned()))
            }
            _ => {}
        }
        if what == Named::Key {
            let poses = std::str::from_utf8(frame.aux).ok().and_then(|name| self.texts.poses(name));
            put_at(&mut self.poses, number, poses, || None);
        }
        put_at(&mut self.names[what as usize], number, frame.aux.into(), Box::default);
    }

    /// Makes the text that the message of `frame` is told as, if it is. One that cannot be is told as bytes.
    ///
    /// # Errors
    /// Why it cannot be.
    pub fn put_into_text(&mut self, frame: &Frame<'_>) -> Result<(), Refusal> {
        let header = frame.header;
        self.text = None;
        let Some(poses) = self.poses.get(header.key as usize).copied().flatten() else { return Ok(()) };
        if header.value_kind != ValueKind::Binary || header.flags & BULK != 0 {
            return Ok(());
        }
        let variable = String::from_utf8_lossy(self.name(Named::Key, header.key)).into_owned();
        let text = match self.forms.get(header.type_ as usize) {
            Some(Ok(form)) => form.text(&variable, frame.value, poses),
            Some(Err(reason)) => Err(reason.clone()),
            None => Err("nobody has said what it is".to_owned()),
        };
        let refused =
            |reason| Refusal { key: variable, reason: format!("it is told as bytes and not as text: {reason}") };
        self.text = Some(text.map_err(refused)?);
        Ok(())
    }

    fn name(&self, what: Named, number: u32) -> &[u8] {
        self.names[what as usize].get(number as usize).map_or(&[], |name| name)
    }

    /// A message as its client gets it; `None`: its value is gone.
    pub fn message<'a>(&'a self, frame: &Frame<'a>) -> Option<Message<'a>> {
        let header = frame.header;
        if header.flags & BULK != 0 {
            return None;
        }
        let mut message = Message {
            // A latest value is nobody's n-th message.
            id: if header.flags & LATEST != 0 { NO_ID } else { id_of(header.sequence) },
            source: self.name(Named::Source, header.source),
            source_aux: frame.aux,
            community: self.name(Named::Community, header.community),
            key: self.name(Named::Key, header.key),
            time: header.time,
            ..Message::new(Kind::NOTIFY, data_of(header.value_kind))
        };
        match header.value_kind {
            ValueKind::Double => {
                message.number = wire::double(frame.value)?;
                message.second = wire::second_double(frame.value).unwrap_or(NO_NUMBER);
            }
            ValueKind::Text | ValueKind::Binary => match &self.text {
                Some(text) => (message.data, message.value) = (Data::STRING, text.as_bytes()),
                None => message.value = frame.value,
            },
        }
        Some(message)
    }
}

/// Puts something at its place, behind fillers if there are places before it that are empty.
fn put_at<T>(all: &mut Vec<T>, place: usize, one: T, filler: impl FnMut() -> T) {
    if all.len() <= place {
        all.resize_with(place + 1, filler);
    }
    all[place] = one;
}

/// The form of a type that the broker defines.
fn form_of(frame: &Frame<'_>) -> Result<Form, String> {
    let [name, description] = [frame.aux, frame.value].map(String::from_utf8_lossy);
    Form::of(Type::from_text(&name, frame.header.sequence, &description)?)
}

/// MOOS' letter for a kind of value.
pub fn data_of(kind: ValueKind) -> Data {
    match kind {
        ValueKind::Double => Data::DOUBLE,
        ValueKind::Text => Data::STRING,
        ValueKind::Binary => Data::BINARY,
    }
}

/// MOOS counts a publisher's messages from 0.
fn id_of(sequence: u64) -> i32 {
    match wire::count(sequence) {
        0 => NO_ID,
        count => i32::try_from(count - 1).unwrap_or(NO_ID),
    }
}
