//! A client's mail in the broker: bounded, oldest dropped first, drops counted.

use super::message::Message;
use crate::wire::{self, Frame, FrameKind, Header, Named};

/// Frames that wait for a client, back to back in one buffer, and what the client must know before them.
#[derive(Debug)]
pub struct Mailbox {
    /// Definitions and refusals: never dropped, always delivered ahead of the mail.
    notices: Vec<u8>,
    mail: Vec<u8>,
    /// Where the oldest frame starts in `mail`.
    head: usize,
    limit: usize,
    /// Messages ever pushed, and those that have left again, taken or dropped.
    pushed: u64,
    left: u64,
    dropped: u64,
    told_dropped: u64,
    lossless: bool,
    last_taken: f64,
    /// By [`Named`]: the numbers that the client has been told the names of.
    known: [Vec<bool>; 4],
}

impl Mailbox {
    /// An empty mailbox for at most `limit` bytes of mail.
    pub fn new(limit: usize, now: f64) -> Self {
        Self {
            notices: Vec::new(),
            mail: Vec::new(),
            head: 0,
            limit,
            pushed: 0,
            left: 0,
            dropped: 0,
            told_dropped: 0,
            lossless: false,
            last_taken: now,
            known: Default::default(),
        }
    }

    /// Where notices are written.
    pub(super) fn notices(&mut self) -> &mut Vec<u8> {
        &mut self.notices
    }

    /// Whether `number` is new to the client; from now on it is not.
    pub(super) fn learns(&mut self, what: Named, number: u32) -> bool {
        let known = &mut self.known[what as usize];
        if known.len() <= number as usize {
            known.resize(number as usize + 1, false);
        }
        !std::mem::replace(&mut known[number as usize], true)
    }

    /// Marks the client as one whose mail publishers wait for.
    pub(super) fn set_lossless(&mut self, lossless: bool) {
        self.lossless = lossless;
    }

    /// Whether publishers wait for this client.
    pub fn is_lossless(&self) -> bool {
        self.lossless
    }

    /// Bytes of mail that wait.
    pub fn waiting(&self) -> usize {
        self.mail.len() - self.head
    }

    /// Messages dropped so far.
    pub fn dropped(&self) -> u64 {
        self.dropped
    }

    /// Messages ever put in: the position of the newest.
    pub fn pushed(&self) -> u64 {
        self.pushed
    }

    /// Messages that have left, taken or dropped: the position up to which the mail is done with.
    pub fn left(&self) -> u64 {
        self.left
    }

    /// Whether neither mail nor notices wait.
    pub fn is_empty(&self) -> bool {
        self.waiting() == 0 && self.notices.is_empty()
    }

    /// Whether publishers have to wait: lossless, full, and its client has read within `patience` (s).
    pub fn holds_back(&self, now: f64, patience: f64) -> bool {
        self.lossless && self.waiting() >= self.limit && now - self.last_taken < patience
    }

    /// Adds a message; makes room for it if it must.
    pub(super) fn push(&mut self, now: f64, message: &Message<'_>, patience: f64) {
        if self.waiting() == 0 {
            // Patience is with a client that does not read although there is mail, not with one that has none.
            self.last_taken = now;
        }
        // A lossless mailbox takes what a batch in flight brings beyond the limit; the next batch waits.
        while self.waiting() > 0 && self.waiting() + message.len() > self.limit && !self.holds_back_at(now, patience) {
            self.head += wire::first_len(&self.mail[self.head..]);
            self.dropped += 1;
            self.left += 1;
        }
        self.pushed += 1;
        self.reclaim();
        message.append_to(&mut self.mail);
    }

    fn holds_back_at(&self, now: f64, patience: f64) -> bool {
        self.lossless && now - self.last_taken < patience
    }

    /// Takes back the space of frames that are gone once it is the larger half.
    fn reclaim(&mut self) {
        if self.head == self.mail.len() {
            self.mail.clear();
            self.head = 0;
            if self.mail.capacity() > self.limit {
                self.mail.shrink_to(self.limit);
            }
        } else if self.head > self.mail.len() / 2 {
            self.mail.drain(..self.head);
            self.head = 0;
        }
    }

    /// See [`super::Broker::take_mail`].
    pub(super) fn take(
        &mut self,
        now: f64,
        max: usize,
        batch: &mut Vec<u8>,
        mut bulk: impl FnMut(&Frame<'_>, &mut Vec<u8>),
    ) {
        self.last_taken = now;
        batch.append(&mut self.notices);
        if self.dropped != self.told_dropped {
            self.told_dropped = self.dropped;
            let header = Header { sequence: self.dropped, ..Header::new(FrameKind::Dropped) };
            wire::put(batch, &header, &[], &[]);
        }
        // Frames are copied in runs; a bulk one ends its run, since it may leave as something else.
        let mut run = self.head;
        while self.waiting() > 0 {
            let rest = &self.mail[self.head..];
            let len = wire::first_len(rest);
            let filled = batch.len() + self.head - run;
            if filled > 0 && filled + len > max {
                break;
            }
            if wire::is_bulk(rest) {
                batch.extend_from_slice(&self.mail[run..self.head]);
                if let Ok(frame) = wire::first_frame(rest) {
                    bulk(&frame, batch);
                }
                run = self.head + len;
            }
            self.head += len;
            self.left += 1;
        }
        batch.extend_from_slice(&self.mail[run..self.head]);
        self.reclaim();
    }
}
