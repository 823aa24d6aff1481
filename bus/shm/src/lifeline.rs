//! A client's connection, which the broker takes for its process' life. A process that is forked off has the descriptor as well,
//! and would keep its parent alive in the broker's eyes.

use std::collections::BTreeSet;
use std::mem::ManuallyDrop;
use std::ops::Deref;
use std::os::fd::{AsRawFd, FromRawFd, OwnedFd, RawFd};
use std::os::unix::net::UnixStream;
use std::sync::{Mutex, MutexGuard, PoisonError};

use rustix::io::DupFlags;

/// The descriptors of this process' connections.
static OPEN: Mutex<BTreeSet<RawFd>> = Mutex::new(BTreeSet::new());

fn open() -> MutexGuard<'static, BTreeSet<RawFd>> {
    OPEN.lock().unwrap_or_else(PoisonError::into_inner)
}

/// A connection that a fork lets go of ([`let_go_of_parent`]).
pub struct Lifeline(UnixStream);

impl Lifeline {
    /// This connection.
    pub fn new(stream: UnixStream) -> Self {
        open().insert(stream.as_raw_fd());
        Self(stream)
    }
}

impl Deref for Lifeline {
    type Target = UnixStream;
    fn deref(&self) -> &UnixStream {
        &self.0
    }
}

impl Drop for Lifeline {
    fn drop(&mut self) {
        // While it is still open: its number may be another's the moment after.
        open().remove(&self.0.as_raw_fd());
    }
}

/// Lets go of the connections of the process that this one was forked off, if it does not replace itself by another program
/// (which closes them): as the first thing that it does. The parent's clients are of no use here afterwards, as they were before.
pub fn let_go_of_parent() {
    // A thread that held this in the parent is not there to let go of it.
    let Ok(mut open) = OPEN.try_lock() else { return };
    let Ok(nothing) = std::fs::File::open("/dev/null") else { return };
    for descriptor in std::mem::take(&mut *open) {
        // SAFETY: it is open, as it was in the parent: whoever closes one takes it out of the set before. It is not closed
        // here, but leads elsewhere, so that who owned it in the parent's memory does not own another's.
        let mut owned = unsafe { ManuallyDrop::new(OwnedFd::from_raw_fd(descriptor)) };
        // What cannot be exchanged stays.
        let _ = rustix::io::dup3(&nothing, &mut owned, DupFlags::CLOEXEC);
    }
}
