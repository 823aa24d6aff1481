//! Names and types, and the broker's numbers for them.

use std::collections::BTreeMap;

use super::expected::Expected;
use super::interner::Interner;
use super::types::Types;
use super::variable::TypeLock;
use crate::types::Type;
use crate::wire::{Named, ValueKind};

/// What the names of the broker's own variables begin with.
pub const OWN_PREFIX: &str = "DB_";

/// What a definition says.
#[derive(Debug, Clone, Copy)]
pub struct Definition<'a> {
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
pub struct Names {
    pub keys: Interner,
    pub sources: Interner,
    pub types: Types,
    pub communities: Interner,
    /// Which builds of which programs clients have said that they are.
    builds: Interner,
    /// Of each source, which of them the client was that began last to write under its name.
    build_of: BTreeMap<u32, u32>,
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
            Named::Source => (self.sources.name(number), 0, self.build(self.build_of.get(&number).copied())),
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

    /// Bytes of all of them, of the types' descriptions and of the builds.
    pub fn bytes(&self) -> usize {
        self.keys.bytes() + self.sources.bytes() + self.types.bytes() + self.communities.bytes() + self.builds.bytes()
    }

    /// The number of a build that somebody has said already.
    pub fn known_build(&self, build: &str) -> Option<u32> {
        self.builds.known(build)
    }

    /// The number of a build; a new one is given the next.
    pub fn number_build(&mut self, build: &str) -> u32 {
        self.builds.number(build)
    }

    /// How many builds there are.
    pub fn builds(&self) -> usize {
        self.builds.len()
    }

    /// The build of a number; empty: it was not said.
    pub fn build(&self, number: Option<u32>) -> &str {
        number.map_or("", |number| self.builds.name(number))
    }

    /// A client of this build begins to write under a source's name; whether that is another build than before.
    pub fn note_build(&mut self, source: u32, build: Option<u32>) -> bool {
        let before = match build {
            None => self.build_of.remove(&source),
            Some(build) => self.build_of.insert(source, build),
        };
        before != build
    }

    /// What is carried, for people.
    pub fn describe(&self, lock: TypeLock) -> String {
        match lock.kind {
            ValueKind::Double => "numbers".into(),
            ValueKind::Text => "texts".into(),
            ValueKind::Binary => {
                format!("{} (layout {:016x})", self.types.name(lock.type_), self.types.layout(lock.type_))
            }
        }
    }

    /// Whether a reader that expects this can read what is carried: it is that, or another version of it.
    pub fn can_read(&self, lock: TypeLock, expected: &Expected) -> bool {
        match (lock.kind, expected) {
            (ValueKind::Double, Expected::Numbers) | (ValueKind::Text, Expected::Texts) => true,
            (ValueKind::Binary, Expected::Values(name, layout)) => {
                let number = self.types.known(name, *layout);
                number.is_some_and(|number| self.types.can_be_read_as(lock.type_, number))
            }
            _ => false,
        }
    }

    /// Whether two types are versions of one, as their names say, whether or not they can be read as each other.
    pub fn are_of_one_name(&self, one: TypeLock, other: TypeLock) -> bool {
        let are_typed = one.kind == ValueKind::Binary && other.kind == ValueKind::Binary;
        are_typed && self.types.name(one.type_) == self.types.name(other.type_)
    }

    /// Whether two types are versions of one, each of which can be read as the other: a variable carries both. A reader of
    /// a third may read the one and not the other, which it then rejects.
    pub fn are_versions(&self, one: TypeLock, other: TypeLock) -> bool {
        let can_be_read_as = |one: TypeLock, other: TypeLock| self.types.can_be_read_as(one.type_, other.type_);
        one.kind == ValueKind::Binary
            && other.kind == ValueKind::Binary
            && can_be_read_as(one, other)
            && can_be_read_as(other, one)
    }
}
