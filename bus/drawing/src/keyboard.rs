//! Whose a key is that two apps declare: the view's own keys are nobody else's, and of two apps that are there it is his who
//! declared it first. Everybody who hears the declarations, in whatever order, comes to the same answer, so apps and views
//! need not ask each other.

use std::collections::{BTreeMap, BTreeSet};

use crate::keys::{KeyTable, KeyUse, VIEWS_OWN};

/// The view, as the owner of a key.
pub const THE_VIEW: &str = "the view";
/// Apps whose keys are known; of more nobody takes note.
pub const MAX_APPS: usize = 256;

/// The keys that apps have declared.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Keyboard {
    /// By app, with the time of the declaration (s).
    tables: BTreeMap<String, (f64, KeyTable)>,
    /// The clients that are there; `None`: nobody has said.
    present: Option<BTreeSet<String>>,
}

/// A key as an app has declared it.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Declared<'a> {
    /// The app.
    pub app: &'a str,
    /// The key.
    pub key: &'a str,
    /// What it means to the app.
    pub meaning: &'a str,
    /// Who has it instead: another app, or [`THE_VIEW`].
    pub taken_by: Option<&'a str>,
}

impl Keyboard {
    /// An app declares its keys, at `time` (s, the community's). A table without keys takes back what it had declared.
    pub fn declare(&mut self, app: &str, time: f64, table: KeyTable) {
        if table.keys.is_empty() {
            self.tables.remove(app);
            return;
        }
        if self.tables.len() >= MAX_APPS
            && let Some(present) = &self.present
        {
            // Who comes back declares anew.
            self.tables.retain(|app, _| present.contains(app));
        }
        if self.tables.len() < MAX_APPS || self.tables.contains_key(app) {
            self.tables.insert(app.to_owned(), (time, table));
        }
    }

    /// These clients are there, as the broker says it (`DB_CLIENTS`: names, each with a comma behind it). The keys of others
    /// are free.
    pub fn hear_of_clients(&mut self, names: &str) {
        self.present = Some(names.split(',').filter(|name| !name.is_empty()).map(str::to_owned).collect());
    }

    /// Whose a key is.
    pub fn owner(&self, key: &str) -> Option<&str> {
        if VIEWS_OWN.contains(&key) {
            return Some(THE_VIEW);
        }
        let has = |(_, (_, table)): &(&String, &(f64, KeyTable))| table.keys.iter().any(|one| one.key == key);
        let first = self
            .there()
            .filter(has)
            .min_by(|(one, (at, _)), (other, (then, _))| at.total_cmp(then).then_with(|| one.cmp(other)));
        first.map(|(app, _)| app.as_str())
    }

    /// All that is declared by who is there, by app.
    pub fn declared(&self) -> impl Iterator<Item = Declared<'_>> {
        self.there().flat_map(move |(app, (_, table))| {
            table.keys.iter().map(move |KeyUse { key, meaning }| {
                let taken_by = self.owner(key).filter(|owner| owner != app);
                Declared { app, key, meaning, taken_by }
            })
        })
    }

    fn there(&self) -> impl Iterator<Item = (&String, &(f64, KeyTable))> {
        let is_there = |app: &String| self.present.as_ref().is_none_or(|present| present.contains(app));
        self.tables.iter().filter(move |(app, _)| is_there(app))
    }
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    fn table(keys: &[&str]) -> KeyTable {
        KeyTable::new(keys.iter().map(|key| (*key, "something")))
    }

    #[test]
    fn who_declares_first_has_the_key_and_the_view_has_its_own() {
        let mut keyboard = Keyboard::default();
        keyboard.declare("b", 1.0, table(&["g", "v"]));
        keyboard.declare("a", 2.0, table(&["g", "k"]));
        assert_eq!(["g", "k", "v", "x"].map(|key| keyboard.owner(key)), [Some("b"), Some("a"), Some(THE_VIEW), None]);
        let taken: Vec<_> = keyboard.declared().map(|one| (one.app, one.key, one.taken_by)).collect();
        assert_eq!(taken, [("a", "g", Some("b")), ("a", "k", None), ("b", "g", None), ("b", "v", Some(THE_VIEW))]);
        // Who is not there has no key, and who takes his back neither.
        keyboard.hear_of_clients("a,view,");
        assert_eq!((keyboard.owner("g"), keyboard.declared().count()), (Some("a"), 2));
        keyboard.hear_of_clients("a,b,");
        keyboard.declare("b", 3.0, KeyTable::default());
        assert_eq!(keyboard.owner("g"), Some("a"));
    }

    #[test]
    fn no_number_of_apps_fills_the_memory() {
        let mut keyboard = Keyboard::default();
        (0..10_000).for_each(|app| keyboard.declare(&app.to_string(), 0.0, table(&["g"])));
        assert_eq!(keyboard.declared().count(), MAX_APPS);
        // Where it is known who is there, the others leave room.
        keyboard.hear_of_clients("1,2,new,");
        keyboard.declare("new", 1.0, table(&["k"]));
        let declared: Vec<_> = keyboard.declared().map(|one| one.app).collect();
        assert_eq!(declared, ["1", "2", "new"]);
    }

    proptest! {
        /// In whatever order declarations are heard, everybody comes to the same answer, and each key has one owner.
        #[test]
        fn the_order_of_hearing_does_not_matter(
            said in prop::collection::vec((0u8..4, prop::collection::btree_set("[a-e]", 1..4)), 1..6).prop_map(|said| {
                let said: BTreeMap<u8, _> = said.into_iter().collect();
                said.into_iter().collect::<Vec<_>>()
            }),
            times in prop::collection::vec(0u8..3, 6),
            by in any::<prop::sample::Index>(),
        ) {
            let hear = |order: &[usize]| {
                let mut keyboard = Keyboard::default();
                for &i in order {
                    let (app, keys) = &said[i];
                    let keys: Vec<&str> = keys.iter().map(String::as_str).collect();
                    keyboard.declare(&app.to_string(), f64::from(times[i]), table(&keys));
                }
                keyboard
            };
            let mut order: Vec<usize> = (0..said.len()).collect();
            let one = hear(&order);
            order.rotate_left(by.index(said.len()));
            order.reverse();
            let other = hear(&order);
            prop_assert_eq!(&one, &other);
            for key in ["a", "b", "c", "d", "e"] {
                let owners = one.declared().filter(|declared| declared.key == key && declared.taken_by.is_none()).count();
                let wanted = one.declared().any(|declared| declared.key == key);
                prop_assert_eq!(owners, usize::from(wanted));
            }
        }
    }
}
