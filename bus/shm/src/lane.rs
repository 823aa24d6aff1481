//! Lanes: an iceoryx2 publish-subscribe service with one writer and one reader, for batches of frames.
//!
//! Counters in the client's page keep the writer at most [`DEPTH`] batches ahead of the reader, which the lane's buffer
//! holds; nothing is ever overwritten, and iceoryx2's own waiting (which a killed reader would turn into hanging for
//! good) is never needed.

use elk_proto::link::LinkError;
use iceoryx2::node::{Node, NodeBuilder};
use iceoryx2::port::publisher::Publisher;
use iceoryx2::port::subscriber::Subscriber;
use iceoryx2::prelude::{AllocationStrategy, BackpressureStrategy, SignalHandlingMode};
use iceoryx2::sample::Sample;
use iceoryx2::service::port_factory::publish_subscribe::PortFactory;

use super::full;
use super::namespace::{Namespace, failed};
use super::scarce;

pub use super::service::Service;

/// A received batch.
pub type LaneSample = Sample<Service, [u8], ()>;

/// Batches that may be under way in a lane.
pub const DEPTH: u64 = 16;
/// Batches that a reader may hold on to.
const BORROWED: usize = 4;
/// What a lane is made for at first (bytes a batch); it grows.
const FIRST_BATCH_BYTES: usize = 4096;

/// This process' node in a community's namespace; refused where shared memory is all but full.
pub fn node(namespace: &Namespace) -> Result<Node<Service>, LinkError> {
    iceoryx2::prelude::set_log_level(iceoryx2::prelude::LogLevel::Fatal);
    full::say_why();
    scarce::room()?;
    NodeBuilder::new()
        .config(&namespace.config()?)
        .signal_handling_mode(SignalHandlingMode::Disabled)
        .create::<Service>()
        .map_err(failed("joining the community's shared memory"))
}

fn open(node: &Node<Service>, name: &str) -> Result<PortFactory<Service, [u8], ()>, LinkError> {
    node.service_builder(&name.try_into().map_err(failed(name))?)
        .publish_subscribe::<[u8]>()
        .enable_safe_overflow(true)
        .subscriber_max_buffer_size(DEPTH as usize + 2)
        .subscriber_max_borrowed_samples(BORROWED)
        .history_size(0)
        .max_publishers(1)
        .max_subscribers(1)
        .max_nodes(4)
        .open_or_create()
        .map_err(failed(format_args!("opening lane {name}")))
}

/// The writing end.
pub struct LaneWriter(Publisher<Service, [u8], ()>);

impl LaneWriter {
    /// Opens the writing end of a lane.
    pub fn open(node: &Node<Service>, name: &str) -> Result<Self, LinkError> {
        open(node, name)?
            .publisher_builder()
            .initial_max_slice_len(FIRST_BATCH_BYTES)
            .allocation_strategy(AllocationStrategy::PowerOfTwo)
            .max_loaned_samples(1)
            .backpressure_strategy(BackpressureStrategy::DiscardData)
            .create()
            .map(Self)
            .map_err(failed(format_args!("writing to lane {name}")))
    }

    /// Sends a batch. That nobody is there to read it is an error: iceoryx2 passes over a reader whose memory it cannot
    /// open, and the reader would wait for ever.
    pub fn send(&self, batch: &[u8]) -> Result<(), LinkError> {
        let sample = self.0.loan_slice_uninit(batch.len()).map_err(failed("room for a batch"))?;
        match sample.write_from_slice(batch).send().map_err(failed("sending a batch"))? {
            0 => Err(failed("sending a batch")("it reached nobody")),
            _ => Ok(()),
        }
    }
}

/// What to say of a batch that was announced and cannot be read: iceoryx2 passes over what lies in memory that it cannot
/// open.
pub fn lost() -> LinkError {
    failed("receiving a batch")("it lies in memory that cannot be opened")
}

/// The reading end.
pub struct LaneReader(Subscriber<Service, [u8], ()>);

impl LaneReader {
    /// Opens the reading end of a lane.
    pub fn open(node: &Node<Service>, name: &str) -> Result<Self, LinkError> {
        open(node, name)?.subscriber_builder().create().map(Self).map_err(failed(format_args!("reading lane {name}")))
    }

    /// The next batch, if one is there.
    pub fn receive(&self) -> Result<Option<LaneSample>, LinkError> {
        self.0.receive().map_err(failed("receiving a batch"))
    }
}
