//! A broker for a test, and what a test waits for.

use std::net::SocketAddr;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::mpsc::channel;
use std::thread::JoinHandle;
use std::time::Duration;

use elk_bus::moos::client::{ClientError, MoosClient};
use elk_bus::moos::gateway::{GatewayOptions, Listening};
use elk_bus::moos::hello::Manner;
use elk_bus::moos::message::{Data, Kind, Message};
use elk_bus::shm::Server;
use elk_bus::{BrokerConfig, Client, Clock, Community};

use crate::common::events::{Patience, WATCHDOG};

/// A short wait for mail: it is looked for again and again.
pub const MOMENT: Duration = Duration::from_millis(20);

/// A broker on a thread, with a port of its own.
pub struct Served {
    pub community: Community,
    pub address: SocketAddr,
    stop: Arc<AtomicBool>,
    thread: Option<JoinHandle<()>>,
}

impl Served {
    pub fn start(name: &str) -> Self {
        Self::with(name, |options| options)
    }

    pub fn with(name: &str, change: impl FnOnce(GatewayOptions) -> GatewayOptions) -> Self {
        Self::warped(name, 1.0, change)
    }

    /// … whose clock runs so many times as fast as the wall's.
    pub fn warped(name: &str, warp: f64, change: impl FnOnce(GatewayOptions) -> GatewayOptions) -> Self {
        let community = Community::new(format!("moos-{name}-{}", std::process::id())).unwrap();
        let options = change(GatewayOptions::new("127.0.0.1:0".parse().unwrap()));
        let listening = Listening::at(options).unwrap();
        let address = listening.address().unwrap();
        let stop = Arc::new(AtomicBool::new(false));
        let config = BrokerConfig::new(community.as_str());
        // The server is made where it runs; nobody connects before it is there.
        let (served, running) = (community.clone(), stop.clone());
        let (ready, is_ready) = channel();
        let thread = std::thread::spawn(move || {
            let mut server = Server::start(served, config, Clock::new(warp), Some(listening)).unwrap();
            ready.send(()).unwrap();
            server.run(&running);
        });
        is_ready.recv_timeout(WATCHDOG).expect("a broker starts");
        Self { community, address, stop, thread: Some(thread) }
    }

    pub fn moos(&self, name: &str) -> MoosClient {
        MoosClient::connect(self.address, name, Manner::Asynchronous).unwrap()
    }

    pub fn synchronous(&self, name: &str) -> MoosClient {
        MoosClient::connect(self.address, name, Manner::Synchronous).unwrap()
    }

    pub fn elk(&self, name: &str) -> Client {
        Client::connect(&self.community, name).unwrap()
    }
}

impl Drop for Served {
    fn drop(&mut self) {
        self.stop.store(true, Ordering::Relaxed);
        if let Some(thread) = self.thread.take()
            && thread.join().is_err()
            && !std::thread::panicking()
        {
            panic!("the broker panicked");
        }
    }
}

/// A message as it was received.
#[derive(Debug, Clone, PartialEq)]
pub struct Heard {
    pub id: i32,
    pub kind: Kind,
    pub data: Data,
    pub source: String,
    pub aux: String,
    pub community: String,
    pub key: String,
    pub time: f64,
    pub number: f64,
    pub second: f64,
    pub value: Vec<u8>,
}

impl Heard {
    pub fn of(message: &Message<'_>) -> Self {
        let text = |bytes: &[u8]| String::from_utf8(bytes.to_vec()).unwrap();
        Self {
            id: message.id,
            kind: message.kind,
            data: message.data,
            source: text(message.source),
            aux: text(message.source_aux),
            community: text(message.community),
            key: text(message.key),
            time: message.time,
            number: message.number,
            second: message.second,
            value: message.value.to_vec(),
        }
    }

    pub fn text(&self) -> &str {
        std::str::from_utf8(&self.value).unwrap()
    }
}

/// Receives until `enough`.
pub fn hear(client: &mut MoosClient, what: &str, mut enough: impl FnMut(&[Heard]) -> bool) -> Vec<Heard> {
    let (patience, mut heard) = (Patience::new(), Vec::new());
    while !enough(&heard) {
        patience.left(what);
        client.receive(MOMENT, |message| heard.push(Heard::of(message))).unwrap();
    }
    heard
}

/// What a synchronous client is answered.
pub fn exchange(client: &mut MoosClient) -> Vec<Heard> {
    let mut heard = Vec::new();
    client.exchange(|message| heard.push(Heard::of(message))).unwrap();
    heard
}

/// Waits until all that a client has said was taken in: it hears itself.
pub fn settle(client: &mut MoosClient) {
    let key = format!("SETTLED_{}", std::process::id());
    client.register(&key, 0.0);
    client.notify_number(&key, client.time());
    hear(client, "a client hears itself", |heard| heard.iter().any(|one| one.key == key));
    client.unregister(&key);
    client.flush().unwrap();
}

/// Waits until the server has ended a client's connection.
pub fn wait_for_end(client: &mut MoosClient, what: &str) {
    let patience = Patience::new();
    loop {
        patience.left(what);
        match client.read(MOMENT, &mut |_| {}) {
            Ok(_) => {}
            Err(ClientError::Closed | ClientError::Io(_)) => return,
            Err(error) => panic!("{what}: {error}"),
        }
    }
}
