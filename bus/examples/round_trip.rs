//! What a message's way costs, for `bus/python/benches/bus.py`, which runs these beside Python's own: `echo` answers `PING`
//! with `PONG`, `ping` measures the round trip of 64 bytes at 1 kHz, `scans` says 1 MB again and again, `read` takes that.
//!
//!     cargo run --release -p elk-bus --example round_trip -- ping COMMUNITY COUNT

use std::time::Duration;

use elk_bus::clock::Stopwatch;
use elk_bus::{
    App, AppError, Client, Comms, Community, Failure, Key, Mail, Origin, RunOptions, TypeRef, ValueRef, any, codec,
    payload, run_app,
};

/// So many numbers are a megabyte.
const NUMBERS: usize = 1 << 18;
const PERIOD: Duration = Duration::from_millis(1);

/// Numbers that somebody has measured.
#[payload]
struct Numbers {
    /// As they came.
    numbers: Vec<f32>,
}

const NUMBERS_KEY: Key<Numbers> = Key::new("NUMBERS");

struct Echo;

impl App for Echo {
    fn on_start_up(&mut self, comms: &mut Comms) -> Result<(), AppError> {
        Ok(comms.register("PING")?)
    }

    fn on_new_mail(&mut self, comms: &mut Comms, mail: &Mail<'_>) -> Result<(), AppError> {
        Ok(comms.notify("PONG", mail.text()?)?)
    }
}

/// Waits for the next message of a variable.
fn next(client: &mut Client, variable: &str) -> Result<(), Failure> {
    let mut came = false;
    while !came {
        client.receive(Duration::from_secs(1), |mail| came |= mail.key() == variable)?;
    }
    Ok(())
}

/// Round trips, each begun a period after the one before; prints the quantiles (µs).
fn ping(client: &mut Client, count: usize) -> Result<(), Failure> {
    client.comms.register("PONG")?;
    let mut trips = Vec::new();
    let running = Stopwatch::start();
    // The first tenth finds everybody awake.
    for number in 0..count + count / 10 {
        std::thread::sleep(((number as u32 + 1) * PERIOD).saturating_sub(running.elapsed()));
        let trip = Stopwatch::start();
        client.comms.notify("PING", "0123456789abcdef0123456789abcdef0123456789abcdef0123456789abcdef")?;
        next(client, "PONG")?;
        trips.push(trip.elapsed().as_secs_f64() * 1e6);
    }
    let trips = &mut trips[count / 10..];
    trips.sort_by(f64::total_cmp);
    println!("{:.2} {:.2}", trips[trips.len() / 2], trips[trips.len() * 99 / 100]);
    Ok(())
}

/// Says the same megabyte again and again, as fast as its readers read.
fn scans(client: &mut Client, count: usize) -> Result<(), Failure> {
    let mut bytes = Vec::new();
    codec::encode_onto(&Numbers { numbers: (0..NUMBERS).map(|number| number as f32).collect() }, &mut bytes)?;
    for _ in 0..count {
        let value = ValueRef::Binary { type_: TypeRef::of::<Numbers>(), bytes: &bytes };
        client.comms.publish_value(NUMBERS_KEY.name(), value, Origin::default())?;
    }
    Ok(client.comms.flush()?)
}

/// Takes so many of them where they lie; prints GB/s from the first to the last.
fn read(client: &mut Client, count: usize) -> Result<(), Failure> {
    client.comms.register(any("NUMBERS").lossless())?;
    let (mut heard, mut bytes, mut running) = (0, 0, Stopwatch::start());
    while heard < count {
        client.receive(Duration::from_secs(1), |mail| {
            if heard == 0 {
                (bytes, running) = (0, Stopwatch::start());
            } else {
                bytes += mail.value().byte_len();
            }
            heard += 1;
        })?;
    }
    println!("{:.3}", bytes as f64 / running.elapsed().as_secs_f64() / 1e9);
    Ok(())
}

fn main() -> Result<(), Failure> {
    let words: Vec<String> = std::env::args().skip(1).collect();
    let [role, community, rest @ ..] = &words[..] else {
        return Err(Failure::from("right is echo|ping|scans|read COMMUNITY [COUNT]"));
    };
    let community = Community::new(community)?;
    let count = rest.first().map_or(Ok(2000), |count| count.parse())?;
    if role == "echo" {
        return Ok(run_app(Box::new(Echo), &RunOptions::new("echo", community))?);
    }
    let mut client = Client::connect(&community, role)?;
    match role.as_str() {
        "ping" => ping(&mut client, count),
        "scans" => scans(&mut client, count),
        "read" => read(&mut client, count),
        other => Err(Failure::from(format!("{other} is none of echo, ping, scans and read"))),
    }
}
