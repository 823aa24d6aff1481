//! What a client says: publishes, registers.

use std::collections::BTreeMap;
use std::io::Write;

use crate::ClockSetting;
use crate::clock::{Clock, monotonic_nanos};
use crate::codec::{self, EncodeError};
use crate::community::Community;
use crate::complaints::Complaints;
use crate::drawing_state::DrawingState;
use crate::key::{Key, Payload};
use crate::link::{Downlink, Fill, Link, LinkError, Rejoin, Uplink};
use crate::mail::Mail;
use crate::numbering::Numbering;
use crate::outbox::{BATCH_BYTES, Outbox};
use crate::pattern;
use crate::subscription::{Carries, Subscribe, Terms};
use crate::types::TypeRef;
use crate::value::{Value, ValueRef};
use crate::wire::{self, BULK, FrameKind, Header, LOSSLESS, Named, RESENT, TYPED, ValueKind};

/// Values of at least this many bytes are written once into shared memory and read in place.
pub const BULK_MIN_BYTES: usize = 16 << 10;

/// Why the bus could not do what it was asked to.
#[derive(Debug, thiserror::Error)]
pub enum CommsError {
    /// The transport failed.
    #[error(transparent)]
    Link(#[from] LinkError),
    /// The value cannot be encoded.
    #[error("{key}: {source}")]
    Encode {
        /// The variable.
        key: String,
        /// Why.
        source: EncodeError,
    },
    /// A name, or a pattern, is too long.
    #[error("{0:?}… is a name of {1} bytes; at most {max} are allowed", max = wire::MAX_NAME)]
    Name(String, usize),
    /// The value is too long.
    #[error(
        "{key}: a value of {len} bytes; at most {max} are allowed: publish it in parts, or where it lies",
        max = codec::MAX_VALUE_BYTES
    )]
    Value {
        /// The variable.
        key: String,
        /// Bytes of the value.
        len: usize,
    },
}

/// Sees that names or patterns are short enough.
fn short<'a>(names: impl IntoIterator<Item = &'a str>) -> Result<(), CommsError> {
    match names.into_iter().find(|name| name.len() > wire::MAX_NAME) {
        None => Ok(()),
        Some(name) => Err(CommsError::Name(name.chars().take(40).collect(), name.len())),
    }
}

/// What the community's clock is set to by whoever drives it (see [`Comms::drive_clock`]).
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Drive {
    /// What it shows now (s).
    pub time_secs: f64,
    /// How many times as fast as by itself it runs from now on; 0: it stands still.
    pub rate: f64,
}

impl Drive {
    /// A clock that stands still at this time (s).
    pub fn standing_at(time_secs: f64) -> Self {
        Self { time_secs, rate: 0.0 }
    }
}

/// Where a message comes from, if it is not simply this client's own: for gateways and replay.
#[derive(Debug, Clone, Copy, Default)]
pub struct Origin<'a> {
    /// Who said it; `None`: this client.
    pub source: Option<&'a str>,
    /// A word about the source (MOOS' source aux).
    pub source_aux: &'a str,
    /// When it was said (s, the community's clock); `None`: now.
    pub time: Option<f64>,
}

/// What a client says: publishes, registers. Messages gather in a batch that leaves at [`Comms::flush`], when it is
/// full, or, in an app, at the end of each callback.
pub struct Comms {
    name: String,
    community: Community,
    clock: Clock,
    /// This client drives the community's clock.
    driving: bool,
    up: Box<dyn Uplink>,
    back: Box<dyn Rejoin>,
    /// The way down of a link that was joined after the broker had died, until the inbox takes it.
    new_down: Option<Box<dyn Downlink>>,
    batch: Vec<u8>,
    outbox: Outbox,
    /// By the patterns of key and source.
    registrations: BTreeMap<(String, String), Asked>,
    registered: u64,
    /// Between the start of an app and its first mail.
    starting: bool,
    /// The broker was told that mail may flow.
    ready: bool,
    scratch: Vec<u8>,
    keys: Numbering,
    sources: Numbering,
    types: Numbering,
    sequence: u64,
    /// What the inbox has counted (see [`Comms::dropped`]).
    dropped: u64,
    /// What this client's app has rejected, and what of its own the broker has refused.
    pub(crate) rejections: Complaints,
    pub(crate) refusals: Complaints,
    /// What it draws, and which keys it takes.
    pub(crate) drawing: DrawingState,
    stopping: bool,
    epoch: u64,
}

/// A registration.
struct Asked {
    /// The client has made it for what it does of itself; its app is not given what comes of it.
    for_itself: bool,
    /// Its number in the order in which they were made.
    number: u64,
    interval_secs: f64,
    flags: u16,
    expects: Expects,
}

/// What a registration says that its client reads.
#[derive(Clone, Copy)]
enum Expects {
    Anything,
    Numbers,
    Texts,
    /// Values of the type with this number.
    Values(u32),
}

impl Comms {
    /// The saying end of a client called `name`, over a transport's link, and the link's way down.
    pub(crate) fn new(name: &str, community: &Community, link: Link) -> (Self, Box<dyn Downlink>) {
        let comms = Self {
            name: name.into(),
            community: community.clone(),
            clock: Clock::new(link.warp).driven(link.clock_setting),
            driving: false,
            up: link.up,
            back: link.back,
            new_down: None,
            batch: Vec::new(),
            outbox: Outbox::default(),
            registrations: BTreeMap::new(),
            registered: 0,
            starting: false,
            ready: false,
            scratch: Vec::new(),
            keys: Numbering::new(Named::Key, 0),
            // On the way up, source 0 is the client itself.
            sources: Numbering::new(Named::Source, 1),
            types: Numbering::new(Named::Type, 0),
            sequence: wire::first_sequence(monotonic_nanos() / 1_000_000),
            dropped: 0,
            rejections: Complaints::default(),
            refusals: Complaints::default(),
            drawing: DrawingState::default(),
            stopping: false,
            epoch: link.epoch,
        };
        (comms, link.down)
    }

    /// The name that the broker knows this client by.
    pub fn name(&self) -> &str {
        &self.name
    }

    /// The community's name.
    pub fn community(&self) -> &str {
        self.community.as_str()
    }

    /// The community's clock.
    pub fn clock(&self) -> Clock {
        self.clock
    }

    /// The community's time (s).
    pub fn time(&self) -> f64 {
        self.clock.now()
    }

    /// Drives the community's clock. It is left to itself again when this client goes, or says so. While another client
    /// drives it the broker refuses that (see [`crate::Inbox::take_refusals`]), under the name [`crate::broker::CLOCK`].
    pub fn drive_clock(&mut self, Drive { time_secs, rate }: Drive) -> Result<(), CommsError> {
        self.clock_is_driven(Some(ClockSetting { at: self.clock.own(), time: time_secs, rate }))
    }

    /// Leaves the community's clock, which this client drives, to itself.
    pub fn let_go_of_clock(&mut self) -> Result<(), CommsError> {
        if self.driving { self.clock_is_driven(None) } else { Ok(()) }
    }

    fn clock_is_driven(&mut self, setting: Option<ClockSetting>) -> Result<(), CommsError> {
        self.driving = setting.is_some();
        self.clock = self.clock.driven(setting);
        wire::put_clock(&mut self.batch, setting);
        self.flush_if_full()
    }

    /// Another client has set the community's clock, or left it to itself.
    pub(crate) fn clock_was_set(&mut self, setting: Option<ClockSetting>) {
        // What was said before the broker knew that this one drives is not news.
        if !self.driving {
            self.clock = self.clock.driven(setting);
        }
    }

    /// The broker lets another client drive the clock.
    pub(crate) fn clock_was_refused(&mut self) {
        self.driving = false;
    }

    /// Tells one life of the broker from the next.
    pub fn epoch(&self) -> u64 {
        self.epoch
    }

    /// Messages that this client will never see, because it did not read in time: those before the message that it is
    /// just given.
    pub fn dropped(&self) -> u64 {
        self.dropped
    }

    pub(crate) fn note_dropped(&mut self, dropped: u64) {
        self.dropped = dropped;
    }

    /// Asks the app's run loop to end after this callback.
    pub fn stop(&mut self) {
        self.stopping = true;
    }

    /// Whether [`Comms::stop`] was called.
    pub fn stopping(&self) -> bool {
        self.stopping
    }

    /// Registers: the latest values come at once, then all new ones. What is registered for with the same patterns again is
    /// put in the place of what was. What this client reads there is said with it, if it is known: whoever writes something
    /// else is told so, and so is this client ([`crate::Inbox::take_refusals`]).
    pub fn register(&mut self, what: impl Subscribe) -> Result<(), CommsError> {
        self.register_for(&what.subscription().terms)
    }

    pub(crate) fn register_for(&mut self, terms: &Terms) -> Result<(), CommsError> {
        self.ask(terms, false)
    }

    /// Registers for what the client does of itself: its app is not given what comes of it.
    pub(crate) fn register_for_itself(&mut self, what: impl Subscribe) -> Result<(), CommsError> {
        self.ask(&what.subscription().terms, true)
    }

    /// Whether the app has registered for a message.
    pub(crate) fn is_registered_for(&self, mail: &Mail<'_>) -> bool {
        let fits = |(keys, sources): &(String, String)| {
            pattern::matches(keys, mail.key()) && pattern::matches(sources, mail.source())
        };
        self.registrations.iter().any(|(patterns, asked)| !asked.for_itself && fits(patterns))
    }

    /// The variables that it has published so far.
    pub(crate) fn published(&self) -> impl Iterator<Item = &str> {
        self.keys.names()
    }

    /// The variables and patterns that the app has registered for.
    pub(crate) fn registered(&self) -> impl Iterator<Item = &str> {
        let of_app = self.registrations.iter().filter(|(_, asked)| !asked.for_itself);
        of_app.map(|((keys, _), _)| keys.as_str())
    }

    fn ask(&mut self, terms: &Terms, for_itself: bool) -> Result<(), CommsError> {
        short([terms.keys.as_str(), &terms.sources])?;
        let expects = match terms.carries {
            Carries::Anything => Expects::Anything,
            Carries::Numbers => Expects::Numbers,
            Carries::Texts => Expects::Texts,
            Carries::Values(type_) => {
                short([type_.name()])?;
                Expects::Values(self.type_number(type_))
            }
        };
        self.registered += 1;
        let flags = if terms.lossless { LOSSLESS } else { 0 };
        let asked =
            Asked { for_itself, number: self.registered, interval_secs: terms.interval.as_secs_f64(), flags, expects };
        let header = asked.header(FrameKind::Register);
        self.registrations.insert((terms.keys.clone(), terms.sources.clone()), asked);
        self.say_registration(&header, terms)
    }

    /// Takes back the registration that was made for these variables and sources.
    pub fn unregister(&mut self, what: impl Subscribe) -> Result<(), CommsError> {
        self.unregister_from(&what.subscription().terms)
    }

    pub(crate) fn unregister_from(&mut self, terms: &Terms) -> Result<(), CommsError> {
        short([terms.keys.as_str(), &terms.sources])?;
        self.registrations.remove(&(terms.keys.clone(), terms.sources.clone()));
        self.say_registration(&Header::new(FrameKind::Unregister), terms)
    }

    fn say_registration(&mut self, header: &Header, terms: &Terms) -> Result<(), CommsError> {
        wire::put(&mut self.batch, header, terms.keys.as_bytes(), terms.sources.as_bytes());
        self.flush_if_full()
    }

    /// Whether the client is about to say what has to be said before its mail may flow: until it has, a client that
    /// comes as a successor does not have the session.
    pub(crate) fn set_starting(&mut self, starting: bool) {
        self.starting = starting;
    }

    fn say_ready(&mut self) {
        if !self.starting && !std::mem::replace(&mut self.ready, true) {
            wire::put(&mut self.batch, &Header::new(FrameKind::Ready), &[], &[]);
        }
    }

    /// Says goodbye: whoever leaves without a word is thought to have died, and its session may be kept.
    pub(crate) fn say_goodbye(&mut self) -> Result<(), CommsError> {
        self.flush()?;
        self.up.say_goodbye();
        Ok(())
    }

    /// The way down of a new link, if there is one.
    pub(crate) fn take_new_down(&mut self) -> Option<Box<dyn Downlink>> {
        self.new_down.take()
    }

    /// Joins the community again after its broker died: waits for the next one, with limited patience, registers, and
    /// says again what not everybody had heard.
    pub(crate) fn rejoin(&mut self) -> Result<(), CommsError> {
        loop {
            let link = self.back.rejoin()?;
            let dead = std::mem::replace(&mut self.up, link.up);
            self.outbox.recall(&*dead);
            self.back = link.back;
            // A broker that knows of nobody who drives the clock may yet be told; till then it runs on as it was set.
            self.clock = Clock::new(link.warp).driven(link.clock_setting.or(self.clock.setting()));
            self.epoch = link.epoch;
            self.new_down = Some(link.down);
            self.ready = true;
            let introduction = self.introduction();
            let said = self.up.send(&introduction).and_then(|()| {
                // The introduction is a batch like any other in the broker's count.
                self.outbox.keep(introduction, false);
                self.outbox.say_again(&mut *self.up)?;
                let mut all_is_said = Vec::new();
                wire::put(&mut all_is_said, &Header::new(FrameKind::Ready), &[], &[]);
                self.up.send(&all_is_said).map(|()| drop(self.outbox.keep(all_is_said, false)))
            });
            match said {
                Err(LinkError::BrokerDied(_)) => {}
                other => return Ok(other?),
            }
        }
    }

    /// All names and registrations, for a broker that knows none of them.
    fn introduction(&self) -> Vec<u8> {
        let mut batch = Vec::new();
        for names in [&self.keys, &self.sources, &self.types] {
            names.introduce_all(&mut batch);
        }
        let mut registrations: Vec<_> = self.registrations.iter().collect();
        registrations.sort_by_key(|(_, asked)| asked.number);
        for ((key_pattern, source_pattern), asked) in registrations {
            let header = asked.header(FrameKind::Register);
            let header = Header { flags: header.flags | RESENT, ..header };
            wire::put(&mut batch, &header, key_pattern.as_bytes(), source_pattern.as_bytes());
        }
        if self.driving {
            wire::put_clock(&mut batch, self.clock.setting());
        }
        wire::put(&mut batch, &Header::new(FrameKind::Ready), &[], &[]);
        batch
    }

    /// Does something on the way up; should the broker have died, joins the next one and does it there.
    fn on_link<T>(&mut self, mut act: impl FnMut(&mut Self) -> Result<T, LinkError>) -> Result<T, CommsError> {
        loop {
            match act(self) {
                Err(LinkError::BrokerDied(_)) => self.rejoin()?,
                other => return Ok(other?),
            }
        }
    }

    /// Publishes a typed value. A bulky one is encoded straight into shared memory, where its readers read it.
    pub fn publish<T: Payload>(&mut self, key: &Key<T>, value: &T::View<'_>) -> Result<(), CommsError> {
        self.publish_from(key, value, Origin::default())
    }

    /// As [`Comms::publish`], with a word about the source, or in the name of another one.
    pub fn publish_from<T: Payload>(
        &mut self,
        key: &Key<T>,
        value: &T::View<'_>,
        origin: Origin<'_>,
    ) -> Result<(), CommsError> {
        short([key.name(), T::NAME, origin.source.unwrap_or_default(), origin.source_aux])?;
        let bad = |source| CommsError::Encode { key: key.name().into(), source };
        let len = codec::encoded_len(value).map_err(bad)?;
        if len >= BULK_MIN_BYTES {
            let fill =
                &mut |writer: &mut dyn Write| codec::encode_to_writer(value, writer).map_err(std::io::Error::other);
            let type_ = Some(TypeRef::of::<T>());
            if self.bulk(key.name(), (ValueKind::Binary, type_), &origin, len, fill)? {
                return Ok(());
            }
        }
        self.scratch.clear();
        codec::encode_onto(value, &mut self.scratch).map_err(bad)?;
        let bytes = std::mem::take(&mut self.scratch);
        let value = ValueRef::Binary { type_: TypeRef::of::<T>(), bytes: &bytes };
        let done = self.message(key.name(), &value, &origin);
        self.scratch = bytes;
        done
    }

    /// Publishes a number or a text.
    pub fn notify(&mut self, key: &str, value: impl Into<Value>) -> Result<(), CommsError> {
        self.publish_value(key, value.into().as_ref(), Origin::default())
    }

    /// Publishes a value of any kind, and, for gateways and replay, in the name of another source.
    pub fn publish_value(&mut self, key: &str, value: ValueRef<'_>, origin: Origin<'_>) -> Result<(), CommsError> {
        let type_name = if let ValueRef::Binary { type_, .. } = value { type_.name() } else { "" };
        short([key, type_name, origin.source.unwrap_or_default(), origin.source_aux])?;
        let bulky = match value {
            ValueRef::Binary { type_, bytes } => Some((ValueKind::Binary, Some(type_), bytes)),
            ValueRef::Text(text) => Some((ValueKind::Text, None, text.as_bytes())),
            ValueRef::Double(_) => None,
        };
        if let Some((kind, type_, bytes)) = bulky.filter(|(.., bytes)| bytes.len() >= BULK_MIN_BYTES)
            && self.bulk(key, (kind, type_), &origin, bytes.len(), &mut |w| w.write_all(bytes))?
        {
            return Ok(());
        }
        self.message(key, &value, &origin)
    }

    /// Sends what has gathered.
    pub fn flush(&mut self) -> Result<(), CommsError> {
        self.say_ready();
        self.send_gathered()
    }

    fn send_gathered(&mut self) -> Result<(), CommsError> {
        if !self.batch.is_empty() {
            self.on_link(|comms| comms.up.send(&comms.batch))?;
            self.batch_is_sent(false);
        }
        Ok(())
    }

    /// Batches that were sent and that not everybody whom they reached has handled, as far as the broker has said so: it
    /// says so whenever it is sent something.
    pub fn unhandled_batches(&self) -> u64 {
        self.outbox.unhandled(&*self.up)
    }

    /// Whether what was said can leave without waiting. If not, the client's descriptor (see [`crate::Client::wake_fd`]) is
    /// readable once it can.
    #[cfg(feature = "tokio")]
    pub(crate) fn has_room(&self) -> bool {
        self.up.has_room()
    }

    fn batch_is_sent(&mut self, bulk: bool) {
        let sent = std::mem::take(&mut self.batch);
        self.batch = self.outbox.keep(sent, bulk);
        self.outbox.trim(&mut *self.up);
    }

    fn flush_if_full(&mut self) -> Result<(), CommsError> {
        if self.batch.len() >= BATCH_BYTES { self.flush() } else { Ok(()) }
    }

    fn bulk(
        &mut self,
        key: &str,
        (kind, type_): (ValueKind, Option<TypeRef<'_>>),
        origin: &Origin<'_>,
        len: usize,
        fill: &mut Fill<'_>,
    ) -> Result<bool, CommsError> {
        if len > codec::MAX_VALUE_BYTES {
            return Err(CommsError::Value { key: key.to_owned(), len });
        }
        // What readers have to acknowledge before there is room must have left first.
        self.flush()?;
        loop {
            let Some(reference) = self.on_link(|comms| comms.up.send_bulk(len, fill))? else {
                return Ok(false);
            };
            let header = Header { flags: BULK, ..self.header(key, kind, type_, origin) };
            wire::put(&mut self.batch, &header, origin.source_aux.as_bytes(), &reference.to_bytes());
            match self.up.send(&self.batch) {
                // The value died with the broker before anybody knew of it: it is written anew.
                Err(LinkError::BrokerDied(_)) => self.batch.clear(),
                sent => {
                    sent?;
                    self.batch_is_sent(true);
                    return Ok(true);
                }
            }
            self.rejoin()?;
        }
    }

    fn message(&mut self, key: &str, value: &ValueRef<'_>, origin: &Origin<'_>) -> Result<(), CommsError> {
        let aux = origin.source_aux.as_bytes();
        match *value {
            ValueRef::Double(number) => {
                let header = self.header(key, ValueKind::Double, None, origin);
                wire::put(&mut self.batch, &header, aux, &number.to_le_bytes());
            }
            ValueRef::Text(text) => {
                let header = self.header(key, ValueKind::Text, None, origin);
                wire::put(&mut self.batch, &header, aux, text.as_bytes());
            }
            ValueRef::Binary { type_, bytes } => {
                let header = self.header(key, ValueKind::Binary, Some(type_), origin);
                wire::put(&mut self.batch, &header, aux, bytes);
            }
        }
        self.flush_if_full()
    }

    fn header(&mut self, key: &str, kind: ValueKind, type_: Option<TypeRef<'_>>, origin: &Origin<'_>) -> Header {
        self.sequence += 1;
        let key = self.keys.number(&mut self.batch, key);
        self.outbox.note(key, self.sequence);
        Header {
            value_kind: kind,
            key,
            source: origin.source.map_or(0, |name| self.sources.number(&mut self.batch, name)),
            type_: type_.map_or(0, |type_| self.type_number(type_)),
            sequence: self.sequence,
            time: origin.time.unwrap_or_else(|| self.clock.now()),
            ..Header::new(FrameKind::Notify)
        }
    }

    fn type_number(&mut self, type_: TypeRef<'_>) -> u32 {
        self.types.number_of(&mut self.batch, (type_.name(), type_.layout()), || type_.text())
    }

    /// Tells the broker that the bulk service of client `publisher` is open here.
    pub(crate) fn attached(&mut self, publisher: u32) {
        let header = Header { source: publisher, ..Header::new(FrameKind::Attached) };
        wire::put(&mut self.batch, &header, &[], &[]);
    }
}

impl Drop for Comms {
    fn drop(&mut self) {
        // Nobody is left to tell of a failure; who needs to know flushes first. And who leaves is not ready for more.
        let _ = self.send_gathered();
    }
}

impl Asked {
    fn header(&self, kind: FrameKind) -> Header {
        let header = Header { flags: self.flags, time: self.interval_secs, ..Header::new(kind) };
        let (value_kind, type_) = match self.expects {
            Expects::Anything => return header,
            Expects::Numbers => (ValueKind::Double, 0),
            Expects::Texts => (ValueKind::Text, 0),
            Expects::Values(type_) => (ValueKind::Binary, type_),
        };
        Header { flags: self.flags | TYPED, value_kind, type_, ..header }
    }
}
