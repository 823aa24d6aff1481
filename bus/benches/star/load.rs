//! What a publisher sends: how large, how often, how many; and the message itself.

use std::str::FromStr;

use elk_bus::clock::monotonic_nanos;
use rustix::thread::{ClockId, clock_nanosleep_absolute};
use rustix::time::Timespec;

use crate::transport::BenchResult;

/// Bytes of a message that the stamp takes: `CLOCK_MONOTONIC` (ns, or 0: not stamped), then the sequence number.
pub const STAMP: usize = 16;
/// Messages of more than this many bytes are read byte for byte, and checked.
const READ_BYTES: usize = 4096;
/// Flat out, every so many messages carry the time; reading the clock for each would be the load.
const STAMP_EVERY: u64 = 64;

/// A publisher's load, and what the ways between need to know of it.
#[derive(Debug, Clone, Copy)]
pub struct Load {
    /// Length of a message (bytes).
    pub bytes: usize,
    /// Time between bursts (ns); 0: flat out.
    pub period_nanos: u64,
    /// Messages in a burst.
    pub burst: u64,
    /// Messages that count.
    pub messages: u64,
    /// Messages before these.
    pub warm_up: u64,
    /// Messages that a baseline packs into one sample.
    pub batch: u64,
    /// Whether the publisher waits rather than a message be lost.
    pub lossless: bool,
}

impl Load {
    /// One message of `bytes` every `period_nanos`.
    pub fn paced(bytes: usize, period_nanos: u64, messages: u64) -> Self {
        Self { bytes, period_nanos, burst: 1, messages, warm_up: 20, batch: 1, lossless: false }
    }

    /// Messages as fast as the way takes them.
    pub fn flat_out(bytes: usize, messages: u64) -> Self {
        Self { burst: u64::MAX, lossless: true, ..Self::paced(bytes, 0, messages) }
    }

    /// All messages, warm-up included.
    pub fn total(&self) -> u64 {
        self.warm_up + self.messages
    }

    /// Whether nothing holds the publisher back but the way itself.
    pub fn is_flat_out(&self) -> bool {
        self.period_nanos == 0
    }

    /// The number of the first message after the burst that `sequence` begins; a flat-out warm-up is a burst of its own.
    pub fn end_of_burst(&self, sequence: u64) -> u64 {
        let end = if self.is_flat_out() && sequence < self.warm_up { self.warm_up } else { self.total() };
        end.min(sequence.saturating_add(self.burst))
    }

    /// Whether receivers read and check every byte.
    pub fn is_read(&self) -> bool {
        self.bytes > READ_BYTES
    }

    /// The message, not yet stamped.
    pub fn message(&self) -> Vec<u8> {
        (0..self.bytes.max(STAMP)).map(|i| (i * 31 + i / 256) as u8).collect()
    }

    /// Stamps a message as number `sequence`.
    pub fn stamp(&self, message: &mut [u8], sequence: u64) {
        let timed = !self.is_flat_out() || sequence.is_multiple_of(STAMP_EVERY) || self.is_read();
        let nanos = if timed { monotonic_nanos() } else { 0 };
        message[..8].copy_from_slice(&nanos.to_le_bytes());
        message[8..STAMP].copy_from_slice(&sequence.to_le_bytes());
    }

    /// The load as arguments of a role.
    pub fn to_words(self) -> Vec<String> {
        let Self { bytes, period_nanos, burst, messages, warm_up, batch, lossless } = self;
        vec![
            format!("bytes={bytes}"),
            format!("period_nanos={period_nanos}"),
            format!("burst={burst}"),
            format!("messages={messages}"),
            format!("warm_up={warm_up}"),
            format!("batch={batch}"),
            format!("lossless={lossless}"),
        ]
    }

    /// The load from a role's arguments.
    pub fn from_words(words: &[String]) -> BenchResult<Self> {
        Ok(Self {
            bytes: setting(words, "bytes")?,
            period_nanos: setting(words, "period_nanos")?,
            burst: setting(words, "burst")?,
            messages: setting(words, "messages")?,
            warm_up: setting(words, "warm_up")?,
            batch: setting(words, "batch")?,
            lossless: setting(words, "lossless")?,
        })
    }
}

/// The value of `name=value` among a role's arguments, or in a line that a role wrote.
pub fn setting<T: FromStr>(words: &[impl AsRef<str>], name: &str) -> BenchResult<T> {
    let value = words.iter().find_map(|w| w.as_ref().strip_prefix(name)?.strip_prefix('='));
    value.and_then(|v| v.parse().ok()).ok_or_else(|| format!("no usable {name}=… was given").into())
}

/// The time (ns) and the number that a message was stamped with.
pub fn read_stamp(message: &[u8]) -> Option<(u64, u64)> {
    let word = |at: usize| Some(u64::from_le_bytes(message.get(at..at + 8)?.try_into().ok()?));
    Some((word(0)?, word(8)?))
}

/// Reads every byte behind the stamp.
pub fn sum(message: &[u8]) -> u64 {
    let (words, rest) = message.get(STAMP..).unwrap_or_default().as_chunks::<8>();
    let words = words.iter().fold(0_u64, |sum, word| sum.wrapping_add(u64::from_le_bytes(*word)));
    rest.iter().fold(words, |sum, byte| sum.wrapping_add(u64::from(*byte)))
}

/// Sleeps from one burst to the next, without drift.
pub struct Pace {
    period_nanos: u64,
    next: u64,
}

impl Pace {
    /// Starts now; a period of 0 never sleeps.
    pub fn start(period_nanos: u64) -> Self {
        Self { period_nanos, next: monotonic_nanos() }
    }

    /// Sleeps until the next burst is due.
    pub fn sleep(&mut self) -> BenchResult {
        if self.period_nanos > 0 {
            self.next += self.period_nanos;
            let (secs, nanos) = (self.next / 1_000_000_000, self.next % 1_000_000_000);
            clock_nanosleep_absolute(ClockId::Monotonic, &Timespec { tv_sec: secs as i64, tv_nsec: nanos as _ })?;
        }
        Ok(())
    }
}
