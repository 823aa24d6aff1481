//! One turn: broker, publisher, two readers, a scope or nobody, and what came of it.

use std::fmt;

use elk_bus::Community;
use elk_bus::clock::Stopwatch;
use elk_scope::Scope;

use crate::BenchResult;
use crate::children::Child;

const READERS: [&str; 2] = ["reader-0", "reader-1"];

/// What the publisher says.
#[derive(Debug, Clone, Copy)]
pub struct Load {
    /// Messages in all.
    pub messages: u64,
    /// Messages a second; 0: as many as the readers take.
    pub per_second: u64,
    /// Messages that leave together.
    pub burst: u64,
}

impl Load {
    /// 100,000 messages a second.
    pub fn paced(seconds: f64) -> Self {
        Self { messages: (100_000.0 * seconds) as u64, per_second: 100_000, burst: 10 }
    }

    /// As many as the readers take.
    pub fn flat_out(seconds: f64) -> Self {
        Self { messages: (400_000.0 * seconds) as u64, per_second: 0, burst: 100 }
    }

    /// The load from a role's arguments.
    pub fn from_words(words: &[String]) -> BenchResult<Self> {
        let [messages, per_second, burst, ..] = words else { return Err("a load has three numbers".into()) };
        Ok(Self { messages: messages.parse()?, per_second: per_second.parse()?, burst: burst.parse()? })
    }
}

impl fmt::Display for Load {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self.per_second {
            0 => write!(f, "{} messages, as fast as the readers take them, {} at a time", self.messages, self.burst),
            rate => write!(f, "{} messages, {rate} a second, {} at a time", self.messages, self.burst),
        }
    }
}

/// What came of a turn.
#[derive(Debug, Clone, Copy)]
pub struct Turn {
    /// Messages that a reader got a second, the mean of both.
    pub rate: f64,
    /// Time from publisher to reader (µs).
    pub p50_micros: f64,
    /// Time that one message in a hundred exceeded (µs).
    pub p99_micros: f64,
    /// Processors that the broker used.
    pub broker_cpu: f64,
    /// Processors that the scope used.
    pub scope_cpu: f64,
    /// Bytes a second that the scope wrote.
    pub scope_output: f64,
}

/// Takes a turn with this scope.
pub fn take(scope: &str, load: &Load) -> BenchResult<Turn> {
    let community = Community::new(format!("overhead-{}", std::process::id()))?;
    let name = community.as_str();
    let [messages, per_second, burst] = [load.messages, load.per_second, load.burst].map(|n| n.to_string());
    let broker = Child::start(&["broker", name])?;
    let mut publisher = Child::start(&["publish", name, &messages, &per_second, &burst])?;
    publisher.hear()?;
    let mut readers = Vec::new();
    for reader in READERS {
        let mut child = Child::start(&["read", name, &messages, &per_second, &burst, reader])?;
        child.hear()?;
        readers.push(child);
    }
    let mut looking = match scope {
        "nobody" => None,
        scope => Some(Child::start(&[scope, name])?),
    };
    if let Some(child) = &mut looking {
        child.drain()?;
    }
    wait_until_there(&community, scope)?;
    let cpu = |child: Option<&Child>| child.map_or(Ok(0.0), Child::cpu_secs);
    let before = (broker.cpu_secs()?, cpu(looking.as_ref())?, looking.as_ref().map_or(0, Child::output));
    let clock = Stopwatch::start();
    publisher.tell("go")?;
    let heard = readers.iter_mut().map(Child::hear).collect::<BenchResult<Vec<String>>>()?;
    let seconds = clock.elapsed().as_secs_f64();
    let mut mean = [0.0; 3];
    for line in &heard {
        for (sum, figure) in mean.iter_mut().zip(line.split(' ')) {
            *sum += figure.parse::<f64>()? / heard.len() as f64;
        }
    }
    Ok(Turn {
        rate: mean[0],
        p50_micros: mean[1],
        p99_micros: mean[2],
        broker_cpu: (broker.cpu_secs()? - before.0) / seconds,
        scope_cpu: (cpu(looking.as_ref())? - before.1) / seconds,
        scope_output: (looking.as_ref().map_or(0, Child::output) - before.2) as f64 / seconds,
    })
}

/// Waits until everybody is registered that the turn needs.
fn wait_until_there(community: &Community, scope: &str) -> BenchResult {
    let mut asker = Scope::join(community, "asker")?;
    loop {
        let table = asker.table()?;
        let registered = |name: &str| {
            let client = table.clients.iter().find(|client| client.name.starts_with(name));
            client.is_some_and(|client| name == "top" || !client.registrations.is_empty())
        };
        if READERS.iter().chain([&scope]).all(|name| *name == "nobody" || registered(name)) {
            return Ok(());
        }
    }
}
