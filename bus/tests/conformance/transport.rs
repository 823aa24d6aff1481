//! The transports.

use std::process::Child;
use std::sync::{Mutex, PoisonError};
use std::time::Duration;

use elk_bus::memory::MemoryBroker;
use elk_bus::{BrokerConfig, Client, Clock, Community, Introduction, RunOptions};
use rustix::process::{Pid, Signal};

use crate::common::broker_that_says;
use crate::common::events::once_served;

/// A community on some transport.
pub trait Transport {
    fn start(name: &str) -> Self;
    fn join(&self, who: &Introduction<'_>) -> Result<Client, String>;
    /// The broker dies, and another one takes over.
    fn replace_broker(&self);
    fn stop(self);

    fn connect(&self, name: &str) -> Result<Client, String> {
        self.join(&Introduction::new(name))
    }
}

/// Clients and broker in one process.
pub struct Memory(MemoryBroker, Community);

impl Transport for Memory {
    fn start(name: &str) -> Self {
        Memory(MemoryBroker::new(BrokerConfig::new(name), Clock::new(1.0)), Community::new(name).unwrap())
    }
    fn join(&self, who: &Introduction<'_>) -> Result<Client, String> {
        Ok(Client::over(self.0.join(who).map_err(|e| e.to_string())?, who.name, &self.1))
    }
    fn replace_broker(&self) {
        self.0.crash();
        self.0.recover();
    }
    fn stop(self) {
        self.0.stop();
    }
}

/// A broker in a process of its own, which is this very program again.
pub struct Shm {
    community: Community,
    broker: Mutex<Child>,
    /// What the brokers have said, of all of them.
    said: tempfile::NamedTempFile,
}

impl Shm {
    fn broker(community: &Community, said: &tempfile::NamedTempFile) -> Child {
        broker_that_says(community, said.as_file().try_clone().unwrap())
    }
}

impl Transport for Shm {
    fn start(name: &str) -> Self {
        let community = Community::new(format!("{name}-{}", std::process::id())).unwrap();
        let said = tempfile::NamedTempFile::new().unwrap();
        Shm { broker: Mutex::new(Self::broker(&community, &said)), community, said }
    }
    fn join(&self, who: &Introduction<'_>) -> Result<Client, String> {
        let options = RunOptions {
            lease: Duration::from_secs_f64(who.lease_secs),
            succeeds: who.succeeds,
            build: who.build.to_owned(),
            ..RunOptions::new(who.name, self.community.clone())
        };
        once_served(&self.community, || Client::join(&options)).map_err(|error| error.to_string())
    }
    fn replace_broker(&self) {
        let mut broker = self.broker.lock().unwrap();
        broker.kill().unwrap();
        broker.wait().unwrap();
        *broker = Self::broker(&self.community, &self.said);
    }
    fn stop(self) {
        // A broker that was started just now does not heed signals yet; one that lets somebody in does.
        drop(self.connect("usher"));
        let mut broker = self.broker.lock().unwrap();
        rustix::process::kill_process(Pid::from_child(&broker), Signal::TERM).unwrap();
        assert!(broker.wait().unwrap().success());
        let prefix = format!("elk_{}=", self.community);
        let left: Vec<_> = std::fs::read_dir("/dev/shm").unwrap().flatten().map(|f| f.file_name()).collect();
        assert!(!left.iter().any(|f| f.to_string_lossy().starts_with(&prefix)), "left in /dev/shm: {left:?}");
    }
}

impl Drop for Shm {
    fn drop(&mut self) {
        // Has ended already unless the test failed.
        let broker = self.broker.get_mut().unwrap_or_else(PoisonError::into_inner);
        if std::thread::panicking() {
            let said = std::fs::read_to_string(self.said.path()).unwrap_or_default();
            println!("its broker, which has ended with {:?} so far, said: {said}", broker.try_wait());
        }
        let _ = broker.kill();
        let _ = broker.wait();
    }
}
