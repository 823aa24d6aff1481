//! Has a descriptor be readable whenever a client's bell rings, for a client that lives in somebody's event loop: futexes
//! cannot be polled.

use std::sync::Arc;
use std::sync::atomic::AtomicBool;
use std::sync::atomic::Ordering::{Acquire, Relaxed};
use std::time::Duration;

use super::page::{ClientPage, OPEN, Page};
use elk_proto::link::Wake;

/// The longest that the listener sleeps: the bell rings when there is news.
const LONGEST_SLEEP: Duration = Duration::from_secs(5);

/// A thread that listens to a bell, until this is dropped or the broker has gone.
pub struct Forward {
    pub wake: Arc<dyn Wake>,
    page: Arc<Page<ClientPage>>,
    over: Arc<AtomicBool>,
}

impl Forward {
    pub fn start(page: &Arc<Page<ClientPage>>, wake: Arc<dyn Wake>) -> std::io::Result<Self> {
        let forward = Self { wake, page: page.clone(), over: Arc::default() };
        let (page, wake, over) = (page.clone(), forward.wake.clone(), forward.over.clone());
        let listen = move || {
            let mut heard = page.bell.rings();
            wake.set();
            while !over.load(Relaxed) && page.closed.load(Acquire) == OPEN {
                page.bell.wait(heard, LONGEST_SLEEP);
                if std::mem::replace(&mut heard, page.bell.rings()) != heard {
                    wake.set();
                }
            }
            wake.set();
        };
        std::thread::Builder::new().name("wake".into()).stack_size(64 << 10).spawn(listen)?;
        Ok(forward)
    }
}

impl Drop for Forward {
    fn drop(&mut self) {
        self.over.store(true, Relaxed);
        self.page.bell.ring();
    }
}
