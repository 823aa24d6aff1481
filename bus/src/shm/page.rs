//! Pages of atomics that two processes share: bells and counters.

use std::os::fd::{AsFd, OwnedFd};
use std::ptr::NonNull;
use std::sync::atomic::{AtomicU32, AtomicU64, Ordering};
use std::time::Duration;

use rustix::fs::{MemfdFlags, ftruncate, memfd_create};
use rustix::io::Errno;
use rustix::mm::{MapFlags, ProtFlags, mmap, munmap};
use rustix::thread::futex;

/// Wakes one sleeper. The word counts rings, so that a ring between looking and sleeping is not missed; who rings pays
/// a system call only if somebody sleeps.
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
            // There is nobody to tell of a failure, and a sleeper's timeout mends it.
            let _ = futex::wake(&self.rings, futex::Flags::empty(), 1);
        }
    }

    /// The number of rings so far; look for work after this, then [`Bell::wait`] with it.
    pub fn rings(&self) -> u32 {
        self.rings.load(Ordering::SeqCst)
    }

    /// Sleeps until the bell has rung since `rings` was read, a signal came, or `timeout` has passed; answers whether it
    /// was a signal.
    pub fn wait(&self, rings: u32, timeout: Duration) -> bool {
        self.sleeping.store(1, Ordering::SeqCst);
        let mut interrupted = false;
        if self.rings.load(Ordering::SeqCst) == rings {
            let timeout = futex::Timespec {
                tv_sec: timeout.as_secs().min(1 << 30) as i64,
                tv_nsec: i64::from(timeout.subsec_nanos()) as _,
            };
            let woken = futex::wait(&self.rings, futex::Flags::empty(), rings, Some(&timeout));
            interrupted = woken == Err(Errno::INTR);
        }
        self.sleeping.store(0, Ordering::SeqCst);
        interrupted
    }
}

/// The broker's page: every client rings its bell.
#[repr(C)]
pub struct BrokerPage {
    /// Wakes the broker.
    pub bell: Bell,
}

/// A client's page. Each counter has one writer; the difference of a pair is what is under way.
#[repr(C, align(64))]
pub struct ClientPage {
    /// Wakes the client.
    pub bell: Bell,
    /// 1: the client has opened its lanes. Written by the client.
    pub ready: AtomicU32,
    /// 1: the broker has mail that waits for room in the lane. Written by the broker.
    pub broker_waits: AtomicU32,
    /// 1: the client sleeps until there is room in its way up. Written by the client.
    pub client_waits: AtomicU32,
    /// Whether the connection has ended: [`OPEN`], [`SENT_AWAY`] or [`BROKER_DIED`].
    pub closed: AtomicU32,
    /// 1: the client is to leave at the next message boundary, its successor is ready. Written by the broker.
    pub retire: AtomicU32,
    /// 1: the client leaves in good order. Written by the client.
    pub goodbye: AtomicU32,
    /// How many clients have attached to this client's bulk service. Written by the broker.
    pub attachments: AtomicU32,
    /// Batches sent up. Written by the client.
    pub up_sent: AtomicU64,
    /// Batches taken by the broker.
    pub up_taken: AtomicU64,
    /// Batches sent down. Written by the broker.
    pub down_sent: AtomicU64,
    /// Batches that the client is done with.
    pub down_taken: AtomicU64,
    /// The batch sent up to which all mail from this client is handled. Written by the broker.
    pub up_handled: AtomicU64,
    /// Messages that the client has handled of those that it was given. Written by the client.
    pub handled: AtomicU64,
    /// When it had handled the first and the last of them (ns, monotonic). Written by the client.
    pub first_handled_at: AtomicU64,
    /// See `first_handled_at`.
    pub last_handled_at: AtomicU64,
    /// The last bulk sample up to which no lossless receiver is behind. Written by the broker.
    pub bulk_settled: AtomicU64,
}

/// The connection is open.
pub const OPEN: u32 = 0;
/// The broker is on its way out, or has let go of this client. Written by the broker.
pub const SENT_AWAY: u32 = 1;
/// The broker's process is gone. Written by the client's own watch.
pub const BROKER_DIED: u32 = 2;

/// A shared mapping of a `T` that consists of atomics.
pub struct Page<T> {
    at: NonNull<T>,
    file: OwnedFd,
}

// SAFETY: `Page` hands out `&T` only, and the two types it is made for consist of atomics.
unsafe impl<T: Sync> Send for Page<T> {}
unsafe impl<T: Sync> Sync for Page<T> {}

/// Types that may be shared with another process: atomics only, valid for any bit pattern.
pub trait Shareable: Sync {}
impl Shareable for BrokerPage {}
impl Shareable for ClientPage {}

impl<T: Shareable> Page<T> {
    /// A fresh page, all zero.
    pub fn create(name: &str) -> std::io::Result<Self> {
        let file = memfd_create(name, MemfdFlags::CLOEXEC)?;
        ftruncate(&file, size_of::<T>() as u64)?;
        Self::open(file)
    }

    /// The page that another process created.
    pub fn open(file: OwnedFd) -> std::io::Result<Self> {
        let length = rustix::fs::fstat(&file)?.st_size;
        if (length as usize) < size_of::<T>() {
            return Err(std::io::Error::other(format!(
                "the shared page has {length} bytes, {} expected",
                size_of::<T>()
            )));
        }
        // SAFETY: a new mapping, of at least the size of `T`, aliases no Rust object.
        let at = unsafe {
            mmap(
                std::ptr::null_mut(),
                size_of::<T>(),
                ProtFlags::READ | ProtFlags::WRITE,
                MapFlags::SHARED,
                file.as_fd(),
                0,
            )?
        };
        let at = NonNull::new(at.cast()).ok_or_else(|| std::io::Error::other("the page was mapped nowhere"))?;
        Ok(Self { at, file })
    }

    /// The file to hand to the other process.
    pub fn file(&self) -> &OwnedFd {
        &self.file
    }
}

impl<T> std::ops::Deref for Page<T> {
    type Target = T;
    fn deref(&self) -> &T {
        // SAFETY: the mapping lives as long as `self`, is page-aligned, and any bits are a valid `T`.
        unsafe { self.at.as_ref() }
    }
}

impl<T> Drop for Page<T> {
    fn drop(&mut self) {
        // SAFETY: the mapping that `open` made, of the same length, unmapped once.
        let _ = unsafe { munmap(self.at.as_ptr().cast(), size_of::<T>()) };
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn two_mappings_see_the_same_counters() {
        let page = Page::<ClientPage>::create("elk-test").unwrap();
        let other = Page::<ClientPage>::open(page.file().try_clone().unwrap()).unwrap();
        page.up_sent.store(7, Ordering::Release);
        assert_eq!(other.up_sent.load(Ordering::Acquire), 7);
    }

    #[test]
    fn a_ring_before_the_sleep_is_not_missed() {
        let page = Page::<BrokerPage>::create("elk-test").unwrap();
        let before = page.bell.rings();
        page.bell.ring();
        page.bell.wait(before, Duration::from_secs(3600));
    }

    #[test]
    fn a_short_file_is_refused() {
        let file = memfd_create("elk-test", MemfdFlags::CLOEXEC).unwrap();
        assert!(Page::<ClientPage>::open(file).is_err());
    }
}
