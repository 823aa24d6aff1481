//! What a transport gives a client: a way up to the broker, and a way down from it.

use std::io::Write;
use std::ops::Deref;
use std::time::Duration;

use crate::clock::Clock;
use crate::wire::BulkRef;

/// Why a transport could not do what it was asked to.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
pub enum LinkError {
    /// The broker is gone.
    #[error("the broker of community {0} is gone (its process ended, or it let go of this client)")]
    BrokerGone(String),
    /// Shared memory failed.
    #[error("shared memory: {0}")]
    SharedMemory(String),
}

/// The way up: batches of frames from a client to the broker.
pub trait Uplink {
    /// Hands a batch to the broker, in order, losing nothing; waits for room if the broker is behind.
    fn send(&mut self, batch: &[u8]) -> Result<(), LinkError>;

    /// Writes a bulk value of `len` bytes where its readers will find it; `fill` writes the bytes. `None`: this
    /// transport has no such place, the value has to travel in a batch. Waits if lossless readers are behind.
    fn send_bulk(&mut self, len: usize, fill: &mut Fill<'_>) -> Result<Option<BulkRef>, LinkError>;
}

/// Writes a value's bytes, straight into the memory where they will be read.
pub type Fill<'a> = dyn FnMut(&mut dyn Write) -> std::io::Result<()> + 'a;

/// The way down: batches of frames from the broker to a client.
pub trait Downlink {
    /// The next batch; waits at most `timeout` for it.
    fn receive(&mut self, timeout: Duration) -> Result<Option<Batch>, LinkError>;

    /// The bytes of a bulk value in place; they stay until the next call or the end of the batch. `None`: it was
    /// overwritten before this client came to read it.
    fn bulk(&mut self, reference: BulkRef) -> Option<&[u8]>;

    /// Opens the place where client `publisher` writes its bulk values; whether that worked.
    fn attach(&mut self, publisher: u32) -> bool;
}

/// A received batch; the transport takes its memory back when it is dropped.
pub struct Batch(pub Box<dyn Deref<Target = [u8]>>);

impl Deref for Batch {
    type Target = [u8];
    fn deref(&self) -> &[u8] {
        &self.0
    }
}

/// Both ways, and what the broker said when it let the client in.
pub struct Link {
    /// The way up.
    pub up: Box<dyn Uplink>,
    /// The way down.
    pub down: Box<dyn Downlink>,
    /// The community's clock.
    pub clock: Clock,
    /// Tells one life of the broker from the next.
    pub epoch: u64,
}
