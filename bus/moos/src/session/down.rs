//! What a client is told: the broker's numbers become the names that they stand for.

use elk_proto::broker::Broker;
use elk_proto::wire::{self, BULK, Frame, LATEST, Named, ValueKind};

use super::refusal::Refusal;
use crate::message::{Data, Kind, Message, NO_ID, NO_NUMBER};
use crate::text::{Forms, Texts};

/// What a client is told of in texts. The names are the broker's, which is in this process.
#[derive(Debug)]
pub struct Down {
    /// Variables whose typed values the client hears as texts.
    texts: Texts,
    /// The text of the message that is told next, if it is told as one.
    text: Option<String>,
}

impl Down {
    /// For a client that hears the typed values of these variables as texts.
    pub fn new(texts: Texts) -> Self {
        Self { texts, text: None }
    }

    /// Makes the text that the message of `frame` is told as, if it is. One that cannot be is told as bytes.
    ///
    /// # Errors
    /// Why it cannot be.
    pub fn put_into_text(&mut self, frame: &Frame<'_>, broker: &Broker, forms: &mut Forms) -> Result<(), Refusal> {
        let header = frame.header;
        self.text = None;
        if header.value_kind != ValueKind::Binary || header.flags & BULK != 0 || self.texts.is_empty() {
            return Ok(());
        }
        let (variable, ..) = broker.said(Named::Key, header.key);
        let Some(poses) = self.texts.poses(variable) else { return Ok(()) };
        let text = forms.of(header.type_, broker).and_then(|form| form.text(variable, frame.value, poses));
        let refused = |reason| Refusal {
            key: variable.to_owned(),
            reason: format!("it is told as bytes and not as text: {reason}"),
        };
        self.text = Some(text.map_err(refused)?);
        Ok(())
    }

    /// A message as its client gets it; `None`: its value is gone.
    pub fn message<'a>(&'a self, frame: &Frame<'a>, broker: &'a Broker) -> Option<Message<'a>> {
        let header = frame.header;
        let name = |what, number| broker.said(what, number).0.as_bytes();
        if header.flags & BULK != 0 {
            return None;
        }
        let mut message = Message {
            // A latest value is nobody's n-th message.
            id: if header.flags & LATEST != 0 { NO_ID } else { id_of(header.sequence) },
            source: name(Named::Source, header.source),
            source_aux: frame.aux,
            community: name(Named::Community, header.community),
            key: name(Named::Key, header.key),
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
