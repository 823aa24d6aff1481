//! Waits for the sockets, on a thread of its own, and rings for whoever serves them. It reads and writes nothing.

use std::io;
use std::os::fd::{AsFd, OwnedFd};
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Arc, Mutex, PoisonError};

use rustix::buffer::spare_capacity;
use rustix::event::epoll::{self, CreateFlags, Event, EventData, EventFlags};
use rustix::event::{EventfdFlags, eventfd};
use rustix::io::Errno;

/// Tells one socket from another.
pub(super) type Token = u64;

/// That of what ends the thread.
const END: Token = Token::MAX;
/// Sockets that are noted at a time.
const AT_A_TIME: usize = 64;

/// The sockets that something has happened at.
pub(super) struct Poller {
    shared: Arc<Shared>,
    end: OwnedFd,
}

struct Shared {
    epoll: OwnedFd,
    happened: Mutex<Vec<Token>>,
    any: AtomicBool,
}

impl Poller {
    /// Begins to wait; `ring` is called on the thread that waits, whenever something has happened.
    ///
    /// # Errors
    /// The operating system has no thread or descriptor left.
    pub fn start(ring: impl Fn() + Send + 'static) -> io::Result<Self> {
        let epoll = epoll::create(CreateFlags::CLOEXEC)?;
        let end = eventfd(0, EventfdFlags::CLOEXEC | EventfdFlags::NONBLOCK)?;
        epoll::add(&epoll, &end, EventData::new_u64(END), EventFlags::IN)?;
        let shared = Arc::new(Shared { epoll, happened: Mutex::default(), any: AtomicBool::new(false) });
        let waiting = shared.clone();
        std::thread::Builder::new().name("moos".into()).stack_size(64 << 10).spawn(move || waiting.wait(ring))?;
        Ok(Self { shared, end })
    }

    /// Waits for a socket as well, until it is closed.
    ///
    /// # Errors
    /// The operating system has no room for it.
    pub fn add(&self, socket: impl AsFd, token: Token) -> io::Result<()> {
        // Only what is new is told, once: whoever serves the socket goes on until there is nothing more.
        let what = EventFlags::IN | EventFlags::OUT | EventFlags::RDHUP | EventFlags::ET;
        Ok(epoll::add(&self.shared.epoll, socket, EventData::new_u64(token), what)?)
    }

    /// The sockets that something has happened at since this was asked last.
    pub fn take(&self) -> Vec<Token> {
        if !self.shared.any.swap(false, Ordering::Acquire) {
            return Vec::new();
        }
        std::mem::take(&mut self.shared.happened.lock().unwrap_or_else(PoisonError::into_inner))
    }
}

impl Drop for Poller {
    fn drop(&mut self) {
        // A counter takes a one more; should it not, the thread waits on for sockets that are closed, and does no harm.
        let _ = rustix::io::write(&self.end, &1_u64.to_ne_bytes());
    }
}

impl Shared {
    fn wait(&self, ring: impl Fn()) {
        let mut events: Vec<Event> = Vec::with_capacity(AT_A_TIME);
        loop {
            match epoll::wait(&self.epoll, spare_capacity(&mut events), None) {
                Ok(_) => {}
                Err(Errno::INTR) => continue,
                // Of a descriptor that is ours there is no other error.
                Err(_) => return,
            }
            if events.iter().any(|event| event.data.u64() == END) {
                return;
            }
            let tokens = events.drain(..).map(|event| event.data.u64());
            self.happened.lock().unwrap_or_else(PoisonError::into_inner).extend(tokens);
            self.any.store(true, Ordering::Release);
            ring();
        }
    }
}
