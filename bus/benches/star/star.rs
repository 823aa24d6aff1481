//! One turn: a publisher, what lies between, its readers, each a process of its own.

use std::path::PathBuf;
use std::time::Duration;

use crate::baselines::bare_iceoryx2;
use crate::cases::Bench;
use crate::children::Child;
use crate::load::{Load, setting};
use crate::report::Figures;
use crate::transport::BenchResult;
use crate::{moos, os};

/// How long a process may take to stand.
const STANDING: Duration = Duration::from_secs(20);

/// The way that messages take.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Way {
    /// Through elk's broker.
    Elk,
    /// Two hops over iceoryx2, a relay between.
    BareTwoHops,
    /// One hop over iceoryx2.
    BareDirect,
    /// One hop over an `AF_UNIX` stream.
    UnixStream,
    /// From a client of MOOS' to another, through elk's broker.
    Moos,
    /// From a client of elk's to one of MOOS', through elk's broker.
    ElkToMoos,
    /// Through elk's broker, where clients of MOOS' could come in and none has.
    ElkBesideMoos,
    /// From a client of MOOS' to another, through a MOOSDB.
    Moosdb,
}

impl Way {
    /// As tables name it.
    pub fn title(self) -> &'static str {
        match self {
            Way::Elk => "elk star",
            Way::BareTwoHops => "bare iceoryx2, two hops",
            Way::BareDirect => "bare iceoryx2, direct",
            Way::UnixStream => "AF_UNIX stream, one hop",
            Way::Moos => "MOOS → elk → MOOS",
            Way::ElkToMoos => "elk → elk → MOOS",
            Way::ElkBesideMoos => "elk star, idle gateway",
            Way::Moosdb => "MOOS → MOOSDB → MOOS",
        }
    }

    fn word(self) -> &'static str {
        match self {
            Way::Elk => "elk",
            Way::BareTwoHops => "relayed",
            Way::BareDirect => "direct",
            Way::UnixStream => "unix",
            Way::Moos | Way::Moosdb => "moos",
            Way::ElkToMoos => "elk-to-moos",
            Way::ElkBesideMoos => "elk",
        }
    }

    fn is_of_moos(self) -> bool {
        matches!(self, Way::Moos | Way::ElkToMoos | Way::ElkBesideMoos | Way::Moosdb)
    }

    fn is_of_elk(self) -> bool {
        self == Way::Elk || (self.is_of_moos() && self != Way::Moosdb)
    }

    /// What lies between publisher and readers.
    fn middle(self) -> Option<&'static str> {
        match self {
            Way::Elk => Some("broker"),
            Way::Moos | Way::ElkToMoos | Way::ElkBesideMoos => Some("gateway"),
            Way::Moosdb => Some("moosdb"),
            Way::BareTwoHops => Some("relay"),
            Way::BareDirect | Way::UnixStream => None,
        }
    }
}

/// A reader of a turn.
#[derive(Debug, Clone, Copy, Default)]
pub struct Reader {
    /// Whether the publisher waits for it.
    pub lossless: bool,
    /// How long it thinks about each message (µs).
    pub pause_micros: u64,
}

/// What a turn is made of.
#[derive(Debug, Clone)]
pub struct Turn {
    /// What is published.
    pub load: Load,
    /// Who reads.
    pub readers: Vec<Reader>,
    /// Whether to watch shared memory, which costs the machine some CPU.
    pub watch_memory: bool,
    /// Whether there is another client of MOOS', which registers and never reads.
    pub is_beside_deaf: bool,
}

impl Turn {
    /// The load, to so many readers alike.
    pub fn to_readers(load: Load, readers: usize) -> Self {
        let reader = Reader { lossless: load.lossless, pause_micros: 0 };
        Self { load, readers: vec![reader; readers], watch_memory: false, is_beside_deaf: false }
    }

    /// Plays the turn over a way; its figures.
    pub fn play(&self, bench: &Bench, way: Way) -> BenchResult<Figures> {
        let namespace = Namespace::new(bench, way)?;
        let mut players = self.players(bench, &namespace)?;
        let before = players.cpu_nanos()?;
        players.publisher.tell("GO")?;
        let mut shared = 0;
        let mut watch = || {
            if self.watch_memory {
                shared = shared.max(os::shared_bytes(&namespace.prefix()));
            }
        };
        let patience = self.patience();
        players.publisher.hear_while("DONE", patience, &mut watch)?;
        let heard = players.readers.iter().map(|r| r.hear_while("DONE", patience, &mut watch));
        let heard = heard.collect::<BenchResult<Vec<_>>>()?;
        let cpu = (players.cpu_nanos()? - before) as f64 * 1e-3 / self.load.total() as f64;
        let mut figures = figures(&heard)?;
        figures.insert("cpu", cpu);
        figures.insert("shared_mb", shared as f64 * 1e-6);
        if let Some(middle) = &players.middle {
            figures.insert("rss_mb", os::memory_mb(middle.id(), "VmHWM")?);
        }
        drop(players);
        namespace.check_left()?;
        Ok(figures)
    }

    /// Everybody in place, the publisher last.
    fn players(&self, bench: &Bench, namespace: &Namespace) -> BenchResult<Players> {
        let start = |role: &str, load: Load, more: Vec<String>| {
            let mut words = vec![role.to_owned(), namespace.way.word().to_owned(), namespace.name.clone()];
            words.extend(load.to_words());
            words.extend(more);
            Child::start(&bench.stop, &words)
        };
        let middle = namespace.way.middle().map(|role| start(role, self.load, vec![])).transpose()?;
        if let Some(relay) = middle.as_ref().filter(|_| namespace.way == Way::BareTwoHops) {
            relay.hear("READY", STANDING)?;
        }
        if namespace.way == Way::Moosdb {
            moos::await_server(&namespace.name, STANDING)?;
        }
        let mut readers = Vec::new();
        for (number, reader) in self.readers.iter().enumerate() {
            let load = Load { lossless: reader.lossless, ..self.load };
            // Only elk lets each reader choose; elsewhere the service is what it was made as.
            let load = if namespace.way.is_of_elk() { load } else { self.load };
            let more = vec![format!("reader={number}"), format!("pause_micros={}", reader.pause_micros)];
            readers.push(start("read", load, more)?);
        }
        readers.iter().try_for_each(|r| r.hear("READY", STANDING).map(|_| ()))?;
        let publisher = start("publish", self.load, vec![format!("readers={}", readers.len())])?;
        publisher.hear("READY", STANDING)?;
        let seconds = self.patience().as_secs();
        let deaf =
            self.is_beside_deaf.then(|| start("deaf", self.load, vec![format!("seconds={seconds}")])).transpose()?;
        deaf.iter().try_for_each(|one| one.hear("READY", STANDING).map(|_| ()))?;
        Ok(Players { publisher, readers, _deaf: deaf, middle })
    }

    /// Far longer than any machine needs.
    fn patience(&self) -> Duration {
        let bursts = self.load.total() / self.load.burst.max(1);
        let pauses = self.readers.iter().map(|r| r.pause_micros).max().unwrap_or(0) * self.load.total();
        Duration::from_secs(60) + 2 * Duration::from_nanos(self.load.period_nanos * bursts + pauses * 1000)
    }
}

/// Dropped in this order: who is in the middle leaves last.
struct Players {
    publisher: Child,
    readers: Vec<Child>,
    _deaf: Option<Child>,
    middle: Option<Child>,
}

impl Players {
    fn cpu_nanos(&self) -> BenchResult<u64> {
        let all = self.readers.iter().chain(&self.middle).chain([&self.publisher]);
        all.map(|child| os::cpu_nanos(child.id())).sum()
    }
}

/// Over several readers: the median of their p50, the rate of the fastest, the worst of everything else.
fn figures(heard: &[Vec<String>]) -> BenchResult<Figures> {
    let all = |name: &str| -> BenchResult<Vec<f64>> {
        let mut values = heard.iter().map(|words| setting(words, name)).collect::<BenchResult<Vec<f64>>>()?;
        values.sort_by(f64::total_cmp);
        Ok(values)
    };
    if all("damaged")?.iter().any(|damaged| *damaged > 0.0) {
        return Err("messages arrived damaged or out of order".into());
    }
    let mut figures = Figures::new();
    figures.insert("p50", crate::report::median(&all("p50")?));
    for name in ["p99", "max", "lost", "dropped", "rate"] {
        figures.insert(name, all(name)?.last().copied().unwrap_or(0.0));
    }
    Ok(figures)
}

/// The namespace of a turn: a name of its own, whose files are gone afterwards.
pub struct Namespace {
    /// The name.
    pub name: String,
    way: Way,
}

impl Namespace {
    /// A namespace that no other run uses.
    pub fn new(bench: &Bench, way: Way) -> BenchResult<Self> {
        let name = format!("star-{}-{}", std::process::id(), bench.next_turn());
        // Where clients of MOOS' connect, the name says.
        let name = if way.is_of_moos() { format!("{name}-{}", moos::free_port()?) } else { name };
        Ok(Self { name, way })
    }

    fn prefix(&self) -> String {
        if self.way.is_of_elk() { format!("elk_{}=", self.name) } else { bare_iceoryx2::prefix(&self.name) }
    }

    fn folder(&self) -> PathBuf {
        if self.way.is_of_elk() {
            let user = rustix::process::geteuid().as_raw();
            std::env::temp_dir().join(format!("elk-{user}")).join(&self.name)
        } else {
            bare_iceoryx2::root(&self.name)
        }
    }

    /// The bus clears up behind itself; the baselines, killed as they are, cannot.
    pub fn check_left(&self) -> BenchResult {
        let left = if self.way.is_of_elk() { os::shared_files(&self.prefix()) } else { vec![] };
        if left.is_empty() { Ok(()) } else { Err(format!("left in shared memory: {left:?}").into()) }
    }
}

impl Drop for Namespace {
    fn drop(&mut self) {
        os::remove(&self.prefix(), &self.folder());
    }
}
