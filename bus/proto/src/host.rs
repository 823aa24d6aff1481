//! A community as a transport hosts it: the broker, and what its decisions mean for the clients' endpoints, the same
//! for all transports.
//!
//! A transport carries batches in and mail out, and says who came and who has gone. What follows from that is done here,
//! in the right order: holders of names retire for their successors, whoever waits for a reader that was replaced waits
//! for the next one, and what the next broker has to find, should this one die, is handed over to be kept.

use crate::broker::{Action, AdmissionError, Broker, BrokerConfig, Introduction, Retained, Session, Succession};
use crate::wire::{BulkRef, ClientId, Frame, WireError};

/// How long the sessions of the clients of a broker that died are kept (s, the wall's).
const SESSIONS_KEPT_SECS: f64 = 10.0;

/// How far a client is with its mail.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub struct Progress {
    /// How many of the messages that the client was ever given it has handled.
    pub handled: u64,
    /// When it had handled the first of them (ns, monotonic); 0: not yet.
    pub first_handled_at: u64,
    /// When it had handled the last of them (ns, monotonic); 0: never.
    pub last_handled_at: u64,
}

/// The clients' endpoints, as a transport's broker side has them.
pub trait Endpoints {
    /// How far a client is; `None`: it has no endpoint here.
    fn progress(&self, id: ClientId) -> Option<Progress>;

    /// Asks a client to leave at its next message boundary.
    fn retire(&mut self, id: ClientId);

    /// The present moment (ns, monotonic).
    fn monotonic_nanos(&self) -> u64;

    /// Keeps the sessions, with their holders' numbers, where the next broker finds them.
    fn keep_sessions(&mut self, sessions: Vec<(ClientId, Session)>);

    /// Keeps what those have left who are gone where the next broker finds it.
    fn keep_retained(&mut self, retained: Vec<Retained>);

    /// [`Host::follow_up`] is to be called once this client has handled mail.
    fn watch(&mut self, _id: ClientId) {}

    /// The bytes of a bulk value, as far as they are kept: for transports that keep any.
    fn bulk(&self, _reference: BulkRef) -> Option<&[u8]> {
        None
    }

    /// A client can read the bulk values of another, or the broker those of a client, if both are the same.
    fn attach(&mut self, _receiver: ClientId, _publisher: ClientId) {}

    /// Whoever waits for somebody to read a bulk value waits for the successor.
    fn follow(&mut self, _succession: &Succession) {}
}

/// A broker, and the hand-overs under way.
pub struct Host {
    /// The broker: who uses it directly takes nothing in and lets nobody come or go.
    pub broker: Broker,
    handovers: Vec<Handover>,
    /// What is to be kept, until it is.
    sessions_changed: bool,
    retained_changed: bool,
}

/// A hand-over on its way: from the moment that its holder was asked to retire.
#[derive(Debug)]
struct Handover {
    holder: ClientId,
    name: String,
    /// When the holder was asked to retire, or had handled its last message, if that was later (ns, monotonic).
    stopped_at: u64,
    /// The holder is gone.
    vacant: bool,
}

/// What has become of a hand-over.
enum HandoverState {
    /// The successor has begun, then (ns, monotonic).
    Done(u64),
    /// Its end is still to come.
    Pending,
    /// Nobody has the name, or will have it: it was not handed over.
    Void,
}

impl Host {
    /// A community without clients or variables, started at `now` (s).
    pub fn new(config: BrokerConfig, now: f64) -> Self {
        Self::of(Broker::new(config, now))
    }

    /// Takes over from a broker that died: with the sessions of its clients, each with whether that one lives and will
    /// return, and what those had left who were gone.
    pub fn recover(
        config: BrokerConfig,
        now: f64,
        sessions: impl IntoIterator<Item = (Session, bool)>,
        retained: &[Retained],
    ) -> Self {
        let mut broker = Broker::recover(config, now, sessions, SESSIONS_KEPT_SECS);
        broker.inherit(now, retained);
        Self::of(broker)
    }

    fn of(broker: Broker) -> Self {
        Self { broker, handovers: Vec::new(), sessions_changed: false, retained_changed: false }
    }

    /// Lets a client in, or says why not.
    ///
    /// # Errors
    /// See [`AdmissionError`].
    pub fn join(
        &mut self,
        now: f64,
        who: &Introduction<'_>,
        endpoints: &mut impl Endpoints,
    ) -> Result<ClientId, AdmissionError> {
        let id = self.broker.connect(now, who);
        self.heed(endpoints);
        id
    }

    /// Takes in a client's batch (see [`Broker::receive`]).
    ///
    /// # Errors
    /// The batch is damaged.
    #[inline]
    pub fn receive(
        &mut self,
        now: f64,
        from: ClientId,
        batch: &[u8],
        endpoints: &mut impl Endpoints,
    ) -> Result<(), WireError> {
        let taken = self.broker.receive(now, from, batch);
        self.heed(endpoints);
        taken
    }

    /// Takes one message of a client's in, whose parts need not lie in a batch.
    ///
    /// # Errors
    /// It cannot be.
    pub fn receive_message(
        &mut self,
        now: f64,
        from: ClientId,
        message: &Frame<'_>,
        endpoints: &mut impl Endpoints,
    ) -> Result<(), WireError> {
        let taken = self.broker.receive_message(now, from, message);
        self.heed(endpoints);
        taken
    }

    /// A client has gone; `goodbye`: in good order.
    pub fn leave(&mut self, now: f64, id: ClientId, progress: Progress, goodbye: bool, endpoints: &mut impl Endpoints) {
        for handover in self.handovers.iter_mut().filter(|handover| handover.holder == id) {
            handover.vacant = true;
            handover.stopped_at = handover.stopped_at.max(progress.last_handled_at);
        }
        self.broker.disconnect(now, id, progress.handled, goodbye);
        self.heed(endpoints);
    }

    /// What the broker wants done at once.
    #[inline]
    fn heed(&mut self, endpoints: &mut impl Endpoints) {
        while let Some(action) = self.broker.poll() {
            match action {
                Action::Resolve(id) => self.broker.resolve_mail(id, |reference| endpoints.bulk(reference)),
                Action::Follow(succession) => endpoints.follow(&succession),
                Action::Attach { receiver, publisher } => endpoints.attach(receiver, publisher),
                Action::Retire(holder) => self.retire(holder, endpoints),
                // Written once a round, however many have come and registered in it.
                Action::KeepSessions => self.sessions_changed = true,
                Action::KeepRetained => self.retained_changed = true,
            }
        }
    }

    fn retire(&mut self, holder: ClientId, endpoints: &mut impl Endpoints) {
        // Who has gone meanwhile need not be asked.
        let (Some(_), Some(name)) = (endpoints.progress(holder), self.broker.client_name(holder)) else { return };
        let (name, stopped_at) = (name.to_owned(), endpoints.monotonic_nanos());
        self.handovers.push(Handover { holder, name, stopped_at, vacant: false });
        endpoints.retire(holder);
    }

    /// What can wait until a round is over: says of hand-overs that they are done, and has kept what is to be kept.
    pub fn follow_up(&mut self, now: f64, endpoints: &mut impl Endpoints) {
        self.finish_handovers(now, endpoints);
        self.heed(endpoints);
        if std::mem::take(&mut self.sessions_changed) {
            endpoints.keep_sessions(self.broker.sessions());
        }
        if std::mem::take(&mut self.retained_changed) {
            endpoints.keep_retained(self.broker.retained(|reference| endpoints.bulk(reference)));
        }
    }

    /// Whether a name is being handed over.
    pub fn is_handing_over(&self) -> bool {
        !self.handovers.is_empty()
    }

    /// Says how long nobody handled the mail of a name that was handed over, once its successor has begun.
    fn finish_handovers(&mut self, now: f64, endpoints: &mut impl Endpoints) {
        for handover in std::mem::take(&mut self.handovers) {
            match self.state_of(&handover, endpoints) {
                HandoverState::Pending => self.handovers.push(handover),
                HandoverState::Void => {}
                HandoverState::Done(begun_at) => {
                    let gap_ms = begun_at.saturating_sub(handover.stopped_at) as f64 * 1e-6;
                    self.broker.publish_event(now, &format!("handover={} gap_ms={gap_ms:.3}", handover.name));
                }
            }
        }
    }

    fn state_of(&self, handover: &Handover, endpoints: &mut impl Endpoints) -> HandoverState {
        if !handover.vacant {
            return HandoverState::Pending;
        }
        let Some(successor) = self.broker.client_named(&handover.name).filter(|id| endpoints.progress(*id).is_some())
        else {
            return if self.broker.is_expected(&handover.name) { HandoverState::Pending } else { HandoverState::Void };
        };
        endpoints.watch(successor);
        match endpoints.progress(successor).map_or(0, |progress| progress.first_handled_at) {
            0 if self.broker.is_idle(successor) => HandoverState::Done(endpoints.monotonic_nanos()),
            0 => HandoverState::Pending,
            begun_at => HandoverState::Done(begun_at),
        }
    }
}

#[cfg(test)]
mod tests {
    use std::collections::BTreeMap;

    use super::*;
    use crate::wire::{self, FrameKind, Header};

    /// Endpoints that note what is asked of them.
    #[derive(Default)]
    struct Noted {
        progress: BTreeMap<ClientId, Progress>,
        retired: Vec<ClientId>,
        kept: Vec<Vec<String>>,
    }

    impl Endpoints for Noted {
        fn progress(&self, id: ClientId) -> Option<Progress> {
            self.progress.get(&id).copied()
        }
        fn retire(&mut self, id: ClientId) {
            self.retired.push(id);
        }
        fn monotonic_nanos(&self) -> u64 {
            5_000_000
        }
        fn keep_sessions(&mut self, sessions: Vec<(ClientId, Session)>) {
            self.kept.push(sessions.into_iter().map(|(_, session)| session.name).collect());
        }
        fn keep_retained(&mut self, _: Vec<Retained>) {}
    }

    fn join(host: &mut Host, endpoints: &mut Noted, who: &Introduction<'_>) -> ClientId {
        let id = host.join(0.0, who, endpoints).unwrap();
        endpoints.progress.insert(id, Progress::default());
        id
    }

    /// What the broker said last on `DB_EVENT`.
    fn last_event(host: &mut Host, watcher: ClientId) -> String {
        let mut batch = Vec::new();
        host.broker.take_mail(watcher, usize::MAX, &mut batch, |_, _| {});
        let events = wire::frames(&batch).flatten().filter(|frame| frame.header.kind == FrameKind::Notify);
        events.last().map(|frame| String::from_utf8_lossy(frame.value).into_owned()).unwrap_or_default()
    }

    #[test]
    fn a_holder_retires_for_its_successor_and_the_silence_between_them_is_said() {
        let (mut host, mut endpoints) = (Host::new(BrokerConfig::new("lab"), 0.0), Noted::default());
        let watcher = join(&mut host, &mut endpoints, &Introduction::new("watcher"));
        let mut batch = Vec::new();
        wire::put(&mut batch, &Header::new(FrameKind::Register), b"DB_EVENT", b"*");
        host.receive(0.0, watcher, &batch, &mut endpoints).unwrap();
        let holder = join(&mut host, &mut endpoints, &Introduction::new("Map"));
        let successor = Introduction { succeeds: true, ..Introduction::new("Map") };
        let successor = join(&mut host, &mut endpoints, &successor);
        batch.clear();
        wire::put(&mut batch, &Header::new(FrameKind::Register), b"DB_TIME", b"*");
        wire::put(&mut batch, &Header::new(FrameKind::Ready), &[], &[]);
        host.receive(0.0, successor, &batch, &mut endpoints).unwrap();
        assert_eq!((&*endpoints.retired, host.is_handing_over()), (&[holder][..], true));

        let handled = Progress { handled: 3, first_handled_at: 1, last_handled_at: 7_000_000 };
        host.leave(0.0, holder, handled, true, &mut endpoints);
        host.broker.tick(0.0);
        host.follow_up(0.0, &mut endpoints);
        assert!(host.is_handing_over(), "it has mail, and has not begun with it");
        endpoints
            .progress
            .insert(successor, Progress { handled: 1, first_handled_at: 9_500_000, last_handled_at: 9_500_000 });
        host.follow_up(0.0, &mut endpoints);
        assert_eq!(last_event(&mut host, watcher), "handover=Map gap_ms=2.500");
        assert!(!host.is_handing_over());
        assert_eq!(endpoints.kept, [["Map", "watcher"]], "once a round, and not again while nothing has changed");
    }
}
