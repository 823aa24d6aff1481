//! Which bytes of a damaged file are a record: how reading is synchronised with the records again.
//!
//! A record is known by its head, by texts that fill it to the byte, by a message's channel and time, and by the head
//! behind it. All of that together does not happen by chance, even in values full of zeros and small numbers.
//!
//! Any byte may be a head, and what it claims may lead anywhere: so of each only a few bytes are looked at, wherever
//! they lie, and looking at all of a file costs no more than its length. Texts that lead from one to the next are looked at
//! as long as all bytes together can [`afford`](Bytes::afford) it; then no record of texts is believed any more.

use std::collections::BTreeSet;
use std::io::Result;
use std::ops::{Range, RangeInclusive};

use mcap::records::op;

use crate::chunk::{self, ChunkHead};
use crate::head::{Head, MAX_RECORD_BYTES, MESSAGE_HEAD, word};

/// Messages are believed that are said to be so much older or younger (ns) than those that are known: a day.
const AROUND_NS: u64 = 86_400_000_000_000;

/// Bytes that are searched at once.
pub(crate) const AHEAD_BYTES: usize = 4096;
/// So many texts are looked at for each byte that is searched: records that do not overlap have one in four bytes.
const TEXTS_PER_BYTE: u64 = 4;

/// Bytes that can be looked at anywhere.
pub(crate) trait Bytes {
    /// How many there are.
    fn length(&self) -> u64;
    /// `count` of them from `at` on, or as many as there are; what is looked at next lies near them.
    fn get(&mut self, at: u64, count: usize) -> Result<&[u8]>;
    /// A few of them that lie anywhere; nothing: so many there are not.
    fn peek<const N: usize>(&mut self, at: u64) -> Result<Option<[u8; N]>>;
    /// Whether one more text may be looked at, which has its length at `at`.
    fn afford(&mut self, at: u64) -> bool;
}

impl Bytes for &[u8] {
    fn length(&self) -> u64 {
        self.len() as u64
    }

    fn get(&mut self, at: u64, count: usize) -> Result<&[u8]> {
        let rest = usize::try_from(at).ok().and_then(|at| self.split_at_checked(at)).unwrap_or_default().1;
        Ok(&rest[..count.min(rest.len())])
    }

    fn peek<const N: usize>(&mut self, at: u64) -> Result<Option<[u8; N]>> {
        Ok(self.get(at, N)?.first_chunk().copied())
    }

    /// They are one record, read once.
    fn afford(&mut self, _: u64) -> bool {
        true
    }
}

/// What is left of a damaged chunk.
pub(crate) struct DamagedChunk {
    pub bytes: Vec<u8>,
    /// So many texts may still be looked at.
    texts: u64,
}

impl DamagedChunk {
    pub fn of(bytes: Vec<u8>) -> Self {
        Self { texts: affordable(bytes.len() as u64), bytes }
    }
}

impl Bytes for DamagedChunk {
    fn length(&self) -> u64 {
        self.bytes.as_slice().length()
    }

    fn get(&mut self, at: u64, count: usize) -> Result<&[u8]> {
        let from = usize::try_from(at).unwrap_or(usize::MAX).min(self.bytes.len());
        Ok(&self.bytes[from..from.saturating_add(count).min(self.bytes.len())])
    }

    fn peek<const N: usize>(&mut self, at: u64) -> Result<Option<[u8; N]>> {
        self.bytes.as_slice().peek(at)
    }

    fn afford(&mut self, _: u64) -> bool {
        spend(&mut self.texts)
    }
}

/// How many texts may be looked at in so many bytes.
pub(crate) fn affordable(bytes: u64) -> u64 {
    bytes.saturating_mul(TEXTS_PER_BYTE)
}

/// Takes one, if there is one left.
pub(crate) fn spend(left: &mut u64) -> bool {
    left.checked_sub(1).map(|less| *left = less).is_some()
}

/// A record's head, and where it lies.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) struct RecordAt {
    pub at: u64,
    pub head: Head,
}

impl RecordAt {
    /// Where the record ends.
    pub fn end(&self) -> u64 {
        self.head.end(self.at)
    }
}

/// Finds records by what is known of their file.
#[derive(Debug, Clone, Default)]
pub(crate) struct RecordFinder {
    /// The channels; none: they are not known.
    pub channels: BTreeSet<u16>,
    /// When messages were recorded (ns); nothing: that is not known.
    pub times: Option<RangeInclusive<u64>>,
}

impl RecordFinder {
    /// The record at `at`, or the next one behind it that can be relied on; nothing: there is none.
    pub fn next(&self, bytes: &mut impl Bytes, at: u64) -> Result<Option<RecordAt>> {
        let Some(head) = self.record(bytes, at)? else {
            return self.find(bytes, at + 1, u64::MAX);
        };
        let located = RecordAt { at, head };
        if head.opcode == op::CHUNK || follows(bytes, located.end())? {
            return Ok(Some(located));
        }
        // Its length is damaged, or the head behind it: if another record begins within it, it is its length.
        let within = self.find(bytes, at + 1, located.end())?;
        Ok(within.or(Some(located)))
    }

    /// Whether these bytes can be the first ones of a chunk: of a schema, a channel, or a message.
    pub fn may_begin(&self, mut bytes: &[u8]) -> bool {
        bytes.split_off(..Head::BYTES).and_then(<[u8]>::first_chunk).map(Head::of).is_some_and(|head| {
            match head.opcode {
                op::MESSAGE => {
                    head.length <= chunk::MAX_BYTES && bytes.get(..MESSAGE_HEAD).is_some_and(|head| self.message(head))
                }
                op::SCHEMA | op::CHANNEL => head.length <= MAX_RECORD_BYTES,
                _ => false,
            }
        })
    }

    /// The first record in `from..to` that can be relied on.
    fn find(&self, bytes: &mut impl Bytes, from: u64, to: u64) -> Result<Option<RecordAt>> {
        let mut at = from;
        while at < to && at.saturating_add(Head::BYTES as u64) <= bytes.length() {
            let ahead = bytes.get(at, AHEAD_BYTES)?;
            let Some(skipped) = ahead.iter().position(|byte| (op::HEADER..=op::DATA_END).contains(byte)) else {
                at += ahead.len().max(1) as u64;
                continue;
            };
            at += skipped as u64;
            if at < to
                && let Some(head) = self.record(bytes, at)?
                && (head.opcode == op::CHUNK || follows(bytes, head.end(at))?)
            {
                return Ok(Some(RecordAt { at, head }));
            }
            at += 1;
        }
        Ok(None)
    }

    /// The head at `at`, if it can be a record's as far as it says itself.
    fn record(&self, bytes: &mut impl Bytes, at: u64) -> Result<Option<Head>> {
        let Some(head) = head_at(bytes, at)? else {
            return Ok(None);
        };
        let (start, length) = (at + Head::BYTES as u64, head.length);
        if head.opcode == op::CHUNK {
            return Ok(chunk_head(bytes, start)?.filter(|chunk| chunk.check(length).is_ok()).map(|_| head));
        }
        let there = head.end(at) <= bytes.length();
        let is = there
            && match head.opcode {
                op::MESSAGE => length <= chunk::MAX_BYTES && self.message(bytes.get(start, MESSAGE_HEAD)?),
                op::ATTACHMENT if length > MAX_RECORD_BYTES => follows(bytes, head.end(at))?,
                op::HEADER | op::SCHEMA | op::CHANNEL | op::METADATA | op::ATTACHMENT => {
                    let end = head.end(at);
                    length <= MAX_RECORD_BYTES && end_of_content(head.opcode, bytes, start..end)? == Some(end)
                }
                op::MESSAGE_INDEX => bytes.get(start, 6)?.last_chunk().is_some_and(|size| {
                    let size = u64::from(u32::from_le_bytes(*size));
                    size % 16 == 0 && length == 6 + size
                }),
                op::DATA_END => length == 4,
                op::FOOTER => length == 20 && head.end(at) + mcap::MAGIC.len() as u64 == bytes.length(),
                op::CHUNK_INDEX..=op::DATA_END | 0x80.. => follows(bytes, head.end(at))?,
                _ => false,
            };
        Ok(is.then_some(head))
    }

    /// Whether a message may begin so.
    fn message(&self, head: &[u8]) -> bool {
        head.len() == MESSAGE_HEAD
            && (self.channels.is_empty() || self.channels.contains(&u16::from_le_bytes([head[0], head[1]])))
            && self.times.as_ref().is_none_or(|times| {
                let time = word(&head[6..]);
                time.saturating_add(AROUND_NS) >= *times.start() && time <= times.end().saturating_add(AROUND_NS)
            })
    }
}

/// Whether what lies at `at` can be another record, or is the end.
fn follows(bytes: &mut impl Bytes, at: u64) -> Result<bool> {
    let length = bytes.length();
    Ok(match head_at(bytes, at)? {
        None => at <= length,
        Some(Head { opcode: op::HEADER..=op::DATA_END | 0x80.., length: size }) => size <= length - at,
        Some(_) => false,
    })
}

fn head_at(bytes: &mut impl Bytes, at: u64) -> Result<Option<Head>> {
    Ok(bytes.peek(at)?.as_ref().map(Head::of))
}

/// Where all that a record says to hold ends; the record itself lies at `range`; nothing: beyond its own end. Of its texts
/// only the lengths are read.
pub(crate) fn end_of_content(opcode: u8, bytes: &mut impl Bytes, range: Range<u64>) -> Result<Option<u64>> {
    let mut texts = Texts { bytes, at: range.start, end: range.end };
    let there = match opcode {
        op::HEADER => texts.skip(2)?,
        op::SCHEMA => texts.behind(2).skip(3)?, // the last one may be any bytes
        op::CHANNEL => texts.behind(4).skip(2)? && texts.map()?,
        op::METADATA => texts.skip(1)? && texts.map()?,
        // Behind the data a checksum.
        op::ATTACHMENT => texts.behind(16).skip(2)? && texts.data()? && texts.behind(4).skip(0)?,
        // Its map of offsets has a length and so many bytes, as a text has.
        op::CHUNK_INDEX => texts.behind(32).skip(1)? && texts.behind(8).skip(1)?,
        op::ATTACHMENT_INDEX => texts.behind(40).skip(2)?,
        op::METADATA_INDEX => texts.behind(16).skip(1)?,
        op::STATISTICS => true,
        _ => false,
    };
    Ok(there.then_some(texts.at))
}

/// The texts of a record, one after the other.
struct Texts<'a, B> {
    bytes: &'a mut B,
    at: u64,
    end: u64,
}

impl<B: Bytes> Texts<'_, B> {
    /// Passes over so many bytes.
    fn behind(&mut self, bytes: u64) -> &mut Self {
        self.at = self.at.saturating_add(bytes);
        self
    }

    /// Passes over so many texts; whether they are there.
    fn skip(&mut self, count: u32) -> Result<bool> {
        for _ in 0..count {
            let Some(length) = self.length()? else {
                return Ok(false);
            };
            self.behind(length);
        }
        Ok(self.at <= self.end)
    }

    /// Passes over the length of a text, and answers it.
    fn length(&mut self) -> Result<Option<u64>> {
        if self.at.saturating_add(4) > self.end || !self.bytes.afford(self.at) {
            return Ok(None);
        }
        let length = self.bytes.peek(self.at)?.map(|length| u64::from(u32::from_le_bytes(length)));
        self.behind(4);
        Ok(length)
    }

    /// Passes over the texts of a map, which has its length before it.
    fn map(&mut self) -> Result<bool> {
        let Some(end) = self.length()?.map(|length| self.at + length).filter(|end| *end <= self.end) else {
            return Ok(false);
        };
        while self.at < end {
            if !self.skip(2)? {
                return Ok(false);
            }
        }
        Ok(self.at == end)
    }

    /// Passes over bytes with their length before them.
    fn data(&mut self) -> Result<bool> {
        let length = if self.at.saturating_add(8) <= self.end { self.bytes.peek(self.at)? } else { None };
        let length = length.map(u64::from_le_bytes);
        self.behind(8).behind(length.unwrap_or_default());
        Ok(length.is_some() && self.at <= self.end)
    }
}

/// The header of a chunk, which begins at `start`, if it can be one.
pub(crate) fn chunk_head(bytes: &mut impl Bytes, start: u64) -> Result<Option<ChunkHead>> {
    let head = ChunkHead::of(bytes.get(start, chunk::HEAD_BYTES as usize + 8)?);
    Ok(head.filter(|head| matches!(head.compression.as_str(), "" | "lz4" | "zstd")))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn message(channel: u16, time: u64, value: &[u8]) -> Vec<u8> {
        let length = (MESSAGE_HEAD + value.len()) as u64;
        let head = [&[op::MESSAGE][..], &length.to_le_bytes(), &channel.to_le_bytes(), &[0; 4]].concat();
        [&head, &time.to_le_bytes()[..], &time.to_le_bytes(), value].concat()
    }

    fn found(finder: &RecordFinder, bytes: &[u8]) -> Vec<u64> {
        let (mut bytes, mut at, mut found) = (bytes, 0, Vec::new());
        while let Some(located) = finder.next(&mut bytes, at).unwrap() {
            found.push(located.at);
            at = located.end();
        }
        found
    }

    #[test]
    fn a_flipped_bit_in_a_head_costs_one_message_at_most() {
        let messages: Vec<Vec<u8>> = (0..9).map(|n| message(1, 1 << 60 | n, &vec![n as u8; 40 + n as usize])).collect();
        let starts: Vec<u64> =
            messages.iter().scan(0, |at, m| Some(std::mem::replace(at, *at + m.len() as u64))).collect();
        let bytes = messages.concat();
        let finder = RecordFinder { channels: BTreeSet::from([1]), times: Some(1 << 60..=1 << 60 | 9) };
        assert_eq!(found(&finder, &bytes), starts);
        for (number, start) in starts.iter().enumerate() {
            for bit in 0..8 * Head::BYTES {
                let mut damaged = bytes.clone();
                damaged[*start as usize + bit / 8] ^= 1 << (bit % 8);
                let found = found(&finder, &damaged);
                let kept = starts.iter().filter(|start| found.contains(start)).count();
                assert!(kept >= 8 && found.len() <= 9, "bit {bit} of head {number}: {found:?}");
            }
        }
    }

    #[test]
    fn a_hole_costs_what_it_touches() {
        let messages: Vec<Vec<u8>> = (0..100).map(|n| message(n % 3, 1 << 60, &[n as u8; 50])).collect();
        let size = messages[0].len();
        let mut bytes = messages.concat();
        for fill in [0, 5, 0xff] {
            bytes[1234..2345].fill(fill);
            let finder = RecordFinder { channels: BTreeSet::from([0, 1, 2]), times: Some(1 << 60..=1 << 60) };
            let touched = 2344 / size - 1234 / size + 1;
            let found = found(&finder, &bytes);
            assert!(found.len() >= 100 - touched, "{} of 100", found.len());
            assert!(found.iter().all(|at| at % size as u64 == 0), "{found:?}");
        }
    }
}
