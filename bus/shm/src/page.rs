//! Pages that two processes share: bells, counters, and batches that are small enough to lie beside them.

use std::os::fd::{AsFd, OwnedFd};
use std::ptr::NonNull;
use std::sync::atomic::{AtomicU32, AtomicU64, Ordering};

use rustix::fs::{MemfdFlags, SealFlags, fcntl_add_seals, fcntl_get_seals, ftruncate, memfd_create};
use rustix::mm::{MapFlags, ProtFlags, mmap, munmap};

use super::lane::DEPTH;
use super::shared::{Bell, Slots};

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
    /// 1: the broker cannot open this client's bulk service. Written by the broker.
    pub bulk_refused: AtomicU32,
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
    /// Bulk values that were overwritten before the client came to read them. Written by the client.
    pub missed: AtomicU64,
    /// When it had handled the first and the last of them (ns, monotonic). Written by the client.
    pub first_handled_at: AtomicU64,
    /// See `first_handled_at`.
    pub last_handled_at: AtomicU64,
    /// The last bulk sample up to which no lossless receiver is behind. Written by the broker.
    pub bulk_settled: AtomicU64,
    /// Small batches on the way up. Written by the client.
    pub up: Slots,
    /// Small batches on the way down. Written by the broker.
    pub down: Slots,
}

/// More messages than any client can have been given.
const COUNTLESS: u64 = 1 << 48;

impl ClientPage {
    /// Batches that the client has sent and the broker has not taken; more than [`DEPTH`] if the counters cannot be true.
    pub fn on_the_way_up(&self) -> u64 {
        ahead(self.up_sent.load(Ordering::Acquire), self.up_taken.load(Ordering::Relaxed))
    }

    /// Batches that the broker has sent and the client is not done with; as above.
    pub fn on_the_way_down(&self) -> u64 {
        ahead(self.down_sent.load(Ordering::Relaxed), self.down_taken.load(Ordering::SeqCst))
    }

    /// What cannot be true of the counters, seen from the broker, which writes one of each pair and is never overtaken by
    /// an honest client: whoever has written over its page is not served on.
    pub fn fault(&self) -> Option<&'static str> {
        let too_many = |counter: &AtomicU64| counter.load(Ordering::Relaxed) > COUNTLESS;
        if self.on_the_way_up() > DEPTH {
            Some("it has sent more batches than there is room for, or fewer than were taken")
        } else if self.on_the_way_down() > DEPTH {
            Some("it has taken more batches than it was sent")
        } else if too_many(&self.handled) || too_many(&self.missed) {
            Some("it has handled or missed more messages than there can have been")
        } else {
            None
        }
    }
}

/// How far one counter is ahead of another that cannot be ahead of it.
fn ahead(one: u64, other: u64) -> u64 {
    one.checked_sub(other).unwrap_or(u64::MAX)
}

/// The connection is open.
pub const OPEN: u32 = 0;
/// The broker is on its way out, or has let go of this client. Written by the broker.
pub const SENT_AWAY: u32 = 1;
/// The broker's process is gone. Written by the client's own watch.
pub const BROKER_DIED: u32 = 2;

/// What is sealed of a page.
const SIZED: SealFlags = SealFlags::SHRINK.union(SealFlags::GROW);

/// A shared mapping of a `T` that consists of atomics.
pub struct Page<T> {
    at: NonNull<T>,
    file: OwnedFd,
}

// SAFETY: `Page` hands out `&T` only, and the two types it is made for consist of atomics and of bytes that they guard.
unsafe impl<T: Sync> Send for Page<T> {}
unsafe impl<T: Sync> Sync for Page<T> {}

/// Types that may be shared with another process: atomics, and bytes that atomics guard; valid for any bit pattern.
pub trait Shareable: Sync {}
impl Shareable for BrokerPage {}
impl Shareable for ClientPage {}

impl<T: Shareable> Page<T> {
    /// A fresh page, all zero.
    pub fn create(name: &str) -> std::io::Result<Self> {
        let file = memfd_create(name, MemfdFlags::CLOEXEC | MemfdFlags::ALLOW_SEALING)?;
        ftruncate(&file, size_of::<T>() as u64)?;
        fcntl_add_seals(&file, SIZED | SealFlags::SEAL)?;
        Self::open(file)
    }

    /// The page that another process created. Its size is sealed: a page that the other end could shrink would end
    /// whoever touches it (SIGBUS).
    pub fn open(file: OwnedFd) -> std::io::Result<Self> {
        match fcntl_get_seals(&file) {
            Ok(seals) if seals.contains(SIZED) => Self::map(file),
            _ => Err(std::io::Error::other("the shared page's size is not sealed")),
        }
    }

    /// The page in a file of whatever kind.
    pub(super) fn map(file: OwnedFd) -> std::io::Result<Self> {
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
    use std::time::Duration;

    use rustix::io::Errno;

    use super::super::shared::SMALL;
    use super::*;

    #[test]
    fn two_mappings_see_the_same_counters() {
        let page = Page::<ClientPage>::create("elk-test").unwrap();
        let other = Page::<ClientPage>::open(page.file().try_clone().unwrap()).unwrap();
        page.up_sent.store(7, Ordering::Release);
        assert_eq!(other.up_sent.load(Ordering::Acquire), 7);
    }

    #[test]
    fn small_batches_lie_in_the_page_and_long_ones_do_not() {
        let page = Page::<ClientPage>::create("elk-test").unwrap();
        let other = Page::<ClientPage>::open(page.file().try_clone().unwrap()).unwrap();
        for number in 0..3 * DEPTH {
            let batch = vec![number as u8; (number * 20) as usize + 1];
            let small = page.up.put(number, &batch);
            assert_eq!((small, other.up.get(number)), (batch.len() <= SMALL, small.then_some(&batch[..])));
        }
        assert!(other.down.get(0).is_none());
    }

    #[test]
    fn a_ring_before_the_sleep_is_not_missed() {
        let page = Page::<BrokerPage>::create("elk-test").unwrap();
        let before = page.bell.rings();
        page.bell.ring();
        page.bell.wait(before, Duration::from_secs(3600));
    }

    #[test]
    fn a_page_s_size_is_sealed_and_one_whose_is_not_is_refused() {
        let page = Page::<ClientPage>::create("elk-test").unwrap();
        for size in [0, 1 << 20] {
            assert_eq!(ftruncate(page.file(), size), Err(Errno::PERM));
        }
        assert_eq!(fcntl_add_seals(page.file(), SealFlags::FUTURE_WRITE), Err(Errno::PERM));
        let open = memfd_create("elk-test", MemfdFlags::CLOEXEC | MemfdFlags::ALLOW_SEALING).unwrap();
        ftruncate(&open, size_of::<ClientPage>() as u64).unwrap();
        assert!(Page::<ClientPage>::open(open).is_err());
        let short = memfd_create("elk-test", MemfdFlags::CLOEXEC | MemfdFlags::ALLOW_SEALING).unwrap();
        fcntl_add_seals(&short, SIZED).unwrap();
        assert!(Page::<ClientPage>::open(short).is_err());
    }

    #[test]
    fn counters_that_cannot_be_true_are_noticed() {
        let page = Page::<ClientPage>::create("elk-test").unwrap();
        let honest = |page: &ClientPage| {
            page.up_taken.store(3, Ordering::Relaxed);
            page.up_sent.store(3 + DEPTH, Ordering::Relaxed);
            page.down_sent.store(5, Ordering::Relaxed);
            page.down_taken.store(5, Ordering::Relaxed);
            page.handled.store(7, Ordering::Relaxed);
            page.missed.store(0, Ordering::Relaxed);
        };
        honest(&page);
        assert_eq!(page.fault(), None);
        let lies: [(&AtomicU64, &[u64]); 4] = [
            (&page.up_sent, &[0, 2, 4 + DEPTH, 1 << 63, u64::MAX]),
            (&page.down_taken, &[6, 1 << 63, u64::MAX]),
            (&page.handled, &[1 << 63, u64::MAX]),
            (&page.missed, &[u64::MAX]),
        ];
        for (counter, values) in lies {
            for value in values {
                counter.store(*value, Ordering::Relaxed);
                assert!(page.fault().is_some(), "{value}");
                honest(&page);
            }
        }
    }
}
