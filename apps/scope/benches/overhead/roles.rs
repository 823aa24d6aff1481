//! What a process of a measurement does: `--role ROLE COMMUNITY [LOAD…]`.

use std::io::BufWriter;
use std::time::Duration;

use elk_bus::clock::{Stopwatch, monotonic_nanos};
use elk_bus::{BrokerConfig, Client, Clock, Community, ConnectError, any, serve_broker, stop_on_signals};
use elk_scope::{Echo, Output, Pattern, Quantity, Rates, Scope, ScopeError, Screen, Top, yield_to_others};
use rustix::process::{Signal, set_parent_process_death_signal};
use rustix::thread::{ClockId, clock_nanosleep_absolute};
use rustix::time::Timespec;

use crate::BenchResult;
use crate::turn::Load;

/// The variable that is published.
const KEY: &str = "LOAD";
/// A reader that hears nothing for so long, once it has heard anything, has heard all.
const SILENCE: Duration = Duration::from_millis(500);
const PATIENCE: Duration = Duration::from_secs(10);

/// Plays the role that the arguments name.
pub fn play(args: &[String]) -> BenchResult {
    set_parent_process_death_signal(Some(Signal::TERM))?;
    let [role, community, load @ ..] = args else {
        return Err("--role needs a role and a community".into());
    };
    let community = Community::new(community)?;
    match role.as_str() {
        "broker" => Ok(serve_broker(community.clone(), BrokerConfig::new(community.as_str()), Clock::new(1.0))?),
        "publish" => publish(&community, &Load::from_words(load)?),
        "read" => read(&community, &Load::from_words(load)?, load.last().map_or("", String::as_str)),
        scope => look(&community, scope),
    }
}

fn join(community: &Community, name: &str) -> BenchResult<Client> {
    let waited = Stopwatch::start();
    loop {
        match Client::connect(community, name) {
            Err(ConnectError::NoBroker(_)) if waited.elapsed() < PATIENCE => {
                std::thread::sleep(Duration::from_millis(2))
            }
            other => return Ok(other?),
        }
    }
}

/// Publishes at a word; each message carries its time, and a burst leaves together.
fn publish(community: &Community, load: &Load) -> BenchResult {
    let mut client = join(community, "publisher")?;
    println!("READY");
    std::io::stdin().read_line(&mut String::new())?;
    let started = monotonic_nanos();
    for burst in 0..load.messages / load.burst {
        if let Some(after) = (burst * load.burst * 1_000_000_000).checked_div(load.per_second) {
            let due = started + after;
            let due = Timespec { tv_sec: (due / 1_000_000_000) as i64, tv_nsec: (due % 1_000_000_000) as _ };
            clock_nanosleep_absolute(ClockId::Monotonic, &due)?;
        }
        for _ in 0..load.burst {
            client.comms.notify(KEY, format!("{:064}", monotonic_nanos()))?;
        }
        client.comms.flush()?;
    }
    println!("DONE");
    std::io::stdin().read_line(&mut String::new())?;
    Ok(())
}

fn read(community: &Community, load: &Load, name: &str) -> BenchResult {
    let mut client = join(community, name)?;
    match load.per_second {
        0 => client.comms.register(any(KEY).lossless())?,
        _ => client.comms.register(KEY)?,
    }
    client.comms.flush()?;
    println!("READY");
    let (mut latencies, mut first, mut last, mut heard) = (Vec::new(), 0, 0, Stopwatch::start());
    while (latencies.len() as u64) < load.messages && (latencies.is_empty() || heard.elapsed() < SILENCE) {
        let messages = client.receive(Duration::from_millis(100), |mail| {
            let sent = mail.as_text().and_then(|text| text.parse::<u64>().ok());
            latencies.extend(sent.map(|sent| monotonic_nanos().saturating_sub(sent)));
        })?;
        if messages > 0 {
            last = monotonic_nanos();
            first = if first == 0 { last } else { first };
            heard = Stopwatch::start();
        }
    }
    latencies.sort_unstable();
    let micros =
        |share: f64| latencies.get((latencies.len() as f64 * share) as usize).map_or(0.0, |n| *n as f64 * 1e-3);
    let seconds = (last - first) as f64 * 1e-9;
    println!("{} {} {}", latencies.len() as f64 / seconds, micros(0.5), micros(0.99));
    std::io::stdin().read_line(&mut String::new())?;
    Ok(())
}

/// Looks as `elk` does.
fn look(community: &Community, scope: &str) -> BenchResult {
    yield_to_others();
    let stop = stop_on_signals()?;
    let mut out = BufWriter::new(std::io::stdout().lock());
    let screen = scope.ends_with("terminal").then_some(Screen { columns: 120, rows: 50 });
    let mut output = Output::new(&mut out, screen);
    let patterns = vec![Pattern::any()];
    let mut client = Scope::join(community, scope)?;
    let done = match scope {
        "hz" => Rates { quantity: Quantity::Rate, patterns, window_secs: 10, count: None, json: false }.run(
            &mut client,
            &mut output,
            &stop,
        ),
        "top" => Top { count: None, json: false }.run(&mut client, &mut output, &stop),
        _ => Echo { patterns, source: Pattern::any(), latest: false, count: None, json: false }.run(
            &mut client,
            &mut output,
            &stop,
        ),
    };
    match done {
        Err(ScopeError::ReaderGone) => Ok(()),
        done => Ok(done?),
    }
}
