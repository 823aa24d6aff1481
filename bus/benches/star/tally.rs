//! What a reader makes of the messages that arrive.

use std::hint::black_box;

use elk_bus::clock::monotonic_nanos;

use crate::load::{self, Load};

/// Counts, and the time that each message was under way.
pub struct Tally {
    load: Load,
    /// What the bytes of a whole message add up to.
    sum: u64,
    /// The number that comes next if nothing is lost.
    next: u64,
    received: u64,
    damaged: u64,
    latencies: Vec<u64>,
    /// When the first and the last message that count came (ns).
    first: u64,
    last: u64,
}

impl Tally {
    /// Nothing has come yet.
    pub fn new(load: Load) -> Self {
        let sum = load::sum(&load.message());
        Self { load, sum, next: 0, received: 0, damaged: 0, latencies: Vec::new(), first: 0, last: 0 }
    }

    /// Takes in a message.
    pub fn take(&mut self, message: &[u8]) {
        let whole = !self.load.is_read() || black_box(load::sum(message)) == self.sum;
        let stamp = load::read_stamp(message).filter(|(_, sequence)| whole && *sequence >= self.next);
        let Some((sent, sequence)) = stamp else {
            self.damaged += 1;
            return;
        };
        self.next = sequence + 1;
        if sequence < self.load.warm_up {
            return;
        }
        self.received += 1;
        if sent > 0 {
            self.last = monotonic_nanos();
            self.latencies.push(self.last - sent);
        }
        if self.first == 0 {
            self.first = monotonic_nanos();
        }
    }

    /// Notes that a run of messages has been taken in.
    pub fn pause(&mut self) {
        self.last = monotonic_nanos();
    }

    /// Whether anything has come.
    pub fn has_begun(&self) -> bool {
        self.next > 0
    }

    /// Whether the last message has come.
    pub fn is_complete(&self) -> bool {
        self.next == self.load.total()
    }

    /// The figures as words; times in µs.
    pub fn into_words(mut self, dropped: u64) -> String {
        self.latencies.sort_unstable();
        let micros = |share: f64| percentile(&self.latencies, share) as f64 * 1e-3;
        let seconds = (self.last.saturating_sub(self.first) as f64 * 1e-9).max(1e-9);
        format!(
            "received={} lost={} damaged={} dropped={dropped} p50={:.2} p99={:.2} max={:.2} rate={:.1}",
            self.received,
            self.load.messages.saturating_sub(self.received),
            self.damaged,
            micros(0.5),
            micros(0.99),
            micros(1.0),
            self.received as f64 / seconds,
        )
    }
}

/// The value below which a `share` of the sorted values lies; 0 if there is none.
fn percentile(sorted: &[u64], share: f64) -> u64 {
    let at = (sorted.len() as f64 * share) as usize;
    sorted.get(at.min(sorted.len().saturating_sub(1))).copied().unwrap_or(0)
}
