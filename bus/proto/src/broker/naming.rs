//! Names and their numbers: the broker's own, and those that each client has given to the same names on its way up.

use super::state::Broker;
use super::state::client::REFUSED;
use super::state::names::{Definition, OWN_PREFIX};
use super::state::variable::Variable;
use crate::wire::{self, ClientId, Frame, Named};

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

    /// The broker's number of a name, for a client inside ([`super::Introduction::inside`]), which says all in these numbers and
    /// has none of its own; `layout`: a type's, 0 for all else.
    ///
    /// # Errors
    /// Why it takes no further name.
    pub fn number_for(&mut self, from: ClientId, what: Named, name: &str, layout: u64) -> Result<u32, String> {
        let definition = Definition { layout, ..Definition::of(name) };
        if let Some(known) = self.names.known(what, definition) {
            return Ok(known);
        }
        if let Some(reason) = self.name_refusal(from, what, definition) {
            return Err(reason);
        }
        self.sessions.clients.entry(from).and_modify(|client| client.brought += 1);
        Ok(self.number(what, definition))
    }

    /// What one of the broker's numbers stands for: a name, a type's layout, and what else is said of it, of a type its
    /// description; all of it empty: nothing.
    pub fn said(&self, what: Named, number: u32) -> (&str, u64, &str) {
        self.names.said(what, number)
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
        let name = self.client_name(id).ok_or("the client is not connected")?.to_owned();
        let number = self.admit_name(id, Named::Source, Definition::of(&name))?;
        let client = self.sessions.clients.get_mut(&id).ok_or("the client is not connected")?;
        client.numbers[Named::Source as usize][0] = number;
        let build = client.build.clone();
        let build = self.admit_build(&build);
        self.sessions.clients.entry(id).and_modify(|client| client.build_number = build);
        if number != REFUSED && self.names.note_build(number, build) {
            self.define_anew(Named::Source, number);
        }
        Ok(())
    }

    /// The broker's number of a build; `None`: it was not said, or there is no room for it.
    fn admit_build(&mut self, build: &str) -> Option<u32> {
        if build.is_empty() {
            return None;
        }
        let has_room =
            || self.names.builds() < self.config.limits.other_names && self.no_room_for(build.len()).is_none();
        if self.names.known_build(build).is_none() && !has_room() {
            return None;
        }
        Some(self.names.number_build(build))
    }
}
