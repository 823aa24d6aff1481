//! The processor and the kernel as loom plays them: what `bus/shm/src/sync.rs` is to the bus.

use std::time::Duration;

use loom::cell::UnsafeCell;
pub use loom::sync::atomic::Ordering;
use loom::sync::atomic::{self, fence};
use loom::sync::{Condvar, Mutex};

loom::lazy_static! {
    /// The kernel's queue of sleepers: looking at the word and going to sleep is one step, as it is in the kernel.
    static ref QUEUE: (Mutex<()>, Condvar) = (Mutex::new(()), Condvar::new());
}

/// An atomic whose sequentially consistent accesses are that. Loom takes them for acquire and release, and knows only fences
/// that are sequentially consistent; so there is one on either side. Where all accesses of the words in question are
/// sequentially consistent, as those of a bell are, both come to the same: one order of all of them.
#[derive(Debug, Default)]
pub struct AtomicU32(atomic::AtomicU32);

impl AtomicU32 {
    pub fn load(&self, order: Ordering) -> u32 {
        fenced(order, || self.0.load(order))
    }

    pub fn store(&self, value: u32, order: Ordering) {
        fenced(order, || self.0.store(value, order));
    }

    pub fn fetch_sub(&self, value: u32, order: Ordering) -> u32 {
        fenced(order, || self.0.fetch_sub(value, order))
    }

    pub fn fetch_add(&self, value: u32, order: Ordering) -> u32 {
        fenced(order, || self.0.fetch_add(value, order))
    }
}

fn fenced<T>(order: Ordering, access: impl FnOnce() -> T) -> T {
    if order != Ordering::SeqCst {
        return access();
    }
    fence(Ordering::SeqCst);
    let done = access();
    fence(Ordering::SeqCst);
    done
}

/// Sleeps while `word` is `expected`. One queue serves all words, so it may wake for another word's sake, as a futex may.
pub fn sleep(word: &AtomicU32, expected: u32, _: Duration) -> bool {
    let queue = QUEUE.0.lock().unwrap();
    if word.load(Ordering::SeqCst) == expected {
        drop(QUEUE.1.wait(queue).unwrap());
    }
    false
}

/// Wakes whoever sleeps.
pub fn wake(_: &AtomicU32) {
    let _queue = QUEUE.0.lock().unwrap();
    QUEUE.1.notify_all();
}

/// Bytes of which loom sees who reads and who writes them, and that one comes before the other.
pub struct Bytes<const N: usize>(UnsafeCell<[u8; N]>);

impl<const N: usize> Default for Bytes<N> {
    fn default() -> Self {
        Self(UnsafeCell::new([0; N]))
    }
}

impl<const N: usize> Bytes<N> {
    /// As in the bus.
    ///
    /// # Safety
    /// As there; loom looks whether it holds.
    pub unsafe fn write(&self, from: &[u8]) {
        // SAFETY: loom has ended the test if anybody else touches them.
        self.0.with_mut(|bytes| unsafe { (&mut (*bytes))[..from.len()].copy_from_slice(from) });
    }

    /// As in the bus.
    ///
    /// # Safety
    /// As there; loom looks whether it holds.
    pub unsafe fn read(&self, len: usize) -> &[u8] {
        // SAFETY: loom has ended the test if anybody writes them.
        self.0.with(|bytes| unsafe { &(&(*bytes))[..len.min(N)] })
    }
}
