//! The types that values of a community are of: their numbers, and what their bytes are.

use std::cell::RefCell;
use std::collections::{BTreeMap, HashMap};
use std::sync::Arc;

use elk_describe::Difference;

use crate::types::Type;

/// Gives each type the next number; a name with another layout is another type.
#[derive(Debug, Default)]
pub struct Types {
    /// Of each name, the layouts and their numbers.
    numbers: HashMap<Arc<str>, Vec<(u64, u32)>>,
    types: Vec<Entry>,
    bytes: usize,
    /// Pairs of types that were held against each other, to be read as each other.
    looked_at: RefCell<BTreeMap<(u32, u32), Comparison>>,
}

/// Whether one type can be read as another; if not: where they differ, if both are described.
type Comparison = Result<(), Option<Difference>>;

/// So many such pairs are remembered.
const PAIRS: usize = 64;

#[derive(Debug)]
struct Entry {
    name: Arc<str>,
    layout: u64,
    /// The description as it travels; empty: nobody has said any.
    description: Box<str>,
}

impl Types {
    /// The number of a type; a new one is given the next. The first description that comes is kept: all of one layout are
    /// the same, but for what they say to people.
    pub fn number(&mut self, name: &str, layout: u64, description: &str) -> u32 {
        if let Some(number) = self.known(name, layout) {
            let entry = &mut self.types[number as usize];
            if entry.description.is_empty() && !description.is_empty() {
                self.bytes += description.len();
                entry.description = description.into();
                self.looked_at.get_mut().clear();
            }
            return number;
        }
        let (name, number) = (Arc::<str>::from(name), self.types.len() as u32);
        self.bytes += name.len() + description.len();
        self.numbers.entry(Arc::clone(&name)).or_default().push((layout, number));
        self.types.push(Entry { name, layout, description: description.into() });
        number
    }

    /// The number that a type has already.
    pub fn known(&self, name: &str, layout: u64) -> Option<u32> {
        let of_name = self.numbers.get(name)?;
        of_name.iter().find(|(known, _)| *known == layout).map(|(_, number)| *number)
    }

    /// Whether somebody has described a type.
    pub fn is_described(&self, number: u32) -> bool {
        !self.said(number).2.is_empty()
    }

    /// Whether values of the one type can be read as values of the other: it is the same, or another version of it.
    pub fn can_be_read_as(&self, one: u32, other: u32) -> bool {
        one == other || self.name(one) == self.name(other) && self.look_at(one, other, Result::is_ok)
    }

    /// Where the versions of a type differ so that the one cannot be read as the other, or else the other as the one, if both
    /// are described; `whose` are the words for where the one and the other are.
    pub fn difference(&self, one: u32, other: u32, whose: [&str; 2]) -> Option<String> {
        let [there, here] = whose;
        let towards = |one, other| self.look_at(one, other, |comparison| comparison.clone().err()?);
        let there_to_here = towards(one, other).map(|difference| difference.in_words([there, here]));
        there_to_here.or_else(|| towards(other, one).map(|difference| difference.in_words([here, there])))
    }

    fn look_at<T>(&self, one: u32, other: u32, look: impl FnOnce(&Comparison) -> T) -> T {
        let mut looked_at = self.looked_at.borrow_mut();
        if looked_at.len() >= PAIRS && !looked_at.contains_key(&(one, other)) {
            looked_at.clear();
        }
        look(looked_at.entry((one, other)).or_insert_with(|| self.compare(one, other)))
    }

    fn compare(&self, one: u32, other: u32) -> Comparison {
        let (one, other) = (self.get(one), self.get(other));
        let (Some(one), Some(other)) = (one.as_ref().description(), other.as_ref().description()) else {
            return Err(None);
        };
        one.conversion_to(&other).map(drop).map_err(Some)
    }

    /// Bytes of all names and descriptions.
    pub fn bytes(&self) -> usize {
        self.bytes
    }

    /// How many types there are.
    pub fn len(&self) -> usize {
        self.types.len()
    }

    /// Name, layout and description of a number that was given here.
    pub fn said(&self, number: u32) -> (&str, u64, &str) {
        self.types.get(number as usize).map_or(("", 0, ""), |entry| (&entry.name, entry.layout, &entry.description))
    }

    /// The type's name.
    pub fn name(&self, number: u32) -> &str {
        self.said(number).0
    }

    /// The type's layout.
    pub fn layout(&self, number: u32) -> u64 {
        self.said(number).1
    }

    /// The type, its description read.
    pub fn get(&self, number: u32) -> Type {
        let (name, layout, description) = self.said(number);
        // Only what describes the type was taken in.
        Type::from_text(name, layout, description).unwrap_or_else(|_| Type::undescribed(name, layout))
    }
}
