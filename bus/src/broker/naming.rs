//! Names and their numbers: the broker's own, and those that each client has given to the same names on its way up.

use super::interner::Interner;
use super::limits::REFUSED;
use super::message::Message;
use super::variable::Variable;
use super::{Broker, ClientId, mailbox};
use crate::wire::{self, Frame, Named};

/// What the names of the broker's own variables begin with.
pub(super) const OWN_PREFIX: &str = "DB_";

/// The broker's tables, as a mailbox needs them.
pub(super) struct Names<'a> {
    pub keys: &'a Interner,
    pub sources: &'a Interner,
    pub types: &'a Interner,
    pub communities: &'a Interner,
    pub variables: &'a [Variable],
}

impl mailbox::Table for Names<'_> {
    fn name(&self, what: Named, number: u32) -> (&str, u64) {
        let names = match what {
            Named::Key => self.keys,
            Named::Source => self.sources,
            Named::Type => self.types,
            Named::Community => self.communities,
        };
        (names.name(number), names.layout(number))
    }

    fn latest(&self, key: u32, flags: u16) -> Option<Message<'_>> {
        self.variables.get(key as usize)?.latest_message(flags)
    }
}

impl Broker {
    /// The broker's number of a name; a new one is given the next. `layout` counts for types only.
    pub(super) fn number(&mut self, what: Named, name: &str, layout: u64) -> u32 {
        let number = match what {
            Named::Key => self.keys.number(name, 0),
            Named::Source => self.sources.number(name, 0),
            Named::Type => self.types.number(name, layout),
            Named::Community => self.communities.number(name, 0),
        };
        for key in self.variables.len()..self.keys.len() {
            let is_own = self.keys.name(key as u32).starts_with(OWN_PREFIX);
            self.variables.push(Variable { is_own, ..Variable::default() });
        }
        number
    }

    /// The broker's number of a name that a client came with; [`REFUSED`] if it is told why it cannot have one.
    fn admit_name(&mut self, from: ClientId, what: Named, name: &str, layout: u64) -> Result<u32, &'static str> {
        let (names, layout) = match what {
            Named::Key => (&self.keys, 0),
            Named::Source => (&self.sources, 0),
            Named::Type => (&self.types, layout),
            Named::Community => (&self.communities, 0),
        };
        if let Some(number) = names.known(name, layout) {
            return Ok(number);
        }
        if let Some(reason) = self.name_refusal(from, what, name) {
            self.refuse(from, name, 0, &reason)?;
            return Ok(REFUSED);
        }
        self.clients.entry(from).and_modify(|client| client.brought += 1);
        Ok(self.number(what, name, layout))
    }

    /// A client names a number.
    pub(super) fn define(&mut self, from: ClientId, frame: &Frame<'_>) -> Result<(), &'static str> {
        let what = wire::named(frame.header.flags).ok_or("the definition is of no known thing")?;
        // Looked at where nobody else can write.
        let name = String::from_utf8(frame.aux.to_vec()).map_err(|_| "the name is not UTF-8")?;
        if self.is_out_of_numbers(from, what, frame.header.key, &name)? {
            return Ok(());
        }
        let number = self.admit_name(from, what, &name, frame.header.sequence)?;
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
        let number = self.admit_name(id, Named::Source, &name, 0)?;
        let client = self.clients.get_mut(&id).ok_or("the client is not connected")?;
        client.numbers[Named::Source as usize][0] = number;
        Ok(())
    }
}
