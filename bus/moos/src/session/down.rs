//! What a client is told: numbers become the names again that they stand for.

use elk_proto::wire::{self, BULK, Frame, LATEST, Named, ValueKind};

use crate::message::{Data, Kind, Message, NO_ID, NO_NUMBER};

/// What the broker's numbers stand for, by kind, as far as it has said so.
#[derive(Debug, Default)]
pub struct Down([Vec<Box<[u8]>>; 4]);

impl Down {
    /// Takes in a definition. The broker, which is here in this process, gives numbers in order, so none is far off.
    pub fn define(&mut self, frame: &Frame<'_>) {
        let (Some(what), number) = (wire::named(frame.header.flags), frame.header.key as usize) else { return };
        // The name of a type is nothing that MOOS has a place for.
        if what == Named::Type {
            return;
        }
        let names = &mut self.0[what as usize];
        if names.len() <= number {
            names.resize_with(number + 1, Box::default);
        }
        names[number] = frame.aux.into();
    }

    fn name(&self, what: Named, number: u32) -> &[u8] {
        self.0[what as usize].get(number as usize).map_or(&[], |name| name)
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
            ValueKind::Text | ValueKind::Binary => message.value = frame.value,
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
