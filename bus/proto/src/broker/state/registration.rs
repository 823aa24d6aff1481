//! Who wants what: patterns over variables and sources, and what they add up to for one client.

use std::collections::BTreeSet;

use serde::{Deserialize, Serialize};

use super::expected::Expected;
use super::variable::Delivery;
use crate::pattern;
use crate::wire::{ClientId, Frame, FrameKind, LOSSLESS, RESENT};

/// Messages by variable, source and sequence.
pub type Messages = BTreeSet<(u32, u32, u64)>;

/// One registration of a client.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Registration {
    /// The variables.
    pub key_pattern: String,
    /// Whose messages.
    pub source_pattern: String,
    /// At most one message in this time (s); 0: all.
    pub min_interval: f64,
    /// Publishers wait rather than that mail is dropped.
    pub lossless: bool,
    /// The client had it before, under the broker before this one.
    pub again: bool,
    /// What the client reads there; `None`: whatever comes.
    pub expects: Option<Expected>,
}

impl Registration {
    /// Whether only a comparison letter by letter says what it is of, and not the name of one variable, whoever writes it.
    pub fn is_by_pattern(&self) -> bool {
        self.key_pattern.contains(['*', '?']) || self.source_pattern != "*"
    }

    fn matches(&self, key: &str, source: &str) -> bool {
        pattern::matches(&self.key_pattern, key) && pattern::matches(&self.source_pattern, source)
    }

    /// Whether another one is of the same variables of the same sources.
    pub fn same_patterns(&self, other: &Registration) -> bool {
        self.key_pattern == other.key_pattern && self.source_pattern == other.source_pattern
    }

    fn read(frame: &Frame<'_>, expects: Option<Expected>) -> Result<Self, &'static str> {
        // Looked at where nobody else can write.
        let text = |bytes: &[u8]| String::from_utf8(bytes.to_vec()).map_err(|_| "a pattern is not UTF-8");
        let interval = frame.header.time;
        Ok(Self {
            key_pattern: text(frame.aux)?,
            source_pattern: text(frame.value)?,
            min_interval: if interval.is_finite() { interval.max(0.0) } else { 0.0 },
            lossless: frame.header.flags & LOSSLESS != 0,
            again: frame.header.flags & RESENT != 0,
            expects,
        })
    }
}

/// Bytes that a registration takes.
pub fn bytes_of(registration: &Registration) -> usize {
    size_of::<Registration>() + registration.key_pattern.len() + registration.source_pattern.len()
}

/// A change of a client's registrations.
#[derive(Debug, Clone)]
pub enum Change {
    /// Added, or put in the place of one with the same patterns.
    Add(Registration),
    /// Taken back: the one with the same patterns.
    Remove(Registration),
}

impl Change {
    /// What a frame asks for; `expects` is what its client reads, if it says so.
    pub fn read(frame: &Frame<'_>, expects: Option<Expected>) -> Result<Self, &'static str> {
        let registration = Registration::read(frame, expects)?;
        Ok(match frame.header.kind {
            FrameKind::Unregister => Change::Remove(registration),
            _ => Change::Add(registration),
        })
    }

    /// What `registrations` are after it.
    pub fn apply(&self, registrations: &mut Vec<Registration>) {
        let (Change::Add(changed) | Change::Remove(changed)) = self;
        registrations.retain(|r| !r.same_patterns(changed));
        if let Change::Add(added) = self {
            registrations.push(added.clone());
        }
    }
}

/// What a client's registrations add up to for (key, source): one delivery at the shortest of the intervals.
pub fn combine(client: ClientId, registrations: &[Registration], key: &str, source: &str) -> Option<Delivery> {
    let matching = || registrations.iter().filter(|r| r.matches(key, source));
    let min_interval = matching().map(|r| r.min_interval).min_by(f64::total_cmp)?;
    Some(Delivery { client, min_interval, lossless: matching().any(|r| r.lossless) })
}
