//! The numbers under which a client says names.

use std::collections::HashMap;

use crate::wire::{self, Named};

/// The numbers that names have on this client's way up.
pub(crate) struct Numbering {
    what: Named,
    first: u32,
    /// In the order of their numbers, each with a type's layout and its description.
    names: Vec<(String, u64, String)>,
    known: HashMap<String, Vec<(u64, u32)>>,
    /// The name of the message before, its layout and its number: mostly the one that is asked for.
    last: Option<(String, u64, u32)>,
}

impl Numbering {
    /// Of these, the first of which has the number `first`.
    pub fn new(what: Named, first: u32) -> Self {
        Self { what, first, names: Vec::new(), known: HashMap::new(), last: None }
    }

    /// The number of a name; a new one is introduced to the broker in `batch`.
    pub fn number(&mut self, batch: &mut Vec<u8>, name: &str) -> u32 {
        self.number_of(batch, (name, 0), String::new)
    }

    /// The number of a name with a layout; with a new one goes what `describe` says of it.
    pub fn number_of(
        &mut self,
        batch: &mut Vec<u8>,
        (name, layout): (&str, u64),
        describe: impl FnOnce() -> String,
    ) -> u32 {
        if let Some((last, last_layout, number)) = &self.last
            && (last.as_str(), *last_layout) == (name, layout)
        {
            return *number;
        }
        let known = self.known.get(name).and_then(|all| all.iter().find(|(l, _)| *l == layout));
        let number = match known {
            Some((_, number)) => *number,
            None => self.introduce(batch, name, layout, describe()),
        };
        self.last = Some((name.to_owned(), layout, number));
        number
    }

    fn introduce(&mut self, batch: &mut Vec<u8>, name: &str, layout: u64, description: String) -> u32 {
        let number = self.first + self.names.len() as u32;
        wire::put_definition(batch, self.what, number, name, layout, &description);
        self.names.push((name.to_owned(), layout, description));
        self.known.entry(name.to_owned()).or_default().push((layout, number));
        number
    }

    /// All names, in the order in which they were said first.
    pub fn names(&self) -> impl Iterator<Item = &str> {
        self.names.iter().map(|(name, ..)| name.as_str())
    }

    /// Introduces all names, to a broker that knows none of them.
    pub fn introduce_all(&self, batch: &mut Vec<u8>) {
        for (number, (name, layout, description)) in (self.first..).zip(&self.names) {
            wire::put_definition(batch, self.what, number, name, *layout, description);
        }
    }
}
