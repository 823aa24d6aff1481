//! A community inside one process: the broker behind a lock, clients on threads. For tests, and for whole missions in
//! one process. It has no memory for bulk values: a value is a copy away anyway.
//!
//! Its broker can be made to die and to come back, and its clients to be killed, as those of processes are.

use std::collections::BTreeMap;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Arc, Condvar, Mutex, MutexGuard, PoisonError, Weak};
use std::time::Duration;

use elk_proto::host::{Endpoints, Host, Progress};

use crate::broker::{AdmissionError, Broker, BrokerConfig, Introduction, Limits, Retained, Session};
use crate::clock::{Clock, Stopwatch, monotonic_nanos};
use crate::link::{Batch, Downlink, Fill, Held, Link, LinkError, REJOIN_PATIENCE, Rejoin, Uplink, Wake};
use crate::wire::{BulkRef, ClientId};

/// The longest that who listens for a client sleeps.
const LONGEST_SLEEP: Duration = Duration::from_secs(5);
/// How often it is looked whether there is room: patience with who does not read comes to an end without a word.
const ROOM_LOOKED_FOR_EVERY: Duration = Duration::from_millis(50);

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
    host: Option<Host>,
    endpoints: MemoryEndpoints,
    /// 0: the broker has stopped in good order.
    epoch: u64,
}

/// The clients' endpoints, and what the next broker finds, should this one die.
#[derive(Default)]
struct MemoryEndpoints {
    clients: BTreeMap<ClientId, Endpoint>,
    sessions: Vec<Session>,
    retained: Vec<Retained>,
}

#[derive(Default)]
struct Endpoint {
    progress: Progress,
    /// It is to leave, for its successor.
    retires: bool,
    /// It is to be woken once there is room for a batch of it.
    wants_room: bool,
}

impl Endpoints for MemoryEndpoints {
    fn progress(&self, id: ClientId) -> Option<Progress> {
        self.clients.get(&id).map(|endpoint| endpoint.progress)
    }

    fn retire(&mut self, id: ClientId) {
        self.clients.entry(id).and_modify(|endpoint| endpoint.retires = true);
    }

    fn monotonic_nanos(&self) -> u64 {
        monotonic_nanos()
    }

    fn keep_sessions(&mut self, sessions: Vec<(ClientId, Session)>) {
        self.sessions = sessions.into_iter().map(|(_, session)| session).collect();
    }

    fn keep_retained(&mut self, retained: Vec<Retained>) {
        self.retained = retained;
    }
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
        let config = BrokerConfig { limits, time_warp: clock.warp(), ..config };
        let state = State {
            host: Some(Host::new(config.clone(), clock.now())),
            endpoints: MemoryEndpoints::default(),
            epoch: 1,
        };
        Self(Arc::new(Shared { state: Mutex::new(state), changed: Condvar::new(), clock, config }))
    }

    /// Lets a client in.
    pub fn connect(&self, name: &str) -> Result<Link, AdmissionError> {
        self.join(&Introduction::new(name))
    }

    /// Lets a client in that has more to say than its name.
    pub fn join(&self, who: &Introduction<'_>) -> Result<Link, AdmissionError> {
        let shared = &self.0;
        let mut state = shared.lock();
        let now = shared.clock.now();
        let State { host, endpoints, .. } = &mut *state;
        // A broker that has stopped has no names to give; the link will say that it is gone.
        let id = host.as_mut().map_or(Ok(0), |host| host.join(now, who, endpoints))?;
        endpoints.clients.insert(id, Endpoint::default());
        let clock_setting = host.as_ref().and_then(|host| host.broker.clock_setting());
        state.follow_up(now);
        let epoch = state.epoch;
        let connection = Arc::new(Connection { shared: shared.clone(), id, epoch, goodbye: AtomicBool::new(false) });
        let (name, build, lease_secs) = (who.name.to_owned(), who.build.to_owned(), who.lease_secs);
        Ok(Link {
            up: Box::new(MemoryUp(connection.clone())),
            down: Box::new(MemoryDown { connection, wake: None }),
            back: Box::new(MemoryBack { broker: self.clone(), name, build: build.clone(), lease_secs, epoch }),
            build,
            warp: shared.clock.warp(),
            clock_setting,
            epoch,
        })
    }

    /// Ends the community: clients are told that the broker is gone.
    pub fn stop(&self) {
        let mut state = self.0.lock();
        (state.host, state.epoch) = (None, 0);
        self.0.changed.notify_all();
    }

    /// The broker dies, with all that it held.
    pub fn crash(&self) {
        let mut state = self.0.lock();
        state.follow_up(self.0.clock.now());
        state.host = None;
        state.endpoints.clients.clear();
        self.0.changed.notify_all();
    }

    /// The next broker, after [`MemoryBroker::crash`].
    pub fn recover(&self) {
        let mut state = self.0.lock();
        // They stay: this broker may die as well before anybody has come back.
        let sessions = state.endpoints.sessions.clone().into_iter().map(|session| (session, true));
        let (config, now) = (self.0.config.clone(), self.0.clock.now());
        state.host = Some(Host::recover(config, now, sessions, &state.endpoints.retained));
        state.epoch += 1;
        self.0.changed.notify_all();
    }

    /// The client of this name dies where it is; what it does from now on has no effect.
    pub fn kill(&self, name: &str) {
        let mut state = self.0.lock();
        let now = self.0.clock.now();
        if let Some(id) = state.host.as_ref().and_then(|host| host.broker.client_named(name)) {
            state.let_go(now, id, false);
        }
        self.0.changed.notify_all();
    }
}

impl State {
    fn follow_up(&mut self, now: f64) {
        if let Some(host) = &mut self.host {
            host.follow_up(now, &mut self.endpoints);
        }
    }

    fn is_retiring(&self, id: ClientId) -> bool {
        self.endpoints.clients.get(&id).is_some_and(|endpoint| endpoint.retires)
    }

    fn let_go(&mut self, now: f64, id: ClientId, goodbye: bool) {
        if let Some(host) = &mut self.host
            && let Some(endpoint) = self.endpoints.clients.remove(&id)
        {
            host.leave(now, id, endpoint.progress, goodbye, &mut self.endpoints);
            self.follow_up(now);
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
        match &mut state.host {
            Some(host) if now == epoch => Ok(&mut host.broker),
            _ if now == 0 => Err(LinkError::BrokerGone(community)),
            _ => Err(LinkError::BrokerDied(community)),
        }
    }
}

/// Both ways of one client; the client is gone when both are dropped.
struct Connection {
    shared: Arc<Shared>,
    id: ClientId,
    epoch: u64,
    goodbye: AtomicBool,
}

impl Drop for Connection {
    fn drop(&mut self) {
        let mut state = self.shared.lock();
        if state.epoch == self.epoch {
            state.let_go(self.shared.clock.now(), self.id, self.goodbye.load(Ordering::Relaxed));
        }
        self.shared.changed.notify_all();
    }
}

struct MemoryUp(Arc<Connection>);

impl Uplink for MemoryUp {
    fn send(&mut self, batch: &[u8]) -> Result<(), LinkError> {
        let Connection { shared, id, epoch, .. } = &*self.0;
        let mut state = shared.lock();
        loop {
            let broker = shared.broker(&mut state, *epoch)?;
            let now = shared.clock.now();
            if !broker.holds_back(now, *id) {
                let State { host: Some(host), endpoints, .. } = &mut *state else { continue };
                let taken = host.receive(now, *id, batch, endpoints);
                host.follow_up(now, endpoints);
                shared.changed.notify_all();
                return taken.map_err(|e| LinkError::SharedMemory(e.to_string()));
            }
            state = wait(shared, state, ROOM_LOOKED_FOR_EVERY);
        }
    }

    fn has_room(&self) -> bool {
        let Connection { shared, id, epoch, .. } = &*self.0;
        let mut state = shared.lock();
        let now = shared.clock.now();
        // One that is gone keeps nobody waiting.
        let has_room = shared.broker(&mut state, *epoch).map_or(true, |broker| !broker.holds_back(now, *id));
        state.endpoints.clients.entry(*id).and_modify(|endpoint| endpoint.wants_room = !has_room);
        if !has_room {
            shared.changed.notify_all();
        }
        has_room
    }

    fn handled(&self) -> u64 {
        let Connection { shared, id, epoch, .. } = &*self.0;
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

struct MemoryDown {
    connection: Arc<Connection>,
    /// For a client that lives in somebody's event loop.
    wake: Option<Arc<dyn Wake>>,
}

/// Sets `wake` whenever there may be something for a client, until its end or that of its broker.
fn listen(shared: &Shared, connection: &Weak<Connection>, (id, epoch): (ClientId, u64), wake: &dyn Wake) {
    let mut state = shared.lock();
    loop {
        let now = shared.clock.now();
        let retiring = state.is_retiring(id);
        let wants_room = state.endpoints.clients.get(&id).is_some_and(|endpoint| endpoint.wants_room);
        let longest = if wants_room { ROOM_LOOKED_FOR_EVERY } else { LONGEST_SLEEP };
        let next = match shared.broker(&mut state, epoch) {
            Ok(broker) if connection.strong_count() > 0 => {
                broker.tick(now);
                let has_mail = broker.may_give(id) && broker.with_mail().any(|with| with == id);
                if retiring || has_mail || (wants_room && !broker.holds_back(now, id)) {
                    wake.set();
                }
                broker.next_deadline() - now
            }
            _ => return wake.set(),
        };
        state = wait(shared, state, shared.clock.real(next).clamp(Duration::from_millis(1), longest));
    }
}

impl Downlink for MemoryDown {
    fn receive(&mut self, timeout: Duration) -> Result<Option<Batch>, LinkError> {
        let Connection { shared, id, epoch, .. } = &*self.connection;
        let waited = Stopwatch::start();
        self.wake.iter().for_each(|wake| wake.clear());
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
            let Some(left) = left.filter(|_| !state.is_retiring(*id)) else {
                return Ok(None);
            };
            state = wait(shared, state, left.min(next));
        }
    }

    fn wake_by(&mut self, wake: Arc<dyn Wake>) -> std::io::Result<()> {
        let (shared, connection, of) = (
            self.connection.shared.clone(),
            Arc::downgrade(&self.connection),
            (self.connection.id, self.connection.epoch),
        );
        self.wake = Some(wake.clone());
        std::thread::Builder::new()
            .name("wake".into())
            .spawn(move || listen(&shared, &connection, of, &*wake))
            .map(drop)
    }

    fn open(&self) -> bool {
        let Connection { shared, epoch, .. } = &*self.connection;
        shared.broker(&mut shared.lock(), *epoch).is_ok()
    }

    fn note_handled(&mut self, messages: u64) {
        let Connection { shared, id, epoch, .. } = &*self.connection;
        let mut state = shared.lock();
        let Ok(broker) = shared.broker(&mut state, *epoch) else { return };
        broker.note_handled(shared.clock.now(), *id, messages, &mut Vec::new());
        let State { host: Some(host), endpoints, .. } = &mut *state else { return };
        if let Some(Endpoint { progress, .. }) = endpoints.clients.get_mut(id) {
            let at = monotonic_nanos();
            let first_handled_at = if progress.first_handled_at == 0 { at } else { progress.first_handled_at };
            *progress = Progress { handled: messages, first_handled_at, last_handled_at: at };
        }
        if host.is_handing_over() {
            host.follow_up(shared.clock.now(), endpoints);
        }
    }

    fn note_missed(&mut self, _: u64) {}

    fn retiring(&self) -> bool {
        self.connection.shared.lock().is_retiring(self.connection.id)
    }

    fn bulk(&mut self, _: BulkRef) -> Option<&Held> {
        None
    }

    fn attach(&mut self, _: u32) -> bool {
        false
    }
}

struct MemoryBack {
    broker: MemoryBroker,
    name: String,
    build: String,
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
        while state.epoch <= self.epoch || state.host.is_none() {
            if state.epoch == 0 || waited.elapsed() >= REJOIN_PATIENCE {
                return Err(gone());
            }
            state = wait(shared, state, Duration::from_millis(50));
        }
        drop(state);
        let Self { broker, name, build, lease_secs, .. } = &*self;
        let who = Introduction { build, lease_secs: *lease_secs, ..Introduction::new(name).returning() };
        broker.join(&who).map_err(|_| gone())
    }
}

fn wait<'a>(shared: &'a Shared, state: MutexGuard<'a, State>, timeout: Duration) -> MutexGuard<'a, State> {
    shared.changed.wait_timeout(state, timeout).unwrap_or_else(PoisonError::into_inner).0
}
