//! How fast a log is played and opened: `cargo bench -p elk-replay --bench replay -- [small bulk seek]`.
//!
//! `small` and `bulk` play a log at rate `max` onto a bus in shared memory; beside it, in the same run, a client says the
//! same without a log, and a replay waits for a reader. `seek` opens a log (of ELK_BENCH_GB gigabytes, 1 if not said) and jumps in it.

use std::path::Path;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::Duration;

use elk_bus::clock::Stopwatch;
use elk_bus::{BrokerConfig, Client, Clock, Community, Origin, TypeRef, ValueRef};
use elk_log::{Index, LogReader, LogWriter, Metadata, RecordRef, Selection};
use elk_replay::{Console, PlayOptions, Player, Press, Progress, Rate, Tape};

fn main() {
    let wanted: Vec<String> = std::env::args().skip(1).filter(|word| !word.starts_with("--")).collect();
    let run = |name: &str| wanted.is_empty() || wanted.iter().any(|word| word == name);
    if run("small") {
        play("64 B messages", "small", 2_000_000, 64);
    }
    if run("bulk") {
        play("1 MB values", "bulk", 1000, 1 << 20);
    }
    if run("seek") {
        seek();
    }
}

/// Nobody presses anything, nobody looks.
struct Nobody;

impl Console for Nobody {
    fn presses(&mut self) -> Vec<Press> {
        Vec::new()
    }
    fn show(&mut self, _: &Progress) {}
    fn tell(&mut self, _: &str) {}
    fn suspend(&mut self) {}
}

fn value(bytes: &[u8]) -> ValueRef<'_> {
    ValueRef::Binary { type_: TypeRef::undescribed("Bench", 1), bytes }
}

fn write(path: &Path, count: u64, bytes: usize) {
    let mut log = LogWriter::create(path, &Metadata::default()).expect("a log");
    let bytes = vec![7; bytes];
    for number in 0..count {
        let time = number as f64 * 1e-3;
        let record = RecordRef {
            key: "BENCH",
            source: "app",
            source_aux: "",
            community: "bench",
            time,
            sequence: number,
            received: time,
            order: number,
            epoch: 1,
            value: value(&bytes),
        };
        log.append(&record).expect("appended");
    }
    log.finish().expect("finished");
}

fn play(what: &str, name: &str, count: u64, bytes: usize) {
    let folder = tempfile::tempdir().expect("a folder");
    let path = folder.path().join("log.mcap");
    write(&path, count, bytes);
    let community = Community::new(format!("bench-{name}-{}", std::process::id())).expect("a name");
    let stop = Arc::new(AtomicBool::new(false));
    let (served, stopped) = (community.clone(), stop.clone());
    let broker = std::thread::spawn(move || {
        let config = BrokerConfig::new(served.as_str());
        elk_bus::serve_broker_until(served, config, Clock::new(1.0), &stopped).expect("a broker");
    });
    let mut client = loop {
        match Client::connect(&community, "player") {
            Ok(client) => break client,
            Err(_) => std::thread::sleep(Duration::from_millis(5)),
        }
    };
    let plain = vec![7; bytes];
    let clock = Stopwatch::start();
    for _ in 0..count {
        client
            .comms
            .publish_value("PLAIN", value(&plain), Origin { source: Some("app"), ..Origin::default() })
            .expect("published");
    }
    client.comms.flush().expect("flushed");
    let direct = clock.elapsed().as_secs_f64();
    let unread = play_onto(&mut client, &path, false);
    let (waited, heard) = with_a_reader(&community, || play_onto(&mut client, &path, true));
    let rates = |secs: f64| {
        let (messages, megabytes) = (count as f64 / secs / 1e3, count as f64 * bytes as f64 / secs / 1e6);
        format!("{messages:.0} k/s, {megabytes:.0} MB/s")
    };
    println!("{what}: played {}; said without a log {}", rates(unread), rates(direct));
    println!("{what}: played to a reader that is waited for {}; it heard {heard} of {count}", rates(waited));
    drop(client);
    stop.store(true, Ordering::Relaxed);
    broker.join().expect("a broker");
}

/// Plays a log; how long that took (s).
fn play_onto(client: &mut Client, path: &Path, lossless: bool) -> f64 {
    let (selection, remap) = (Selection::default(), Vec::new());
    let options = PlayOptions { rate: Rate::Max, selection, remap, repeat: false, lossless, clock: false };
    let tape = Tape::open(path, &mut |_, _| {}).expect("a log");
    let played = Player::new(tape, &options, client).play(&mut Nobody, &AtomicBool::new(false)).expect("played");
    played.took.as_secs_f64()
}

/// What `act` answers while somebody reads the log's variable, and how many messages that one heard.
fn with_a_reader<T>(community: &Community, act: impl FnOnce() -> T) -> (T, usize) {
    let (ready, registered) = std::sync::mpsc::channel();
    let over = AtomicBool::new(false);
    std::thread::scope(|scope| {
        let reader = scope.spawn(|| {
            let mut reader = Client::connect(community, "reader").expect("joined");
            reader.comms.register("BENCH").expect("registered");
            let mut hear = |millis| reader.receive(Duration::from_millis(millis), |_| {}).expect("received");
            // The latest value, which was said before.
            while hear(10) == 0 {}
            ready.send(()).expect("told");
            let mut heard = 0;
            loop {
                match hear(10) {
                    0 if over.load(Ordering::Relaxed) => return heard - reader.inbox.dropped() as usize,
                    some => heard += some,
                }
            }
        });
        registered.recv().expect("a reader");
        let answer = act();
        over.store(true, Ordering::Relaxed);
        (answer, reader.join().expect("a reader"))
    })
}

fn seek() {
    let gigabytes: u64 = std::env::var("ELK_BENCH_GB").ok().and_then(|text| text.parse().ok()).unwrap_or(1);
    let folder = tempfile::tempdir().expect("a folder");
    let path = folder.path().join("log.mcap");
    let count = gigabytes * 1_000_000_000 / 100_000;
    write(&path, count, 100_000);
    let clock = Stopwatch::start();
    let index = Index::read(&path, &mut |_, _| {}).expect("an index");
    let opened = clock.elapsed().as_secs_f64();
    let mut log = LogReader::open(&path).expect("a log");
    let clock = Stopwatch::start();
    let seconds = count as f64 * 1e-3;
    let targets = [0.9, 0.1, 0.5, 0.99, 0.3];
    for share in targets {
        log.seek(&index, seconds * share).expect("sought");
        assert!(log.next_ref().is_some(), "nothing at {share}");
    }
    let jump = clock.elapsed().as_secs_f64() / targets.len() as f64;
    let megabytes = index.bytes() as f64 / 1e6;
    println!(
        "a log of {megabytes:.0} MB: opened in {:.1} ms, a jump {:.1} ms, memory {} kB at most",
        opened * 1e3,
        jump * 1e3,
        peak_memory_kb()
    );
}

/// The most memory that the process has had resident (kB).
fn peak_memory_kb() -> u64 {
    let status = std::fs::read_to_string("/proc/self/status").unwrap_or_default();
    let line = status.lines().find_map(|line| line.strip_prefix("VmHWM:"));
    line.and_then(|line| line.trim().trim_end_matches(" kB").parse().ok()).unwrap_or(0)
}
