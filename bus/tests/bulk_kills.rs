//! A reader of bulk values that is killed and comes back after a while: what came meanwhile, and its mailbox has room for,
//! is its own, to the value, in order.
//!
//! `ELK_KILLS=40 cargo test --release -p elk-bus --test bulk_kills -- --nocapture` kills for longer.

mod common;

use std::path::{Path, PathBuf};
use std::process::{Child, Command, Stdio};
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::Duration;

use common::events::{Events, Patience, once_served};
use elk_bus::{
    App, AppError, BrokerConfig, Client, Clock, Comms, Community, Key, Mail, RunOptions, run_app, serve_broker,
};

/// Bytes of a value, and values a second of each publisher.
const BYTES: usize = 20_000;
const RATE_HZ: u64 = 100;
const PUBLISHERS: [&str; 2] = ["P1", "P2"];
/// The longest that the reader is away (s), and mailboxes with room for what comes meanwhile (bytes).
const AWAY_SECS: u64 = 5;
const MAILBOX_BYTES: usize = 64 << 20;

/// A numbered value.
#[elk_bus::payload]
#[derive(Debug)]
pub struct Parcel {
    /// From 1, without a gap.
    pub number: u64,
    /// Ballast.
    pub bytes: Vec<u8>,
}

fn key(name: &str) -> Key<Parcel> {
    Key::named(name.to_owned())
}

/// Writes down every number that it hears, and ends at the first that it misses.
struct Reader(PathBuf);

impl App for Reader {
    fn on_start_up(&mut self, comms: &mut Comms) -> Result<(), AppError> {
        PUBLISHERS.iter().try_for_each(|name| comms.register(&key(name)))?;
        Ok(())
    }

    fn on_new_mail(&mut self, comms: &mut Comms, mail: &Mail<'_>) -> Result<(), AppError> {
        let parcel = mail.decode(&key(mail.key()))?;
        assert_eq!(parcel.bytes, vec![parcel.number as u8; BYTES], "{} {}", mail.key(), parcel.number);
        let mut file = std::fs::OpenOptions::new().create(true).append(true).open(&self.0)?;
        let line = format!("{} {}\n", mail.key(), parcel.number);
        std::io::Write::write_all(&mut file, line.as_bytes())?;
        assert_eq!(comms.dropped(), 0);
        Ok(())
    }
}

const ROLE: &str = "ELK_BULK_ROLE";

/// Not a test by itself: the process of the broker or of the reader.
#[test]
fn role() {
    let Ok(said) = std::env::var(ROLE) else { return };
    let [role, community, record]: [&str; 3] = said.split(' ').collect::<Vec<_>>().try_into().unwrap();
    let community = Community::new(community).unwrap();
    if role == "broker" {
        let config = BrokerConfig::new(community.as_str()).with_mailbox_bytes(MAILBOX_BYTES);
        serve_broker(community, config, Clock::new(1.0)).unwrap();
    } else {
        let options = RunOptions::new("reader", community).as_launched().unwrap();
        run_app(Box::new(Reader(record.into())), &options).unwrap();
    }
}

/// A process, killed when it is dropped.
struct Role(Child);

impl Role {
    fn start(role: &str, community: &Community, record: &Path) -> Self {
        let mut command = Command::new(std::env::current_exe().unwrap());
        command.args(["--exact", "role"]).env("ELK_LEASE_SECS", "60").stdout(Stdio::null());
        command.env(ROLE, format!("{role} {community} {}", record.display()));
        Self(command.spawn().unwrap())
    }
}

impl Role {
    fn kill(&mut self) {
        let _ = self.0.kill();
        let _ = self.0.wait();
    }
}

impl Drop for Role {
    fn drop(&mut self) {
        self.kill();
    }
}

fn connect(community: &Community, name: &str) -> Client {
    once_served(community, || Client::connect(community, name)).unwrap()
}

/// Publishes 1, 2, 3, … until it is enough; the last number.
fn publish(community: &Community, name: &str, enough: &AtomicBool) -> u64 {
    let mut client = connect(community, name);
    let mut number = 0;
    while !enough.load(Ordering::Relaxed) {
        number += 1;
        let parcel = Parcel { number, bytes: vec![number as u8; BYTES] };
        client.comms.publish(&key(name), &parcel).unwrap();
        client.receive(Duration::from_micros(1_000_000 / RATE_HZ), |_| {}).unwrap();
    }
    // Who leaves takes its shared memory along: what was not read there is read first.
    let patience = Patience::new();
    while client.comms.unhandled_batches() > 0 {
        patience.left("that the broker has read everything");
        client.comms.notify("NUDGE", 1.0).unwrap();
        client.receive(Duration::from_millis(10), |_| {}).unwrap();
    }
    number
}

/// The numbers of a publisher that the reader has written down.
fn heard(record: &Path, name: &str) -> Vec<u64> {
    let text = std::fs::read_to_string(record).unwrap_or_default();
    text.lines().filter_map(|line| line.strip_prefix(name)?.trim().parse().ok()).collect()
}

#[test]
fn a_reader_that_is_killed_and_comes_back_misses_no_value_that_its_mailbox_has_room_for() {
    let kills = std::env::var("ELK_KILLS").ok().map_or(3, |kills| kills.parse::<u64>().expect("a whole number"));
    let community = Community::new(format!("bulk-kills-{}", std::process::id())).unwrap();
    let folder = tempfile::tempdir().unwrap();
    let record = folder.path().join("heard");
    let once = |what: &str, is_so: &dyn Fn() -> bool| Events::in_folders([folder.path()]).wait_until(what, is_so);
    let _broker = Role::start("broker", &community, &record);
    drop(connect(&community, "usher"));
    let mut reader = Role::start("reader", &community, &record);
    let enough = AtomicBool::new(false);
    let last: Vec<u64> = std::thread::scope(|scope| {
        let publishers = PUBLISHERS.map(|name| scope.spawn(|| publish(&community, name, &enough)));
        for kill in 0..kills {
            let before = heard(&record, PUBLISHERS[0]).len();
            once("more values", &|| heard(&record, PUBLISHERS[0]).len() >= before + 20);
            reader.kill();
            // How long nobody reads is the load; from not at all to as long as it may be.
            std::thread::sleep(Duration::from_millis(kill * 1700 % (1000 * AWAY_SECS)));
            reader = Role::start("reader", &community, &record);
        }
        enough.store(true, Ordering::Relaxed);
        publishers.map(|publisher| publisher.join().unwrap()).into()
    });
    for (name, last) in PUBLISHERS.iter().zip(last) {
        once("the last value", &|| heard(&record, name).last() == Some(&last));
        // The value in whose midst it was killed comes again: it may have been written down already.
        let mut numbers = heard(&record, name);
        let twice = numbers.windows(2).filter(|pair| pair[0] == pair[1]).count() as u64;
        assert!(twice <= kills, "{name}: {twice} values came twice, for {kills} kills");
        numbers.dedup();
        let first = numbers[0];
        assert!(numbers.iter().copied().eq(first..=last), "{name}: {numbers:?}");
        println!("{name}: {} values of {BYTES} bytes, {kills} kills, none lost", numbers.len());
    }
    drop(reader);
}
