//! What two processes touch at the same time in a page: bells, and small batches beside their counters.
//!
//! It names the processor and the kernel by `super::sync` alone, so that `tests/loom` can hold this very file against every
//! order in which two threads can take its steps.

use std::time::Duration;

use super::lane::DEPTH;
use super::sync::{AtomicU32, Bytes, Ordering, sleep, wake};

/// Wakes its sleepers, mostly one. The word counts rings, so that a ring between looking and sleeping is not missed; who rings pays
/// a system call only if somebody sleeps.
#[derive(Default)]
#[repr(C)]
pub struct Bell {
    rings: AtomicU32,
    sleeping: AtomicU32,
}

impl Bell {
    /// Rings.
    pub fn ring(&self) {
        self.rings.fetch_add(1, Ordering::SeqCst);
        if self.sleeping.load(Ordering::SeqCst) != 0 {
            wake(&self.rings);
        }
    }

    /// The number of rings so far; look for work after this, then [`Bell::wait`] with it.
    pub fn rings(&self) -> u32 {
        self.rings.load(Ordering::SeqCst)
    }

    /// Sleeps until the bell has rung since `rings` was read, a signal came, or `timeout` has passed; answers whether it
    /// was a signal.
    pub fn wait(&self, rings: u32, timeout: Duration) -> bool {
        self.sleeping.fetch_add(1, Ordering::SeqCst);
        let mut interrupted = false;
        if self.rings.load(Ordering::SeqCst) == rings {
            interrupted = sleep(&self.rings, rings, timeout);
        }
        self.sleeping.fetch_sub(1, Ordering::SeqCst);
        interrupted
    }
}

/// The longest batch that travels in a page (bytes).
pub const SMALL: usize = 504;

/// Small batches under way, one way: a slot for each that may be. A sample of iceoryx2 costs 4 to 5 µs over a hop, a few
/// hundred bytes beside the counter that announces them cost a copy. A slot is written before its batch is counted as
/// sent, and again only after that was counted as taken.
#[derive(Default)]
#[repr(C, align(64))]
pub struct Slots([Slot; DEPTH as usize]);

#[derive(Default)]
#[repr(C, align(8))]
struct Slot {
    /// 0: the batch is in the lane.
    len: AtomicU32,
    bytes: Bytes<SMALL>,
}

// SAFETY: who may touch a slot's bytes is settled by the counters of sent and taken batches (see `Slots`).
unsafe impl Sync for Slots {}

impl Slots {
    fn slot(&self, number: u64) -> &Slot {
        &self.0[(number % DEPTH) as usize]
    }

    /// Puts batch `number`, counted from 0, into its slot; `false`: it is too long, and has to go into the lane. Only for
    /// the writing end, which has seen batch `number - DEPTH` taken.
    pub fn put(&self, number: u64, batch: &[u8]) -> bool {
        let slot = self.slot(number);
        let small = batch.len() <= SMALL;
        if small {
            // SAFETY: nobody reads the slot before the batch is counted as sent.
            unsafe { slot.bytes.write(batch) };
        }
        slot.len.store(if small { batch.len() as u32 } else { 0 }, Ordering::Relaxed);
        small
    }

    /// Batch `number`, if it lies in its slot. Only for the reading end, between sent and taken.
    pub fn get(&self, number: u64) -> Option<&[u8]> {
        let slot = self.slot(number);
        let len = slot.len.load(Ordering::Relaxed) as usize;
        // SAFETY: the other end does not write the slot before the batch is counted as taken.
        (len > 0).then(|| unsafe { slot.bytes.read(len) })
    }
}
