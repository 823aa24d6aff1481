//! What logging costs: `cargo bench -p elk-logger --bench logging -- [small described bulk latency]`.
//!
//! `small`, `described` (64 B of numbers that describe themselves, and so are JSON in the log) and `bulk` hand messages to a logger on a bus in shared memory, whose publisher waits for it, with the disk's
//! own rate beside it; `latency` is one way from a publisher to a reader at 1 kHz, in turns with and without a logger.

use std::io::Write;
use std::path::Path;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, AtomicU64, Ordering};
use std::thread::JoinHandle;
use std::time::Duration;

use elk_bus::clock::{Stopwatch, monotonic_nanos, thread_cpu_secs};
use elk_bus::comms::CommsError;
use elk_bus::{
    App, AppError, BrokerConfig, Client, Clock, Comms, Community, Handled, Key, Mail, Origin, TypeRef, ValueRef,
    payload, run_app_on,
};
use elk_log::{Compression, Index, LogOptions, Metadata};
use elk_logger::{Logger, Recorder};

const SMALL: u64 = 2_000_000;
const BULK: u64 = 1000;
const BULK_BYTES: usize = 1 << 20;
const LATENCY_MESSAGES: u64 = 2000;
const TURNS: usize = 5;

fn main() {
    let wanted: Vec<String> = std::env::args().skip(1).filter(|word| !word.starts_with("--")).collect();
    let run = |name: &str| wanted.is_empty() || wanted.iter().any(|word| word == name);
    for compression in [Compression::None, Compression::Zstd] {
        if run("small") {
            let value = noise(64);
            flat_out("64 B messages", "small", SMALL, compression, |comms, _| publish_bytes(comms, &value));
        }
        if run("described") {
            let publish = |comms: &mut Comms, count: u64| {
                let numbers = [0.5, 0.25, 0.125, 8.0].map(|factor| count as f64 * factor);
                comms.publish(&ROW, &Row { numbers: numbers.into(), count, turn: 1.0, name: "row".into() })
            };
            flat_out(
                "described messages of 4 numbers, a count, a turn and a name",
                "described",
                SMALL,
                compression,
                publish,
            );
        }
        if run("bulk") {
            let value = noise(BULK_BYTES);
            flat_out("1 MB values", "bulk", BULK, compression, |comms, _| publish_bytes(comms, &value));
        }
    }
    if run("latency") {
        latency();
    }
}

/// What describes itself, of 64 bytes.
#[payload]
struct Row {
    /// Where.
    #[describe(unit = "m")]
    numbers: Vec<f64>,
    /// Which.
    count: u64,
    /// How far.
    #[describe(unit = "rad")]
    turn: f64,
    /// Whose.
    name: String,
}

const ROW: Key<Row> = Key::new("BENCH_ROW");

/// A broker on a thread of its own.
struct Broker {
    community: Community,
    stop: Arc<AtomicBool>,
    thread: Option<JoinHandle<()>>,
}

impl Broker {
    fn start(name: &str) -> Self {
        let community = Community::new(format!("bench-{name}-{}", std::process::id())).expect("a name");
        let stop = Arc::new(AtomicBool::new(false));
        let (served, stopped) = (community.clone(), stop.clone());
        let config = BrokerConfig::new(community.as_str());
        let thread = std::thread::spawn(move || {
            elk_bus::serve_broker_until(served, config, Clock::new(1.0), &stopped).expect("a broker");
        });
        Self { community, stop, thread: Some(thread) }
    }

    fn join(&self, name: &str) -> Client {
        loop {
            if let Ok(client) = Client::connect(&self.community, name) {
                return client;
            }
            std::thread::sleep(Duration::from_millis(5));
        }
    }
}

impl Drop for Broker {
    fn drop(&mut self) {
        self.stop.store(true, Ordering::Relaxed);
        let _ = self.thread.take().map(JoinHandle::join);
    }
}

/// A logger that says how far it is, and what its thread has used.
struct Counted {
    logger: Handled<Logger>,
    seen: Arc<AtomicU64>,
}

impl App for Counted {
    fn on_start_up(&mut self, comms: &mut Comms) -> Result<(), AppError> {
        self.logger.on_start_up(comms)
    }
    fn on_new_mail(&mut self, comms: &mut Comms, mail: &Mail<'_>) -> Result<(), AppError> {
        self.logger.on_new_mail(comms, mail)?;
        self.seen.store(self.logger.state.messages(), Ordering::Relaxed);
        Ok(())
    }
    fn tick_period(&self) -> Option<Duration> {
        self.logger.tick_period()
    }
    fn iterate(&mut self, comms: &mut Comms) -> Result<(), AppError> {
        self.logger.iterate(comms)
    }
    fn gathering(&self) -> Option<Duration> {
        self.logger.gathering()
    }
    fn on_stop(&mut self, comms: &mut Comms) -> Result<(), AppError> {
        self.logger.on_stop(comms)
    }
}

/// A logger of `BENCH*` on a thread, which has registered: it has got the first message, of the publisher's. Its end answers
/// the CPU that it took (s).
fn start_logger(
    broker: &Broker,
    publisher: &mut Client,
    path: &Path,
    compression: Compression,
) -> (Arc<AtomicBool>, Arc<AtomicU64>, JoinHandle<f64>) {
    let (stop, seen) = (Arc::new(AtomicBool::new(false)), Arc::new(AtomicU64::new(0)));
    let options = LogOptions { compression, ..LogOptions::default() };
    let recorder = Recorder::new(path.into(), Metadata::default()).with_options(options);
    let mut app = Counted { logger: Logger::of(recorder, vec!["BENCH*".into()]).on_the_bus(), seen: seen.clone() };
    let (stopped, community) = (stop.clone(), broker.community.clone());
    let thread = std::thread::spawn(move || {
        let mut client = Client::connect(&community, "logger").expect("a client");
        run_app_on(&mut app, &mut client, &stopped).expect("a logger");
        thread_cpu_secs()
    });
    publisher.comms.notify("BENCH_READY", 1.0).expect("published");
    publisher.comms.flush().expect("flushed");
    while seen.load(Ordering::Relaxed) == 0 {
        std::thread::sleep(Duration::from_millis(1));
    }
    (stop, seen, thread)
}

/// As hard to pack as coordinates are: three bytes of noise, and one that is nearly always the same.
fn noise(bytes: usize) -> Vec<u8> {
    let mut noise = 1_u32;
    (0..bytes)
        .map(|at| {
            noise = noise.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
            if at % 4 == 3 { 0x41 } else { (noise >> 24) as u8 }
        })
        .collect()
}

fn publish_bytes(comms: &mut Comms, bytes: &[u8]) -> Result<(), CommsError> {
    let value = ValueRef::Binary { type_: TypeRef::undescribed("Bench", 1), bytes };
    comms.publish_value("BENCH", value, Origin::default())
}

fn flat_out(
    what: &str,
    name: &str,
    count: u64,
    compression: Compression,
    publish: impl Fn(&mut Comms, u64) -> Result<(), CommsError>,
) {
    let folder = tempfile::tempdir().expect("a folder");
    let path = folder.path().join("log.mcap");
    let broker = Broker::start(&format!("{name}-{compression:?}"));
    let mut publisher = broker.join("publisher");
    let (stop, seen, logger) = start_logger(&broker, &mut publisher, &path, compression);
    let count = count + 1; // with the logger's first
    let clock = Stopwatch::start();
    for count in 1..count {
        publish(&mut publisher.comms, count).expect("published");
    }
    publisher.comms.flush().expect("flushed");
    while seen.load(Ordering::Relaxed) < count {
        std::thread::sleep(Duration::from_micros(200));
    }
    let secs = clock.elapsed().as_secs_f64();
    stop.store(true, Ordering::Relaxed);
    let cpu = logger.join().expect("a logger");
    let index = Index::read(&path, &mut |_, _| {}).expect("a log");
    let megabytes = index.bytes() as f64 / 1e6;
    let baseline = disk(folder.path(), index.bytes().min(1 << 30));
    println!(
        "{what}, {compression:?}: {:.0} k/s, {:.0} MB/s in the log; the logger's CPU {cpu:.2} s in {secs:.2} s ({:.0} k/s a core); \
         {} of {count} in the log, {} missing; a plain file takes {baseline:.0} MB/s",
        count as f64 / secs / 1e3,
        megabytes / secs,
        count as f64 / cpu / 1e3,
        index.messages(),
        index.dropped(),
    );
}

/// What the disk takes in pieces of 1 MB (MB/s).
fn disk(folder: &Path, bytes: u64) -> f64 {
    let piece = vec![1_u8; 1 << 20];
    let mut file = std::fs::File::create(folder.join("plain")).expect("a file");
    let clock = Stopwatch::start();
    let pieces = bytes.div_ceil(1 << 20);
    (0..pieces).for_each(|_| file.write_all(&piece).expect("written"));
    file.sync_data().expect("synced");
    pieces as f64 * 1.048_576 / clock.elapsed().as_secs_f64()
}

fn latency() {
    let mut spreads = [Vec::new(), Vec::new()];
    for turn in 0..2 * TURNS {
        spreads[turn % 2].push(one_way(turn));
    }
    let [without, with] = spreads.map(|turns| {
        [0, 1].map(|which: usize| {
            let mut all: Vec<f64> = turns.iter().map(|turn| turn[which]).collect();
            all.sort_by(f64::total_cmp);
            all[all.len() / 2]
        })
    });
    println!(
        "one way at 1 kHz, p50 / p99: {:.0} / {:.0} µs without a logger, {:.0} / {:.0} µs with one: {:.2} / {:.2}",
        without[0],
        without[1],
        with[0],
        with[1],
        with[0] / without[0],
        with[1] / without[1]
    );
}

/// Median and 99th percentile (µs).
fn one_way(turn: usize) -> [f64; 2] {
    let logged = turn % 2 == 1;
    let folder = tempfile::tempdir().expect("a folder");
    let broker = Broker::start(&format!("turn-{turn}"));
    let mut publisher = broker.join("publisher");
    let logger =
        logged.then(|| start_logger(&broker, &mut publisher, &folder.path().join("log.mcap"), Compression::Zstd));
    let community = broker.community.clone();
    let ready = Arc::new(AtomicBool::new(false));
    let listening = ready.clone();
    let reader = std::thread::spawn(move || {
        let mut reader = Client::connect(&community, "reader").expect("a client");
        reader.comms.register("BENCH").expect("registered");
        reader.comms.flush().expect("flushed");
        listening.store(true, Ordering::Relaxed);
        let mut micros = Vec::new();
        while (micros.len() as u64) < LATENCY_MESSAGES * 9 / 10 {
            let note = |mail: &Mail<'_>| {
                let sent = mail.as_text().and_then(|text| text.parse::<u64>().ok()).unwrap_or_default();
                micros.push((monotonic_nanos() - sent) as f64 / 1e3);
            };
            reader.receive(Duration::from_secs(1), note).expect("mail");
        }
        micros.sort_by(f64::total_cmp);
        [micros[micros.len() / 2], micros[micros.len() * 99 / 100]]
    });
    while !ready.load(Ordering::Relaxed) {
        std::thread::sleep(Duration::from_millis(1));
    }
    std::thread::sleep(Duration::from_millis(100));
    for _ in 0..LATENCY_MESSAGES {
        publisher.comms.notify("BENCH", monotonic_nanos().to_string()).expect("published");
        publisher.comms.flush().expect("flushed");
        std::thread::sleep(Duration::from_micros(1000));
    }
    let spread = reader.join().expect("a reader");
    if let Some((stop, _, thread)) = logger {
        stop.store(true, Ordering::Relaxed);
        thread.join().expect("a logger");
    }
    spread
}
