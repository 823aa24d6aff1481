//! Names and their numbers: the broker's own, and those that each client has given to the same names on its way up.

use std::collections::BTreeMap;

use super::interner::Interner;
use super::limits::REFUSED;
use super::message::Message;
use super::types::Types;
use super::variable::Variable;
use super::variables::Variables;
use super::{Broker, ClientId, mailbox};
use crate::types::Type;
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

    /// What is wrong with the description, if anything is.
    pub fn mistake(self) -> Option<String> {
        Type::from_text(self.name, self.layout, self.description).err()
    }
}

/// All names, and what they are numbers of.
#[derive(Debug, Default)]
pub(super) struct Names {
    pub keys: Interner,
    pub sources: Interner,
    pub types: Types,
    pub communities: Interner,
    /// Which build of which program the client was that began last to write under a source's name, as far as it said.
    builds: BTreeMap<u32, String>,
    build_bytes: usize,
}

impl Names {
    /// The number of what a definition names; a new one is given the next.
    pub fn number(&mut self, what: Named, definition: Definition<'_>) -> u32 {
        let Definition { name, layout, description } = definition;
        match what {
            Named::Key => self.keys.number(name),
            Named::Source => self.sources.number(name),
            Named::Type => self.types.number(name, layout, description),
            Named::Community => self.communities.number(name),
        }
    }

    /// The number that this has already.
    pub fn known(&self, what: Named, definition: Definition<'_>) -> Option<u32> {
        match what {
            Named::Key => self.keys.known(definition.name),
            Named::Source => self.sources.known(definition.name),
            Named::Type => self.types.known(definition.name, definition.layout),
            Named::Community => self.communities.known(definition.name),
        }
    }

    /// Name of a number, a type's layout, and what else is said of it: of a type its description, of a source its build.
    pub fn said(&self, what: Named, number: u32) -> (&str, u64, &str) {
        match what {
            Named::Key => (self.keys.name(number), 0, ""),
            Named::Source => (self.sources.name(number), 0, self.builds.get(&number).map_or("", String::as_str)),
            Named::Type => self.types.said(number),
            Named::Community => (self.communities.name(number), 0, ""),
        }
    }

    /// How many there are of a kind.
    pub fn count(&self, what: Named) -> usize {
        match what {
            Named::Key => self.keys.len(),
            Named::Source => self.sources.len(),
            Named::Type => self.types.len(),
            Named::Community => self.communities.len(),
        }
    }

    /// Bytes of all of them, of the types' descriptions and of the sources' builds.
    pub fn bytes(&self) -> usize {
        self.keys.bytes() + self.sources.bytes() + self.types.bytes() + self.communities.bytes() + self.build_bytes
    }

    /// A client of this build begins to write under a source's name; whether that is another build than before.
    fn note_build(&mut self, source: u32, build: &str) -> bool {
        let before = match build {
            "" => self.builds.remove(&source),
            build => self.builds.insert(source, build.to_owned()),
        };
        let before = before.unwrap_or_default();
        self.build_bytes = self.build_bytes + build.len() - before.len();
        before != build
    }
}

/// What a mailbox has to tell of names and values.
pub(super) struct Told<'a> {
    pub names: &'a Names,
    pub variables: &'a Variables,
}

impl mailbox::Table for Told<'_> {
    fn define(&self, what: Named, number: u32, batch: &mut Vec<u8>) {
        let (name, layout, more) = self.names.said(what, number);
        wire::put_definition(batch, what, number, name, layout, more);
    }

    fn latest(&self, key: u32, flags: u16) -> Option<Message<'_>> {
        self.variables.get(key)?.latest_message(flags)
    }
}

impl Broker {
    /// The broker's number of what a definition names; a new one is given the next.
    pub(super) fn number(&mut self, what: Named, definition: Definition<'_>) -> u32 {
        let number = self.names.number(what, definition);
        for key in self.variables.len()..self.names.keys.len() {
            let is_own = self.names.keys.name(key as u32).starts_with(OWN_PREFIX);
            self.variables.add(Variable { is_own, ..Variable::default() });
        }
        number
    }

    /// The broker's number of a name that a client came with; [`REFUSED`] if it is told why it cannot have one.
    fn admit_name(&mut self, from: ClientId, what: Named, definition: Definition<'_>) -> Result<u32, &'static str> {
        let known = self.names.known(what, definition);
        let says_more = what == Named::Type && !definition.description.is_empty();
        let is_news = |number: u32| says_more && !self.names.types.is_described(number);
        if let Some(number) = known.filter(|number| !is_news(*number)) {
            return Ok(number);
        }
        let refusal = match known {
            None => self.name_refusal(from, what, definition),
            Some(_) => self.description_refusal(definition),
        };
        if let Some(reason) = refusal {
            self.refuse(from, definition.name, 0, &reason)?;
            return Ok(known.unwrap_or(REFUSED));
        }
        let number = self.number(what, definition);
        if known.is_none() {
            self.sessions.clients.entry(from).and_modify(|client| client.brought += 1);
        } else {
            self.define_anew(what, number);
        }
        Ok(number)
    }

    /// Those who know something by its name hear what else is said of it before its next message.
    fn define_anew(&mut self, what: Named, number: u32) {
        self.sessions.clients.values_mut().for_each(|client| client.mailbox.forget(what, number));
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
        let client = self.sessions.clients.get_mut(&from).ok_or("the client is not connected")?;
        let numbers = &mut client.numbers[what as usize];
        match numbers.get(frame.header.key as usize) {
            // A client that returns introduces all names again; some may stand in its next batch once more.
            Some(known) if *known == number || number == REFUSED => Ok(()),
            None if numbers.len() == frame.header.key as usize => {
                numbers.push(number);
                self.sessions.numbers += 1;
                Ok(())
            }
            _ => Err("the definitions are not numbered in order"),
        }
    }

    /// Gives a client a number as a source of messages, with the first of them: whoever only listens needs none.
    pub(super) fn name_source(&mut self, id: ClientId) -> Result<(), &'static str> {
        let name = self.client_name(id).unwrap_or_default().to_owned();
        let number = self.admit_name(id, Named::Source, Definition::of(&name))?;
        let client = self.sessions.clients.get_mut(&id).ok_or("the client is not connected")?;
        client.numbers[Named::Source as usize][0] = number;
        let build = client.build.clone();
        let build = if self.no_room_for(build.len()).is_none() { build.as_str() } else { "" };
        if number != REFUSED && self.names.note_build(number, build) {
            self.define_anew(Named::Source, number);
        }
        Ok(())
    }
}
