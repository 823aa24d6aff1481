//! What a process of a measurement does: `--role ROLE TRANSPORT NAMESPACE setting=value…`.
//!
//! It says READY when it stands, starts at a word on its standard input, says DONE with its figures, and keeps what it
//! holds (segments, registrations) until its standard input closes or SIGTERM comes.

use std::collections::BTreeSet;
use std::time::Duration;

use elk_bus::clock::{Stopwatch, monotonic_nanos};
use elk_bus::{App, AppError, Comms, Mail, run_app_on, stop_on_signals};
use rustix::process::{Signal, set_parent_process_death_signal};

use crate::baselines::bare_iceoryx2::{self, BareIntake, BareOutlet};
use crate::baselines::unix_stream::{StreamIntake, StreamOutlet};
use crate::elk::{self, ElkIntake, ElkOutlet};
use crate::load::{Load, Pace, setting};
use crate::moos::{self, MoosIntake, MoosOutlet};
use crate::tally::Tally;
use crate::transport::{BenchResult, Intake, Outlet};

/// A reader that hears nothing for so long, once it has heard anything, has heard all.
const SILENCE: Duration = Duration::from_secs(2);
/// What a flat-out publisher leaves between warm-up and load: an iceoryx2 reader connects when it next looks, and until
/// then a full queue drops, whatever the strategy.
const SETTLING: Duration = Duration::from_millis(100);
const RECEIVE_TIMEOUT: Duration = Duration::from_millis(500);

/// Plays the role that the arguments name.
pub fn play(args: &[String]) -> BenchResult {
    set_parent_process_death_signal(Some(Signal::TERM))?;
    let [role, transport, namespace, settings @ ..] = args else {
        return Err("--role needs a role, a transport and a namespace".into());
    };
    match role.as_str() {
        "broker" => elk::broker(namespace),
        "gateway" => moos::broker(namespace),
        "moosdb" => moos::become_moosdb(namespace),
        "deaf" => moos::stay_deaf(namespace, setting(settings, "seconds")?, ready),
        "relay" => bare_iceoryx2::relay(namespace, &Load::from_words(settings)?, ready),
        "publish" => publish(transport, namespace, settings),
        "read" => read(transport, namespace, settings),
        "timer" => timer(settings),
        "keys" => keys(namespace, settings),
        "idle" => idle(namespace, settings),
        _ => Err(format!("{role:?} is no role").into()),
    }
}

fn ready() -> BenchResult {
    println!("READY");
    Ok(())
}

/// Waits for a word; `false` when there will be none.
fn word() -> BenchResult<bool> {
    Ok(std::io::stdin().read_line(&mut String::new())? > 0)
}

fn done(figures: &str) -> BenchResult {
    println!("DONE {figures}");
    word().map(|_| ())
}

fn publish(transport: &str, namespace: &str, settings: &[String]) -> BenchResult {
    let load = Load::from_words(settings)?;
    let mut outlet: Box<dyn Outlet> = match transport {
        "elk" | "elk-to-moos" => Box::new(ElkOutlet::open(namespace)?),
        "moos" => Box::new(MoosOutlet::open(namespace)?),
        "unix" => Box::new(StreamOutlet::open(namespace, setting(settings, "readers")?)?),
        _ => Box::new(BareOutlet::open(namespace, "up", &load)?),
    };
    ready()?;
    if !word()? {
        return Ok(());
    }
    let (mut message, mut pace, mut sequence) = (load.message(), Pace::start(load.period_nanos), 0);
    while sequence < load.total() {
        pace.sleep()?;
        for sequence in sequence..load.end_of_burst(sequence) {
            load.stamp(&mut message, sequence);
            outlet.send(&message)?;
        }
        outlet.flush()?;
        sequence = load.end_of_burst(sequence);
        if load.is_flat_out() && sequence == load.warm_up {
            std::thread::sleep(SETTLING);
        }
    }
    done("")
}

fn read(transport: &str, namespace: &str, settings: &[String]) -> BenchResult {
    let load = Load::from_words(settings)?;
    let reader: usize = setting(settings, "reader")?;
    let pause = Duration::from_micros(setting(settings, "pause_micros")?);
    let mut intake: Box<dyn Intake> = match transport {
        "elk" => Box::new(ElkIntake::open(namespace, &format!("reader-{reader}"), load.lossless)?),
        "moos" | "elk-to-moos" => Box::new(MoosIntake::open(namespace, &format!("reader-{reader}"))?),
        "unix" => Box::new(StreamIntake::open(namespace, reader, &load)?),
        "direct" => Box::new(BareIntake::open(namespace, "up", &load)?),
        _ => Box::new(BareIntake::open(namespace, "down", &load)?),
    };
    ready()?;
    let (mut tally, mut heard) = (Tally::new(load), Stopwatch::start());
    while !tally.is_complete() && (!tally.has_begun() || heard.elapsed() < SILENCE) {
        let mut any = false;
        intake.receive(RECEIVE_TIMEOUT, &mut |message| {
            any = true;
            tally.take(message);
            if !pause.is_zero() {
                std::thread::sleep(pause);
            }
        })?;
        if any {
            tally.pause();
            heard = Stopwatch::start();
        }
    }
    done(&tally.into_words(intake.dropped()))
}

/// Does nothing at the load's pace: what the pacing alone costs.
fn timer(settings: &[String]) -> BenchResult {
    let load = Load::from_words(settings)?;
    ready()?;
    word()?;
    let mut pace = Pace::start(load.period_nanos);
    for _ in 0..load.total() {
        pace.sleep()?;
    }
    done("")
}

/// Publishes its share of many variables; then, at a word, registers for all of them at once.
fn keys(namespace: &str, settings: &[String]) -> BenchResult {
    let (client, share, all): (usize, usize, usize) =
        (setting(settings, "client")?, setting(settings, "share")?, setting(settings, "all")?);
    let mut bus = elk::join(namespace, &format!("client-{client}"))?;
    for key in 0..share {
        bus.comms.notify(&format!("KEY_{client}_{key}"), key as f64)?;
    }
    elk::settle(&mut bus)?;
    ready()?;
    word()?;
    let started = monotonic_nanos();
    bus.comms.register("KEY_*")?;
    let mut heard = BTreeSet::new();
    while heard.len() < all {
        bus.receive(RECEIVE_TIMEOUT, |mail| {
            heard.insert(mail.key().to_owned());
        })?;
    }
    done(&format!("seconds={:.4}", (monotonic_nanos() - started) as f64 * 1e-9))
}

/// An app that registers and then has nothing to do.
struct Idle;

impl App for Idle {
    fn on_start_up(&mut self, comms: &mut Comms) -> Result<(), AppError> {
        comms.register("NEVER")?;
        Ok(ready().map_err(|e| e.to_string())?)
    }

    fn on_new_mail(&mut self, _: &mut Comms, _: &Mail<'_>) -> Result<(), AppError> {
        Ok(())
    }
}

fn idle(namespace: &str, settings: &[String]) -> BenchResult {
    let name = format!("idle-{}", setting::<usize>(settings, "client")?);
    let stop = stop_on_signals()?;
    Ok(run_app_on(&mut Idle, &mut elk::join(namespace, &name)?, &stop)?)
}
