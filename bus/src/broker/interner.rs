//! Names to numbers and back.

use std::collections::HashMap;
use std::sync::Arc;

/// Gives each name the next number; a name with another layout is another name.
#[derive(Debug, Default)]
pub(super) struct Interner {
    numbers: HashMap<(Arc<str>, u64), u32>,
    names: Vec<(Arc<str>, u64)>,
    bytes: usize,
}

impl Interner {
    /// The number of a name.
    pub fn number(&mut self, name: &str, layout: u64) -> u32 {
        let entry = (Arc::from(name), layout);
        let next = self.names.len() as u32;
        let number = *self.numbers.entry(entry.clone()).or_insert(next);
        if number == next {
            self.bytes += name.len();
            self.names.push(entry);
        }
        number
    }

    /// The number that a name has already.
    pub fn known(&self, name: &str, layout: u64) -> Option<u32> {
        self.numbers.get(&(Arc::from(name), layout)).copied()
    }

    /// Bytes of all names.
    pub fn bytes(&self) -> usize {
        self.bytes
    }

    /// The name of a number that this interner gave.
    pub fn name(&self, number: u32) -> &str {
        self.names.get(number as usize).map_or("", |(name, _)| name)
    }

    /// The layout that goes with a type's name.
    pub fn layout(&self, number: u32) -> u64 {
        self.names.get(number as usize).map_or(0, |(_, layout)| *layout)
    }

    /// How many names there are.
    pub fn len(&self) -> usize {
        self.names.len()
    }
}
