//! A client's mail in the broker: bounded, oldest dropped first, drops counted; kept until the client has handled it.

use std::collections::{BTreeMap, VecDeque};

use super::message::Message;
use crate::clock_setting::ClockSetting;
use crate::wire::{self, ATTACH, BULK, BulkRef, Frame, FrameKind, Header, Named};

/// Room in the buffer of a batch that is under way for nothing (bytes), beside half of what the batch takes.
const SPARE_CAPACITY: usize = 1 << 10;
/// From this length on mail that leaves all at once leaves with its buffer (bytes): below it a copy costs less.
const LONG: usize = 16 << 10;

/// Frames that wait for a client, back to back in one buffer, what the client must know before them, and the batches
/// that it was given and has not handled yet.
#[derive(Debug)]
pub struct Mailbox {
    /// Refusals: never dropped, always delivered ahead of the mail.
    notices: Vec<u8>,
    /// Variables whose latest value the client is still to be given, because its mailbox was full when it registered for
    /// them; with the flags that the message will carry. They are read from the table when they leave.
    owed: BTreeMap<u32, u16>,
    /// What the community's clock was set to, if the client has not been told: only the last setting counts.
    clock: Option<Option<ClockSetting>>,
    mail: Vec<u8>,
    /// Where the oldest frame starts in `mail`, and up to where no value in it lies in shared memory: see
    /// [`Mailbox::resolve`].
    head: usize,
    resolved: usize,
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
    given_bytes: usize,
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
    known: Known,
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
            owed: BTreeMap::new(),
            clock: None,
            mail: Vec::new(),
            head: 0,
            resolved: 0,
            limit,
            pushed: 0,
            left: 0,
            dropped: 0,
            told_dropped: 0,
            missed: 0,
            given: VecDeque::new(),
            given_bytes: 0,
            given_messages: 0,
            before_take: (0, 0),
            lossless: false,
            handled_messages: 0,
            last_read: now,
            known: Known::default(),
        }
    }

    /// Where notices are written.
    pub fn notices(&mut self) -> &mut Vec<u8> {
        &mut self.notices
    }

    /// Has the client told what the community's clock is set to.
    pub fn tell_clock(&mut self, setting: Option<ClockSetting>) {
        self.clock = Some(setting);
    }

    /// Bytes of notices that wait.
    pub fn notice_bytes(&self) -> usize {
        self.notices.len()
    }

    /// What the mailbox holds at most from now on (bytes).
    pub fn set_limit(&mut self, limit: usize) {
        self.limit = limit;
    }

    /// What the mailbox holds at most (bytes).
    pub fn limit(&self) -> usize {
        self.limit
    }

    /// Bytes beyond that, waiting or given: of messages that are larger than the mailbox.
    pub fn oversize_bytes(&self) -> usize {
        // A batch that is given may come on top of what a mailbox holds.
        self.waiting().saturating_sub(self.limit) + self.given_bytes.saturating_sub(2 * self.limit)
    }

    /// Bytes of the batches that the client was given and has not handled.
    pub fn given_bytes(&self) -> usize {
        self.given_bytes
    }

    /// A message did not come so far as to be put in.
    pub fn note_dropped(&mut self) {
        self.dropped += 1;
    }

    /// Whether there is room for so many more bytes of mail.
    pub fn has_room(&self, bytes: usize) -> bool {
        self.owed.is_empty() && self.waiting() + bytes <= self.limit
    }

    /// The client is to be given the latest value of a variable once there is room for it.
    pub fn owe(&mut self, key: u32, flags: u16) {
        self.owed.insert(key, flags);
    }

    /// The client is no longer to be given the latest value of a variable; with which flags it was, if it was.
    pub fn no_longer_owes(&mut self, key: u32) -> Option<u16> {
        if self.owed.is_empty() { None } else { self.owed.remove(&key) }
    }

    /// Whether the client may be given more: of what it has not handled only so much is kept.
    pub fn may_give(&self) -> bool {
        self.given_bytes < self.limit || self.given.is_empty()
    }

    /// Marks the client as one whose mail publishers wait for.
    pub fn set_lossless(&mut self, lossless: bool) {
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
        self.dropped.saturating_add(self.missed)
    }

    /// The client came too late to read so many bulk values.
    pub fn note_missed(&mut self, values: u64) {
        self.missed = values;
    }

    /// Counts what was dropped of the mail of `other`, whose client has not been told, as dropped here.
    pub fn inherit_dropped(&mut self, other: &Mailbox) {
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
        self.waiting() == 0 && self.notices.is_empty() && self.clock.is_none() && self.owed.is_empty()
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
    pub fn push(&mut self, now: f64, message: &Message<'_>, patience: f64) {
        if self.waiting() == 0 && self.given.is_empty() {
            // Patience is with a client that does not read although there is mail, not with one that has none.
            self.last_read = now;
        }
        // A lossless mailbox takes what a batch in flight brings beyond the limit; the next batch waits.
        while self.waiting() > 0 && self.waiting() + message.len() > self.limit && !self.is_waited_for(now, patience) {
            self.drop_oldest();
        }
        self.pushed += 1;
        self.reclaim();
        self.make_room(message.len());
        message.append_to(&mut self.mail);
    }

    /// Makes the buffer larger for so many bytes, if it must, by no more than the mailbox may hold: of many that are full
    /// the spare room counts.
    fn make_room(&mut self, bytes: usize) {
        if self.mail.len() + bytes <= self.mail.capacity() {
            return;
        }
        // Up to half of it is the head, which is reclaimed no sooner: so each byte is moved once at most.
        let more = (2 * self.limit).saturating_sub(self.mail.len()).min(self.mail.len());
        self.mail.reserve_exact(more.max(bytes));
    }

    fn drop_head(&mut self) {
        self.mail.drain(..self.head);
        self.resolved = self.resolved.saturating_sub(self.head);
        self.head = 0;
        if self.mail.capacity() / 4 > self.limit {
            self.mail.shrink_to(self.limit);
        }
    }

    /// Takes back the space of frames that are gone once it is the larger half.
    fn reclaim(&mut self) {
        if self.head == self.mail.len() {
            self.mail.clear();
            (self.head, self.resolved) = (0, 0);
            if self.mail.capacity() > self.limit {
                self.mail.shrink_to(self.limit);
            }
        } else if self.head > self.mail.len() / 2 {
            self.drop_head();
        }
    }

    /// See [`crate::broker::Broker::take_mail`].
    pub fn take(
        &mut self,
        max: usize,
        batch: &mut Vec<u8>,
        table: &impl Table,
        mut bulk: impl FnMut(&Frame<'_>, &mut Vec<u8>),
    ) {
        self.before_take = (self.given_messages, self.left);
        batch.append(&mut self.notices);
        if let Some(setting) = self.clock.take() {
            wire::put_clock(batch, setting);
        }
        if self.dropped != self.told_dropped {
            self.told_dropped = self.dropped;
            let header = Header { sequence: self.dropped, ..Header::new(FrameKind::Dropped) };
            wire::put(batch, &header, &[], &[]);
        }
        self.take_owed(max, batch, table, &mut bulk);
        // Frames are copied in runs; a bulk one ends its run, since it may leave as something else, and so does one that
        // uses a name which the client has not been told. Most use the names of the one before.
        let mut run = self.head;
        let mut before = None;
        while self.waiting() > 0 {
            let rest = &self.mail[self.head..];
            let len = wire::first_len(rest);
            let filled = batch.len() + self.head - run;
            if filled > 0 && filled + len > max {
                break;
            }
            let references = Some(wire::references(rest));
            if references != before && !knows_all(&self.known, rest) {
                batch.extend_from_slice(&self.mail[run..self.head]);
                run = self.head;
                introduce(&mut self.known, rest, table, batch);
            }
            before = references;
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
        if self.is_to_leave_whole(run, batch) {
            std::mem::swap(&mut self.mail, batch);
            self.head = 0;
        } else {
            batch.extend_from_slice(&self.mail[run..self.head]);
        }
        self.reclaim();
    }

    /// Whether the run of frames from `run` on is all there is, long, and in a buffer that is no larger than it has to be:
    /// then it is not copied.
    fn is_to_leave_whole(&self, run: usize, batch: &[u8]) -> bool {
        let len = self.mail.len();
        let is_all = run == 0 && self.head == len && batch.is_empty();
        is_all && len >= LONG && self.mail.capacity() <= fitting(len)
    }

    /// Latest values that there was no room for. They have no position in the mail: nobody waits until they are handled.
    fn take_owed(
        &mut self,
        max: usize,
        batch: &mut Vec<u8>,
        table: &impl Table,
        bulk: &mut impl FnMut(&Frame<'_>, &mut Vec<u8>),
    ) {
        while let Some((key, flags)) = self.owed.first_key_value().map(|(key, flags)| (*key, *flags)) {
            let Some(message) = table.latest(key, flags) else {
                self.owed.remove(&key);
                continue;
            };
            if !batch.is_empty() && batch.len() + message.len() > max {
                break;
            }
            self.owed.remove(&key);
            let frame = message.to_bytes();
            introduce(&mut self.known, &frame, table, batch);
            match (wire::is_bulk(&frame), wire::first_frame(&frame)) {
                (true, Ok(frame)) => bulk(&frame, batch),
                _ => batch.extend_from_slice(&frame),
            }
            self.given_messages += 1;
        }
    }

    /// Keeps the batch that [`Mailbox::take`] has filled, until the client has handled it.
    pub fn keep_given(&mut self, mut batch: Vec<u8>) {
        // A buffer that was another batch's may be far larger than this one.
        if batch.capacity() > fitting(batch.len()) {
            batch.shrink_to_fit();
        }
        let (from, before) = self.before_take;
        self.given_bytes += batch.len();
        self.given.push_back(Given { batch, from, until: self.given_messages, before });
    }

    /// The batch that was kept last.
    pub fn last_given(&self) -> Option<&[u8]> {
        self.given.back().map(|given| given.batch.as_slice())
    }

    /// At `now` the client has handled so many of the messages that it was ever given; answers the buffers of batches
    /// that are done with.
    pub fn handled(&mut self, now: f64, count: u64) -> impl Iterator<Item = Vec<u8>> + '_ {
        if count > self.handled_messages {
            (self.handled_messages, self.last_read) = (count, now);
        }
        self.settle(count)
    }

    fn settle(&mut self, count: u64) -> impl Iterator<Item = Vec<u8>> + '_ {
        std::iter::from_fn(move || {
            let given = self.given.pop_front_if(|given| given.until <= count)?;
            self.given_bytes -= given.batch.len();
            Some(given.batch)
        })
    }

    /// Whether [`Mailbox::handled`] would answer anything.
    pub fn would_settle(&self, count: u64) -> bool {
        self.given.front().is_some_and(|given| given.until <= count)
    }

    /// Whether nothing waits, and nothing is under way.
    pub fn is_idle(&self) -> bool {
        self.is_empty() && self.given.is_empty()
    }

    /// Puts the mail that the client was given and has not handled back in front of what waits: it is for another
    /// client now. `count`: the messages that it has handled of those that it was ever given.
    pub fn take_back(&mut self, count: u64) {
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
        (self.head, self.resolved) = (0, 0);
        // What was owed and given on the way has come on top; whoever waits does so rather too long than too short.
        self.left = self.left.min(self.pushed.saturating_sub(frames_of_messages(&self.mail).count() as u64));
        self.given_bytes = 0;
        self.notices.clear();
        self.owed.clear();
    }

    /// Puts the values that `bulk` finds in the place of the references in the mail that waits, as far as there is room.
    /// The reader of a reference that stays will find nothing behind it, and count: of a value that is gone, or that has no
    /// room here even alone.
    pub fn resolve<'a>(&mut self, bulk: impl Fn(BulkRef) -> Option<&'a [u8]>) {
        let new = self.mail.split_off(self.resolved.max(self.head));
        for frame in wire::frames(&new).map_while(Result::ok) {
            let reference = BulkRef::from_bytes(frame.value).filter(|_| frame.header.flags & BULK != 0);
            let value = reference.and_then(&bulk);
            match value.filter(|value| wire::frame_len(frame.aux.len(), value.len()) <= self.limit) {
                Some(value) => {
                    let header = Header { flags: frame.header.flags & !BULK, ..frame.header };
                    wire::put(&mut self.mail, &header, frame.aux, value);
                }
                None => self.mail.extend_from_slice(frame.bytes),
            }
            while self.waiting() > self.limit {
                self.drop_oldest();
            }
            self.resolved = self.mail.len();
            self.reclaim();
        }
    }

    /// Has the client told a name once more, before the next message that refers to it.
    pub fn forget(&mut self, what: Named, number: u32) {
        self.known.remove(what, number);
    }

    fn drop_oldest(&mut self) {
        self.head += wire::first_len(&self.mail[self.head..]);
        self.dropped += 1;
        self.left += 1;
    }

    #[cfg(test)]
    pub fn clone_mail(&self) -> Vec<u8> {
        self.mail[self.head..].to_vec()
    }

    /// What waits.
    pub fn into_mail(mut self) -> Vec<u8> {
        self.mail.drain(..self.head);
        self.mail
    }
}

/// What the broker knows and a mailbox has to tell.
pub trait Table {
    /// Appends the definition of a number.
    fn define(&self, what: Named, number: u32, batch: &mut Vec<u8>);
    /// The latest value of a variable, with these flags; `None`: it has none.
    fn latest(&self, key: u32, flags: u16) -> Option<Message<'_>>;
}

/// Sets of numbers, by [`Named`], a bit each.
#[derive(Debug, Default)]
struct Known([Vec<u64>; 4]);

impl Known {
    fn has(&self, (what, number): (Named, u32)) -> bool {
        let bits = self.0[what as usize].get(number as usize / 64);
        bits.is_some_and(|bits| bits >> (number % 64) & 1 == 1)
    }

    /// Puts a number in; whether it was not there.
    fn insert(&mut self, what: Named, number: u32) -> bool {
        let is_new = !self.has((what, number));
        let all = &mut self.0[what as usize];
        let word = number as usize / 64;
        if all.len() <= word {
            all.resize(word + 1, 0);
        }
        all[word] |= 1 << (number % 64);
        is_new
    }

    fn remove(&mut self, what: Named, number: u32) {
        if let Some(bits) = self.0[what as usize].get_mut(number as usize / 64) {
            *bits &= !(1 << (number % 64));
        }
    }
}

/// Whether the client has been told all names that a frame uses.
fn knows_all(known: &Known, frame: &[u8]) -> bool {
    wire::numbers(frame).all(|one| known.has(one))
}

/// Tells the client the names that a frame uses and that it has not been told.
fn introduce(known: &mut Known, frame: &[u8], table: &impl Table, batch: &mut Vec<u8>) {
    for (what, number) in wire::numbers(frame) {
        if known.insert(what, number) {
            table.define(what, number, batch);
        }
    }
}

/// Room that a buffer has at most for a batch of so many bytes.
fn fitting(bytes: usize) -> usize {
    SPARE_CAPACITY + bytes / 2 * 3
}

fn frames_of_messages(batch: &[u8]) -> impl Iterator<Item = Frame<'_>> {
    wire::frames(batch).map_while(Result::ok).filter(|frame| frame.header.kind == FrameKind::Notify)
}
