//! What is measured, beside what, and what is wanted.

use std::cell::Cell;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::Duration;

use elk_bus::clock::Stopwatch;

use crate::children::Child;
use crate::load::{Load, setting};
use crate::report::{self, Column, Figures, Row, Wanted, column};
use crate::star::{Namespace, Reader, Turn, Way};
use crate::transport::BenchResult;
use crate::{moos, os};

/// How a run is measured.
pub struct Bench {
    /// Set on SIGINT and SIGTERM.
    pub stop: Arc<AtomicBool>,
    quick: bool,
    turns: Cell<u64>,
}

impl Bench {
    /// A run; a quick one shows that everything works, and little more.
    pub fn new(quick: bool) -> BenchResult<Self> {
        Ok(Self { stop: elk_bus::stop_on_signals()?, quick, turns: Cell::new(0) })
    }

    /// A number that no other turn of this run has.
    pub fn next_turn(&self) -> u64 {
        self.turns.set(self.turns.get() + 1);
        self.turns.get()
    }

    fn repetitions(&self, full: usize) -> usize {
        if self.quick { 1 } else { full }
    }

    /// How much of a full measurement's length this run takes.
    fn share(&self, full: u64) -> u64 {
        if self.quick { full.div_ceil(6) } else { full }
    }
}

/// A measurement.
pub struct Case {
    /// As the command line names it.
    pub name: &'static str,
    /// What it measures.
    pub what: &'static str,
    /// Measures and prints.
    pub run: fn(&Bench) -> BenchResult,
}

const fn case(name: &'static str, what: &'static str, run: fn(&Bench) -> BenchResult) -> Case {
    Case { name, what, run }
}

/// Turns of a latency: many short ones, for where the scheduler puts the processes holds for a turn, and decides it.
const TURNS: usize = 9;

/// All measurements.
pub const CASES: &[Case] = &[
    case("latency-1khz", "one-way A → broker → B, 64 B at 1 kHz", |b| latency(b, 1000)),
    case("latency-100hz", "one-way A → broker → B, 64 B at 100 Hz", |b| latency(b, 100)),
    case("fan-out", "one-way 1 → 4, 64 B at 1 kHz", fan_out),
    case("flat-out", "64 B as fast as it goes, nothing lost", flat_out),
    case("bursts", "64 B at 200 k/s in bursts each millisecond", bursts),
    case("bulk", "1 MB at 30 Hz, every byte read", bulk),
    case("cpu", "CPU of all processes per message at 1 kHz", cpu),
    case("memory", "shared memory under scans of 2.4 MB, one slow reader", memory),
    case("keys", "10,000 variables, 20 clients", keys),
    case("idle", "eight apps with nothing to do", idle),
    case("moos-1khz", "one-way from a client of MOOS' and to one, 64 B at 1 kHz", moos_latency),
    case("moos-idle", "the bus itself, 64 B at 1 kHz, with and without a gateway for MOOS' clients", moos_idle),
    case("moos-flat-out", "the same as fast as it goes", moos_flat_out),
    case("moos-bulk", "the same, 1 MB at 30 Hz, every byte read", moos_bulk),
    case("moos-connect", "100 clients of MOOS' connect, and one again and again", moos_connect),
    case("moos-deaf", "1 MB at 35 Hz to a reader, beside one that never reads", moos_deaf),
];

/// From MOOS to MOOS, and from elk to MOOS, beside the bus itself; and through a MOOSDB, if there is one.
fn of_moos(beside_moosdb: Wanted) -> Vec<(Way, Wanted)> {
    let ways = [(Way::Moos, Wanted::Nothing), (Way::ElkToMoos, Wanted::Nothing), (Way::Elk, Wanted::Nothing)];
    ways.into_iter().chain(moos::moosdb().map(|_| (Way::Moosdb, beside_moosdb))).collect()
}

const SMALL: usize = 64;
const MILLISECOND: u64 = 1_000_000;
const LATENCY: [Column; 5] = [
    column("p50", "p50 µs", 1),
    column("p99", "p99 µs", 1),
    column("max", "max µs", 0),
    column("lost", "lost", 0),
    column("cpu", "CPU µs/msg", 1),
];

const FLAT_OUT: [Column; 6] = [
    column("rate", "messages/s", 0),
    column("lost", "lost", 0),
    column("rss_mb", "broker MB", 1),
    column("p50", "p50 µs", 0),
    column("p99", "p99 µs", 0),
    column("cpu", "CPU µs/msg", 3),
];

/// Lets the ways take turns, so that all see the same machine.
fn compare(bench: &Bench, repetitions: usize, turn: &Turn, ways: &[(Way, Wanted)]) -> BenchResult<Vec<Row>> {
    let mut rows: Vec<Row> = ways.iter().map(|(way, wanted)| Row::new(way.title(), *wanted)).collect();
    for _ in 0..bench.repetitions(repetitions) {
        for (row, (way, _)) in rows.iter_mut().zip(ways) {
            row.turns.push(turn.play(bench, *way)?);
        }
    }
    Ok(rows)
}

fn latency(bench: &Bench, hertz: u64) -> BenchResult {
    let load = Load::paced(SMALL, 1_000_000_000 / hertz, bench.share(3 * hertz / 2));
    let ways = [
        (Way::Elk, Wanted::Nothing),
        (Way::BareTwoHops, Wanted::RatioAtMost(0.6)),
        (Way::UnixStream, Wanted::RatioAtMost(2.2)),
    ];
    let rows = compare(bench, TURNS, &Turn::to_readers(load, 1), &ways)?;
    report::print(&format!("One-way, 64 B, {hertz} Hz, {} messages a turn", load.messages), &LATENCY, &rows);
    Ok(())
}

fn fan_out(bench: &Bench) -> BenchResult {
    let load = Load::paced(SMALL, MILLISECOND, bench.share(3000));
    let ways =
        [(Way::Elk, Wanted::Nothing), (Way::BareTwoHops, Wanted::RatioAtMost(1.0)), (Way::UnixStream, Wanted::Nothing)];
    let rows = compare(bench, TURNS, &Turn::to_readers(load, 4), &ways)?;
    report::print("One-way 1 → 4, 64 B, 1 kHz: median p50, worst p99", &LATENCY, &rows);
    Ok(())
}

fn flat_out(bench: &Bench) -> BenchResult {
    let load = Load::flat_out(SMALL, bench.share(6_000_000));
    let [single, batched] = [load, Load { batch: 150, ..load }];
    let (mut elk, mut bare, mut bare_batched) = (
        Row::new(Way::Elk.title(), Wanted::AtLeast(5e6)),
        Row::new("bare two hops, one by one", Wanted::Nothing),
        Row::new("bare two hops, 150 a batch", Wanted::Nothing),
    );
    for _ in 0..bench.repetitions(5) {
        elk.turns.push(Turn::to_readers(load, 1).play(bench, Way::Elk)?);
        bare.turns.push(Turn::to_readers(single, 1).play(bench, Way::BareTwoHops)?);
        bare_batched.turns.push(Turn::to_readers(batched, 1).play(bench, Way::BareTwoHops)?);
    }
    let title = format!("64 B, 1 → 1, flat out, lossless, {} messages a turn", load.messages);
    report::print(&title, &FLAT_OUT, &[elk, bare, bare_batched]);
    Ok(())
}

fn bursts(bench: &Bench) -> BenchResult {
    let columns = [
        column("p99", "p99 µs", 0),
        column("p50", "p50 µs", 0),
        column("max", "max µs", 0),
        column("lost", "lost", 0),
        column("rate", "messages/s", 0),
    ];
    let load = Load { burst: 200, warm_up: 4000, ..Load::paced(SMALL, MILLISECOND, bench.share(400_000)) };
    let ways = [(Way::Elk, Wanted::AtMost(200.0)), (Way::BareTwoHops, Wanted::Nothing)];
    let rows = compare(bench, 5, &Turn::to_readers(load, 1), &ways)?;
    report::print("64 B, 200 messages each millisecond", &columns, &rows);
    Ok(())
}

fn bulk(bench: &Bench) -> BenchResult {
    let load = Load::paced(1 << 20, 33_333_333, bench.share(90));
    let ways =
        [(Way::Elk, Wanted::Nothing), (Way::BareDirect, Wanted::RatioAtMost(1.1)), (Way::BareTwoHops, Wanted::Nothing)];
    let rows = compare(bench, 5, &Turn::to_readers(load, 1), &ways)?;
    report::print("1 MB at 30 Hz, copied in once, every byte read", &LATENCY, &rows);
    Ok(())
}

fn cpu(bench: &Bench) -> BenchResult {
    let columns = [column("cpu", "CPU µs/msg", 1), column("p50", "p50 µs", 1)];
    let load = Load::paced(SMALL, MILLISECOND, bench.share(3000));
    let ways = [
        // Where the two hops take 90, 75 are wanted.
        (Way::Elk, Wanted::Nothing),
        (Way::BareTwoHops, Wanted::RatioAtMost(75.0 / 90.0)),
    ];
    let mut rows = compare(bench, 5, &Turn::to_readers(load, 1), &ways)?;
    let mut timer = Row::new("an empty 1 kHz timer", Wanted::Nothing);
    for _ in 0..bench.repetitions(5) {
        timer.turns.push(empty_timer(bench, load)?);
    }
    rows.push(timer);
    report::print("CPU of all processes per message, 64 B at 1 kHz", &columns, &rows);
    Ok(())
}

fn empty_timer(bench: &Bench, load: Load) -> BenchResult<Figures> {
    let mut words = vec!["timer".to_owned(), "none".to_owned(), "nowhere".to_owned()];
    words.extend(load.to_words());
    let mut timer = Child::start(&bench.stop, &words)?;
    timer.hear("READY", Duration::from_secs(10))?;
    let before = os::cpu_nanos(timer.id())?;
    timer.tell("GO")?;
    timer.hear("DONE", Duration::from_secs(60))?;
    let nanos = os::cpu_nanos(timer.id())? - before;
    Ok(Figures::from([("cpu", nanos as f64 * 1e-3 / load.total() as f64)]))
}

fn memory(bench: &Bench) -> BenchResult {
    let columns = [
        column("shared_mb", "peak MB", 1),
        column("rate", "scans/s", 0),
        column("lost", "lost, worst", 0),
        column("dropped", "counted", 0),
        column("rss_mb", "broker MB", 1),
    ];
    let load = Load { lossless: false, ..Load::flat_out(2_400_000, bench.share(10_000)) };
    let [prompt, lossless, slow] =
        [(false, 0), (true, 0), (false, 5000)].map(|(lossless, pause_micros)| Reader { lossless, pause_micros });
    let readers = vec![prompt, lossless, slow];
    let turn = Turn { load, readers, watch_memory: true, is_beside_deaf: false };
    let ways = [(Way::Elk, Wanted::AtMost(100.0)), (Way::BareDirect, Wanted::Nothing)];
    let rows = compare(bench, 1, &turn, &ways)?;
    let title =
        format!("Shared memory after {} scans of 2.4 MB; readers: prompt, lossless, 5 ms a scan", load.messages);
    report::print(&title, &columns, &rows);
    Ok(())
}

/// A broker and so many clients in a role of their own.
struct Community {
    clients: Vec<Child>,
    broker: Child,
    namespace: Namespace,
}

impl Community {
    fn start(bench: &Bench, role: &str, clients: usize, settings: &[String]) -> BenchResult<Self> {
        let namespace = Namespace::new(bench, Way::Elk)?;
        let start = |role: &str, more: &[String]| {
            let words = [role.to_owned(), "elk".into(), namespace.name.clone()];
            Child::start(&bench.stop, &[words.as_slice(), more, settings].concat())
        };
        let broker = start("broker", &[])?;
        let clients = (0..clients).map(|n| start(role, &[format!("client={n}")])).collect::<BenchResult<Vec<_>>>()?;
        clients.iter().try_for_each(|c| c.hear("READY", Duration::from_secs(60)).map(|_| ()))?;
        Ok(Self { clients, broker, namespace })
    }

    fn cpu_nanos(&self) -> BenchResult<u64> {
        self.clients.iter().chain([&self.broker]).map(|child| os::cpu_nanos(child.id())).sum()
    }

    fn end(self) -> BenchResult {
        let Self { clients, broker, namespace } = self;
        drop(clients);
        drop(broker);
        namespace.check_left()
    }
}

fn keys(bench: &Bench) -> BenchResult {
    const CLIENTS: usize = 20;
    const KEYS: usize = 10_000;
    let settings = [format!("share={}", KEYS / CLIENTS), format!("all={KEYS}")];
    let mut rows = [
        ("one registers for all", "seconds", 3, Wanted::AtMost(1.0)),
        ("the other 19 at once", "seconds", 3, Wanted::Nothing),
        ("broker, peak", "MB", 1, Wanted::AtMost(100.0)),
        ("broker", "descriptors", 0, Wanted::AtMost(400.0)),
    ]
    .map(|(title, unit, digits, wanted)| (Row::new(title, wanted), column("figure", unit, digits)));
    for _ in 0..bench.repetitions(5) {
        let mut community = Community::start(bench, "keys", CLIENTS, &settings)?;
        let broker = community.broker.id();
        let (first, others) = community.clients.split_at_mut(1);
        let figures = [
            registered_after(first)?,
            registered_after(others)?,
            os::memory_mb(broker, "VmHWM")?,
            os::descriptors(broker)? as f64,
        ];
        rows.iter_mut().zip(figures).for_each(|((row, _), figure)| row.turns.push(Figures::from([("figure", figure)])));
        community.end()?;
    }
    report::list("10,000 variables, 20 clients, registered for by wildcard", &rows);
    Ok(())
}

/// Has clients register for everything at once; how long the slowest took (s).
fn registered_after(clients: &mut [Child]) -> BenchResult<f64> {
    clients.iter_mut().try_for_each(|client| client.tell("GO"))?;
    let seconds = clients.iter().map(|c| setting::<f64>(&c.hear("DONE", Duration::from_secs(60))?, "seconds"));
    Ok(seconds.collect::<BenchResult<Vec<_>>>()?.into_iter().fold(0.0, f64::max))
}

fn idle(bench: &Bench) -> BenchResult {
    const APPS: usize = 8;
    let community = Community::start(bench, "idle", APPS, &[])?;
    let nap = |seconds: u64| {
        let waited = Stopwatch::start();
        while waited.elapsed() < Duration::from_secs(seconds) && !bench.stop.load(Ordering::Relaxed) {
            std::thread::sleep(Duration::from_millis(250));
        }
    };
    nap(1);
    let seconds = bench.share(10);
    let before = community.cpu_nanos()?;
    nap(seconds);
    let percent = (community.cpu_nanos()? - before) as f64 * 1e-9 / seconds as f64 * 100.0;
    community.end()?;
    let mut row = Row::new("all processes", Wanted::AtMost(1.0));
    row.turns.push(Figures::from([("percent", percent)]));
    report::print(
        &format!("Eight idle apps and their broker, {seconds} s"),
        &[column("percent", "% of a core", 3)],
        &[row],
    );
    Ok(())
}

fn moos_latency(bench: &Bench) -> BenchResult {
    let load = Load::paced(SMALL, MILLISECOND, bench.share(1500));
    let rows = compare(bench, TURNS, &Turn::to_readers(load, 1), &of_moos(Wanted::RatioAtMost(0.7)))?;
    report::print("One-way, 64 B, 1 kHz, with clients of MOOS'", &LATENCY, &rows);
    Ok(())
}

fn moos_idle(bench: &Bench) -> BenchResult {
    let load = Load::paced(SMALL, MILLISECOND, bench.share(1500));
    let ways = [(Way::ElkBesideMoos, Wanted::Nothing), (Way::Elk, Wanted::RatioAtMost(1.05))];
    let rows = compare(bench, 2 * TURNS, &Turn::to_readers(load, 1), &ways)?;
    report::print("One-way, 64 B, 1 kHz, beside a gateway that nobody uses", &LATENCY, &rows);
    Ok(())
}

fn moos_flat_out(bench: &Bench) -> BenchResult {
    let load = Load::flat_out(SMALL, bench.share(6_000_000));
    let rows = compare(bench, 5, &Turn::to_readers(load, 1), &of_moos(Wanted::Nothing))?;
    let title = format!("64 B, 1 → 1, flat out, {} messages a turn, with clients of MOOS'", load.messages);
    report::print(&title, &FLAT_OUT, &rows);
    Ok(())
}

fn moos_bulk(bench: &Bench) -> BenchResult {
    let load = Load::paced(1_000_000, 33_333_333, bench.share(90));
    let rows = compare(bench, 5, &Turn::to_readers(load, 1), &of_moos(Wanted::Nothing))?;
    report::print("1 MB at 30 Hz, every byte read, with clients of MOOS'", &LATENCY, &rows);
    Ok(())
}

fn moos_connect(bench: &Bench) -> BenchResult {
    const CLIENTS: usize = 100;
    let reconnects = bench.share(1000) as usize;
    let [mut all, mut again] = [Wanted::AtMost(0.5), Wanted::Nothing].map(|wanted| Row::new("", wanted));
    for _ in 0..bench.repetitions(5) {
        let namespace = Namespace::new(bench, Way::Moos)?;
        let broker = Child::start(&bench.stop, &["gateway".into(), "moos".into(), namespace.name.clone()])?;
        let (connected, reconnected) = moos::connect(&namespace.name, CLIENTS, reconnects)?;
        drop(broker);
        namespace.check_left()?;
        all.turns.push(Figures::from([("seconds", connected)]));
        again.turns.push(Figures::from([("each", reconnected * 1e3 / reconnects as f64)]));
    }
    let rows = [
        (all, column("seconds", "100 clients at once, s", 3)),
        (again, column("each", "under one name again, ms each", 3)),
    ];
    report::list(&format!("Clients of MOOS' connect; {reconnects} times under one name, all welcomed"), &rows);
    Ok(())
}

fn moos_deaf(bench: &Bench) -> BenchResult {
    let columns = [
        column("p50", "p50 µs", 1),
        column("p99", "p99 µs", 1),
        column("lost", "lost", 0),
        column("rss_mb", "broker MB", 1),
    ];
    let load = Load::paced(1_000_000, 28_571_428, bench.share(35 * 60));
    let [mut with, mut without] = ["beside a deaf one", "alone"].map(|title| Row::new(title, Wanted::Nothing));
    let turn = Turn::to_readers(load, 1);
    without.turns.push(turn.play(bench, Way::Moos)?);
    with.turns.push(Turn { is_beside_deaf: true, ..turn }.play(bench, Way::Moos)?);
    report::print("1 MB at 35 Hz, MOOS → elk → MOOS, and a client that never reads", &columns, &[with, without]);
    Ok(())
}
