//! What Python says on the bus, from whichever thread.
//!
//! A client lives on one thread. What is said there, in a callback, is said at once; what other threads say waits in a queue
//! for that thread, which is woken. The queue is bounded: who says more waits.

use std::cell::Cell;
use std::collections::VecDeque;
use std::io;
use std::os::fd::{AsFd, AsRawFd, BorrowedFd, OwnedFd};
use std::ptr::NonNull;
use std::sync::atomic::{AtomicBool, AtomicU64, Ordering};
use std::sync::{Condvar, Mutex, MutexGuard, PoisonError};
use std::time::Duration;

use elk_bus::link::LinkError;
use elk_bus::wire::MAX_NAME;
use elk_bus::{Comms, CommsError, Origin, Refused, Value};
use elk_outside::text;
use elk_pipe::Registration;
use pyo3::prelude::*;
use rustix::pipe::{PipeFlags, pipe_with};

use crate::error::error;
use crate::fork::Home;

/// Bytes that wait for the client's thread at most; one value may be longer.
const MOST_WAITING: usize = 4 << 20;
/// Bytes that something said takes beside its value, about.
const BESIDE_VALUE: usize = 128;
/// How often who waits for room looks for signals.
const LOOK_EVERY: Duration = Duration::from_millis(100);

/// Something said.
pub enum Said {
    Register(Registration),
    Unregister(Registration),
    /// A message that somebody else took, and could not use.
    Reject {
        variable: String,
        source: String,
        sequence: u64,
        why: String,
    },
    /// A variable's value; since when it is so (s, the community's clock), if not now; and what is said about the source.
    Publish {
        variable: String,
        value: Value,
        time: Option<f64>,
        source_aux: String,
    },
}

impl Said {
    fn say(&self, comms: &mut Comms, counts: &Counts) -> Result<(), CommsError> {
        match self {
            Said::Register(wanted) => comms.register(wanted.subscription()),
            Said::Unregister(wanted) => comms.unregister(wanted.subscription()),
            Said::Reject { variable, source, sequence, why } => comms.reject(variable, source, *sequence, why),
            Said::Publish { variable, value, time, source_aux } => {
                let value = value.as_ref();
                comms.publish_value(variable, value, Origin { time: *time, source_aux, source: None })?;
                counts.said.add(value.byte_len());
                Ok(())
            }
        }
    }

    fn value_len(&self) -> usize {
        if let Said::Publish { value, .. } = self { value.as_ref().byte_len() } else { 0 }
    }

    fn is_message(&self) -> bool {
        matches!(self, Said::Publish { .. })
    }

    fn byte_len(&self) -> usize {
        self.value_len() + BESIDE_VALUE
    }

    /// The variable, or the pattern of them.
    fn variable(&self) -> &str {
        match self {
            Said::Register(wanted) | Said::Unregister(wanted) => &wanted.keys,
            Said::Publish { variable, .. } | Said::Reject { variable, .. } => variable,
        }
    }

    /// What the bus would refuse later, when nobody could be told where it was said.
    fn check(&self) -> PyResult<()> {
        let names = match self {
            Said::Register(wanted) | Said::Unregister(wanted) => [&wanted.keys, &wanted.from],
            Said::Publish { variable, source_aux, .. } => [variable, source_aux],
            Said::Reject { .. } => return Ok(()),
        };
        if let Some(long) = names.into_iter().find(|name| name.len() > MAX_NAME) {
            let beginning: String = long.chars().take(40).collect();
            let (beginning, length) = (text::printable(&beginning), long.len());
            return Err(error(format_args!(
                "{beginning}… is a name of {length} bytes; at most {MAX_NAME} are allowed"
            )));
        }
        match self {
            Said::Register(wanted) | Said::Unregister(wanted) if wanted.keys.is_empty() || wanted.from.is_empty() => {
                Err(error(
                    "a registration without a name; right is a variable's name or a pattern, and `*` for all apps",
                ))
            }
            Said::Publish { variable, time: Some(time), .. } if !time.is_finite() => Err(error(format_args!(
                "the time of {variable} is {time}; right is seconds of the community's clock, or -1 for now"
            ))),
            _ => Ok(()),
        }
    }
}

/// Messages, and the bytes of their values.
#[derive(Default)]
pub struct Count {
    messages: AtomicU64,
    bytes: AtomicU64,
}

impl Count {
    /// One message more, whose value has so many bytes.
    pub fn add(&self, bytes: usize) {
        self.messages.fetch_add(1, Ordering::Relaxed);
        self.bytes.fetch_add(bytes as u64, Ordering::Relaxed);
    }

    pub fn get(&self) -> (u64, u64) {
        (self.messages.load(Ordering::Relaxed), self.bytes.load(Ordering::Relaxed))
    }
}

/// What a client has heard and said so far.
#[derive(Default)]
pub struct Counts {
    pub heard: Count,
    pub said: Count,
}

/// A pipe that wakes the client's thread; Python's signals write to it as well.
pub struct Bell {
    read: OwnedFd,
    write: OwnedFd,
}

impl Bell {
    pub fn new() -> io::Result<Self> {
        let (read, write) = pipe_with(PipeFlags::CLOEXEC | PipeFlags::NONBLOCK)?;
        Ok(Self { read, write })
    }

    pub fn ring(&self) {
        // One that is full rings already.
        let _ = rustix::io::write(&self.write, &[0]);
    }

    pub fn hush(&self) {
        let mut rung = [0; 64];
        while rustix::io::read(&self.read, &mut rung).is_ok_and(|read| read == rung.len()) {}
    }

    pub fn readable(&self) -> BorrowedFd<'_> {
        self.read.as_fd()
    }

    pub fn writable(&self) -> i32 {
        self.write.as_raw_fd()
    }
}

/// The way from Python's threads to the bus.
pub struct Outgoing {
    queue: Mutex<Queue>,
    room: Condvar,
    pub bell: std::sync::Arc<Bell>,
    /// The app is to leave.
    pub stop: AtomicBool,
    pub counts: Counts,
    name: String,
    home: Home,
}

#[derive(Default)]
struct Queue {
    said: VecDeque<Said>,
    bytes: usize,
    /// The client is gone: why.
    closed: Option<String>,
}

thread_local! {
    /// The client's saying end, while a callback runs on its thread, and whose it is.
    static LENT: Cell<Option<(*const Outgoing, NonNull<Comms>)>> = const { Cell::new(None) };
}

/// Takes back what was lent, also if the callback panics.
struct Lent(Option<(*const Outgoing, NonNull<Comms>)>);

impl Drop for Lent {
    fn drop(&mut self) {
        LENT.set(self.0);
    }
}

impl Outgoing {
    pub fn new(name: &str) -> io::Result<Self> {
        let (queue, room, bell) = (Mutex::default(), Condvar::new(), Bell::new()?.into());
        let (name, home) = (name.to_owned(), Home::here());
        Ok(Self { queue, room, bell, stop: AtomicBool::new(false), counts: Counts::default(), name, home })
    }

    /// Sees that this is the client's process.
    ///
    /// # Errors
    /// It is a fork of it.
    pub fn check(&self) -> PyResult<()> {
        self.home.check(&self.name)
    }

    fn lock(&self) -> MutexGuard<'_, Queue> {
        self.queue.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// Has what is said on this thread while `call` runs be said at once.
    pub fn lend<T>(&self, comms: &mut Comms, call: impl FnOnce() -> T) -> T {
        let _back = Lent(LENT.replace(Some((std::ptr::from_ref(self), NonNull::from(comms)))));
        call()
    }

    /// Does something with the client's saying end, if this is its thread, in a callback.
    pub fn with_comms<T>(&self, act: impl FnOnce(&mut Comms) -> T) -> Option<T> {
        let lent = LENT.get().filter(|(whose, _)| std::ptr::eq(*whose, self) && !self.home.is_elsewhere())?;
        // Nobody gets hold of it a second time meanwhile.
        let _back = Lent(LENT.replace(None));
        let mut comms = lent.1;
        // SAFETY: `lend` has it exclusively until its call returns, which this is in: the pointer is found on that thread
        // alone, from then until `lend` takes it back, and is taken away while it is in use.
        Some(act(unsafe { comms.as_mut() }))
    }

    /// Says something; waits for room with the interpreter's lock released.
    ///
    /// # Errors
    /// It cannot be, the client is gone, this is a fork, or a signal came.
    pub fn say(&self, py: Python<'_>, said: Said) -> PyResult<()> {
        self.check()?;
        said.check()?;
        if let Some(done) = py.detach(|| self.with_comms(|comms| said.say(comms, &self.counts))) {
            return done.map_err(error);
        }
        let mut said = Some(said);
        while py.detach(|| self.queue_up(&mut said)).map_err(error)? {
            py.check_signals()?;
        }
        Ok(())
    }

    /// Queues what was said, and takes it; whether there is no room yet.
    fn queue_up(&self, said: &mut Option<Said>) -> Result<bool, String> {
        let mut queue = self.lock();
        if queue.bytes >= MOST_WAITING && queue.closed.is_none() {
            let waited = self.room.wait_timeout(queue, LOOK_EVERY);
            queue = waited.unwrap_or_else(PoisonError::into_inner).0;
        }
        if let Some(why) = &queue.closed {
            return Err(why.clone());
        }
        if queue.bytes >= MOST_WAITING {
            return Ok(true);
        }
        if let Some(said) = said.take() {
            queue.bytes += said.byte_len();
            queue.said.push_back(said);
        }
        drop(queue);
        self.bell.ring();
        Ok(false)
    }

    /// Says what has queued up; what the bus has no room for is handed back, and why.
    ///
    /// # Errors
    /// The bus failed.
    pub fn say_queued(&self, comms: &mut Comms) -> Result<Vec<Refused>, CommsError> {
        let said = {
            let mut queue = self.lock();
            queue.bytes = 0;
            std::mem::take(&mut queue.said)
        };
        self.room.notify_all();
        let mut refused = Vec::new();
        for said in said {
            match said.say(comms, &self.counts) {
                Err(CommsError::Link(LinkError::BrokerGone(community))) => {
                    return Err(LinkError::BrokerGone(community).into());
                }
                // Who said it is elsewhere by now, and the next one may be no such thing.
                Err(why) => {
                    refused.push(Refused { key: said.variable().to_owned(), sequence: None, reason: why.to_string() })
                }
                Ok(()) => {}
            }
        }
        Ok(refused)
    }

    /// Messages that wait for the client's thread.
    pub fn unsent(&self) -> usize {
        if self.home.is_elsewhere() {
            return 0;
        }
        self.lock().said.iter().filter(|said| said.is_message()).count()
    }

    /// The client is gone: whoever says something is told why.
    pub fn close(&self, why: String) {
        let mut queue = self.lock();
        queue.said.clear();
        queue.closed = Some(why);
        drop(queue);
        self.room.notify_all();
    }

    /// Has the app leave; nobody's, if this is a fork.
    pub fn stop(&self) {
        if self.home.is_elsewhere() {
            return;
        }
        self.stop.store(true, Ordering::Relaxed);
        self.bell.ring();
    }
}
