//! What readers expect of a variable: writer and reader that mean different things are told when they meet, at both ends.
//!
//! A variable's type is fixed by its first write, as in MOOS. But a number or a text is not taken where all who have said
//! what they read there read something else, and one that was first yields to such a reader: a person's slip, or a writer
//! that was first with a name, does not take the variable from those whose it is. A type that nobody reads yields as soon
//! as another is written that somebody reads: so neither a writer nor a reader alone can take a variable. Where both types
//! are read, the first write stands, and both ends are told: that is for people to sort out. Of a type's versions, the one
//! that a writer left who is gone gives way to another that all who read there can read.

use super::state::Broker;
use super::state::client::{Client, UNDEFINED, Unnumbered};
use super::state::expected::Expected;
use super::state::registration::Registration;
use super::state::variable::TypeLock;
use crate::mail::of_build;
use crate::wire::{ClientId, Frame, Named, TYPED, ValueKind};

impl Broker {
    /// What a registration says that its client expects.
    pub(super) fn expected(&self, from: ClientId, frame: &Frame<'_>) -> Result<Option<Expected>, &'static str> {
        if frame.header.flags & TYPED == 0 {
            return Ok(None);
        }
        Ok(Some(match frame.header.value_kind {
            ValueKind::Double => Expected::Numbers,
            ValueKind::Text => Expected::Texts,
            ValueKind::Binary => {
                let client = self.sessions.clients.get(&from).ok_or("the client is not connected")?;
                let number = match client.number(Named::Type, frame.header.type_) {
                    Ok(number) => number,
                    Err(Unnumbered::Refused) => return Ok(None), // the client was told when it named it
                    Err(Unnumbered::Undefined) => return Err(UNDEFINED),
                };
                Expected::Values(self.names.types.name(number).to_owned(), self.names.types.layout(number))
            }
        }))
    }

    /// Why the first write to a variable, of a number or a text, contradicts all who have registered for it, if so. A typed
    /// value is no slip: readers that expect something else have to see to it themselves.
    pub(super) fn contradicts_readers(&self, key: u32, lock: TypeLock) -> Option<String> {
        let name = self.names.keys.name(key);
        let (reader, expected) = self.expectations(name).next()?;
        let reader = self.client_name(reader)?;
        let nobody = lock.kind != ValueKind::Binary
            && !self.expectations(name).any(|(_, other)| self.names.can_read(lock, other));
        nobody.then(|| format!("{reader} reads {name} as {expected}; {} was refused", self.names.describe(lock)))
    }

    /// Whether a write of another type takes the variable over: somebody reads it as that, and nobody can read what it carries.
    pub(super) fn changes_over(&self, key: u32, lock: TypeLock) -> bool {
        let name = self.names.keys.name(key);
        let is_read_as =
            |lock: TypeLock| self.expectations(name).any(|(_, expected)| self.names.can_read(lock, expected));
        is_read_as(lock) && !self.variables[key].lock.is_some_and(is_read_as)
    }

    /// Whether another version of a type takes a variable over: whoever wrote the one there is gone, and all who read there can
    /// read the other.
    pub(super) fn gives_way(&self, key: u32, was: TypeLock, is: TypeLock) -> bool {
        let name = self.names.keys.name(key);
        let writes = |client: &Client| client.published.contains(&key) && !client.is_disconnected();
        self.names.are_of_one_name(was, is)
            && !self.sessions.clients.values().any(writes)
            && self.expectations(name).all(|(_, expected)| self.names.can_read(is, expected))
    }

    /// A client's write was refused because the variable carries another version of its type: those are told who read the
    /// version that is there and not the other.
    pub(super) fn tell_readers_of_refused(&mut self, from: ClientId, key: u32, refused: TypeLock) {
        let Some(lock) = self.variables[key].lock.filter(|lock| self.names.are_of_one_name(*lock, refused)) else {
            return;
        };
        if lock == refused || !self.variables.note_compared(key, from, refused.type_) {
            return;
        }
        let name = self.names.keys.name(key).to_owned();
        let (is, other) = (self.names.describe(lock), self.names.describe(refused));
        let writer = self.client_name(from).unwrap_or_default();
        let how = self.how_they_differ(key, lock, from, refused).unwrap_or_default();
        let said = format!(
            "{name} carries {is}; {other}, by {writer}, was refused, since this reader could not read it{how}: build both from \
             one version, or give one of them another variable"
        );
        let reads_this_alone = |(_, expected): &(ClientId, &Expected)| {
            self.names.can_read(lock, expected) && !self.names.can_read(refused, expected)
        };
        let readers: Vec<ClientId> = self.expectations(&name).filter(reads_this_alone).map(|(id, _)| id).collect();
        for told in readers.into_iter().filter(|id| *id != from) {
            // Whoever has gone meanwhile need not be told.
            let _ = self.refuse(told, &name, 0, &said);
        }
    }

    /// A client wrote a variable with a type that it did not have before: those who read something else there are told, and
    /// so is the writer; once of each writer and type, also if two write two versions in turn.
    pub(super) fn tell_those_who_expect_else(&mut self, key: u32, from: ClientId) {
        let Some(lock) = self.variables[key].lock else { return };
        if !self.variables.note_compared(key, from, lock.type_) {
            return;
        }
        let name = self.names.keys.name(key).to_owned();
        let writer = self.writer(key);
        let is = self.names.describe(lock);
        let words = |(reader, expected)| {
            let how = self.difference(lock, expected, key, reader).unwrap_or_default();
            let to_reader = format!("{name} carries {is}, by {writer}: this reader cannot read it{how}");
            let who = self.client_name(reader).unwrap_or_default();
            let to_writer = format!("{name} carries {is}: {who} reads it as {expected} and cannot read it{how}");
            [(reader, to_reader), (from, to_writer)]
        };
        let reads_else = self.expectations(&name).filter(|(_, expected)| !self.names.can_read(lock, expected));
        for (told, said) in reads_else.flat_map(words).collect::<Vec<_>>() {
            // Whoever has gone meanwhile need not be told.
            let _ = self.refuse(told, &name, 0, &said);
        }
    }

    /// Who expects what of a variable.
    pub(super) fn expectations<'a>(&'a self, name: &'a str) -> impl Iterator<Item = (ClientId, &'a Expected)> {
        self.sessions.clients.iter().flat_map(move |(id, client)| {
            let of_name = client.registrations.iter().filter(move |r| r.key_pattern == name);
            of_name.filter_map(|r| Some((*id, r.expects.as_ref()?)))
        })
    }

    /// Who wrote last to a variable.
    fn writer(&self, key: u32) -> &str {
        self.variables[key].latest_source().map_or("", |source| self.names.sources.name(source))
    }

    /// Where the definitions of who wrote last to a variable and of a reader differ, and in which builds, if it is one type.
    fn difference(&self, lock: TypeLock, expected: &Expected, key: u32, reader: ClientId) -> Option<String> {
        let Expected::Values(name, layout) = expected else { return None };
        let type_ = self.names.types.known(name, *layout)?;
        self.how_they_differ(key, lock, reader, TypeLock { kind: ValueKind::Binary, type_ })
    }

    /// Where what was written last to a variable and what a client takes for it differ, and in which builds, if it is one type:
    /// in brackets.
    pub(super) fn how_they_differ(&self, key: u32, was: TypeLock, client: ClientId, is: TypeLock) -> Option<String> {
        if !self.names.are_of_one_name(was, is) {
            return None;
        }
        let writer = self.names.sources.name(self.variables[key].latest_source()?);
        let build = self.names.build(self.variables[key].latest_build);
        let client = self.sessions.clients.get(&client)?;
        let [there, here] =
            [of_build(writer, build), of_build(&client.name, &client.build)].map(|end| format!("in {end}"));
        Some(format!(" ({})", self.names.types.difference(was.type_, is.type_, [&there, &here])?))
    }

    /// A client has registered: what it expects is held against what the variable carries.
    pub(super) fn note_expectation(&mut self, id: ClientId, registration: &Registration) {
        let Some(expected) = &registration.expects else { return };
        let name = &registration.key_pattern;
        let Some(key) = self.names.keys.known(name) else { return };
        self.variables.forget_compared(key);
        let Some(lock) = self.variables[key].lock.filter(|lock| !self.names.can_read(*lock, expected)) else { return };
        let is_expected = self.expectations(name).any(|(_, other)| self.names.can_read(lock, other));
        let yields = lock.kind != ValueKind::Binary && !is_expected;
        let what_follows = if yields {
            "what was written is forgotten, and no more of it is taken"
        } else {
            "this reader cannot read it: build both from one version, or give one of them another variable"
        };
        let reader = self.client_name(id).unwrap_or_default();
        let writer = self.writer(key);
        let is = self.names.describe(lock);
        let how = self.difference(lock, expected, key, id).unwrap_or_default();
        let said = format!("{name} carries {is}, by {writer}; {reader} reads it as {expected}{how}: {what_follows}");
        let writes = |(other, client): &(&ClientId, &Client)| **other != id && client.published.contains(&key);
        let writers = self.sessions.clients.iter().filter(writes).map(|(id, _)| *id);
        for told in writers.chain([id]).collect::<Vec<_>>() {
            // Whoever has gone meanwhile need not be told.
            let _ = self.refuse(told, name, 0, &said);
        }
        if yields {
            self.variables.forget_value(key);
        }
    }
}
