//! iceoryx2 as it comes: publish-subscribe, and an event service that wakes the reader; direct, or two hops with a
//! relay between, which is the least that a star can be made of.
//!
//! The lesson of the first such program: who blocks in `send` before the reader was woken stalls for good. So a wake-up
//! goes out at least every quarter of a queue.

use std::path::PathBuf;
use std::time::Duration;

use iceoryx2::config::Config;
use iceoryx2::node::{Node, NodeBuilder};
use iceoryx2::port::listener::Listener;
use iceoryx2::port::notifier::Notifier;
use iceoryx2::port::publisher::Publisher;
use iceoryx2::port::subscriber::Subscriber;
use iceoryx2::prelude::{BackpressureStrategy, FileName, Path, SemanticString, SignalHandlingMode, ipc};

use crate::load::Load;
use crate::transport::{BenchResult, Intake, Outlet};

type Service = ipc::Service;

/// Samples that a reader's queue holds.
const QUEUE_SMALL: usize = 1024;
const QUEUE_LARGE: usize = 16;
/// Samples of at least this many bytes are large.
const LARGE: usize = 64 << 10;
const READERS: usize = 4;

/// What the names of the shared-memory files begin with.
pub fn prefix(namespace: &str) -> String {
    format!("{namespace}_")
}

/// The folder of the other files.
pub fn root(namespace: &str) -> PathBuf {
    std::env::temp_dir().join(namespace)
}

fn node(namespace: &str) -> BenchResult<Node<Service>> {
    iceoryx2::prelude::set_log_level(iceoryx2::prelude::LogLevel::Fatal);
    let mut config = Config::default();
    config.global.prefix = FileName::new(prefix(namespace).as_bytes()).map_err(|e| format!("{e:?}"))?;
    let root = Path::new(root(namespace).to_string_lossy().as_bytes()).map_err(|e| format!("{e:?}"))?;
    config.global.set_root_path(&root);
    Ok(NodeBuilder::new()
        .config(&config)
        .signal_handling_mode(SignalHandlingMode::Disabled)
        .create::<Service>()
        .map_err(|e| format!("{e:?}"))?)
}

fn sample_bytes(load: &Load) -> usize {
    load.bytes * load.batch as usize
}

fn queue(load: &Load) -> usize {
    if sample_bytes(load) >= LARGE { QUEUE_LARGE } else { QUEUE_SMALL }
}

macro_rules! service {
    ($node:expr, $hop:expr, $load:expr) => {
        $node
            .service_builder(&$hop.try_into().map_err(|e| format!("{e:?}"))?)
            .publish_subscribe::<[u8]>()
            .enable_safe_overflow(!$load.lossless)
            .subscriber_max_buffer_size(queue($load))
            .history_size(0)
            .max_publishers(1)
            .max_subscribers(READERS)
            .max_nodes(READERS + 4)
            .open_or_create()
            .map_err(|e| format!("{e:?}"))?
    };
}

macro_rules! event {
    ($node:expr, $hop:expr) => {
        $node
            .service_builder(&format!("{}/wake", $hop).as_str().try_into().map_err(|e| format!("{e:?}"))?)
            .event()
            .open_or_create()
            .map_err(|e| format!("{e:?}"))?
    };
}

/// The writing end of a hop.
pub struct BareOutlet {
    publisher: Publisher<Service, [u8], ()>,
    notifier: Notifier<Service>,
    /// Messages that are to share a sample.
    gathered: Vec<u8>,
    sample_bytes: usize,
    /// Samples that no reader was woken for yet.
    unannounced: usize,
    announce_every: usize,
    _node: Node<Service>,
}

impl BareOutlet {
    /// Opens the writing end of `hop`.
    pub fn open(namespace: &str, hop: &str, load: &Load) -> BenchResult<Self> {
        let node = node(namespace)?;
        let strategy = match load.lossless {
            true => BackpressureStrategy::RetryUntilDelivered,
            false => BackpressureStrategy::DiscardData,
        };
        let publisher = service!(node, hop, load)
            .publisher_builder()
            .initial_max_slice_len(sample_bytes(load))
            .backpressure_strategy(strategy)
            .create()
            .map_err(|e| format!("{e:?}"))?;
        let notifier = event!(node, hop).notifier_builder().create().map_err(|e| format!("{e:?}"))?;
        let large = sample_bytes(load) >= LARGE || load.batch > 1;
        let announce_every = if large { 1 } else { 64 };
        let sample_bytes = sample_bytes(load);
        Ok(Self {
            publisher,
            notifier,
            gathered: Vec::new(),
            sample_bytes,
            unannounced: 0,
            announce_every,
            _node: node,
        })
    }

    fn ship(&mut self, sample: &[u8]) -> BenchResult {
        let slot = self.publisher.loan_slice_uninit(sample.len()).map_err(|e| format!("{e:?}"))?;
        slot.write_from_slice(sample).send().map_err(|e| format!("{e:?}"))?;
        self.unannounced += 1;
        if self.unannounced >= self.announce_every { self.announce() } else { Ok(()) }
    }

    fn announce(&mut self) -> BenchResult {
        if self.unannounced > 0 {
            self.unannounced = 0;
            self.notifier.notify().map_err(|e| format!("{e:?}"))?;
        }
        Ok(())
    }

    fn ship_gathered(&mut self) -> BenchResult {
        let mut gathered = std::mem::take(&mut self.gathered);
        let shipped = if gathered.is_empty() { Ok(()) } else { self.ship(&gathered) };
        gathered.clear();
        self.gathered = gathered;
        shipped
    }
}

impl Outlet for BareOutlet {
    fn send(&mut self, message: &[u8]) -> BenchResult {
        if self.sample_bytes == message.len() {
            return self.ship(message);
        }
        self.gathered.extend_from_slice(message);
        if self.gathered.len() >= self.sample_bytes { self.ship_gathered() } else { Ok(()) }
    }

    fn flush(&mut self) -> BenchResult {
        self.ship_gathered()?;
        self.announce()
    }
}

/// The reading end of a hop.
pub struct BareIntake {
    subscriber: Subscriber<Service, [u8], ()>,
    listener: Listener<Service>,
    message_bytes: usize,
    _node: Node<Service>,
}

impl BareIntake {
    /// Opens the reading end of `hop`.
    pub fn open(namespace: &str, hop: &str, load: &Load) -> BenchResult<Self> {
        let node = node(namespace)?;
        let subscriber = service!(node, hop, load).subscriber_builder().create().map_err(|e| format!("{e:?}"))?;
        let listener = event!(node, hop).listener_builder().create().map_err(|e| format!("{e:?}"))?;
        Ok(Self { subscriber, listener, message_bytes: load.bytes, _node: node })
    }

    /// Hands over each sample that has come; sleeps first if there is none. Answers how many there were.
    fn samples(&self, timeout: Duration, mut on_sample: impl FnMut(&[u8]) -> BenchResult) -> BenchResult<usize> {
        let mut taken = 0;
        while let Some(sample) = self.subscriber.receive().map_err(|e| format!("{e:?}"))? {
            taken += 1;
            on_sample(sample.payload())?;
        }
        if taken == 0 {
            self.listener.timed_wait(|_| (), timeout).map_err(|e| format!("{e:?}"))?;
        }
        Ok(taken)
    }
}

impl Intake for BareIntake {
    fn receive(&mut self, timeout: Duration, on_message: &mut dyn FnMut(&[u8])) -> BenchResult {
        self.samples(timeout, |sample| {
            sample.chunks_exact(self.message_bytes).for_each(&mut *on_message);
            Ok(())
        })?;
        Ok(())
    }
}

/// Copies each sample of the first hop into the second, until the process is killed.
pub fn relay(namespace: &str, load: &Load, ready: impl FnOnce() -> BenchResult) -> BenchResult {
    let from = BareIntake::open(namespace, "up", load)?;
    let mut to = BareOutlet::open(namespace, "down", load)?;
    ready()?;
    loop {
        from.samples(Duration::from_secs(1), |sample| to.ship(sample))?;
        to.announce()?;
    }
}
