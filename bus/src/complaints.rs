//! Words that would be said for each of many messages, rationed.

use std::collections::BTreeMap;
use std::time::Duration;

use crate::clock::Stopwatch;

/// Complaints about one (variable, writer) that are said in full; after that one in [`SAID_EVERY`], with how many were not.
const SAID_IN_FULL: u64 = 3;
const SAID_EVERY: Duration = Duration::from_secs(5);
/// Pairs of variable and writer that are told apart; of all others the words are rationed together.
const PAIRS: usize = 256;

/// How often there was something to complain of, and how much of that was said.
#[derive(Debug, Default)]
pub(crate) struct Complaints {
    count: u64,
    by_writer: BTreeMap<(String, String), Said>,
}

#[derive(Debug, Default)]
struct Said {
    count: u64,
    last: Option<Stopwatch>,
    unsaid: u64,
}

impl Complaints {
    /// How often so far.
    pub fn count(&self) -> u64 {
        self.count
    }

    /// Counts a complaint about what `writer` wrote to `key`. Unless enough was said of that lately: what is to be said of
    /// those that were not.
    pub fn note(&mut self, key: &str, writer: &str) -> Option<String> {
        self.count += 1;
        let mut pair = (key.to_owned(), writer.to_owned());
        if self.by_writer.len() >= PAIRS && !self.by_writer.contains_key(&pair) {
            pair = Default::default();
        }
        let said = self.by_writer.entry(pair).or_default();
        said.count += 1;
        if said.count > SAID_IN_FULL && said.last.is_some_and(|last| last.elapsed() < SAID_EVERY) {
            said.unsaid += 1;
            return None;
        }
        said.last = Some(Stopwatch::start());
        let unsaid = std::mem::take(&mut said.unsaid);
        Some(if unsaid == 0 { String::new() } else { format!(" (and {unsaid} others of it since the last word)") })
    }
}
