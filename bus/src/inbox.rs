//! What a client hears.

use std::time::Duration;

use crate::comms::{Comms, CommsError};
use crate::link::Downlink;
use crate::mail::Mail;
use crate::value::ValueRef;
use crate::wire::{self, ATTACH, BULK, BulkRef, Frame, FrameKind, Named, ValueKind};

/// What a client hears.
pub struct Inbox {
    down: Box<dyn Downlink>,
    names: Names,
    /// Messages dropped in the broker because this client did not read.
    dropped: u64,
    /// Bulk values that were overwritten before this client came to read them.
    missed_bulk: u64,
    refusals: Vec<Refused>,
}

/// A message of this client that the broker did not take.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Refused {
    /// The variable.
    pub key: String,
    /// The message's number (see [`Mail::sequence`]).
    pub sequence: u64,
    /// Why.
    pub reason: String,
}

/// The broker's numbers and what they stand for.
#[derive(Default)]
struct Names {
    tables: [Vec<(String, u64)>; 4],
}

impl Names {
    fn define(&mut self, frame: &Frame<'_>) {
        let Some(what) = wire::named(frame.header.flags) else {
            return;
        };
        let table = &mut self.tables[what as usize];
        let number = frame.header.key as usize;
        if table.len() <= number {
            table.resize(number + 1, (String::new(), 0));
        }
        table[number] = (String::from_utf8_lossy(frame.aux).into_owned(), frame.header.sequence);
    }

    fn get(&self, what: Named, number: u32) -> (&str, u64) {
        self.tables[what as usize].get(number as usize).map_or(("", 0), |(name, layout)| (name, *layout))
    }
}

impl Inbox {
    /// The hearing end of a client, over a transport's way down.
    pub(crate) fn new(down: Box<dyn Downlink>) -> Self {
        Self { down, names: Names::default(), dropped: 0, missed_bulk: 0, refusals: Vec::new() }
    }

    /// Waits at most `timeout` for mail and hands all that has come to `on_mail`, in order; answers how many messages
    /// that were. What `on_mail` fails with ends the batch.
    pub fn receive<E: From<CommsError>>(
        &mut self,
        comms: &mut Comms,
        timeout: Duration,
        mut on_mail: impl FnMut(&mut Comms, &Mail<'_>) -> Result<(), E>,
    ) -> Result<usize, E> {
        comms.flush()?;
        let Some(batch) = self.down.receive(timeout).map_err(CommsError::from)? else {
            return Ok(0);
        };
        let mut messages = 0;
        // The broker and the transport are trusted to frame rightly; a damaged rest is left unread.
        for frame in wire::frames(&batch).map_while(Result::ok) {
            match frame.header.kind {
                FrameKind::Define => self.names.define(&frame),
                FrameKind::Dropped => self.dropped = frame.header.sequence,
                FrameKind::Refused => self.refusals.push(Refused {
                    key: String::from_utf8_lossy(frame.aux).into_owned(),
                    sequence: frame.header.sequence,
                    reason: String::from_utf8_lossy(frame.value).into_owned(),
                }),
                FrameKind::Notify => {
                    self.attach_if_told(comms, &frame);
                    match mail(&mut *self.down, &self.names, &frame) {
                        Some(mail) => on_mail(comms, &mail)?,
                        None => self.missed_bulk += 1,
                    }
                    messages += 1;
                }
                FrameKind::Register | FrameKind::Unregister | FrameKind::Attached => {}
            }
        }
        Ok(messages)
    }

    fn attach_if_told(&mut self, comms: &mut Comms, frame: &Frame<'_>) {
        if let Some(publisher) = wire::publisher_to_attach(frame)
            && self.down.attach(publisher)
        {
            comms.attached(publisher);
        }
    }

    /// Messages that this client will never see, because it did not read in time.
    pub fn dropped(&self) -> u64 {
        self.dropped + self.missed_bulk
    }

    /// What the broker refused of this client's messages since the last call.
    pub fn take_refusals(&mut self) -> Vec<Refused> {
        std::mem::take(&mut self.refusals)
    }
}

fn mail<'a>(down: &'a mut dyn Downlink, names: &'a Names, frame: &Frame<'a>) -> Option<Mail<'a>> {
    let header = frame.header;
    let bytes = match header.flags & BULK {
        0 => frame.value,
        _ => down.bulk(BulkRef::from_bytes(frame.value)?)?,
    };
    let (type_name, layout) = names.get(Named::Type, header.type_);
    let value = match header.value_kind {
        ValueKind::Double => ValueRef::Double(f64::from_le_bytes(bytes.try_into().ok()?)),
        ValueKind::Text => ValueRef::Text(std::str::from_utf8(bytes).ok()?),
        ValueKind::Binary => ValueRef::Binary { type_name, layout, bytes },
    };
    Some(Mail {
        header,
        key: names.get(Named::Key, header.key).0,
        source: names.get(Named::Source, header.source).0,
        community: names.get(Named::Community, header.community).0,
        source_aux: if header.flags & ATTACH != 0 { "" } else { std::str::from_utf8(frame.aux).ok()? },
        value,
    })
}
