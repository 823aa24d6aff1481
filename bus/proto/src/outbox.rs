//! What a client has said and may have to say again: the broker may die before everybody has heard it.
//!
//! A batch stays until the broker reports that all mail from it has been handled (see [`Uplink::handled`]); then only the
//! latest message of each variable stays, since a new broker starts with an empty table.

use std::collections::{BTreeSet, VecDeque};

use crate::link::{LinkError, Uplink};
use crate::wire::{self, BULK, BulkRef, Frame, FrameKind, Header, RESENT};

/// A batch that has grown to this many bytes leaves without being asked to.
pub const BATCH_BYTES: usize = 48 << 10;

/// Batches beyond so many bytes are let go of, whether they were handled or not: a registrant that is so far behind
/// loses mail in the broker, too.
const KEPT_BYTES: usize = 4 << 20;
/// The same for batches with a bulk value: these hold shared memory.
const KEPT_BULK: usize = 8;
/// Buffers that are kept for the next batches.
const SPARE_BUFFERS: usize = 32;

/// What was said.
#[derive(Default)]
pub struct Outbox {
    kept: VecDeque<SentBatch>,
    kept_bytes: usize,
    kept_bulk: usize,
    /// Batches sent over the present link.
    sent: u64,
    /// By key number: the sequence of the latest message, and that message once its batch is let go of.
    latest: Vec<Latest>,
    /// What is to be said again over the next link, in order.
    again: Vec<Again>,
    spare: Vec<Vec<u8>>,
}

struct SentBatch {
    number: u64,
    batch: Vec<u8>,
    bulk: bool,
}

#[derive(Default)]
struct Latest {
    sequence: u64,
    frame: Vec<u8>,
}

/// A message that is to be sent again.
struct Again {
    header: Header,
    aux: Vec<u8>,
    value: Vec<u8>,
    /// The value lay in shared memory; it goes there again.
    bulk: bool,
}

impl Outbox {
    /// A message of this key number and sequence was put into the batch that will be sent next.
    #[inline]
    pub fn note(&mut self, key: u32, sequence: u64) {
        let key = key as usize;
        if self.latest.len() <= key {
            self.latest.resize_with(key + 1, Latest::default);
        }
        self.latest[key].sequence = sequence;
    }

    /// Takes the batch that was just sent, and gives an empty one for the next.
    #[inline]
    pub fn keep(&mut self, batch: Vec<u8>, bulk: bool) -> Vec<u8> {
        self.sent += 1;
        self.kept_bytes += batch.len();
        self.kept_bulk += usize::from(bulk);
        self.kept.push_back(SentBatch { number: self.sent, batch, bulk });
        self.spare.pop().unwrap_or_default()
    }

    /// Batches of which not all mail is known to be handled.
    pub fn unhandled(&self, up: &dyn Uplink) -> u64 {
        self.sent.saturating_sub(up.handled())
    }

    /// Lets go of what was handled.
    #[inline]
    pub fn trim(&mut self, up: &mut dyn Uplink) {
        let handled = up.handled();
        let mut bulk = false;
        while let Some(oldest) = self.kept.front() {
            let many = self.kept_bytes > KEPT_BYTES || self.kept_bulk > KEPT_BULK;
            if oldest.number > handled && !many {
                break;
            }
            bulk |= self.let_go_of_oldest();
        }
        if bulk {
            let wanted = self.wanted_bulk();
            up.keep_bulk(&|sample| wanted.contains(&sample));
        }
    }

    #[inline]
    fn let_go_of_oldest(&mut self) -> bool {
        let Some(oldest) = self.kept.pop_front() else { return false };
        self.kept_bytes -= oldest.batch.len();
        self.kept_bulk -= usize::from(oldest.bulk);
        self.keep_latest(&oldest.batch);
        self.recycle(oldest.batch);
        oldest.bulk
    }

    #[inline]
    fn recycle(&mut self, mut batch: Vec<u8>) {
        if self.spare.len() < SPARE_BUFFERS {
            batch.clear();
            self.spare.push(batch);
        }
    }

    /// Keeps the messages of a batch that are still the latest of their variable.
    fn keep_latest(&mut self, batch: &[u8]) {
        for frame in messages(batch) {
            if let Some(latest) = self.latest.get_mut(frame.header.key as usize)
                && latest.sequence == frame.header.sequence
            {
                latest.frame.clear();
                latest.frame.extend_from_slice(frame.bytes);
            }
        }
    }

    fn kept(&self) -> impl Iterator<Item = Frame<'_>> {
        let latest = self.latest.iter().filter_map(|latest| {
            let frame = wire::first_frame(&latest.frame).ok()?;
            (frame.header.sequence == latest.sequence).then_some(frame)
        });
        latest.chain(self.kept.iter().flat_map(|kept| messages(&kept.batch)))
    }

    fn wanted_bulk(&self) -> BTreeSet<u64> {
        let bulk = self.kept().filter(|frame| frame.header.flags & BULK != 0);
        bulk.filter_map(|frame| BulkRef::from_bytes(frame.value)).map(|reference| reference.sample).collect()
    }

    /// Makes all that was said over a link whose broker is dead ready to be said again.
    pub fn recall(&mut self, dead: &dyn Uplink) {
        let recalled: Vec<Again> = self.kept().filter_map(|frame| again(&frame, dead)).collect();
        self.again.extend(recalled);
        self.again.sort_by_key(|message| message.header.sequence);
        self.kept.clear();
        (self.kept_bytes, self.kept_bulk, self.sent) = (0, 0, 0);
        self.latest.iter_mut().for_each(|latest| latest.frame.clear());
    }

    /// Says all that was recalled, over a link whose broker knows the names by the same numbers. What it does not take
    /// stays recalled.
    pub fn say_again(&mut self, up: &mut dyn Uplink) -> Result<(), LinkError> {
        let all = std::mem::take(&mut self.again);
        let mut batch = Vec::new();
        let mut sent = 0;
        for (number, message) in all.iter().enumerate() {
            let outcome = match message.bulk {
                true => self.send_batch(&mut batch, false, up).and_then(|()| {
                    sent = number;
                    message.put_in_place(&mut batch, up)
                }),
                false => {
                    wire::put(&mut batch, &message.header, &message.aux, &message.value);
                    Ok(())
                }
            };
            let full = message.bulk || batch.len() >= BATCH_BYTES || number + 1 == all.len();
            let outcome =
                outcome.and_then(|()| if full { self.send_batch(&mut batch, message.bulk, up) } else { Ok(()) });
            if let Err(error) = outcome {
                self.again = all.into_iter().skip(sent).collect();
                return Err(error);
            }
            if full {
                sent = number + 1;
            }
        }
        Ok(())
    }

    fn send_batch(&mut self, batch: &mut Vec<u8>, bulk: bool, up: &mut dyn Uplink) -> Result<(), LinkError> {
        if !batch.is_empty() {
            up.send(batch)?;
            let sent = std::mem::take(batch);
            *batch = self.keep(sent, bulk);
        }
        Ok(())
    }
}

impl Again {
    fn put_in_place(&self, batch: &mut Vec<u8>, up: &mut dyn Uplink) -> Result<(), LinkError> {
        let Self { header, aux, value, .. } = self;
        match up.send_bulk(value.len(), &mut |writer| writer.write_all(value))? {
            Some(reference) => {
                wire::put(batch, &Header { flags: header.flags | BULK, ..*header }, aux, &reference.to_bytes())
            }
            None => wire::put(batch, header, aux, value),
        }
        Ok(())
    }
}

/// A message to be said again, with its value; `None` if the value is gone, as it is for registrants so far behind.
fn again(frame: &Frame<'_>, dead: &dyn Uplink) -> Option<Again> {
    let bulk = frame.header.flags & BULK != 0;
    let value = match bulk {
        true => dead.kept_bulk(BulkRef::from_bytes(frame.value)?.sample)?.to_vec(),
        false => frame.value.to_vec(),
    };
    let header = Header { flags: frame.header.flags & !BULK | RESENT, ..frame.header };
    Some(Again { header, aux: frame.aux.to_vec(), value, bulk })
}

fn messages(batch: &[u8]) -> impl Iterator<Item = Frame<'_>> {
    wire::frames(batch).map_while(Result::ok).filter(|frame| frame.header.kind == FrameKind::Notify)
}
