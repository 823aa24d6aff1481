//! The latest value of each key, in the order in which they last changed: whoever knows how far he has read is told what is
//! new, once, however often it changed meanwhile.

use std::collections::BTreeMap;

/// Latest values, and the order of their last changes.
///
/// Its size is that of its keys: a reader that is slow costs nothing, he only skips what was overwritten.
#[derive(Debug, Clone)]
pub struct Journal<K, V> {
    entries: BTreeMap<K, (u64, V)>,
    order: BTreeMap<u64, K>,
    last: u64,
}

impl<K, V> Default for Journal<K, V> {
    fn default() -> Self {
        Self { entries: BTreeMap::new(), order: BTreeMap::new(), last: 0 }
    }
}

impl<K: Ord + Clone, V> Journal<K, V> {
    /// Sets the value of `key`; it is the newest now.
    pub fn put(&mut self, key: K, value: V) {
        self.last += 1;
        if let Some((before, _)) = self.entries.insert(key.clone(), (self.last, value)) {
            self.order.remove(&before);
        }
        self.order.insert(self.last, key);
    }

    /// The value of `key`.
    pub fn get(&self, key: &K) -> Option<&V> {
        self.entries.get(key).map(|(_, value)| value)
    }

    /// What changed after `seen`, oldest first, each with the number that a reader has seen once he has taken it.
    pub fn since(&self, seen: u64) -> impl Iterator<Item = (u64, &K, &V)> {
        let value = |key: &K| self.entries.get(key).map(|(_, value)| value);
        self.order.range(seen + 1..).filter_map(move |(&number, key)| Some((number, key, value(key)?)))
    }

    /// Takes the value of `key` out.
    pub fn remove(&mut self, key: &K) -> Option<V> {
        let (number, value) = self.entries.remove(key)?;
        self.order.remove(&number);
        Some(value)
    }

    /// How many keys there are.
    pub fn len(&self) -> usize {
        self.entries.len()
    }

    /// Keeps only the keys of which `keep` is true.
    pub fn retain(&mut self, keep: impl Fn(&K) -> bool) {
        let order = &mut self.order;
        self.entries.retain(|key, (number, _)| {
            let kept = keep(key);
            if !kept {
                order.remove(number);
            }
            kept
        });
    }
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    proptest! {
        /// A reader that looks now and then knows in the end what the journal knows, and is never told a thing twice.
        #[test]
        fn a_reader_knows_what_the_journal_knows(steps in prop::collection::vec((0u8..20, any::<bool>()), 1..200)) {
            let mut journal = Journal::default();
            let (mut seen, mut known) = (0, BTreeMap::new());
            let mut read = |journal: &Journal<u8, usize>, known: &mut BTreeMap<u8, usize>| {
                for (number, key, value) in journal.since(seen) {
                    assert_ne!(known.insert(*key, *value), Some(*value), "told twice");
                    seen = number;
                }
            };
            for (value, (key, reads)) in steps.into_iter().enumerate() {
                journal.put(key, value);
                if reads {
                    read(&journal, &mut known);
                }
            }
            read(&journal, &mut known);
            prop_assert_eq!(known.len(), journal.entries.len());
            for (key, value) in known {
                prop_assert_eq!(journal.get(&key), Some(&value));
            }
        }
    }

    #[test]
    fn what_is_not_kept_is_not_told() {
        let mut journal = Journal::default();
        ["a", "b", "c"].into_iter().for_each(|key| journal.put(key, ()));
        journal.retain(|key| *key != "b");
        assert_eq!(journal.since(0).map(|(_, key, ())| *key).collect::<Vec<_>>(), ["a", "c"]);
    }
}
