//! A client's end of the shared-memory transport.

use std::cell::Cell;
use std::collections::BTreeMap;
use std::ops::Deref;
use std::os::unix::net::UnixStream;
use std::rc::Rc;
use std::sync::atomic::Ordering::{Acquire, Relaxed, Release, SeqCst};
use std::time::Duration;

use iceoryx2::node::Node;

use super::bulk::{self, BulkReader, BulkWriter};
use super::handshake::{self, Answer, Hello};
use super::lane::{self, DEPTH, LaneReader, LaneSample, LaneWriter, Service};
use super::page::{BrokerPage, ClientPage, Page};
use crate::clock::{Clock, Stopwatch};
use crate::community::Community;
use crate::limits;
use crate::link::{Batch, Downlink, Fill, Link, LinkError, Uplink};
use crate::wire::{self, BulkRef, FrameKind, Header};

/// How often a sleeping client looks whether the broker's process is still there.
const LOOK_EVERY: Duration = Duration::from_millis(500);

/// How long a client that leaves waits for the broker to take its last words.
const LINGER: Duration = Duration::from_secs(10);

/// Why a client could not join a community.
#[derive(Debug, thiserror::Error)]
pub enum ConnectError {
    /// Nobody serves the community.
    #[error("no broker serves community {0} here: start one with `elk db --community {0}` or `elk launch`")]
    NoBroker(Community),
    /// The community is another user's.
    #[error("community {community} belongs to user {user}: join as that user, or choose another --community")]
    ForeignUser {
        /// The community.
        community: Community,
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
    /// Shared memory failed.
    #[error(transparent)]
    Link(#[from] LinkError),
}

/// Joins a community under a name.
pub fn connect(community: &Community, name: &str) -> Result<Link, ConnectError> {
    limits::raise_descriptors();
    let broken = |source| ConnectError::Handshake { community: community.clone(), source };
    let stream = handshake::dial(community).map_err(|_| ConnectError::NoBroker(community.clone()))?;
    let (_, user) = handshake::peer(&stream).map_err(broken)?;
    if user != handshake::own_user() {
        return Err(ConnectError::ForeignUser { community: community.clone(), user });
    }
    let hello = Hello { protocol: handshake::PROTOCOL, name: name.into() };
    handshake::send(&stream, &hello, &[]).map_err(broken)?;
    let (answer, files) = handshake::receive(&stream).map_err(broken)?;
    let (id, epoch, warp) = match answer {
        Answer::Welcome { id, epoch, warp } => (id, epoch, warp),
        Answer::Refused { reason } => {
            return Err(ConnectError::Refused { community: community.clone(), reason });
        }
    };
    let [broker_page, page]: [_; 2] =
        files.try_into().map_err(|_| broken(std::io::Error::other("it sent no shared pages")))?;
    let (broker, page) = (Page::open(broker_page).map_err(broken)?, Page::open(page).map_err(broken)?);
    let line =
        Rc::new(Line { community: community.clone(), id, epoch, stream, broker, page, node: lane::node(community)? });
    open_lanes(line, Clock::new(warp)).map_err(ConnectError::from)
}

fn open_lanes(line: Rc<Line>, clock: Clock) -> Result<Link, LinkError> {
    let up = LaneWriter::open(&line.node, &lane_name(line.epoch, "up", line.id))?;
    let down = LaneReader::open(&line.node, &lane_name(line.epoch, "down", line.id))?;
    line.page.ready.store(1, Release);
    line.broker.bell.ring();
    let epoch = line.epoch;
    let up = Box::new(ShmUp { lane: up, bulk: None, line: line.clone() });
    let down = Box::new(ShmDown { lane: down, received: 0, taken: Rc::new(Cell::new(0)), bulk: BTreeMap::new(), line });
    Ok(Link { up, down, clock, epoch })
}

/// The name of a client's service in the community.
pub fn lane_name(epoch: u64, what: &str, id: u32) -> String {
    format!("{epoch:x}/{what}/{id}")
}

/// What both ends of a client share. The node goes before the socket: when the broker hears that the client is gone,
/// there is nothing of it left to clean up.
struct Line {
    node: Node<Service>,
    page: Page<ClientPage>,
    broker: Page<BrokerPage>,
    community: Community,
    id: u32,
    epoch: u64,
    stream: UnixStream,
}

impl Line {
    fn gone(&self) -> LinkError {
        LinkError::BrokerGone(self.community.to_string())
    }

    fn check(&self) -> Result<(), LinkError> {
        match self.page.closed.load(Acquire) != 0 || handshake::hung_up(&self.stream) {
            true => Err(self.gone()),
            false => Ok(()),
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
            self.page.bell.wait(rings, LOOK_EVERY);
        };
        self.page.client_waits.store(0, SeqCst);
        waited
    }
}

struct ShmUp {
    lane: LaneWriter,
    bulk: Option<BulkWriter>,
    line: Rc<Line>,
}

impl ShmUp {
    fn open_bulk(&mut self, len: usize) -> Result<BulkWriter, LinkError> {
        let name = lane_name(self.line.epoch, "bulk", self.line.id);
        let writer = BulkWriter::open(&self.line.node, &name, len)?;
        // The broker attaches first: it keeps latest values, and copies for those who come later.
        let mut frame = Vec::new();
        let header = Header { source: self.line.id, ..Header::new(FrameKind::Attached) };
        wire::put(&mut frame, &header, &[], &[]);
        self.send(&frame)?;
        self.line.wait_until(|page| page.attachments.load(Acquire) > 0)?;
        Ok(writer)
    }
}

impl Uplink for ShmUp {
    fn send(&mut self, batch: &[u8]) -> Result<(), LinkError> {
        let page = &self.line.page;
        let sent = page.up_sent.load(Relaxed);
        self.line.wait_until(|page| sent - page.up_taken.load(Acquire) < DEPTH)?;
        if page.closed.load(Acquire) != 0 {
            return Err(self.line.gone());
        }
        self.lane.send(batch)?;
        page.up_sent.store(sent + 1, Release);
        self.line.broker.bell.ring();
        Ok(())
    }

    fn send_bulk(&mut self, len: usize, fill: &mut Fill<'_>) -> Result<Option<BulkRef>, LinkError> {
        let mut writer = match self.bulk.take() {
            Some(writer) => writer,
            None => self.open_bulk(len)?,
        };
        let sent = writer.sent;
        self.line.wait_until(|page| sent - page.bulk_settled.load(Acquire) < bulk::DEPTH)?;
        // Read before sending: whoever attached by now is reached by this very sample.
        let generation = self.line.page.attachments.load(Acquire);
        let sample = writer.send(len, fill)?;
        self.bulk = Some(writer);
        Ok(sample.map(|sample| BulkRef { client: self.line.id, generation, sample, len: len as u64 }))
    }
}

/// A client that leaves waits until the broker has taken its last words: iceoryx2 loses what lies in a segment that no
/// reader has mapped before its writer is gone.
impl Drop for ShmUp {
    fn drop(&mut self) {
        // A broker that is gone, or that has no room for so long, will not hear them either way.
        let sent = self.line.page.up_sent.load(Relaxed);
        let _ = self.line.wait_at_most(LINGER, |page| page.up_taken.load(Acquire) == sent);
    }
}

struct ShmDown {
    lane: LaneReader,
    received: u64,
    taken: Rc<Cell<u64>>,
    bulk: BTreeMap<u32, BulkReader>,
    line: Rc<Line>,
}

impl Downlink for ShmDown {
    fn receive(&mut self, timeout: Duration) -> Result<Option<Batch>, LinkError> {
        let page = &self.line.page;
        let mut waited: Option<Stopwatch> = None;
        loop {
            let rings = page.bell.rings();
            if page.down_sent.load(Acquire) > self.received
                && let Some(sample) = self.lane.receive()?
            {
                self.received += 1;
                return Ok(Some(Batch(Box::new(Taken { sample, taken: self.taken.clone(), line: self.line.clone() }))));
            }
            if page.closed.load(Acquire) != 0 {
                return Err(self.line.gone());
            }
            let waited = *waited.get_or_insert_with(Stopwatch::start);
            let Some(left) = timeout.checked_sub(waited.elapsed()).filter(|left| !left.is_zero()) else {
                return self.line.check().map(|()| None);
            };
            page.bell.wait(rings, left.min(LOOK_EVERY));
            if waited.elapsed() >= LOOK_EVERY {
                self.line.check()?;
            }
        }
    }

    fn bulk(&mut self, reference: BulkRef) -> Option<&[u8]> {
        self.bulk.get_mut(&reference.client)?.get(reference.sample)
    }

    fn attach(&mut self, publisher: u32) -> bool {
        if self.bulk.contains_key(&publisher) {
            return false; // told twice: the first word is still on its way up
        }
        let opened = BulkReader::open(&self.line.node, &lane_name(self.line.epoch, "bulk", publisher));
        opened.map(|reader| self.bulk.insert(publisher, reader)).is_ok()
    }
}

/// A batch in place; dropping it makes room in the lane.
struct Taken {
    sample: LaneSample,
    taken: Rc<Cell<u64>>,
    line: Rc<Line>,
}

impl Deref for Taken {
    type Target = [u8];
    fn deref(&self) -> &[u8] {
        self.sample.payload()
    }
}

impl Drop for Taken {
    fn drop(&mut self) {
        self.taken.set(self.taken.get() + 1);
        self.line.page.down_taken.store(self.taken.get(), SeqCst);
        if self.line.page.broker_waits.load(SeqCst) != 0 {
            self.line.broker.bell.ring();
        }
    }
}
