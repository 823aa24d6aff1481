//! A community inside one process: the broker behind a lock, clients on threads. For tests, and for whole missions in
//! one process. It has no bulk place of its own: a value is a copy away anyway.

use std::sync::{Arc, Condvar, Mutex, MutexGuard, PoisonError};
use std::time::Duration;

use crate::broker::{Broker, BrokerConfig, ClientId, Refusal};
use crate::clock::{Clock, Stopwatch};
use crate::link::{Batch, Downlink, Fill, Link, LinkError, Uplink};
use crate::wire::BulkRef;

/// A broker that clients of the same process connect to.
#[derive(Clone)]
pub struct MemoryBroker(Arc<Shared>);

struct Shared {
    broker: Mutex<Option<Broker>>,
    /// Rung whenever mail or room may have come about.
    changed: Condvar,
    clock: Clock,
    community: String,
}

impl MemoryBroker {
    /// Starts a community.
    pub fn new(config: BrokerConfig, clock: Clock) -> Self {
        let community = config.community.clone();
        let broker = Mutex::new(Some(Broker::new(config, clock.now())));
        Self(Arc::new(Shared { broker, changed: Condvar::new(), clock, community }))
    }

    /// Lets a client in.
    pub fn connect(&self, name: &str) -> Result<Link, Refusal> {
        let mut broker = self.0.lock();
        // A broker that has stopped has no names to give; the link will say that it is gone.
        let id = broker.as_mut().map_or(Ok(0), |b| b.connect(self.0.clock.now(), name))?;
        let end = Arc::new(End { shared: self.0.clone(), id });
        Ok(Link { up: Box::new(MemoryUp(end.clone())), down: Box::new(MemoryDown(end)), clock: self.0.clock, epoch: 1 })
    }

    /// Ends the community: clients are told that the broker is gone.
    pub fn stop(&self) {
        *self.0.lock() = None;
        self.0.changed.notify_all();
    }
}

impl Shared {
    fn lock(&self) -> MutexGuard<'_, Option<Broker>> {
        self.broker.lock().unwrap_or_else(PoisonError::into_inner)
    }

    fn gone(&self) -> LinkError {
        LinkError::BrokerGone(self.community.clone())
    }
}

/// Both ways of one client; the client is gone when both are dropped.
struct End {
    shared: Arc<Shared>,
    id: ClientId,
}

impl Drop for End {
    fn drop(&mut self) {
        if let Some(broker) = self.shared.lock().as_mut() {
            broker.disconnect(self.shared.clock.now(), self.id);
        }
        self.shared.changed.notify_all();
    }
}

struct MemoryUp(Arc<End>);

impl Uplink for MemoryUp {
    fn send(&mut self, batch: &[u8]) -> Result<(), LinkError> {
        let End { shared, id } = &*self.0;
        let mut guard = shared.lock();
        loop {
            let broker = guard.as_mut().ok_or_else(|| shared.gone())?;
            let now = shared.clock.now();
            if !broker.holds_back(now, *id) {
                let taken = broker.receive(now, *id, batch);
                shared.changed.notify_all();
                return taken.map_err(|e| LinkError::SharedMemory(e.to_string()));
            }
            guard = wait(shared, guard, Duration::from_millis(50));
        }
    }

    fn send_bulk(&mut self, _: usize, _: &mut Fill<'_>) -> Result<Option<BulkRef>, LinkError> {
        Ok(None)
    }
}

struct MemoryDown(Arc<End>);

impl Downlink for MemoryDown {
    fn receive(&mut self, timeout: Duration) -> Result<Option<Batch>, LinkError> {
        let End { shared, id } = &*self.0;
        let waited = Stopwatch::start();
        let mut guard = shared.lock();
        loop {
            let broker = guard.as_mut().ok_or_else(|| shared.gone())?;
            let now = shared.clock.now();
            broker.tick(now);
            let mut batch = Vec::new();
            broker.take_mail(now, *id, usize::MAX, &mut batch, |_, _| {});
            if !batch.is_empty() {
                shared.changed.notify_all();
                return Ok(Some(Batch(Box::new(batch))));
            }
            let Some(left) = timeout.checked_sub(waited.elapsed()).filter(|left| !left.is_zero()) else {
                return Ok(None);
            };
            let next = shared.clock.real(broker.next_deadline() - now).max(Duration::from_millis(1));
            guard = wait(shared, guard, left.min(next));
        }
    }

    fn bulk(&mut self, _: BulkRef) -> Option<&[u8]> {
        None
    }

    fn attach(&mut self, _: u32) -> bool {
        false
    }
}

fn wait<'a>(
    shared: &'a Shared,
    guard: MutexGuard<'a, Option<Broker>>,
    timeout: Duration,
) -> MutexGuard<'a, Option<Broker>> {
    shared.changed.wait_timeout(guard, timeout).unwrap_or_else(PoisonError::into_inner).0
}
