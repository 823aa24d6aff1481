//! What readers expect of a variable: a type that writer and reader do not share is seen when they meet, at both ends.
//!
//! A variable's type is fixed by its first write, as in MOOS, unless somebody has registered for it with a type: then that
//! is its type. Where the first write came first and is another type, both are told. A number or a text yields to a
//! reader with a type as long as nobody has asked for just this variable without one: a person's slip, or a writer that
//! was first with a name, does not take the variable from those whose it is.

use super::registration::Registration;
use super::variable::TypeLock;
use super::{Broker, ClientId, bulk_of};
use crate::wire::{Frame, Named, TYPED, ValueKind};

impl Broker {
    /// The type that a registration names, if it names one.
    pub(super) fn expected_type(
        &self,
        from: ClientId,
        frame: &Frame<'_>,
    ) -> Result<Option<(String, u64)>, &'static str> {
        if frame.header.flags & TYPED == 0 {
            return Ok(None);
        }
        let client = self.clients.get(&from).ok_or("the client is not connected")?;
        let number = client.numbers[Named::Type as usize].get(frame.header.type_ as usize);
        let number = *number.ok_or("a number was used before its definition")?;
        Ok(Some((self.types.name(number).to_owned(), self.types.layout(number))))
    }

    /// Why the first write to a variable contradicts those who have registered for it, if so.
    pub(super) fn contradicts_readers(&self, key: u32, lock: TypeLock) -> Option<String> {
        let (reader, expected) = self.expectation(key)?;
        if self.is(lock, expected) {
            return None;
        }
        let name = self.keys.name(key);
        Some(format!("{reader} reads {name} as {}; {} was refused", shown(expected), self.describe(lock)))
    }

    /// Who expects a type of a variable, and which; the first of several.
    fn expectation(&self, key: u32) -> Option<(&str, &(String, u64))> {
        let name = self.keys.name(key);
        let expects = |r: &Registration| r.expects.is_some() && r.key_pattern == name;
        self.clients.values().find_map(|client| {
            let registration = client.registrations.iter().find(|r| expects(r))?;
            Some((client.name.as_str(), registration.expects.as_ref()?))
        })
    }

    fn is(&self, lock: TypeLock, expected: &(String, u64)) -> bool {
        let type_ = (self.types.name(lock.type_), self.types.layout(lock.type_));
        lock.kind == ValueKind::Binary && type_ == (expected.0.as_str(), expected.1)
    }

    /// A client has registered: what it expects is held against what the variable carries.
    pub(super) fn note_expectation(&mut self, id: ClientId, registration: &Registration) {
        let Some(expected) = &registration.expects else { return };
        let Some(key) = self.keys.known(&registration.key_pattern, 0) else { return };
        let Some(lock) = self.variables[key as usize].lock.filter(|lock| !self.is(*lock, expected)) else { return };
        let reader = self.client_name(id).unwrap_or_default().to_owned();
        let name = registration.key_pattern.clone();
        let yields = lock.kind != ValueKind::Binary && !self.is_read_untyped(&name, id);
        let writer = self.variables[key as usize].latest_source().map_or("", |source| self.sources.name(source));
        let what_follows = if yields {
            "what was written is forgotten, and no more of it is taken"
        } else {
            "nothing of it reaches this reader: build both from one version, or give one of them another variable"
        };
        let is = self.describe(lock);
        let said =
            format!("{name} carries {is}, by {writer}; {reader} reads it as {}: {what_follows}", shown(expected));
        let writers: Vec<ClientId> =
            self.clients.iter().filter(|(_, client)| client.published.contains(&key)).map(|(id, _)| *id).collect();
        for told in writers.into_iter().filter(|writer| *writer != id).chain([id]) {
            // Whoever has gone meanwhile need not be told.
            let _ = self.refuse(told, &name, 0, &said);
        }
        if yields {
            self.forget_value(key);
        }
    }

    /// Whether another client asks for just this variable and takes it as it is.
    fn is_read_untyped(&self, name: &str, except: ClientId) -> bool {
        let untyped = |r: &Registration| r.expects.is_none() && r.key_pattern == name;
        let mut others = self.clients.iter().filter(|(id, _)| **id != except);
        others.any(|(_, client)| client.registrations.iter().any(untyped))
    }

    fn forget_value(&mut self, key: u32) {
        let variable = &mut self.variables[key as usize];
        if let Some(bulk) = bulk_of(&variable.latest) {
            self.latest_bulk.remove(&(bulk.client, bulk.sample));
        }
        self.latest_bytes -= variable.latest.len();
        (variable.lock, variable.latest) = (None, Vec::new());
    }
}

fn shown((name, layout): &(String, u64)) -> String {
    format!("{name} (layout {layout:016x})")
}
