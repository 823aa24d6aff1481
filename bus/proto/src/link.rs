//! What a transport gives a client: a way up to the broker, a way down from it, and a way back should the broker die.

use std::fmt;
use std::io::Write;
use std::ops::Deref;
use std::rc::Rc;
use std::sync::Arc;
use std::time::Duration;

use crate::clock_setting::ClockSetting;
use crate::wire::BulkRef;

/// Why a transport could not do what it was asked to.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
pub enum LinkError {
    /// The broker stopped in good order, let go of this client, or died and did not come back in time.
    #[error("the broker of community {0} is gone (its process ended, or it let go of this client)")]
    BrokerGone(String),
    /// The broker's process died; the next one may be on its way (see [`Rejoin`]).
    #[error("the broker of community {0} died")]
    BrokerDied(String),
    /// A client in an event loop has no thread to listen to its bell.
    #[error("there is no thread to listen for mail: {0}; end other programs, or raise the limit (ulimit -u)")]
    NoThread(String),
    /// Shared memory failed.
    #[error("shared memory: {0}")]
    SharedMemory(String),
}

/// What wakes a client that lives in somebody's event loop.
pub trait Wake: Send + Sync {
    /// There may be something to receive, or room for a batch.
    fn set(&self);
    /// Whatever there was is about to be looked for.
    fn clear(&self);
}

/// The way up: batches of frames from a client to the broker.
pub trait Uplink {
    /// Hands a batch to the broker, in order, losing nothing; waits for room if the broker is behind. An error means
    /// that the broker has not got it.
    fn send(&mut self, batch: &[u8]) -> Result<(), LinkError>;

    /// Whether the next batch is taken without waiting, be it that the broker is gone and sending it says so. If not, the
    /// [`Wake`] of the way down is set once it is.
    fn has_room(&self) -> bool;

    /// The number of the last batch sent such that all mail from it and from those before has been handled, or dropped:
    /// none of it has to be sent again. Batches are counted from 1.
    fn handled(&self) -> u64;

    /// Writes a bulk value of `len` bytes where its readers will find it; `fill` writes the bytes. `None`: this
    /// transport has no such memory, the value has to travel in a batch. Waits if lossless readers are behind.
    fn send_bulk(&mut self, len: usize, fill: &mut Fill<'_>) -> Result<Option<BulkRef>, LinkError>;

    /// A bulk value that was sent, as long as it is kept.
    fn kept_bulk(&self, sample: u64) -> Option<&[u8]>;

    /// Says that the client leaves in good order.
    fn say_goodbye(&mut self);

    /// Lets go of the bulk values that nobody will ask for again; the newest few may stay.
    fn keep_bulk(&mut self, wanted: &dyn Fn(u64) -> bool);
}

/// Writes a value's bytes, straight into the memory where they will be read.
pub type Fill<'a> = dyn FnMut(&mut dyn Write) -> std::io::Result<()> + 'a;

/// The way down: batches of frames from the broker to a client.
pub trait Downlink {
    /// The next batch; waits at most `timeout` for it.
    fn receive(&mut self, timeout: Duration) -> Result<Option<Batch>, LinkError>;

    /// Whether the broker is still at the other end; if not, what it had delivered can be received all the same.
    fn open(&self) -> bool;

    /// Has `wake` be set whenever there may be something to receive, from now on; a receive clears it before it looks.
    ///
    /// # Errors
    /// There is no thread for that, or the transport has no such way.
    fn wake_by(&mut self, _wake: Arc<dyn Wake>) -> std::io::Result<()> {
        Err(std::io::ErrorKind::Unsupported.into())
    }

    /// Says how many of the messages that this client was ever given it has handled.
    fn note_handled(&mut self, messages: u64);

    /// Says how many bulk values were overwritten before this client came to read them.
    fn note_missed(&mut self, values: u64);

    /// Whether the client is to leave at the next message boundary, because its successor is ready.
    fn retiring(&self) -> bool;

    /// A bulk value in place; who keeps it for longer than until the next call holds it. `None`: it was overwritten before
    /// this client came to read it.
    fn bulk(&mut self, reference: BulkRef) -> Option<&Held>;

    /// Opens the memory where client `publisher` writes its bulk values; whether that worked.
    fn attach(&mut self, publisher: u32) -> bool;
}

/// A bulk value where it lies, in its publisher's shared memory: nothing else is written there while somebody holds it. Of
/// a publisher's values that a client holds a few lie there; more are copies.
#[derive(Clone)]
pub struct Held(Rc<dyn Deref<Target = [u8]>>);

impl Held {
    /// A value that stays in these bytes.
    pub fn new(bytes: impl Deref<Target = [u8]> + 'static) -> Self {
        Self(Rc::new(bytes))
    }

    /// How many hold it.
    pub fn holders(&self) -> usize {
        Rc::strong_count(&self.0)
    }
}

impl Deref for Held {
    type Target = [u8];
    fn deref(&self) -> &[u8] {
        &self.0
    }
}

impl fmt::Debug for Held {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{} bytes", self.len())
    }
}

/// A received batch; the transport takes its memory back when it is dropped.
pub struct Batch(pub Box<dyn Deref<Target = [u8]>>);

impl Deref for Batch {
    type Target = [u8];
    fn deref(&self) -> &[u8] {
        &self.0
    }
}

/// How long a client waits for the next broker after one died.
pub const REJOIN_PATIENCE: Duration = Duration::from_secs(10);

/// The way back into the community after its broker died.
pub trait Rejoin {
    /// Waits for the next broker, with limited patience, and joins it under the old name.
    fn rejoin(&mut self) -> Result<Link, LinkError>;
}

/// Both ways, what the client said of itself, and what the broker said when it let the client in.
pub struct Link {
    /// The way up.
    pub up: Box<dyn Uplink>,
    /// The way down.
    pub down: Box<dyn Downlink>,
    /// The way back.
    pub back: Box<dyn Rejoin>,
    /// Which build of which program the client is; empty: it has not said.
    pub build: String,
    /// How much faster than the wall's clock the community's runs by itself.
    pub warp: f64,
    /// What the community's clock is set to, if somebody drives it.
    pub clock_setting: Option<ClockSetting>,
    /// Tells one life of the broker from the next.
    pub epoch: u64,
}
