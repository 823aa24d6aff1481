//! What a client has heard of each variable from each source, so that it hears nothing twice after a broker's death.

use std::collections::HashMap;

use crate::wire::{self, Header};

/// The sequence of the last message of each (variable, source).
#[derive(Default)]
pub(crate) struct Seen {
    /// By the present broker's number of the variable: its sources' numbers and sequences.
    now: Vec<Vec<(u32, u64)>>,
    /// By variable and source: what brokers before it delivered.
    before: HashMap<String, HashMap<String, u64>>,
}

impl Seen {
    /// Takes note of a message.
    pub fn note(&mut self, header: &Header) {
        let key = header.key as usize;
        if self.now.len() <= key {
            self.now.resize_with(key + 1, Vec::new);
        }
        match self.now[key].iter_mut().find(|(source, _)| *source == header.source) {
            Some((_, sequence)) => *sequence = header.sequence,
            None => self.now[key].push((header.source, header.sequence)),
        }
    }

    /// Whether a message that was sent again, of `key` from `source`, was heard before.
    pub fn knows(&self, header: &Header, key: &str, source: &str) -> bool {
        let now = self.now.get(header.key as usize).and_then(|all| all.iter().find(|(s, _)| *s == header.source));
        let before = || self.before.get(key)?.get(source).copied();
        let last = now.map(|(_, sequence)| *sequence).or_else(before);
        last.is_some_and(|last| wire::same_life(last, header.sequence) && header.sequence <= last)
    }

    /// The broker died: the next one has other numbers. `name` gives the names of a variable's and a source's number.
    pub fn renumber<'a>(&mut self, name: impl Fn(u32, u32) -> (&'a str, &'a str)) {
        for (key, sources) in (0..).zip(std::mem::take(&mut self.now)) {
            for (source, sequence) in sources {
                let (key, source) = name(key, source);
                self.before.entry(key.to_owned()).or_default().insert(source.to_owned(), sequence);
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::wire::FrameKind;

    fn message(key: u32, source: u32, sequence: u64) -> Header {
        Header { key, source, sequence, ..Header::new(FrameKind::Notify) }
    }

    #[test]
    fn what_was_heard_is_known_across_brokers_and_a_new_life_is_not() {
        let mut seen = Seen::default();
        let life = wire::first_sequence(5);
        seen.note(&message(0, 3, life + 7));
        assert!(seen.knows(&message(0, 3, life + 7), "X", "a") && !seen.knows(&message(0, 3, life + 8), "X", "a"));
        seen.renumber(|_, _| ("X", "a"));
        assert!(seen.knows(&message(4, 1, life + 6), "X", "a"), "whatever its numbers are now");
        assert!(!seen.knows(&message(4, 1, life + 6), "Y", "a") && !seen.knows(&message(4, 1, life + 6), "X", "b"));
        assert!(!seen.knows(&message(4, 1, wire::first_sequence(6) + 1), "X", "a"), "started again, counts anew");
    }
}
