//! Names and their numbers: the broker's own, and those that each client has given to the same names on its way up.

use super::interner::Interner;
use super::limits::REFUSED;
use super::message::Message;
use super::types::Types;
use super::variable::Variable;
use super::{Broker, ClientId, mailbox};
use crate::wire::{self, Frame, Named};

/// What the names of the broker's own variables begin with.
pub(super) const OWN_PREFIX: &str = "DB_";

/// What a definition says.
#[derive(Debug, Clone, Copy)]
pub(super) struct Definition<'a> {
    pub name: &'a str,
    /// A type's; 0 for all else.
    pub layout: u64,
    /// A type's, as it travels; empty: it has none.
    pub description: &'a str,
}

impl<'a> Definition<'a> {
    /// The definition of a name.
    pub fn of(name: &'a str) -> Self {
        Self { name, layout: 0, description: "" }
    }
}

/// The broker's tables, as a mailbox needs them.
pub(super) struct Names<'a> {
    pub keys: &'a Interner,
    pub sources: &'a Interner,
    pub types: &'a Types,
    pub communities: &'a Interner,
    pub variables: &'a [Variable],
}

impl mailbox::Table for Names<'_> {
    fn define(&self, what: Named, number: u32, batch: &mut Vec<u8>) {
        let (name, layout, description) = match what {
            Named::Key => (self.keys.name(number), 0, ""),
            Named::Source => (self.sources.name(number), 0, ""),
            Named::Type => self.types.said(number),
            Named::Community => (self.communities.name(number), 0, ""),
        };
        wire::put_definition(batch, what, number, name, layout, description);
    }

    fn latest(&self, key: u32, flags: u16) -> Option<Message<'_>> {
        self.variables.get(key as usize)?.latest_message(flags)
    }
}

impl Broker {
    /// The broker's number of what a definition names; a new one is given the next.
    pub(super) fn number(&mut self, what: Named, definition: Definition<'_>) -> u32 {
        let Definition { name, layout, description } = definition;
        let number = match what {
            Named::Key => self.keys.number(name),
            Named::Source => self.sources.number(name),
            Named::Type => self.types.number(name, layout, description),
            Named::Community => self.communities.number(name),
        };
        for key in self.variables.len()..self.keys.len() {
            let is_own = self.keys.name(key as u32).starts_with(OWN_PREFIX);
            self.variables.push(Variable { is_own, ..Variable::default() });
        }
        number
    }

    /// The broker's number of a name that a client came with; [`REFUSED`] if it is told why it cannot have one.
    fn admit_name(&mut self, from: ClientId, what: Named, definition: Definition<'_>) -> Result<u32, &'static str> {
        let Definition { name, layout, description } = definition;
        let known = match what {
            Named::Key => self.keys.known(name),
            Named::Source => self.sources.known(name),
            Named::Type => self.types.known(name, layout),
            Named::Community => self.communities.known(name),
        };
        let is_news = |number: u32| what == Named::Type && !description.is_empty() && !self.types.is_described(number);
        if let Some(number) = known.filter(|number| !is_news(*number)) {
            return Ok(number);
        }
        if let Some(reason) = self.name_refusal(from, what, definition) {
            self.refuse(from, name, 0, &reason)?;
            return Ok(known.unwrap_or(REFUSED));
        }
        let number = self.number(what, definition);
        if known.is_none() {
            self.clients.entry(from).and_modify(|client| client.brought += 1);
        } else {
            // Those who know the type by its name hear what it is before its next value.
            self.clients.values_mut().for_each(|client| client.mailbox.forget(what, number));
        }
        Ok(number)
    }

    /// A client names a number.
    pub(super) fn define(&mut self, from: ClientId, frame: &Frame<'_>) -> Result<(), &'static str> {
        let what = wire::named(frame.header.flags).ok_or("the definition is of no known thing")?;
        // Looked at where nobody else can write.
        let name = String::from_utf8(frame.aux.to_vec()).map_err(|_| "the name is not UTF-8")?;
        if self.is_out_of_numbers(from, what, frame.header.key, &name)? {
            return Ok(());
        }
        let description = String::from_utf8(frame.value.to_vec()).map_err(|_| "the description is not UTF-8")?;
        let definition = Definition { name: &name, layout: frame.header.sequence, description: &description };
        let number = self.admit_name(from, what, definition)?;
        let client = self.clients.get_mut(&from).ok_or("the client is not connected")?;
        let numbers = &mut client.numbers[what as usize];
        match numbers.get(frame.header.key as usize) {
            // A client that returns introduces all names again; some may stand in its next batch once more.
            Some(known) if *known == number || number == REFUSED => Ok(()),
            None if numbers.len() == frame.header.key as usize => {
                numbers.push(number);
                Ok(())
            }
            _ => Err("the definitions are not numbered in order"),
        }
    }

    /// Gives a client a number as a source of messages, with the first of them: whoever only listens needs none.
    pub(super) fn name_source(&mut self, id: ClientId) -> Result<(), &'static str> {
        let name = self.client_name(id).unwrap_or_default().to_owned();
        let number = self.admit_name(id, Named::Source, Definition::of(&name))?;
        let client = self.clients.get_mut(&id).ok_or("the client is not connected")?;
        client.numbers[Named::Source as usize][0] = number;
        Ok(())
    }
}
