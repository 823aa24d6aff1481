//! A client in somebody's event loop: a file descriptor that is readable when mail waits.
//!
//! Nobody pays for it who does not ask: with the first [`Client::wake_fd`](crate::Client::wake_fd) a thread
//! begins to listen to the client's bell.
//!
//! ```
//! use std::time::Duration;
//! use elk_bus::{BrokerConfig, Client, Clock, Community, memory::MemoryBroker};
//! use rustix::event::{PollFd, PollFlags, poll};
//!
//! # let community = Community::new("doc")?;
//! # let broker = MemoryBroker::new(BrokerConfig::new("doc"), Clock::new(1.0));
//! # let join = |name: &str| Ok::<_, Box<dyn std::error::Error>>(Client::over(broker.connect(name)?, name, &community));
//! let (mut reader, mut writer) = (join("reader")?, join("writer")?);
//! reader.comms.register("GREETING")?;
//! reader.comms.flush()?;
//! writer.comms.notify("GREETING", "hello")?;
//! writer.comms.flush()?;
//! let mut heard = 0;
//! while heard == 0 {
//!     // Beside whatever else the loop waits for.
//!     let fd = reader.wake_fd()?;
//!     poll(&mut [PollFd::from_borrowed_fd(fd, PollFlags::IN)], None)?;
//!     reader.receive(Duration::ZERO, |_| heard += 1)?;
//! }
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```

use std::io;
use std::os::fd::{AsFd, BorrowedFd, OwnedFd};
use std::sync::{Arc, Mutex, PoisonError};
use std::task::Waker;

use rustix::event::{EventfdFlags, eventfd};

use crate::link::Wake;

/// A descriptor that is readable from when it is set until it is cleared.
#[derive(Debug)]
pub(crate) struct EventFd {
    fd: OwnedFd,
    /// A task that waits for room, and not for what there is to read.
    task: Mutex<Option<Waker>>,
}

impl EventFd {
    /// One that is set: whoever is about to sleep has to look first.
    pub(crate) fn new() -> io::Result<Arc<Self>> {
        let fd = eventfd(1, EventfdFlags::CLOEXEC | EventfdFlags::NONBLOCK)?;
        Ok(Arc::new(Self { fd, task: Mutex::default() }))
    }

    /// Has a task woken as well when it is set next, in place of the one before.
    #[cfg(feature = "tokio")]
    pub(crate) fn wake_task(&self, task: &Waker) {
        *self.task.lock().unwrap_or_else(PoisonError::into_inner) = Some(task.clone());
    }
}

impl Wake for EventFd {
    fn set(&self) {
        // One that is full is set.
        let _ = rustix::io::write(&self.fd, &1_u64.to_ne_bytes());
        let task = self.task.lock().unwrap_or_else(PoisonError::into_inner).take();
        task.into_iter().for_each(Waker::wake);
    }

    fn clear(&self) {
        // One that is empty is clear.
        let _ = rustix::io::read(&self.fd, &mut [0; 8]);
    }
}

impl AsFd for EventFd {
    fn as_fd(&self) -> BorrowedFd<'_> {
        self.fd.as_fd()
    }
}
