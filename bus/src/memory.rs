//! A community inside one process: the broker behind a lock, clients on threads. For tests, and for whole missions in
//! one process. It has no bulk place of its own: a value is a copy away anyway.
//!
//! Its broker can be made to die and to come back, and its clients to be killed, as those of processes are.

use std::collections::{BTreeMap, BTreeSet};
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Arc, Condvar, Mutex, MutexGuard, PoisonError};
use std::time::Duration;

use crate::broker::{Broker, BrokerConfig, ClientId, Introduction, Limits, Refusal, Retained, Session};
use crate::clock::{Clock, Stopwatch};
use crate::link::{Batch, Downlink, Fill, Link, LinkError, Rejoin, Uplink};
use crate::wire::BulkRef;

/// How long a client waits for the next broker.
const REJOIN_PATIENCE: Duration = Duration::from_secs(10);
/// How long a recovered broker keeps the sessions of clients that do not come back (s).
const SESSIONS_KEPT_SECS: f64 = 10.0;

/// A broker that clients of the same process connect to.
#[derive(Clone)]
pub struct MemoryBroker(Arc<Shared>);

struct Shared {
    state: Mutex<State>,
    /// Rung whenever mail or room may have come about.
    changed: Condvar,
    clock: Clock,
    config: BrokerConfig,
}

struct State {
    broker: Option<Broker>,
    /// What the next broker finds, should this one die.
    sessions: Vec<Session>,
    retained: Vec<Retained>,
    /// 0: the broker has stopped in good order.
    epoch: u64,
    handled: BTreeMap<ClientId, u64>,
    retiring: BTreeSet<ClientId>,
    /// Names whose holder has retired, until its successor has handled a message.
    handovers: BTreeMap<String, Stopwatch>,
}

impl MemoryBroker {
    /// Starts a community.
    pub fn new(config: BrokerConfig, clock: Clock) -> Self {
        // All values travel in batches here, and lie in this process anyway.
        let limits = Limits {
            message_bytes: usize::MAX,
            latest_bytes: usize::MAX,
            oversize_bytes: usize::MAX,
            pending_bytes: usize::MAX,
            ..config.limits
        };
        let config = BrokerConfig { limits, ..config };
        let state = State {
            broker: Some(Broker::new(config.clone(), clock.now())),
            sessions: Vec::new(),
            retained: Vec::new(),
            epoch: 1,
            handled: BTreeMap::new(),
            retiring: BTreeSet::new(),
            handovers: BTreeMap::new(),
        };
        Self(Arc::new(Shared { state: Mutex::new(state), changed: Condvar::new(), clock, config }))
    }

    /// Lets a client in.
    pub fn connect(&self, name: &str) -> Result<Link, Refusal> {
        self.join(&Introduction::new(name))
    }

    /// Lets a client in that has more to say than its name.
    pub fn join(&self, who: &Introduction<'_>) -> Result<Link, Refusal> {
        let shared = &self.0;
        let mut state = shared.lock();
        let now = shared.clock.now();
        // A broker that has stopped has no names to give; the link will say that it is gone.
        let id = state.broker.as_mut().map_or(Ok(0), |b| b.connect(now, who))?;
        let dial = state.broker.as_ref().and_then(Broker::dial);
        state.follow_up();
        let epoch = state.epoch;
        let end = Arc::new(End { shared: shared.clone(), id, epoch, goodbye: AtomicBool::new(false) });
        let (name, lease_secs) = (who.name.to_owned(), who.lease_secs);
        Ok(Link {
            up: Box::new(MemoryUp(end.clone())),
            down: Box::new(MemoryDown(end)),
            back: Box::new(MemoryBack { broker: self.clone(), name, lease_secs, epoch }),
            warp: shared.clock.warp(),
            dial,
            epoch,
        })
    }

    /// Ends the community: clients are told that the broker is gone.
    pub fn stop(&self) {
        let mut state = self.0.lock();
        (state.broker, state.epoch) = (None, 0);
        self.0.changed.notify_all();
    }

    /// The broker dies, with all that it held.
    pub fn crash(&self) {
        let mut state = self.0.lock();
        state.follow_up();
        (state.broker, state.retiring, state.handled) = (None, BTreeSet::new(), BTreeMap::new());
        self.0.changed.notify_all();
    }

    /// The next broker, after [`MemoryBroker::crash`].
    pub fn recover(&self) {
        let mut state = self.0.lock();
        // They stay: this broker may die as well before anybody has come back.
        let sessions = state.sessions.clone().into_iter().map(|session| (session, true));
        let (config, now) = (self.0.config.clone(), self.0.clock.now());
        let mut broker = Broker::recover(config, now, sessions, SESSIONS_KEPT_SECS);
        broker.inherit(now, &state.retained);
        state.broker = Some(broker);
        state.epoch += 1;
        self.0.changed.notify_all();
    }

    /// The client of this name dies where it is; what it does from now on has no effect.
    pub fn kill(&self, name: &str) {
        let mut state = self.0.lock();
        let now = self.0.clock.now();
        let State { broker: Some(broker), handled, .. } = &mut *state else { return };
        if let Some(id) = broker.client_named(name) {
            broker.disconnect(now, id, handled.get(&id).copied().unwrap_or_default(), false);
        }
        state.follow_up();
        self.0.changed.notify_all();
    }
}

impl State {
    fn follow_up(&mut self) {
        if let Some(broker) = &mut self.broker {
            self.retiring.extend(broker.take_retiring());
            if let Some(sessions) = broker.take_sessions() {
                self.sessions = sessions;
            }
            if let Some(retained) = broker.take_retained(|_| None) {
                self.retained = retained;
            }
        }
    }
}

impl Shared {
    fn lock(&self) -> MutexGuard<'_, State> {
        self.state.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// The broker that the clients of this epoch are connected to.
    fn broker<'a>(&self, state: &'a mut State, epoch: u64) -> Result<&'a mut Broker, LinkError> {
        let (now, community) = (state.epoch, self.config.community.clone());
        match &mut state.broker {
            Some(broker) if now == epoch => Ok(broker),
            _ if now == 0 => Err(LinkError::BrokerGone(community)),
            _ => Err(LinkError::BrokerDied(community)),
        }
    }
}

/// Both ways of one client; the client is gone when both are dropped.
struct End {
    shared: Arc<Shared>,
    id: ClientId,
    epoch: u64,
    goodbye: AtomicBool,
}

impl Drop for End {
    fn drop(&mut self) {
        let mut state = self.shared.lock();
        let handled = state.handled.remove(&self.id).unwrap_or_default();
        let retired = state.retiring.remove(&self.id);
        if let Ok(broker) = self.shared.broker(&mut state, self.epoch) {
            let name = broker.client_name(self.id).filter(|_| retired).map(str::to_owned);
            broker.disconnect(self.shared.clock.now(), self.id, handled, self.goodbye.load(Ordering::Relaxed));
            state.handovers.extend(name.map(|name| (name, Stopwatch::start())));
            state.follow_up();
        }
        self.shared.changed.notify_all();
    }
}

struct MemoryUp(Arc<End>);

impl Uplink for MemoryUp {
    fn send(&mut self, batch: &[u8]) -> Result<(), LinkError> {
        let End { shared, id, epoch, .. } = &*self.0;
        let mut state = shared.lock();
        loop {
            let broker = shared.broker(&mut state, *epoch)?;
            let now = shared.clock.now();
            if !broker.holds_back(now, *id) {
                let taken = broker.receive(now, *id, batch);
                state.follow_up();
                shared.changed.notify_all();
                return taken.map_err(|e| LinkError::SharedMemory(e.to_string()));
            }
            state = wait(shared, state, Duration::from_millis(50));
        }
    }

    fn handled(&self) -> u64 {
        let End { shared, id, epoch, .. } = &*self.0;
        shared.broker(&mut shared.lock(), *epoch).map_or(0, |broker| broker.handled_batches(*id))
    }

    fn send_bulk(&mut self, _: usize, _: &mut Fill<'_>) -> Result<Option<BulkRef>, LinkError> {
        Ok(None)
    }

    fn kept_bulk(&self, _: u64) -> Option<&[u8]> {
        None
    }

    fn say_goodbye(&mut self) {
        self.0.goodbye.store(true, Ordering::Relaxed);
    }

    fn keep_bulk(&mut self, _: &dyn Fn(u64) -> bool) {}
}

struct MemoryDown(Arc<End>);

impl Downlink for MemoryDown {
    fn receive(&mut self, timeout: Duration) -> Result<Option<Batch>, LinkError> {
        let End { shared, id, epoch, .. } = &*self.0;
        let waited = Stopwatch::start();
        let mut state = shared.lock();
        loop {
            let broker = shared.broker(&mut state, *epoch)?;
            let now = shared.clock.now();
            broker.tick(now);
            let mut batch = Vec::new();
            if broker.may_give(*id) {
                broker.take_mail(*id, usize::MAX, &mut batch, |_, _| {});
            }
            if !batch.is_empty() {
                broker.keep_given(*id, batch.clone());
                shared.changed.notify_all();
                return Ok(Some(Batch(Box::new(batch))));
            }
            let next = shared.clock.real(broker.next_deadline() - now).max(Duration::from_millis(1));
            let left = timeout.checked_sub(waited.elapsed()).filter(|left| !left.is_zero());
            let Some(left) = left.filter(|_| !state.retiring.contains(id)) else {
                return Ok(None);
            };
            state = wait(shared, state, left.min(next));
        }
    }

    fn open(&self) -> bool {
        let End { shared, epoch, .. } = &*self.0;
        shared.broker(&mut shared.lock(), *epoch).is_ok()
    }

    fn note_handled(&mut self, messages: u64) {
        let End { shared, id, epoch, .. } = &*self.0;
        let mut state = shared.lock();
        let Ok(broker) = shared.broker(&mut state, *epoch) else { return };
        broker.note_handled(shared.clock.now(), *id, messages, &mut Vec::new());
        let name = broker.client_name(*id).unwrap_or_default().to_owned();
        state.handled.insert(*id, messages);
        if let Some(since) = state.handovers.remove(&name)
            && let Ok(broker) = shared.broker(&mut state, *epoch)
        {
            let gap_ms = since.elapsed().as_secs_f64() * 1e3;
            broker.publish_event(shared.clock.now(), &format!("handover={name} gap_ms={gap_ms:.3}"));
        }
    }

    fn note_missed(&mut self, _: u64) {}

    fn retiring(&self) -> bool {
        self.0.shared.lock().retiring.contains(&self.0.id)
    }

    fn bulk(&mut self, _: BulkRef) -> Option<&[u8]> {
        None
    }

    fn attach(&mut self, _: u32) -> bool {
        false
    }
}

struct MemoryBack {
    broker: MemoryBroker,
    name: String,
    lease_secs: f64,
    /// The epoch of the broker that died.
    epoch: u64,
}

impl Rejoin for MemoryBack {
    fn rejoin(&mut self) -> Result<Link, LinkError> {
        let shared = &self.broker.0;
        let waited = Stopwatch::start();
        let gone = || LinkError::BrokerGone(shared.config.community.clone());
        let mut state = shared.lock();
        while state.epoch <= self.epoch || state.broker.is_none() {
            if state.epoch == 0 || waited.elapsed() >= REJOIN_PATIENCE {
                return Err(gone());
            }
            state = wait(shared, state, Duration::from_millis(50));
        }
        drop(state);
        let who = Introduction { name: &self.name, lease_secs: self.lease_secs, succeeds: false, returns: true };
        self.broker.join(&who).map_err(|_| gone())
    }
}

fn wait<'a>(shared: &'a Shared, state: MutexGuard<'a, State>, timeout: Duration) -> MutexGuard<'a, State> {
    shared.changed.wait_timeout(state, timeout).unwrap_or_else(PoisonError::into_inner).0
}
