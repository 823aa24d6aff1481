//! A client's mail in the broker: bounded, oldest dropped first, drops counted; kept until the client has handled it.

use std::collections::VecDeque;

use super::message::Message;
use crate::clock::Dial;
use crate::wire::{self, ATTACH, Frame, FrameKind, Header, Named};

/// Frames that wait for a client, back to back in one buffer, what the client must know before them, and the batches
/// that it was given and has not handled yet.
#[derive(Debug)]
pub struct Mailbox {
    /// Definitions and refusals: never dropped, always delivered ahead of the mail.
    notices: Vec<u8>,
    /// What the community's clock was set to, if the client has not been told: only the last setting counts.
    clock: Option<Option<Dial>>,
    mail: Vec<u8>,
    /// Where the oldest frame starts in `mail`.
    head: usize,
    limit: usize,
    /// Messages ever pushed, and those that have left again, given or dropped.
    pushed: u64,
    left: u64,
    dropped: u64,
    told_dropped: u64,
    /// Bulk values that the client came too late to read, as it says itself.
    missed: u64,
    /// Batches under way: should the client die, its successor gets what is in them.
    given: VecDeque<Given>,
    /// Messages ever given.
    given_messages: u64,
    /// `given_messages` and `left` before the last [`Mailbox::take`].
    before_take: (u64, u64),
    lossless: bool,
    /// Messages that the client has handled of those that it was ever given.
    handled_messages: u64,
    /// When the client was last seen to read, or had nothing to read.
    last_read: f64,
    /// By [`Named`]: the numbers that the client has been told the names of.
    known: [Vec<bool>; 4],
}

/// A batch on its way.
#[derive(Debug)]
struct Given {
    batch: Vec<u8>,
    /// Messages given before it, and with it.
    from: u64,
    until: u64,
    /// Position in the mail up to which all was settled before it.
    before: u64,
}

impl Mailbox {
    /// An empty mailbox for at most `limit` bytes of mail.
    pub fn new(limit: usize, now: f64) -> Self {
        Self {
            notices: Vec::new(),
            clock: None,
            mail: Vec::new(),
            head: 0,
            limit,
            pushed: 0,
            left: 0,
            dropped: 0,
            told_dropped: 0,
            missed: 0,
            given: VecDeque::new(),
            given_messages: 0,
            before_take: (0, 0),
            lossless: false,
            handled_messages: 0,
            last_read: now,
            known: Default::default(),
        }
    }

    /// Where notices are written.
    pub(super) fn notices(&mut self) -> &mut Vec<u8> {
        &mut self.notices
    }

    /// Has the client told what the community's clock is set to.
    pub(super) fn tell_clock(&mut self, dial: Option<Dial>) {
        self.clock = Some(dial);
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

    /// Messages that the client has lost so far: dropped here, or read too late.
    pub fn lost(&self) -> u64 {
        self.dropped + self.missed
    }

    /// The client came too late to read so many bulk values.
    pub(super) fn note_missed(&mut self, values: u64) {
        self.missed = values;
    }

    /// Counts what was dropped of the mail of `other`, whose client has not been told, as dropped here.
    pub(super) fn inherit_dropped(&mut self, other: &Mailbox) {
        self.dropped += other.dropped - other.told_dropped;
    }

    /// Messages ever put in: the position of the newest.
    pub fn pushed(&self) -> u64 {
        self.pushed
    }

    /// The position up to which the mail is done with: handled by the client, or dropped.
    pub fn done(&self) -> u64 {
        self.given.front().map_or(self.left, |given| given.before)
    }

    /// Whether neither mail nor notices wait.
    pub fn is_empty(&self) -> bool {
        self.waiting() == 0 && self.notices.is_empty() && self.clock.is_none()
    }

    /// Whether publishers have to wait until there is room.
    pub fn holds_back(&self, now: f64, patience: f64) -> bool {
        self.waiting() >= self.limit && self.is_waited_for(now, patience)
    }

    /// Whether publishers wait for this client at all: lossless, and it has read within `patience` (s).
    pub fn is_waited_for(&self, now: f64, patience: f64) -> bool {
        self.lossless && now - self.last_read < patience
    }

    /// Adds a message; makes room for it if it must.
    pub(super) fn push(&mut self, now: f64, message: &Message<'_>, patience: f64) {
        if self.waiting() == 0 && self.given.is_empty() {
            // Patience is with a client that does not read although there is mail, not with one that has none.
            self.last_read = now;
        }
        // A lossless mailbox takes what a batch in flight brings beyond the limit; the next batch waits.
        while self.waiting() > 0 && self.waiting() + message.len() > self.limit && !self.is_waited_for(now, patience) {
            self.head += wire::first_len(&self.mail[self.head..]);
            self.dropped += 1;
            self.left += 1;
        }
        self.pushed += 1;
        self.reclaim();
        message.append_to(&mut self.mail);
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
    pub(super) fn take(&mut self, max: usize, batch: &mut Vec<u8>, mut bulk: impl FnMut(&Frame<'_>, &mut Vec<u8>)) {
        self.before_take = (self.given_messages, self.left);
        // Not `append`: whoever was told of thousands of names once needs no room for them for ever.
        batch.extend_from_slice(&std::mem::take(&mut self.notices));
        if let Some(dial) = self.clock.take() {
            wire::put_clock(batch, dial);
        }
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
            self.given_messages += 1;
        }
        batch.extend_from_slice(&self.mail[run..self.head]);
        self.reclaim();
    }

    /// Keeps the batch that [`Mailbox::take`] has filled, until the client has handled it.
    pub(super) fn keep_given(&mut self, batch: Vec<u8>) {
        let (from, before) = self.before_take;
        self.given.push_back(Given { batch, from, until: self.given_messages, before });
    }

    /// At `now` the client has handled so many of the messages that it was ever given; answers the buffers of batches
    /// that are done with.
    pub(super) fn handled(&mut self, now: f64, count: u64) -> impl Iterator<Item = Vec<u8>> + '_ {
        if count > self.handled_messages {
            (self.handled_messages, self.last_read) = (count, now);
        }
        self.settle(count)
    }

    fn settle(&mut self, count: u64) -> impl Iterator<Item = Vec<u8>> + '_ {
        std::iter::from_fn(move || self.given.pop_front_if(|given| given.until <= count)).map(|given| given.batch)
    }

    /// Whether [`Mailbox::handled`] would answer anything.
    pub(super) fn would_settle(&self, count: u64) -> bool {
        self.given.front().is_some_and(|given| given.until <= count)
    }

    /// Whether nothing waits, and nothing is under way.
    pub(super) fn is_idle(&self) -> bool {
        self.is_empty() && self.given.is_empty()
    }

    /// Puts the mail that the client was given and has not handled back in front of what waits: it is for another
    /// client now. `count`: the messages that it has handled of those that it was ever given.
    pub(super) fn take_back(&mut self, count: u64) {
        self.settle(count).for_each(drop);
        self.left = self.done();
        let mut mail = Vec::new();
        for given in std::mem::take(&mut self.given) {
            let unhandled = frames_of_messages(&given.batch).skip(count.saturating_sub(given.from) as usize);
            for frame in unhandled {
                // An attachment that the client was told of is nobody else's.
                let attach = frame.header.flags & ATTACH != 0;
                let header = Header { flags: frame.header.flags & !ATTACH, ..frame.header };
                wire::put(&mut mail, &header, if attach { &[] } else { frame.aux }, frame.value);
            }
        }
        mail.extend_from_slice(&self.mail[self.head..]);
        self.mail = mail;
        self.head = 0;
        self.notices.clear();
    }

    /// What waits.
    pub(super) fn into_mail(mut self) -> Vec<u8> {
        self.mail.drain(..self.head);
        self.mail
    }
}

fn frames_of_messages(batch: &[u8]) -> impl Iterator<Item = Frame<'_>> {
    wire::frames(batch).map_while(Result::ok).filter(|frame| frame.header.kind == FrameKind::Notify)
}
