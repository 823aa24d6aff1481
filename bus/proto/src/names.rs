//! What the broker's numbers stand for, and a message read with them.

use crate::link::Downlink;
use crate::mail::{Mail, Source, of_build};
use crate::types::Type;
use crate::value::ValueRef;
use crate::wire::{self, ATTACH, BULK, BulkRef, Frame, Named, ValueKind};

/// Names of one kind that a client takes in; a broker has fewer (see [`crate::broker::Limits`]).
const MOST_NAMES: usize = 1 << 20;

/// The broker's numbers and what they stand for, as far as it has said so.
#[derive(Default)]
pub struct Names {
    /// Of variables and communities.
    names: [Vec<Option<String>>; 4],
    sources: Vec<Option<Source>>,
    types: Vec<Option<Type>>,
    /// The client whose names they are, as people read it.
    reader: String,
}

impl Names {
    /// What the numbers stand for to a client of this name and build.
    pub fn of_reader(name: &str, build: &str) -> Self {
        Self { reader: of_build(name, build), ..Self::default() }
    }

    /// Begins anew, with another broker; answers what its numbers stood for before.
    pub fn begin_anew(&mut self) -> Self {
        let reader = self.reader.clone();
        std::mem::replace(self, Self { reader, ..Self::default() })
    }

    /// Takes in a definition.
    pub fn define(&mut self, frame: &Frame<'_>) {
        let number = frame.header.key as usize;
        if number >= MOST_NAMES {
            return; // no broker has so many: whoever sent this is none
        }
        let name = String::from_utf8_lossy(frame.aux);
        match wire::named(frame.header.flags) {
            None => {}
            Some(Named::Type) => *slot(&mut self.types, number) = Some(type_of(frame, &name)),
            Some(Named::Source) => {
                let build = String::from_utf8_lossy(frame.value).into_owned();
                *slot(&mut self.sources, number) = Some(Source { name: name.into_owned(), build });
            }
            Some(what) => *slot(&mut self.names[what as usize], number) = Some(name.into_owned()),
        }
    }

    /// The name that a message refers to by its number.
    #[inline]
    fn said(&self, what: Named, number: u32) -> Result<&str, Unreadable> {
        let name = self.names[what as usize].get(number as usize).and_then(Option::as_deref);
        name.ok_or(Unreadable::Damaged(unsaid(what)))
    }

    #[inline]
    fn said_source(&self, number: u32) -> Result<&Source, Unreadable> {
        let source = self.sources.get(number as usize).and_then(Option::as_ref);
        source.ok_or(Unreadable::Damaged(unsaid(Named::Source)))
    }

    #[inline]
    fn said_type(&self, number: u32) -> Result<&Type, Unreadable> {
        let type_ = self.types.get(number as usize).and_then(Option::as_ref);
        type_.ok_or(Unreadable::Damaged(unsaid(Named::Type)))
    }

    /// A message as its client gets it; `down` knows where bulk values lie.
    ///
    /// # Errors
    /// It cannot be shown.
    #[inline(always)]
    pub fn mail<'a>(&'a self, down: &'a mut dyn Downlink, frame: &Frame<'a>) -> Result<Mail<'a>, Unreadable> {
        let header = frame.header;
        let key = self.said(Named::Key, header.key)?;
        let source = self.said_source(header.source)?;
        let community = self.said(Named::Community, header.community)?;
        let held = match header.flags & BULK {
            0 => None,
            _ => Some(BulkRef::from_bytes(frame.value).and_then(|at| down.bulk(at)).ok_or(Unreadable::Gone)?),
        };
        let bytes = held.map_or(frame.value, |held| &**held);
        let text =
            |bytes: &'a [u8]| std::str::from_utf8(bytes).map_err(|_| Unreadable::Damaged("a text that is not UTF-8"));
        let value = match header.value_kind {
            ValueKind::Double => ValueRef::Double(
                wire::double(bytes).ok_or(Unreadable::Damaged("a number that is not eight bytes long"))?,
            ),
            ValueKind::Text => ValueRef::Text(text(bytes)?),
            ValueKind::Binary => ValueRef::Binary { type_: self.said_type(header.type_)?.as_ref(), bytes },
        };
        Ok(Mail {
            header,
            key,
            source,
            community,
            reader: &self.reader,
            source_aux: if header.flags & ATTACH != 0 { "" } else { text(frame.aux)? },
            value,
            held,
        })
    }

    /// The names of a variable and a source, as far as the broker has said them.
    pub fn of(&self, key: u32, source: u32) -> Option<(&str, &str)> {
        Some((self.said(Named::Key, key).ok()?, &self.said_source(source).ok()?.name))
    }
}

fn unsaid(what: Named) -> &'static str {
    match what {
        Named::Key => "a variable whose name was never said",
        Named::Source => "a source whose name was never said",
        Named::Type => "a type whose name was never said",
        Named::Community => "a community whose name was never said",
    }
}

/// The slot of a number in a table that is as long as it has to be.
fn slot<T>(table: &mut Vec<Option<T>>, number: usize) -> &mut Option<T> {
    if table.len() <= number {
        table.resize_with(number + 1, || None);
    }
    &mut table[number]
}

/// The type that a definition names. A broker passes no description on that is none.
fn type_of(frame: &Frame<'_>, name: &str) -> Type {
    let layout = frame.header.sequence;
    let described = std::str::from_utf8(frame.value).ok().and_then(|text| Type::from_text(name, layout, text).ok());
    described.unwrap_or_else(|| Type::undescribed(name, layout))
}

/// Why a message cannot be shown.
pub enum Unreadable {
    /// Its value was overwritten before this client came to read it.
    Gone,
    /// It is not what it says it is.
    Damaged(&'static str),
}
