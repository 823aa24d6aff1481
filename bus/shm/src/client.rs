//! A client's end of the shared-memory transport.

use std::cell::Cell;
use std::collections::BTreeMap;
use std::io::ErrorKind;
use std::ops::Deref;
use std::os::unix::net::UnixStream;
use std::rc::Rc;
use std::sync::Arc;
use std::sync::atomic::Ordering::{Acquire, Relaxed, Release, SeqCst};
use std::time::Duration;

use elk_os::clock::{Stopwatch, monotonic_nanos};
use elk_os::limits;
use elk_os::{Owner, tell};
use elk_proto::ClockSetting;
use elk_proto::broker::Introduction;
use elk_proto::community::Community;
use elk_proto::link::{Batch, Downlink, Fill, Held, Link, LinkError, REJOIN_PATIENCE, Rejoin, Uplink, Wake};
use elk_proto::wire::{self, BulkRef, FrameKind, Header};
use iceoryx2::node::Node;

use super::bulk::{self, BulkReader, BulkWriter};
use super::folder::FolderError;
use super::forward::Forward;
use super::handshake::{self, Answer, Hello};
use super::lane::{self, DEPTH, LaneReader, LaneSample, LaneWriter, Service};
use super::lifeline::Lifeline;
use super::namespace::Namespace;
use super::page::{BROKER_DIED, BrokerPage, ClientPage, OPEN, Page};
use super::scarce;

/// The longest that a client sleeps: its bell rings when there is news, also when the broker dies.
const LONGEST_SLEEP: Duration = Duration::from_secs(5);

/// How often it looks whether that is there.
const REJOIN_EVERY: Duration = Duration::from_millis(3);

/// A value of at most so many bytes travels in a batch if there is no chunk of shared memory for it.
const LONGEST_IN_BATCH: usize = wire::MAX_MESSAGE - wire::HEADER - wire::MAX_NAME - 8;
/// How often it is tried again to open a bulk service that could not be opened.
const REATTACH_EVERY: Duration = Duration::from_secs(5);

/// How long a client that leaves waits for the broker to take its last words.
const LINGER: Duration = Duration::from_secs(10);

/// Why a client could not join a community.
#[derive(Debug, thiserror::Error)]
pub enum ConnectError {
    /// Nobody serves the community.
    #[error("no broker serves community {0} here: start one with `elk db --community {0}` or `elk launch`")]
    NoBroker(Community),
    /// Another user has the community's name.
    #[error(
        "community {community} is not this user's: process {process} of user {user} has that name; choose another \
         --community, or join as that user"
    )]
    ForeignUser {
        /// The community.
        community: Community,
        /// The process that listens there.
        process: u32,
        /// The user's id.
        user: u32,
    },
    /// The broker refused.
    #[error("community {community}: {reason}")]
    Refused {
        /// The community.
        community: Community,
        /// The broker's reason.
        reason: String,
    },
    /// The broker did not answer as it should.
    #[error("the broker of community {community} does not answer: {source}")]
    Handshake {
        /// The community.
        community: Community,
        /// What the socket says.
        source: std::io::Error,
    },
    /// There is no thread to see the broker's end.
    #[error("community {community} cannot be joined: no thread for that: {source}{}", scarce::remedy(.source))]
    NoThread {
        /// The community.
        community: Community,
        /// Why.
        source: std::io::Error,
    },
    /// The community's folder is not safe, or not to be seen from here.
    #[error("community {community}: {source}")]
    Folder {
        /// The community.
        community: Community,
        /// What is wrong with it.
        source: FolderError,
    },
    /// Shared memory failed.
    #[error(transparent)]
    Link(#[from] LinkError),
}

/// Joins a community.
pub fn connect(community: &Community, who: &Introduction<'_>) -> Result<Link, ConnectError> {
    limits::raise_descriptors();
    limits::let_owner_in();
    let broken = |source| ConnectError::Handshake { community: community.clone(), source: handshake::failure(source) };
    let stream = handshake::connect(community).map_err(|error| match error.kind() {
        ErrorKind::WouldBlock => broken(error),
        _ => ConnectError::NoBroker(community.clone()),
    })?;
    let Owner { process, user } = Owner::at_other_end(&stream).map_err(broken)?;
    if user != elk_os::own_user() {
        return Err(ConnectError::ForeignUser { community: community.clone(), process, user });
    }
    let Introduction { name, build, lease_secs, succeeds, returns, .. } = *who;
    let (name, build) = (name.to_owned(), build.to_owned());
    let hello = Hello { protocol: handshake::PROTOCOL, name, build, lease_secs, succeeds, returns };
    handshake::send(&stream, &hello, &[]).map_err(broken)?;
    let (answer, files) = handshake::receive(&stream).map_err(broken)?;
    let (id, epoch, clock, folder) = match answer {
        Answer::Welcome { id, epoch, warp, clock_setting, folder } => (id, epoch, (warp, clock_setting), folder),
        Answer::Refused { reason } => {
            return Err(ConnectError::Refused { community: community.clone(), reason });
        }
    };
    let [broker_page, page]: [_; 2] =
        files.try_into().map_err(|_| broken(std::io::Error::other("it sent no shared pages")))?;
    let (broker, page) = (Page::open(broker_page).map_err(broken)?, Page::open(page).map_err(broken)?);
    let page = Arc::new(page);
    watch(&stream, &page).map_err(|source| ConnectError::NoThread { community: community.clone(), source })?;
    let unusable = |source| ConnectError::Folder { community: community.clone(), source };
    let namespace = Namespace::open(community, &folder).map_err(unusable)?;
    let node = lane::node(&namespace)?;
    namespace.close_folder().map_err(unusable)?;
    let community = community.clone();
    let back = ShmBack { community: community.clone(), name: hello.name, build: hello.build, lease_secs };
    let line = Rc::new(Line { community, id, epoch, broker, page, node, stream: Connection(Lifeline::new(stream)) });
    open_lanes(line, back, clock).map_err(ConnectError::from)
}

fn open_lanes(
    line: Rc<Line>,
    back: ShmBack,
    (warp, clock_setting): (f64, Option<ClockSetting>),
) -> Result<Link, LinkError> {
    let up = LaneWriter::open(&line.node, &lane_name(line.epoch, "up", line.id))?;
    let down = LaneReader::open(&line.node, &lane_name(line.epoch, "down", line.id))?;
    line.page.ready.store(1, Release);
    line.broker.bell.ring();
    let (epoch, build) = (line.epoch, back.build.clone());
    let up = Box::new(ShmUp { lane: up, bulk: None, bulk_failed: false, own_batch: None, line: line.clone() });
    let (taken, bulk, refused) = (Rc::new(Cell::new(0)), BTreeMap::new(), BTreeMap::new());
    let down = Box::new(ShmDown { lane: down, received: 0, taken, bulk, refused, forward: None, line });
    Ok(Link { up, down, back: Box::new(back), build, warp, clock_setting, epoch })
}

/// Nothing in shared memory tells of a process' death, the socket does: a thread waits for its end, and rings the
/// client's own bell then.
fn watch(stream: &UnixStream, page: &Arc<Page<ClientPage>>) -> std::io::Result<()> {
    let (stream, page) = (Lifeline::new(stream.try_clone()?), page.clone());
    stream.set_read_timeout(None)?;
    let wait = move || {
        handshake::wait_for_end(&stream);
        // Who was sent away knows better.
        let _ = page.closed.compare_exchange(OPEN, BROKER_DIED, SeqCst, SeqCst);
        page.bell.ring();
    };
    std::thread::Builder::new().name("watch".into()).stack_size(64 << 10).spawn(wait).map(|_| ())
}

/// The way to the next broker.
struct ShmBack {
    community: Community,
    name: String,
    build: String,
    lease_secs: f64,
}

impl Rejoin for ShmBack {
    fn rejoin(&mut self) -> Result<Link, LinkError> {
        let Self { community, name, build, lease_secs } = self;
        let who = Introduction { build, lease_secs: *lease_secs, ..Introduction::new(name).returning() };
        let waited = Stopwatch::start();
        loop {
            match connect(community, &who) {
                Ok(link) => return Ok(link),
                // Another user can have the name only for as long as no broker has it.
                Err(
                    ConnectError::NoBroker(_)
                    | ConnectError::ForeignUser { .. }
                    | ConnectError::Handshake { .. }
                    | ConnectError::Link(_),
                ) if waited.elapsed() < REJOIN_PATIENCE => {}
                Err(error) => {
                    tell(format_args!("{name}: the broker died, and there is no way back: {error}"));
                    return Err(LinkError::BrokerGone(community.to_string()));
                }
            }
            std::thread::sleep(REJOIN_EVERY);
        }
    }
}

/// The name of a client's service in the community.
pub fn lane_name(epoch: u64, what: &str, id: u32) -> String {
    format!("{epoch:x}/{what}/{id}")
}

/// What both ends of a client share. The node goes before the socket: when the broker hears that the client is gone,
/// there is nothing of it left to clean up.
struct Line {
    node: Node<Service>,
    page: Arc<Page<ClientPage>>,
    broker: Page<BrokerPage>,
    community: Community,
    id: u32,
    epoch: u64,
    stream: Connection,
}

/// A connection that ends with its owner, whoever else watches it.
struct Connection(Lifeline);

impl Drop for Connection {
    fn drop(&mut self) {
        // One that has ended already needs no end.
        let _ = self.0.shutdown(std::net::Shutdown::Both);
    }
}

impl Line {
    fn check(&self) -> Result<(), LinkError> {
        let community = self.community.to_string();
        match self.page.closed.load(Acquire) {
            OPEN if handshake::hung_up(&self.stream.0) => Err(LinkError::BrokerDied(community)),
            OPEN => Ok(()),
            BROKER_DIED => Err(LinkError::BrokerDied(community)),
            _ => Err(LinkError::BrokerGone(community)),
        }
    }

    /// Sleeps until `done`, which the broker brings about.
    fn wait_until(&self, done: impl Fn(&ClientPage) -> bool) -> Result<(), LinkError> {
        self.wait_at_most(Duration::MAX, done)
    }

    fn wait_at_most(&self, patience: Duration, done: impl Fn(&ClientPage) -> bool) -> Result<(), LinkError> {
        if done(&self.page) {
            return Ok(());
        }
        let since = Stopwatch::start();
        self.page.client_waits.store(1, SeqCst);
        let waited = loop {
            let rings = self.page.bell.rings();
            if done(&self.page) || since.elapsed() > patience {
                break Ok(());
            }
            if let Err(gone) = self.check() {
                break Err(gone);
            }
            self.page.bell.wait(rings, LONGEST_SLEEP);
        };
        self.page.client_waits.store(0, SeqCst);
        waited
    }
}

struct ShmUp {
    lane: LaneWriter,
    bulk: Option<BulkWriter>,
    /// The bulk service could not be opened, at one end or the other.
    bulk_failed: bool,
    /// The number of the batch that this end sent by itself: nobody else counts it.
    own_batch: Option<u64>,
    line: Rc<Line>,
}

impl ShmUp {
    /// `None`: there is no bulk service for this client, and its values travel in batches from now on.
    fn try_open_bulk(&mut self, len: usize) -> Result<Option<BulkWriter>, LinkError> {
        let name = lane_name(self.line.epoch, "bulk", self.line.id);
        let opened = match scarce::room().and_then(|()| BulkWriter::open(&self.line.node, &name, len)) {
            Ok(writer) => self.introduce(writer)?,
            Err(error) => Err(error.to_string()),
        };
        self.bulk_failed = opened.is_err();
        Ok(opened
            .map_err(|why| tell(format_args!("values of 16 KiB and more take the long way, as copies: {why}")))
            .ok())
    }

    /// Has the broker open the receiving end; the inner error is why it could not.
    fn introduce(&mut self, writer: BulkWriter) -> Result<Result<BulkWriter, String>, LinkError> {
        // The broker attaches first: it keeps latest values, and copies for those who come later.
        let mut frame = Vec::new();
        let header = Header { source: self.line.id, ..Header::new(FrameKind::Attached) };
        wire::put(&mut frame, &header, &[], &[]);
        self.send(&frame)?;
        self.own_batch = Some(self.line.page.up_sent.load(Relaxed));
        self.line.wait_until(|page| page.attachments.load(Acquire) > 0)?;
        match self.line.page.bulk_refused.load(Acquire) {
            0 => Ok(Ok(writer)),
            _ => Ok(Err("the broker could not open this client's bulk service; its log says why".to_owned())),
        }
    }
}

impl Uplink for ShmUp {
    fn send(&mut self, batch: &[u8]) -> Result<(), LinkError> {
        let page = &self.line.page;
        let sent = page.up_sent.load(Relaxed);
        self.line.wait_until(|page| sent.saturating_sub(page.up_taken.load(Acquire)) < DEPTH)?;
        if page.closed.load(Acquire) != OPEN {
            self.line.check()?;
        }
        if !page.up.put(sent, batch)
            && let Err(error) = self.lane.send(batch)
        {
            // A broker that died can be the reason.
            return Err(self.line.check().err().unwrap_or(error));
        }
        page.up_sent.store(sent.wrapping_add(1), Release);
        self.line.broker.bell.ring();
        Ok(())
    }

    fn has_room(&self) -> bool {
        let page = &self.line.page;
        let sent = page.up_sent.load(Relaxed);
        let has_room = || sent.saturating_sub(page.up_taken.load(SeqCst)) < DEPTH || page.closed.load(Acquire) != OPEN;
        if has_room() {
            page.client_waits.store(0, SeqCst);
            return true;
        }
        // The broker rings when it has taken a batch; one that it took just before this flag is seen at once.
        page.client_waits.store(1, SeqCst);
        has_room()
    }

    fn send_bulk(&mut self, len: usize, fill: &mut Fill<'_>) -> Result<Option<BulkRef>, LinkError> {
        if self.bulk.is_none() && !self.bulk_failed {
            self.bulk = self.try_open_bulk(len)?;
        }
        let Some(writer) = &mut self.bulk else { return Ok(None) };
        let sent = writer.sent;
        self.line.wait_until(|page| sent.saturating_sub(page.bulk_settled.load(Acquire)) < bulk::DEPTH)?;
        // Read before sending: whoever attached by now is reached by this very sample.
        let generation = self.line.page.attachments.load(Acquire);
        let mut sample = writer.send(len, fill)?;
        // What is too long for a batch has to wait until a reader lets go of a chunk, of which nothing tells.
        let waited = Stopwatch::start();
        while sample.is_none() && len > LONGEST_IN_BATCH {
            if waited.elapsed() > LINGER {
                return Err(LinkError::SharedMemory(format!(
                    "no room for a value of {len} bytes: readers have held on to all values before it for {} s",
                    LINGER.as_secs()
                )));
            }
            self.line.check()?;
            std::thread::sleep(REJOIN_EVERY);
            sample = writer.send(len, fill)?;
        }
        Ok(sample.map(|sample| BulkRef { client: self.line.id, generation, sample, len: len as u64 }))
    }

    fn handled(&self) -> u64 {
        let handled = self.line.page.up_handled.load(Acquire);
        handled - u64::from(self.own_batch.is_some_and(|own| own <= handled))
    }

    fn kept_bulk(&self, sample: u64) -> Option<&[u8]> {
        self.bulk.as_ref()?.kept.get(sample)
    }

    fn keep_bulk(&mut self, wanted: &dyn Fn(u64) -> bool) {
        if let Some(bulk) = &mut self.bulk {
            let newest = bulk.sent;
            bulk.kept.let_go(newest, wanted);
        }
    }

    fn say_goodbye(&mut self) {
        self.line.page.goodbye.store(1, SeqCst);
    }
}

/// A client that leaves waits until the broker has taken its last words: iceoryx2 loses what lies in a segment that no
/// reader has mapped before its writer is gone.
impl Drop for ShmUp {
    fn drop(&mut self) {
        // A broker that is gone, or that has no room for so long, will not hear them either way.
        let sent = self.line.page.up_sent.load(Relaxed);
        // Its last bulk values are gone with it: whoever asked for all of them has to have read them first.
        let bulk = self.bulk.as_ref().map_or(0, |writer| writer.sent);
        let read = |page: &ClientPage| page.bulk_settled.load(Acquire) >= bulk;
        let _ = self.line.wait_at_most(LINGER, |page| page.up_taken.load(Acquire) == sent && read(page));
    }
}

struct ShmDown {
    lane: LaneReader,
    received: u64,
    taken: Rc<Cell<u64>>,
    bulk: BTreeMap<u32, BulkReader>,
    /// Publishers whose bulk service could not be opened, and since when.
    refused: BTreeMap<u32, Stopwatch>,
    /// For a client that lives in somebody's event loop.
    forward: Option<Forward>,
    line: Rc<Line>,
}

impl Downlink for ShmDown {
    fn receive(&mut self, timeout: Duration) -> Result<Option<Batch>, LinkError> {
        let page = &self.line.page;
        let mut waited: Option<Stopwatch> = None;
        self.forward.iter().for_each(|forward| forward.wake.clear());
        loop {
            let rings = page.bell.rings();
            if page.down_sent.load(Acquire) > self.received {
                let number = self.received;
                let small = page.down.get(number).is_some();
                let sample = if small { None } else { self.lane.receive()? };
                if !small && sample.is_none() {
                    // What a broker that is gone has taken along is said again by the next.
                    return Err(self.line.check().err().unwrap_or_else(lane::lost));
                }
                self.received += 1;
                if let Some(forward) = self.forward.as_ref().filter(|_| page.down_sent.load(Acquire) > self.received) {
                    forward.wake.set();
                }
                let (taken, line) = (self.taken.clone(), self.line.clone());
                return Ok(Some(Batch(Box::new(Taken { number, sample, taken, line }))));
            }
            if page.closed.load(Acquire) != OPEN {
                self.line.check()?;
            }
            let waited = *waited.get_or_insert_with(Stopwatch::start);
            let left = timeout.checked_sub(waited.elapsed()).filter(|left| !left.is_zero());
            let Some(left) = left.filter(|_| !self.retiring()) else {
                return self.line.check().map(|()| None);
            };
            if page.bell.wait(rings, left.min(LONGEST_SLEEP)) {
                return Ok(None); // the caller looks what the signal was for
            }
            if waited.elapsed() >= LONGEST_SLEEP {
                self.line.check()?;
            }
        }
    }

    fn wake_by(&mut self, wake: Arc<dyn Wake>) -> std::io::Result<()> {
        self.forward = Some(Forward::start(&self.line.page, wake)?);
        Ok(())
    }

    fn open(&self) -> bool {
        self.line.page.closed.load(Acquire) == OPEN
    }

    fn note_handled(&mut self, messages: u64) {
        let page = &self.line.page;
        if messages == 1 {
            page.first_handled_at.store(monotonic_nanos(), Relaxed);
        }
        page.handled.store(messages, Release);
    }

    fn note_missed(&mut self, values: u64) {
        self.line.page.missed.store(values, Relaxed);
    }

    fn retiring(&self) -> bool {
        self.line.page.retire.load(Relaxed) != 0
    }

    fn bulk(&mut self, reference: BulkRef) -> Option<&Held> {
        let len = usize::try_from(reference.len).unwrap_or(usize::MAX);
        self.bulk.get_mut(&reference.client)?.get(reference.sample, len)
    }

    fn attach(&mut self, publisher: u32) -> bool {
        if self.bulk.contains_key(&publisher) {
            return false; // told twice: the first word is still on its way up
        }
        if self.refused.get(&publisher).is_some_and(|since| since.elapsed() < REATTACH_EVERY) {
            return false;
        }
        let name = lane_name(self.line.epoch, "bulk", publisher);
        match scarce::room().and_then(|()| BulkReader::open(&self.line.node, &name)) {
            Ok(reader) => {
                self.bulk.insert(publisher, reader);
                self.refused.remove(&publisher);
                true
            }
            Err(error) => {
                // The broker goes on to send copies, and hints, as long as it is not told otherwise.
                if self.refused.insert(publisher, Stopwatch::start()).is_none() {
                    tell(format_args!("large values come as copies, their shared memory cannot be opened: {error}"));
                }
                false
            }
        }
    }
}

/// A batch in place; dropping it makes room in the lane.
struct Taken {
    number: u64,
    /// `None`: it lies in the page.
    sample: Option<LaneSample>,
    taken: Rc<Cell<u64>>,
    line: Rc<Line>,
}

impl Deref for Taken {
    type Target = [u8];
    fn deref(&self) -> &[u8] {
        match &self.sample {
            Some(sample) => sample.payload(),
            None => {
                let batch = self.line.page.down.get(self.number);
                debug_assert!(batch.is_some(), "the page had batch {} when it was taken", self.number);
                batch.unwrap_or_default()
            }
        }
    }
}

impl Drop for Taken {
    fn drop(&mut self) {
        self.taken.set(self.taken.get() + 1);
        self.line.page.last_handled_at.store(monotonic_nanos(), Relaxed);
        self.line.page.down_taken.store(self.taken.get(), SeqCst);
        if self.line.page.broker_waits.load(SeqCst) != 0 {
            self.line.broker.bell.ring();
        }
    }
}
