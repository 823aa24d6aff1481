//! A message as a client gets it.

use crate::codec::DecodeError;
use crate::key::{Key, Payload};
use crate::link::Held;
use crate::rejection::Rejection;
use crate::value::ValueRef;
use crate::wire::{self, Header, LATEST};

/// A message where it lies: names in the client's tables, the value in the batch or in the publisher's shared memory.
#[derive(Clone, Copy, Debug)]
pub struct Mail<'a> {
    pub(super) header: Header,
    pub(super) key: &'a str,
    pub(super) source: &'a Source,
    /// The client that is given it, as people read it.
    pub(super) reader: &'a str,
    pub(super) community: &'a str,
    pub(super) source_aux: &'a str,
    pub(super) value: ValueRef<'a>,
    /// The value, if it is a bulk value.
    pub(super) held: Option<&'a Held>,
}

/// Under whose name a message is published.
#[derive(Debug)]
pub(crate) struct Source {
    pub name: String,
    /// Which build of which program that is; empty: nobody has said.
    pub build: String,
}

/// A client with its build, for people: `sensor (elk 0.2.0)`.
pub(crate) fn of_build(name: &str, build: &str) -> String {
    if build.is_empty() { name.to_owned() } else { format!("{name} ({build})") }
}

/// Words for where a value was written, under this name and by this build, and for where it is read.
pub fn ends(source: &str, build: &str, reader: &str) -> [String; 2] {
    [format!("in {}", of_build(source, build)), format!("in {reader}")]
}

impl<'a> Mail<'a> {
    /// The variable's name.
    #[inline]
    pub fn key(&self) -> &'a str {
        self.key
    }

    /// The name of the app that published it.
    #[inline]
    pub fn source(&self) -> &'a str {
        &self.source.name
    }

    /// Which build of which program published it, as that said; empty: it has not said.
    #[inline]
    pub fn source_build(&self) -> &'a str {
        &self.source.build
    }

    /// The client that is given it, with its build, for people.
    #[inline]
    pub fn reader(&self) -> &'a str {
        self.reader
    }

    /// What the publisher said about the source; mostly empty.
    #[inline]
    pub fn source_aux(&self) -> &'a str {
        self.source_aux
    }

    /// The community that it was first published in.
    #[inline]
    pub fn community(&self) -> &'a str {
        self.community
    }

    /// When it was published (s, the community's clock).
    #[inline]
    pub fn time(&self) -> f64 {
        self.header.time
    }

    /// The publisher's count of its messages, from 1; a publisher that was started again counts anew.
    #[inline]
    pub fn sequence(&self) -> u64 {
        wire::count(self.header.sequence)
    }

    /// Whether it was published before this client registered, and given to it as the variable's latest value.
    #[inline]
    pub fn is_latest(&self) -> bool {
        self.header.flags & LATEST != 0
    }

    /// The value.
    #[inline]
    pub fn value(&self) -> ValueRef<'a> {
        self.value
    }

    /// The value's bytes, for who keeps them for longer than it has the message: `None` if they lie in the message, and not in
    /// its publisher's shared memory.
    pub fn hold(&self) -> Option<Held> {
        self.held.cloned()
    }

    /// The value, if it is a number.
    #[inline]
    pub fn as_double(&self) -> Option<f64> {
        if let ValueRef::Double(number) = self.value { Some(number) } else { None }
    }

    /// The value of a variable that carries numbers.
    ///
    /// # Errors
    /// It is none: an app that fails with this goes on with the next message.
    #[inline]
    pub fn number(&self) -> Result<f64, Rejection> {
        self.as_double().ok_or_else(|| Rejection::new("it has to be a number"))
    }

    /// The value, if it is a text.
    #[inline]
    pub fn as_text(&self) -> Option<&'a str> {
        if let ValueRef::Text(text) = self.value { Some(text) } else { None }
    }

    /// The value of a variable that carries texts.
    ///
    /// # Errors
    /// It is none: an app that fails with this goes on with the next message.
    pub fn text(&self) -> Result<&'a str, Rejection> {
        self.as_text().ok_or_else(|| Rejection::new("it has to be a text"))
    }

    /// Whether it is of the variable that `key` names.
    #[inline]
    pub fn is<T: Payload>(&self, key: &Key<T>) -> bool {
        self.key == key.name()
    }

    /// Decodes the value as a `T`, whatever the variable.
    pub fn decode_as<T: Payload>(&self) -> Result<T::View<'a>, DecodeError> {
        self.decode_from::<T>(self.key)
    }

    fn decode_from<T: Payload>(&self, key: &str) -> Result<T::View<'a>, DecodeError> {
        self.value.decode_as::<T>(key, || ends(self.source(), self.source_build(), self.reader))
    }

    /// Decodes the value as what `key` carries; bulky parts stay where they lie.
    #[inline]
    pub fn decode<T: Payload>(&self, key: &Key<T>) -> Result<T::View<'a>, DecodeError> {
        self.decode_from::<T>(key.name())
    }
}
