//! What a client hears.

use std::collections::VecDeque;
use std::os::fd::{AsFd, BorrowedFd};
use std::sync::Arc;
use std::time::Duration;

use elk_proto::names::{Names, Unreadable};
use elk_proto::seen::Seen;

use crate::broker::CLOCK;
use crate::clock::Stopwatch;
use crate::comms::{Comms, CommsError};
use crate::event_loop::EventFd;
use crate::link::{Downlink, LinkError};
use crate::mail::Mail;
use crate::wire::{self, Frame, FrameKind, RESENT};

/// What a client hears.
pub struct Inbox {
    down: Box<dyn Downlink>,
    names: Names,
    seen: Seen,
    /// Messages of the present broker that this client has done with.
    handled: u64,
    /// Messages dropped in the broker because this client did not read.
    dropped: u64,
    /// Bulk values that were overwritten before this client came to read them.
    missed_bulk: u64,
    /// Both, of the brokers before this one.
    dropped_before: u64,
    refusals: VecDeque<Refused>,
    /// For a client that lives in somebody's event loop.
    wake: Option<Arc<EventFd>>,
}

/// A message, a registration or a name of this client that the broker did not take.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Refused {
    /// The variable.
    pub key: String,
    /// The message's number (see [`Mail::sequence`]); `None`: it is no message, but a registration or a name.
    pub sequence: Option<u64>,
    /// Why.
    pub reason: String,
}

/// Refusals that are kept for who asks for them; of more the oldest go.
const MOST_REFUSALS: usize = 1000;

impl Inbox {
    /// The hearing end of a client, over a transport's way down; `names` is what numbers stand for to it.
    pub(crate) fn new(down: Box<dyn Downlink>, names: Names) -> Self {
        Self {
            down,
            names,
            seen: Seen::default(),
            handled: 0,
            dropped: 0,
            dropped_before: 0,
            missed_bulk: 0,
            refusals: VecDeque::new(),
            wake: None,
        }
    }

    /// Waits at most `timeout` for mail and hands all that has come to `on_mail`, in order; answers how many messages
    /// that were. What `on_mail` fails with ends the batch, and so does a successor that is ready (see
    /// [`Inbox::retiring`]).
    ///
    /// Should the broker have died, what it had still delivered is handed out first; then the next broker is joined.
    pub fn receive<E: From<CommsError>>(
        &mut self,
        comms: &mut Comms,
        timeout: Duration,
        on_mail: impl FnMut(&mut Comms, &Mail<'_>) -> Result<(), E>,
    ) -> Result<usize, E> {
        comms.flush()?;
        self.receive_alone(comms, timeout, on_mail)
    }

    /// As [`Inbox::receive`], without seeing to it that what was said has left.
    pub(crate) fn receive_alone<E: From<CommsError>>(
        &mut self,
        comms: &mut Comms,
        timeout: Duration,
        mut on_mail: impl FnMut(&mut Comms, &Mail<'_>) -> Result<(), E>,
    ) -> Result<usize, E> {
        let waited = Stopwatch::start();
        loop {
            match self.down.receive(timeout.saturating_sub(waited.elapsed())) {
                Ok(None) => return Ok(0),
                Ok(Some(batch)) => return self.hand_out(comms, &batch, &mut on_mail),
                Err(LinkError::BrokerDied(_)) => self.change_over(comms)?,
                Err(error) => return Err(CommsError::from(error).into()),
            }
        }
    }

    /// Goes on with the next broker.
    fn change_over(&mut self, comms: &mut Comms) -> Result<(), CommsError> {
        let down = match comms.take_new_down() {
            Some(down) => down,
            None => {
                comms.rejoin()?;
                comms.take_new_down().ok_or_else(|| LinkError::BrokerGone(comms.community().to_owned()))?
            }
        };
        self.down = down;
        if let Some(wake) = &self.wake {
            self.down.wake_by(wake.clone()).map_err(|error| LinkError::NoThread(error.to_string()))?;
        }
        let names = self.names.begin_anew();
        self.seen.renumber(|key, source| names.of(key, source));
        self.handled = 0;
        self.dropped_before = self.dropped();
        (self.dropped, self.missed_bulk) = (0, 0);
        Ok(())
    }

    /// Has a task woken when the descriptor of [`Inbox::wake_fd`] is set next.
    #[cfg(feature = "tokio")]
    pub(crate) fn wake_task(&self, task: &std::task::Waker) {
        self.wake.iter().for_each(|wake| wake.wake_task(task));
    }

    /// Wakes that task, since there is room: who looks for room takes back the word that somebody waits for it.
    #[cfg(feature = "tokio")]
    pub(crate) fn wake_waiting_task(&self) {
        self.wake.iter().for_each(|wake| wake.wake_waiting());
    }

    /// See [`crate::Client::wake_fd`].
    pub(crate) fn wake_fd(&mut self) -> std::io::Result<BorrowedFd<'_>> {
        let wake = match self.wake.take() {
            Some(wake) => wake,
            None => {
                let wake = EventFd::new()?;
                self.down.wake_by(wake.clone())?;
                wake
            }
        };
        let wake: &EventFd = self.wake.insert(wake);
        Ok(wake.as_fd())
    }

    fn hand_out<E: From<CommsError>>(
        &mut self,
        comms: &mut Comms,
        batch: &[u8],
        on_mail: &mut impl FnMut(&mut Comms, &Mail<'_>) -> Result<(), E>,
    ) -> Result<usize, E> {
        let mut messages = 0;
        let mut outcome = Ok(());
        // The broker and the transport are trusted to frame rightly; a damaged rest is left unread.
        let mut frames = wire::frames(batch);
        while let Some(Ok(frame)) = frames.next() {
            match frame.header.kind {
                FrameKind::Define => self.names.define(&frame),
                FrameKind::Dropped => {
                    self.dropped = frame.header.sequence;
                    comms.note_dropped(self.dropped());
                }
                FrameKind::Refused => self.note_refusal(comms, &frame),
                FrameKind::Notify => {
                    if self.down.retiring() {
                        break;
                    }
                    // After a failure the rest is passed over, but it counts: nobody is to wait for it.
                    if outcome.is_ok() {
                        outcome = self.hand_over(comms, &frame, on_mail);
                    }
                    self.handled += 1;
                    self.down.note_handled(self.handled);
                    messages += 1;
                }
                // What the broker sends is sound.
                FrameKind::Clock => {
                    wire::clock_setting(&frame).into_iter().for_each(|setting| comms.clock_was_set(setting))
                }
                FrameKind::Register | FrameKind::Unregister | FrameKind::Attached | FrameKind::Ready => {}
            }
        }
        outcome.map(|()| messages)
    }

    fn note_refusal(&mut self, comms: &mut Comms, frame: &Frame<'_>) {
        let [key, reason] = [frame.aux, frame.value].map(|text| String::from_utf8_lossy(text).into_owned());
        if key == CLOCK {
            comms.clock_was_refused();
        }
        if self.refusals.len() >= MOST_REFUSALS {
            self.refusals.pop_front();
        }
        let sequence = Some(wire::count(frame.header.sequence)).filter(|sequence| *sequence != 0);
        self.refusals.push_back(Refused { key, sequence, reason });
    }

    fn hand_over<E: From<CommsError>>(
        &mut self,
        comms: &mut Comms,
        frame: &Frame<'_>,
        on_mail: &mut impl FnMut(&mut Comms, &Mail<'_>) -> Result<(), E>,
    ) -> Result<(), E> {
        self.attach_if_told(comms, frame);
        if frame.header.flags & RESENT != 0 && self.was_heard(frame) {
            return Ok(());
        }
        // A publisher that has found the next broker already may have taken its shared memory along; it will say again
        // what was in there.
        let will_be_said_again = !self.down.open();
        match self.names.mail(&mut *self.down, frame) {
            Ok(mail) => {
                self.seen.note(&frame.header, mail.key(), mail.source());
                match comms.note_word(&mail)? {
                    true => on_mail(comms, &mail),
                    false => Ok(()),
                }
            }
            Err(Unreadable::Damaged(why)) => {
                let (key, source) = self.names.of(frame.header.key, frame.header.source).unwrap_or(("?", "?"));
                Ok(comms.reject(key, source, wire::count(frame.header.sequence), &why)?)
            }
            Err(Unreadable::Gone) => {
                self.missed_bulk += u64::from(!will_be_said_again);
                self.down.note_missed(self.missed_bulk);
                comms.note_dropped(self.dropped());
                Ok(())
            }
        }
    }

    fn was_heard(&self, frame: &Frame<'_>) -> bool {
        let names = self.names.of(frame.header.key, frame.header.source);
        names.is_some_and(|(key, source)| self.seen.knows(&frame.header, key, source))
    }

    fn attach_if_told(&mut self, comms: &mut Comms, frame: &Frame<'_>) {
        if let Some(publisher) = wire::publisher_to_attach(frame)
            && self.down.attach(publisher)
        {
            comms.attached(publisher);
        }
    }

    /// Messages that this client will never see, because it did not read in time.
    pub fn dropped(&self) -> u64 {
        self.dropped_before.saturating_add(self.dropped).saturating_add(self.missed_bulk)
    }

    /// Whether this client is to leave, because its successor is ready: it gets no more mail, its successor does.
    pub fn retiring(&self) -> bool {
        self.down.retiring()
    }

    /// What the broker refused of this client's messages since the last call.
    pub fn take_refusals(&mut self) -> Vec<Refused> {
        std::mem::take(&mut self.refusals).into()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::ValueRef;
    use crate::broker::BrokerConfig;
    use crate::clock::Clock;
    use crate::community::Community;
    use crate::link::{Batch, Link};
    use crate::memory::MemoryBroker;
    use crate::wire::{BulkRef, Header, Named, ValueKind};

    /// The far end of a client whose broker says this one batch.
    struct Said(Option<Vec<u8>>);

    impl Downlink for Said {
        fn receive(&mut self, _: Duration) -> Result<Option<Batch>, LinkError> {
            Ok(self.0.take().map(|bytes| Batch(Box::new(bytes))))
        }
        fn open(&self) -> bool {
            true
        }
        fn note_handled(&mut self, _: u64) {}
        fn note_missed(&mut self, _: u64) {}
        fn retiring(&self) -> bool {
            false
        }
        fn bulk(&mut self, _: BulkRef) -> Option<&crate::link::Held> {
            None
        }
        fn attach(&mut self, _: u32) -> bool {
            false
        }
    }

    /// A message of these four numbers (see [`Named`]), as a broker could say it.
    fn put_message(batch: &mut Vec<u8>, [key, source, type_, community]: [u32; 4], value_kind: ValueKind) {
        let header = Header { key, source, type_, community, value_kind, ..Header::new(FrameKind::Notify) };
        wire::put(batch, &header, &[], &1.5_f64.to_le_bytes());
    }

    /// What a client makes of a batch: the names of each message that it hears, and how many it rejects.
    fn hear(batch: Vec<u8>) -> (Vec<[String; 4]>, u64) {
        let broker = MemoryBroker::new(BrokerConfig::new("lab"), Clock::new(1.0));
        let link = Link { down: Box::new(Said(Some(batch))), ..broker.connect("reader").unwrap() };
        let mut client = crate::Client::over(link, "reader", &Community::new("lab").unwrap());
        let mut heard = Vec::new();
        let names = |mail: &Mail<'_>| {
            let type_ = match mail.value() {
                ValueRef::Binary { type_, .. } => type_.name(),
                _ => "",
            };
            [mail.key(), mail.source(), type_, mail.community()].map(str::to_owned)
        };
        client.receive(Duration::ZERO, |mail| heard.push(names(mail))).unwrap();
        (heard, client.comms.rejected())
    }

    /// Regression: a message of variable 1,800,000,000, of which no name was said, made its reader ask for 43 GB.
    #[test]
    fn a_message_of_a_variable_without_a_name_is_of_no_use_and_costs_nothing() {
        let mut batch = Vec::new();
        wire::put_definition(&mut batch, Named::Key, 1_800_000_000, "FAR", 0, "");
        wire::put_definition(&mut batch, Named::Key, 3, "SPEED", 0, "");
        wire::put_definition(&mut batch, Named::Source, 0, "car", 0, "");
        wire::put_definition(&mut batch, Named::Community, 0, "lab", 0, "");
        for key in [u32::MAX, 1_800_000_000, 4, 3] {
            put_message(&mut batch, [key, 0, 0, 0], ValueKind::Double);
        }
        assert_eq!(hear(batch), (vec![["SPEED", "car", "", "lab"].map(str::to_owned)], 3));
    }

    proptest::proptest! {
        /// Regression: a number below the highest that was named passed for named, and its message for one of a variable
        /// without a name.
        #[test]
        fn what_is_heard_bears_the_names_that_were_said_and_all_else_is_rejected(
            said in proptest::collection::vec((0..4_usize, 0..6_u32), 0..12),
            messages in proptest::collection::vec((proptest::array::uniform4(0..8_u32), proptest::bool::ANY), 0..12),
        ) {
            let mut batch = Vec::new();
            let kinds = [Named::Key, Named::Source, Named::Type, Named::Community];
            for (kind, number) in &said {
                wire::put_definition(&mut batch, kinds[*kind], *number, &format!("{kind}/{number}"), 0, "");
            }
            let mut expected = Vec::new();
            for (numbers, is_typed) in &messages {
                put_message(&mut batch, *numbers, if *is_typed { ValueKind::Binary } else { ValueKind::Double });
                let counts = |kind: usize| kind != 2 || *is_typed;
                if (0..4).all(|kind| !counts(kind) || said.contains(&(kind, numbers[kind]))) {
                    let name = |kind: usize| if counts(kind) { format!("{kind}/{}", numbers[kind]) } else { String::new() };
                    expected.push([0, 1, 2, 3].map(name));
                }
            }
            let rejected = (messages.len() - expected.len()) as u64;
            proptest::prop_assert_eq!(hear(batch), (expected, rejected));
        }
    }
}
