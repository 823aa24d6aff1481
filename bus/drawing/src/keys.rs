//! The keys that an app declares, each with its meaning, and one that was pressed.
//!
//! A key is called as browsers call it (`KeyboardEvent.key`): by the character that it types, a letter in lower case, or by
//! its name. Those that the view itself takes ([`VIEWS_OWN`]) nobody else can have.

use elk_describe::payload;

use crate::limits::{self, Checked, MAX_KEYS, holds};

/// Keys that the view takes itself.
pub const VIEWS_OWN: &[&str] = &[
    "?",
    "v",
    "f",
    "h",
    "[",
    "]",
    "\\",
    "n",
    "t",
    "/",
    " ",
    "1",
    "2",
    "3",
    "4",
    "5",
    "6",
    "7",
    "8",
    "9",
    "0",
    "+",
    "=",
    "-",
    "−",
    "_",
    "ArrowLeft",
    "ArrowRight",
    "ArrowUp",
    "ArrowDown",
    "Tab",
    "Enter",
    "Escape",
];
/// Keys with names that apps can have.
pub const NAMED: &[&str] = &["Insert", "Delete", "Backspace", "Home", "End", "PageUp", "PageDown"];

/// The keys that an app takes. It takes the place of what the same app declared before.
#[payload]
#[describe(check = check)]
#[derive(Debug, Clone, PartialEq, Default)]
pub struct KeyTable {
    /// The keys.
    #[describe(longest = MAX_KEYS)]
    pub keys: Vec<KeyUse>,
}

/// A key that an app takes.
#[payload]
#[derive(Debug, Clone, PartialEq)]
pub struct KeyUse {
    /// The key.
    #[describe(check = key)]
    pub key: String,
    /// What it means, for people.
    #[describe(check = limits::text)]
    pub meaning: String,
}

/// A person has pressed a key that an app has declared.
#[payload]
#[derive(Debug, Clone, PartialEq)]
pub struct KeyPress {
    /// Whose key it is.
    #[describe(check = limits::text)]
    pub app: String,
    /// The key.
    #[describe(check = key)]
    pub key: String,
    /// Whether Shift was held.
    pub shift: bool,
    /// Whether Alt was held. (With Ctrl and the system's own key, keys are the browser's.)
    pub alt: bool,
}

impl KeyTable {
    /// These keys, each with its meaning.
    pub fn new<K: Into<String>, M: Into<String>>(keys: impl IntoIterator<Item = (K, M)>) -> Self {
        let one = |(key, meaning): (K, M)| KeyUse { key: key.into(), meaning: meaning.into() };
        Self { keys: keys.into_iter().map(one).collect() }
    }
}

fn key(key: &str) -> Checked {
    let mut chars = key.chars();
    let is_character = match (chars.next(), chars.next()) {
        (Some(c), None) => !c.is_control() && !c.is_uppercase(),
        _ => false,
    };
    let is_key = is_character || NAMED.contains(&key) || VIEWS_OWN.contains(&key);
    let wanted = "one character, no capital letter, or Insert, Delete, Backspace, Home, End, PageUp or PageDown";
    holds("", is_key, format!("{key:?}"), wanted)
}

fn check(table: &KeyTable) -> Checked {
    for (i, one) in table.keys.iter().enumerate() {
        let again = table.keys[..i].iter().any(|other| other.key == one.key);
        holds(&format!("keys[{i}].key"), !again, format!("{:?} once more", one.key), "each key once")?;
    }
    Ok(())
}
