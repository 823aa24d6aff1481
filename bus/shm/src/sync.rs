//! What shared pages need of the processor and of the kernel: atomics, bytes without a lock, and a futex.

use std::cell::UnsafeCell;
pub use std::sync::atomic::{AtomicU32, Ordering};
use std::time::Duration;

use rustix::io::Errno;
use rustix::thread::futex;

/// Sleeps while `word` is `expected`, until somebody wakes it, a signal comes, or `timeout` has passed; answers whether it
/// was a signal.
pub fn sleep(word: &AtomicU32, expected: u32, timeout: Duration) -> bool {
    let timeout = futex::Timespec {
        tv_sec: timeout.as_secs().min(1 << 30) as i64,
        tv_nsec: i64::from(timeout.subsec_nanos()) as _,
    };
    futex::wait(word, futex::Flags::empty(), expected, Some(&timeout)) == Err(Errno::INTR)
}

/// Wakes all who sleep on `word`.
pub fn wake(word: &AtomicU32) {
    // There is nobody to tell of a failure, and a sleeper's timeout mends it.
    let _ = futex::wake(word, futex::Flags::empty(), i32::MAX as u32);
}

/// Bytes that one end writes and the other one reads, never both at a time: who may is settled elsewhere.
#[repr(transparent)]
pub struct Bytes<const N: usize>(UnsafeCell<[u8; N]>);

impl<const N: usize> Default for Bytes<N> {
    fn default() -> Self {
        Self(UnsafeCell::new([0; N]))
    }
}

impl<const N: usize> Bytes<N> {
    /// Writes the first bytes: as many of `from` as there is room for.
    ///
    /// # Safety
    /// Nobody reads or writes them meanwhile.
    pub unsafe fn write(&self, from: &[u8]) {
        // SAFETY: as the caller has promised, nobody else touches them; the length is held against theirs, and a slice of
        // this process does not overlap with a page.
        unsafe { std::ptr::copy_nonoverlapping(from.as_ptr(), self.0.get().cast(), from.len().min(N)) };
    }

    /// The first bytes, `len` or all of them.
    ///
    /// # Safety
    /// Nobody writes them as long as what is answered lives.
    pub unsafe fn read(&self, len: usize) -> &[u8] {
        // SAFETY: as the caller has promised, nobody writes them; any bytes are valid, and the length is held against theirs.
        unsafe { std::slice::from_raw_parts(self.0.get().cast(), len.min(N)) }
    }
}
