//! Where live apps meet: around a broker in this process' memory, where nobody else is; or, if one of them is a process of
//! its own, in shared memory.

use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::mpsc::channel;
use std::thread::JoinHandle;

use elk_bus::memory::MemoryBroker;
use elk_bus::shm::Server;
use elk_bus::{BrokerConfig, Client, Clock, Community};

use crate::error::ReplayError;

/// Mail of an app that computes is kept, however much it is (bytes): nothing recorded is dropped.
const MAILBOX_BYTES: usize = 8 << 30;
/// The community's name. In memory it only stands in the log.
const NAME: &str = "replay";

/// A community, and its broker until this is dropped.
pub(crate) struct Meeting {
    place: Place,
    /// The broker in shared memory, and what stops it.
    server: Option<(JoinHandle<()>, Arc<AtomicBool>)>,
}

/// How one comes there.
#[derive(Clone)]
pub(crate) struct Place {
    community: Community,
    /// `None`: over shared memory.
    broker: Option<MemoryBroker>,
}

impl Meeting {
    /// In this process.
    pub fn in_memory() -> Result<Self, ReplayError> {
        let community = community(NAME)?;
        let broker = MemoryBroker::new(config(&community), Clock::new(1.0));
        Ok(Self { place: Place { community, broker: Some(broker) }, server: None })
    }

    /// In shared memory, under a name that only this process has.
    pub fn shared() -> Result<Self, ReplayError> {
        let community = community(&format!("{NAME}-{}", std::process::id()))?;
        let stop = Arc::new(AtomicBool::new(false));
        let (ready, started) = channel();
        let (own_community, stopped) = (community.clone(), stop.clone());
        // A broker stays on the thread that it was made on.
        let serve = move || match Server::start(own_community.clone(), config(&own_community), Clock::new(1.0), None) {
            Ok(mut server) => {
                let _ = ready.send(Ok(()));
                server.run(&stopped);
            }
            Err(error) => {
                let _ = ready.send(Err(error.to_string()));
            }
        };
        let failed = |reason: String| ReplayError::App { app: "the broker".into(), reason };
        let server = std::thread::Builder::new().name("broker".into()).spawn(serve);
        let server = server.map_err(|error| failed(error.to_string()))?;
        let ended = |_| failed("it ended at once".into());
        started.recv().map_err(ended)?.map_err(failed)?;
        Ok(Self { place: Place { community, broker: None }, server: Some((server, stop)) })
    }

    /// How one comes there.
    pub fn place(&self) -> &Place {
        &self.place
    }
}

impl Drop for Meeting {
    fn drop(&mut self) {
        if let Some(broker) = &self.place.broker {
            broker.stop();
        }
        if let Some((server, stop)) = self.server.take() {
            stop.store(true, Ordering::Relaxed);
            // It has said itself what it could not do.
            let _ = server.join();
        }
    }
}

impl Place {
    /// The community's name.
    pub fn community(&self) -> &Community {
        &self.community
    }

    /// Joins under `name`; in words why that cannot be.
    pub fn join(&self, name: &str) -> Result<Client, String> {
        match &self.broker {
            Some(broker) => {
                let link = broker.connect(name).map_err(|refused| refused.to_string())?;
                Ok(Client::over(link, name, &self.community))
            }
            None => Client::connect(&self.community, name).map_err(|refused| refused.to_string()),
        }
    }
}

fn config(community: &Community) -> BrokerConfig {
    BrokerConfig { mailbox_bytes: MAILBOX_BYTES, ..BrokerConfig::new(community.as_str()) }
}

fn community(name: &str) -> Result<Community, ReplayError> {
    Community::new(name).map_err(|error| ReplayError::App { app: name.into(), reason: error.to_string() })
}
