//! What a client has heard of each variable from each source, so that it hears nothing twice after a broker's death.

use std::collections::HashMap;

use crate::wire::{self, Header};

/// Lives of a publisher, before its present one, that are remembered: what a broker finds that those have left who are
/// gone may be of any of them.
const LIVES: usize = 4;

/// The sequence of the last message of each (variable, source).
#[derive(Default)]
pub struct Seen {
    /// By the present broker's number of the variable: its sources' numbers and sequences.
    now: Vec<Vec<(u32, u64)>>,
    /// By variable and source: what brokers before it delivered, and earlier lives of the source; one sequence a life.
    before: HashMap<String, HashMap<String, Vec<u64>>>,
}

impl Seen {
    /// Takes note of a message, of `key` from `source`.
    #[inline]
    pub fn note(&mut self, header: &Header, key: &str, source: &str) {
        let number = header.key as usize;
        if self.now.len() <= number {
            self.now.resize_with(number + 1, Vec::new);
        }
        match self.now[number].iter_mut().find(|(source, _)| *source == header.source) {
            Some((_, last)) => {
                let earlier = std::mem::replace(last, header.sequence);
                if !wire::same_life(earlier, header.sequence) {
                    self.remember(key, source, earlier);
                }
            }
            None => self.now[number].push((header.source, header.sequence)),
        }
    }

    fn remember(&mut self, key: &str, source: &str, sequence: u64) {
        let lives = self.before.entry(key.to_owned()).or_default().entry(source.to_owned()).or_default();
        match lives.iter_mut().find(|last| wire::same_life(**last, sequence)) {
            Some(last) => *last = sequence.max(*last),
            None => lives.push(sequence),
        }
        if lives.len() > LIVES {
            lives.remove(0);
        }
    }

    /// Whether a message that was sent again, of `key` from `source`, was heard before.
    #[inline]
    pub fn knows(&self, header: &Header, key: &str, source: &str) -> bool {
        let now = self.now.get(header.key as usize).into_iter().flatten();
        let now = now.filter(|(number, _)| *number == header.source).map(|(_, sequence)| *sequence);
        let before = self.before.get(key).and_then(|sources| sources.get(source)).into_iter().flatten().copied();
        now.chain(before).any(|last| wire::same_life(last, header.sequence) && header.sequence <= last)
    }

    /// The broker died: the next one has other numbers. `name` gives the names of a variable's and a source's number.
    pub fn renumber<'a>(&mut self, name: impl Fn(u32, u32) -> Option<(&'a str, &'a str)>) {
        for (key, sources) in (0..).zip(std::mem::take(&mut self.now)) {
            for (source, sequence) in sources {
                let names = name(key, source);
                debug_assert!(names.is_some(), "a message was heard of a variable or a source that has no name");
                if let Some((key, source)) = names {
                    self.remember(key, source, sequence);
                }
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
        seen.note(&message(0, 3, life + 7), "X", "a");
        assert!(seen.knows(&message(0, 3, life + 7), "X", "a") && !seen.knows(&message(0, 3, life + 8), "X", "a"));
        seen.renumber(|_, _| Some(("X", "a")));
        assert!(seen.knows(&message(4, 1, life + 6), "X", "a"), "whatever its numbers are now");
        assert!(!seen.knows(&message(4, 1, life + 6), "Y", "a") && !seen.knows(&message(4, 1, life + 6), "X", "b"));
        assert!(!seen.knows(&message(4, 1, wire::first_sequence(6) + 1), "X", "a"), "started again, counts anew");
    }

    /// Regression: a latest value of an earlier life, which the next broker had found, made a client forget what it had
    /// heard of the present one.
    #[test]
    fn lives_do_not_make_each_other_forgotten() {
        let mut seen = Seen::default();
        let (first, second) = (wire::first_sequence(5), wire::first_sequence(9));
        seen.note(&message(0, 0, first + 40), "X", "a");
        seen.note(&message(0, 0, second + 3), "X", "a");
        for _ in 0..2 {
            seen.renumber(|_, _| Some(("X", "a")));
            assert!(seen.knows(&message(1, 1, first + 40), "X", "a"), "left by the first life");
            seen.note(&message(1, 1, first + 41), "X", "a");
            assert!(seen.knows(&message(1, 1, second + 2), "X", "a"), "said again by the second");
        }
    }
}
