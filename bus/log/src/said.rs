//! What the metadata of a log's records say.

use std::collections::BTreeMap;
use std::str::FromStr;

/// Characters of what is no number that are shown.
const MOST_SHOWN: usize = 40;

/// What `metadata` say under `name`; empty: nothing.
pub(crate) fn text(metadata: &BTreeMap<String, String>, name: &str) -> String {
    metadata.get(name).cloned().unwrap_or_default()
}

/// What was said and cannot be read, in words.
#[derive(Default)]
pub(crate) struct Garbled(Vec<String>);

impl Garbled {
    /// The number that `metadata` say under `name`; 0: they say none, or what is none, which is noted.
    pub fn number<T: FromStr + Default>(&mut self, metadata: &BTreeMap<String, String>, name: &str) -> T {
        match metadata.get(name).filter(|text| !text.is_empty()).map(|text| text.parse().map_err(|_| text)) {
            None => T::default(),
            Some(Ok(number)) => number,
            Some(Err(text)) => {
                let shown: String = text.chars().take(MOST_SHOWN).collect();
                self.note(format!("its {name} is said to be {shown:?}, which is no such number; it is read as 0"));
                T::default()
            }
        }
    }

    /// Notes what else cannot be read.
    pub fn note(&mut self, what: String) {
        self.0.push(what);
    }

    /// Nothing, or all of it in one line.
    pub fn said(self) -> Result<(), String> {
        if self.0.is_empty() { Ok(()) } else { Err(self.0.join("; ")) }
    }
}
