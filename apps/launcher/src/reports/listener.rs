//! The launcher's client of the bus, on a thread of its own: calls wait while there is no broker, and whoever starts
//! the next broker must not be the one who waits.

use std::os::fd::{AsFd, BorrowedFd, OwnedFd};
use std::sync::atomic::{AtomicBool, AtomicUsize, Ordering};
use std::sync::mpsc::{Receiver, Sender, channel};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use std::thread::JoinHandle;
use std::time::Duration;

use elk_bus::link::LinkError;
use elk_bus::{Client, CommsError, ConnectError, Value};
use rustix::event::{EventfdFlags, eventfd};

use crate::error::LaunchError;
use crate::reports::observer::{News, Observer};

/// How long one look at the bus takes at most; then it is seen what is to be said.
const LOOK: Duration = Duration::from_millis(20);
/// How often a broker that is not there is asked for.
const ASK_EVERY: Duration = Duration::from_millis(5);

/// How the launcher joins the community; called again when it was thrown out.
pub(crate) type Join = Box<dyn FnMut() -> Result<Client, ConnectError> + Send>;

/// The thread, and what it has heard.
pub(crate) struct Listener {
    shared: Arc<Shared>,
    say: Option<Sender<(String, Value)>>,
    thread: Option<JoinHandle<()>>,
}

struct Shared {
    observer: Mutex<Observer>,
    failed: Mutex<Option<ConnectError>>,
    /// What is to be said and was not yet.
    unsaid: AtomicUsize,
    /// Rings when there is news, and when all is said.
    bell: OwnedFd,
    stop: AtomicBool,
}

impl Listener {
    /// Joins by `join`, as soon as somebody is there to be joined.
    pub fn start(join: Join, observer: Observer) -> Result<Self, LaunchError> {
        let system = |what, source| LaunchError::System { what, source };
        let bell = eventfd(0, EventfdFlags::CLOEXEC | EventfdFlags::NONBLOCK)
            .map_err(|error| system("no bell for the launcher's thread", error.into()))?;
        let (observer, failed) = (Mutex::new(observer), Mutex::new(None));
        let (unsaid, stop) = (AtomicUsize::new(0), AtomicBool::new(false));
        let shared = Arc::new(Shared { observer, failed, unsaid, bell, stop });
        let (say, said) = channel();
        let of_thread = shared.clone();
        let thread = std::thread::Builder::new()
            .name("bus".to_owned())
            .spawn(move || of_thread.run(join, &said))
            .map_err(|source| system("no thread for the launcher's client of the bus", source))?;
        Ok(Self { shared, say: Some(say), thread: Some(thread) })
    }

    /// What was heard.
    pub fn observer(&self) -> MutexGuard<'_, Observer> {
        lock(&self.shared.observer)
    }

    /// Why it cannot join, if it cannot.
    pub fn take_failure(&self) -> Option<ConnectError> {
        lock(&self.shared.failed).take()
    }

    /// Publishes a number or a text, as soon as there is a broker.
    pub fn say(&self, key: &str, value: impl Into<Value>) {
        if let Some(say) = &self.say {
            self.shared.unsaid.fetch_add(1, Ordering::Relaxed);
            // A thread that has failed has said so.
            let _ = say.send((key.to_owned(), value.into()));
        }
    }

    /// Whether all that was to be said is with the broker.
    pub fn has_said_all(&self) -> bool {
        self.shared.unsaid.load(Ordering::Relaxed) == 0
    }

    /// Becomes readable when there is news.
    pub fn bell(&self) -> BorrowedFd<'_> {
        self.shared.bell.as_fd()
    }

    /// Hushes the bell.
    pub fn hush(&self) {
        // It is only a matter of readability: what it counted does not matter, nor that it had not rung.
        let _ = rustix::io::read(&self.shared.bell, &mut [0u8; 8]);
    }

    /// Begins to leave the bus, once all that was to be said is said.
    pub fn leave(&mut self) {
        self.say = None;
        self.shared.stop.store(true, Ordering::Relaxed);
    }

    /// Whether it has left. It may have to wait for a broker until then.
    pub fn has_left(&self) -> bool {
        self.thread.as_ref().is_none_or(JoinHandle::is_finished)
    }
}

impl Drop for Listener {
    fn drop(&mut self) {
        self.leave();
        if let Some(thread) = self.thread.take() {
            let _ = thread.join();
        }
    }
}

impl Shared {
    fn run(&self, mut join: Join, said: &Receiver<(String, Value)>) {
        let mut joined = false;
        while !self.stop.load(Ordering::Relaxed) {
            match join() {
                Ok(mut client) => match self.enter(&mut client) {
                    Ok(()) => {
                        joined = true;
                        // Whatever ended it, the next broker is joined anew.
                        let _ = self.attend(client, said);
                    }
                    Err(CommsError::Link(error @ LinkError::SharedMemory(_))) if !joined => {
                        *lock(&self.failed) = Some(error.into());
                        return self.ring();
                    }
                    Err(_) => std::thread::sleep(ASK_EVERY),
                },
                Err(ConnectError::NoBroker(_)) => std::thread::sleep(ASK_EVERY),
                Err(_) if joined => std::thread::sleep(LOOK),
                Err(error) => {
                    *lock(&self.failed) = Some(error);
                    return self.ring();
                }
            }
        }
    }

    /// Registers for what there is to hear.
    fn enter(&self, client: &mut Client) -> Result<(), CommsError> {
        lock(&self.observer).register(&mut client.comms)?;
        client.comms.flush()
    }

    /// Hears and says what there is, until it is to leave.
    fn attend(&self, mut client: Client, said: &Receiver<(String, Value)>) -> Result<(), CommsError> {
        lock(&self.observer).news.push(News::Joined);
        self.ring();
        loop {
            client.receive(LOOK, |mail| lock(&self.observer).note(mail))?;
            if !lock(&self.observer).news.is_empty() {
                self.ring();
            }
            let leaving = self.stop.load(Ordering::Relaxed);
            let (count, done) = say_all(&mut client, said);
            if count > 0 {
                // What the broker went away with is not said again: whoever joins anew says how things are then.
                self.unsaid.fetch_sub(count, Ordering::Relaxed);
                self.ring();
            }
            done?;
            if leaving {
                return Ok(());
            }
        }
    }

    fn ring(&self) {
        // A bell that has rung too often already rings.
        let _ = rustix::io::write(&self.bell, &1u64.to_ne_bytes());
    }
}

/// Says what is to be said; how much that was, and whether it went out.
fn say_all(client: &mut Client, said: &Receiver<(String, Value)>) -> (usize, Result<(), CommsError>) {
    let mut count = 0;
    let mut done = Ok(());
    while let Ok((key, value)) = said.try_recv() {
        count += 1;
        done = done.and_then(|()| client.comms.notify(&key, value));
    }
    (count, done.and_then(|()| client.comms.flush()))
}

/// A thread that panicked with the lock leaves what it had heard until then.
fn lock<T>(mutex: &Mutex<T>) -> MutexGuard<'_, T> {
    mutex.lock().unwrap_or_else(PoisonError::into_inner)
}
