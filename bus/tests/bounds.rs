//! A broker's memory under attack: clients of the same user that send without bound, or read nothing, or lie.
//!
//! `ELK_BOUNDS_FULL=1 cargo test --release -p elk-bus --test bounds -- --nocapture` attacks at full length.

mod common;

use std::net::SocketAddr;
use std::process::Child;
use std::time::Duration;

use common::events::{Patience, once_served};
use elk_bus::link::Link;
use elk_bus::moos::client::MoosClient;
use elk_bus::moos::hello::Manner;
use elk_bus::moos::message::{Data, Kind, Message};
use elk_bus::wire::{self, FrameKind, Header, Named, ValueKind};
use elk_bus::{Client, Community, Introduction, Key, any, shm};
use rustix::process::{Pid, Signal};

/// What docs/security.md promises (MB).
const BOUND_MB: f64 = 256.0;

/// A payload of any size.
#[elk_bus::payload]
#[derive(Debug)]
pub struct Blob {
    /// Its bytes.
    pub bytes: Vec<u8>,
}

/// Not a test by itself: the broker's process.
#[test]
fn broker_process() {
    common::serve_if_asked_to();
}

/// A community whose broker is under attack.
struct Target {
    community: Community,
    broker: Child,
}

impl Target {
    fn new(name: &str) -> Self {
        let community = Community::new(format!("bounds-{name}-{}", std::process::id())).unwrap();
        Self::of(common::broker_of(&community), community)
    }

    /// One that clients of MOOS' may come to as well, and where to.
    fn with_moos(name: &str) -> (Self, SocketAddr) {
        let community = Community::new(format!("bounds-{name}-{}", std::process::id())).unwrap();
        let (broker, address) = common::broker_with_moos(&community);
        (Self::of(broker, community), address)
    }

    fn of(broker: Child, community: Community) -> Self {
        let target = Self { broker, community };
        // What is there before an attack is there during it.
        let mut control = target.join("control");
        control.comms.notify("CONTROL", 0.0).unwrap();
        control.comms.flush().unwrap();
        target
    }

    fn join(&self, name: &str) -> Client {
        Client::over(self.link(name), name, &self.community)
    }

    /// The bare way to the broker, for a client that keeps to no rule.
    fn link(&self, name: &str) -> Link {
        once_served(&self.community, || shm::connect(&self.community, &Introduction::new(name))).unwrap()
    }

    /// Clients that are registered for everything, and read none of it.
    fn deaf_readers(&self, count: usize) -> Vec<Client> {
        self.deaf_readers_of(count, "*", 0.0)
    }

    fn deaf_readers_of(&self, count: usize, keys: &str, interval_secs: f64) -> Vec<Client> {
        let mut readers: Vec<Client> = (0..count).map(|i| self.join(&format!("reader-{i}"))).collect();
        for reader in &mut readers {
            reader.comms.register(any(keys).every(Duration::from_secs_f64(interval_secs))).unwrap();
            reader.comms.flush().unwrap();
        }
        readers
    }

    /// The most memory of its own that the broker has had (MB), once it still answers.
    fn survives(&self, what: &str) {
        let mut control = self.join("control");
        control.comms.register("CONTROL").unwrap();
        control.comms.notify("CONTROL", 1.0).unwrap();
        let (mut heard, patience) = (false, Patience::new());
        while !heard {
            control.receive(patience.left(what), |mail| heard |= mail.key() == "CONTROL").unwrap();
        }
        let status = std::fs::read_to_string(format!("/proc/{}/status", self.broker.id())).unwrap();
        let megabytes = |field: &str| {
            let kilobytes = status.lines().find_map(|line| line.strip_prefix(field)).unwrap();
            kilobytes.trim().trim_end_matches(" kB").parse::<f64>().unwrap() / 1e3
        };
        // The lanes to clients who do not read are full, and stay so.
        let (shared, own) = (megabytes("RssShmem:"), megabytes("RssAnon:"));
        let megabytes = own.max(megabytes("VmHWM:") - shared);
        println!("{what}: the broker had at most {megabytes:.0} MB, and {shared:.0} MB of lanes");
        assert!(megabytes <= BOUND_MB, "{what}: {megabytes} MB");
    }
}

impl Drop for Target {
    fn drop(&mut self) {
        let _ = rustix::process::kill_process(Pid::from_child(&self.broker), Signal::TERM);
        let _ = self.broker.wait();
    }
}

/// `little` in CI, `much` in a full attack.
fn amount(little: usize, much: usize) -> usize {
    if std::env::var_os("ELK_BOUNDS_FULL").is_some() { much } else { little }
}

/// Regression: 2.9 GB for a value of 1 GB.
#[test]
fn a_huge_value_whose_publisher_leaves_and_who_comes_late() {
    let target = Target::new("huge");
    let blob = Blob { bytes: vec![7; amount(300, 1000) << 20] };
    let mut publisher = target.join("publisher");
    publisher.comms.publish(&Key::<Blob>::new("BLOB"), &blob).unwrap();
    publisher.comms.flush().unwrap();
    let mut late = target.join("late");
    late.comms.register(&Key::<Blob>::new("BLOB")).unwrap();
    late.comms.flush().unwrap();
    let patience = Patience::new();
    while late.inbox.dropped() == 0 {
        patience.left("that it is too large to be copied, and counts as missed");
        late.receive(Duration::from_millis(50), |_| {}).unwrap();
    }
    drop(publisher);
    target.survives("a huge value");
}

/// Regression: 1.5 GB for 2,000 names.
#[test]
fn names_without_end() {
    let target = Target::new("names");
    let mut liar = target.link("liar");
    let mut batch = Vec::new();
    for number in 0..amount(2000, 20_000) as u32 {
        let name = format!("{number:0>65000}");
        wire::put_definition(&mut batch, Named::Key, number, &name, 0, "");
        let header = Header { key: number, value_kind: ValueKind::Double, ..Header::new(FrameKind::Notify) };
        wire::put(&mut batch, &header, &[], &[0; 8]);
        if batch.len() > 48 << 10 {
            liar.up.send(&batch).unwrap();
            batch.clear();
        }
    }
    target.survives("long names");

    let target = Target::new("variables");
    let _deaf = target.deaf_readers(amount(3, 8));
    let mut liar = target.join("liar");
    for number in 0..amount(150_000, 1_000_000) {
        liar.comms.notify(&format!("A_VARIABLE_WITH_A_NAME_OF_SOME_LENGTH_{number}"), number as f64).unwrap();
    }
    liar.comms.flush().unwrap();
    target.survives("variables without end, and readers that do not read");
}

#[test]
fn long_texts_and_many_refusals_for_readers_that_do_not_read() {
    let target = Target::new("texts");
    let _deaf = target.deaf_readers(amount(8, 24));
    // Texts that should have gone another way: in batches.
    let mut liar = target.link("liar");
    let mut batch = Vec::new();
    let text = vec![b'x'; 900 << 10];
    for round in 0..amount(60, 600) as u32 {
        batch.clear();
        if round < 50 {
            wire::put_definition(&mut batch, Named::Key, round, &format!("TEXT_{round}"), 0, "");
        }
        wire::put(&mut batch, &Header { key: round % 50, ..Header::new(FrameKind::Notify) }, &[], &text);
        liar.up.send(&batch).unwrap();
    }
    // And what is refused, over and over.
    let mut bore = target.join("bore");
    bore.comms.notify("NUMBER", 1.0).unwrap();
    for _ in 0..amount(100_000, 1_000_000) {
        bore.comms.notify("NUMBER", "text").unwrap();
    }
    bore.comms.flush().unwrap();
    target.survives("long texts and refusals");
}

/// Regression: a variable kept the room of its longest value up to 4 kB.
#[test]
fn variables_that_were_long_once() {
    let target = Target::new("long-once");
    let mut liar = target.join("liar");
    let text = "x".repeat(4000);
    for number in 0..amount(80_000, 110_000) {
        let name = format!("V{number}");
        liar.comms.notify(&name, &*text).unwrap();
        liar.comms.notify(&name, "x").unwrap();
    }
    liar.comms.flush().unwrap();
    target.survives("variables that were long once");
}

/// Regression: each reader with an interval had a copy of each value that was to wait.
#[test]
fn readers_with_an_interval() {
    let target = Target::new("interval");
    let _deaf = target.deaf_readers_of(amount(20, 90), "*", 1e6);
    let mut liar = target.link("liar");
    let text = vec![b'x'; 900 << 10];
    for round in 0..90_u32 {
        let mut batch = Vec::new();
        if round < 30 {
            wire::put_definition(&mut batch, Named::Key, round, &format!("TEXT_{round}"), 0, "");
        }
        wire::put(&mut batch, &Header { key: round % 30, ..Header::new(FrameKind::Notify) }, &[], &text);
        liar.up.send(&batch).unwrap();
    }
    target.survives("readers with an interval");
}

/// Regression: each reader that came late was given a copy, and if it read nothing, that stayed.
#[test]
fn late_readers_of_a_large_value() {
    let target = Target::new("late");
    let mut publisher = target.join("publisher");
    publisher.comms.publish(&Key::<Blob>::new("BLOB"), &Blob { bytes: vec![7; 40 << 20] }).unwrap();
    publisher.comms.flush().unwrap();
    let _deaf = target.deaf_readers_of(amount(8, 40), "BLOB", 0.0);
    target.survives("late readers of a large value");
}

/// Regression: so many readers of so many variables were counted by nobody.
#[test]
fn many_readers_of_many_variables() {
    let target = Target::new("crowd");
    let _deaf = target.deaf_readers(amount(80, 90));
    let mut liar = target.join("liar");
    for number in 0..amount(60_000, 110_000) {
        liar.comms.notify(&format!("V{number}"), number as f64).unwrap();
    }
    liar.comms.flush().unwrap();
    target.survives("many readers of many variables");
}

/// Regression: a client's numbers for one and the same name were counted by nobody.
#[test]
fn one_name_under_numbers_without_end() {
    let target = Target::new("numbers");
    let mut liar = target.link("liar");
    let mut batch = Vec::new();
    for number in 0..amount(2_000_000, 50_000_000) as u32 {
        wire::put_definition(&mut batch, Named::Key, number, "X", 0, "");
        if batch.len() > 48 << 10 {
            liar.up.send(&batch).unwrap();
            batch.clear();
        }
    }
    target.survives("one name under many numbers");
}

/// Gives signs of life for clients of MOOS', and takes what they are told.
fn keep_alive(clients: &mut [MoosClient]) {
    for client in clients {
        while client.receive(Duration::ZERO, |_| {}).unwrap() {}
    }
}

/// Regression: each client of MOOS' had all names that it had ever said for itself, those that the broker did not take among
/// them: 19 MB a client for those of variables alone.
#[test]
fn names_without_end_that_clients_of_moos_say() {
    let (target, address) = Target::with_moos("moos-says");
    let clients = 0..amount(20, 96);
    let connected = clients.map(|i| MoosClient::connect(address, &format!("liar-{i}"), Manner::Asynchronous).unwrap());
    let mut liars: Vec<MoosClient> = connected.collect();
    for number in 0..amount(26_000, 60_000) {
        let (key, community) = (format!("{number:0>250}"), format!("{number:x>250}"));
        for liar in &mut liars {
            let message = Message::new(Kind::NOTIFY, Data::DOUBLE);
            liar.say(&Message { key: key.as_bytes(), community: community.as_bytes(), time: 1.0, ..message });
        }
        if number % 100 == 0 {
            keep_alive(&mut liars);
        }
    }
    keep_alive(&mut liars);
    target.survives("names without end of MOOS' clients");
    keep_alive(&mut liars);
}

/// Regression: each client of MOOS' had all names that it had ever heard for itself, also when it had long stopped to hear them.
#[test]
fn names_without_end_that_clients_of_moos_hear() {
    let (target, address) = Target::with_moos("moos-hears");
    let mut liar = target.join("liar");
    for number in 0..50_000 {
        liar.comms.notify(&format!("{number:0>140}"), 1.0).unwrap();
    }
    liar.comms.flush().unwrap();
    let mut readers: Vec<MoosClient> = Vec::new();
    for i in 0..amount(30, 96) {
        let mut reader = MoosClient::connect(address, &format!("reader-{i}"), Manner::Asynchronous).unwrap();
        let pattern =
            Message { value: b"AppPattern=*,VarPattern=*,Interval=0", ..Message::new(Kind::NULL, Data::STRING) };
        reader.say(&Message { kind: Kind::WILDCARD_REGISTER, ..pattern });
        let (mut heard, patience) = (0, Patience::new());
        while heard < 50_000 {
            patience.left("that a reader hears all variables");
            let mut count = |message: &Message<'_>| heard += usize::from(message.key.len() == 140);
            reader.receive(Duration::from_millis(20), &mut count).unwrap();
        }
        reader.say(&Message { kind: Kind::WILDCARD_UNREGISTER, ..pattern });
        readers.push(reader);
        keep_alive(&mut readers);
    }
    target.survives("names without end for MOOS' clients");
    keep_alive(&mut readers);
}

#[test]
fn batches_that_are_none() {
    let target = Target::new("junk");
    for (number, junk) in [vec![0; 400], vec![255; 100_000], vec![1; 48]].into_iter().enumerate() {
        let mut liar = target.link(&format!("liar-{number}"));
        liar.up.send(&junk).unwrap();
        let patience = Patience::new();
        while liar.up.send(&junk).is_ok() {
            patience.left("that a client whose lane cannot be trusted is let go of");
        }
    }
    target.survives("junk");
}
