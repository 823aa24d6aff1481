//! Names and types, and the broker's numbers for them.

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

    /// Name, layout and description of a number.
    pub fn said(&self, what: Named, number: u32) -> (&str, u64, &str) {
        match what {
            Named::Key => (self.keys.name(number), 0, ""),
            Named::Source => (self.sources.name(number), 0, ""),
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

    /// Bytes of all of them, and of the types' descriptions.
    pub fn bytes(&self) -> usize {
        self.keys.bytes() + self.sources.bytes() + self.types.bytes() + self.communities.bytes()
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

    /// Whether it is what a reader expects.
    pub fn is(&self, lock: TypeLock, expected: &Expected) -> bool {
        match (lock.kind, expected) {
            (ValueKind::Double, Expected::Numbers) | (ValueKind::Text, Expected::Texts) => true,
            (ValueKind::Binary, Expected::Values(name, layout)) => {
                let (known, hash, _) = self.types.said(lock.type_);
                (known, hash) == (name.as_str(), *layout)
            }
            _ => false,
        }
    }

    /// Where the definitions of writer and reader differ, if it is one type of two builds.
    pub fn difference(&self, lock: TypeLock, expected: &Expected, [writer, reader]: [&str; 2]) -> Option<String> {
        let Expected::Values(name, layout) = expected else { return None };
        if lock.kind != ValueKind::Binary {
            return None;
        }
        let (carried, expected) = (self.types.get(lock.type_), self.types.get(self.types.known(name, *layout)?));
        let whose = [format!("in {writer}'s build"), format!("in {reader}'s")];
        let how = carried.as_ref().difference_to(expected.as_ref(), [&whose[0], &whose[1]])?;
        Some(format!(" ({how})"))
    }
}
