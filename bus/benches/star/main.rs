//! The bus beside its baselines, in the same run: `cargo bench -p elk-bus --bench star -- [CASE…] [--quick]`.
//!
//! Method: separate processes; the payload carries `CLOCK_MONOTONIC` and a sequence number; publishers are paced by
//! `clock_nanosleep(TIMER_ABSTIME)`; receivers block; warm-up messages are not counted; elk and its baselines take turns
//! (A B A B …), and each figure is the median of its turns. Absolute times of a shared machine mean little, ratios of one
//! run do. With `MOOSDB=PROGRAM` in the environment that MOOSDB takes turns, too, with clients of MOOS'.
//!
//! | module | one idea |
//! |---|---|
//! | [`cases`] | what is measured, beside what, and what is wanted |
//! | [`star`] | one turn: a publisher, what lies between, its readers |
//! | [`children`] | processes that are started, listened to, and never left behind |
//! | [`roles`] | what such a process does; the same executable, run with `--role` |
//! | [`transport`], [`elk`], [`moos`], [`baselines`] | the ways that a message can take |
//! | [`events`] | waiting for a broker, as the tests do |
//! | [`load`], [`tally`] | what is sent, and what is made of what arrives |
//! | [`report`], [`os`] | tables, and what the operating system knows |

mod baselines;
mod cases;
mod children;
mod elk;
#[path = "../../tests/common/events.rs"]
mod events;
mod load;
mod moos;
mod os;
mod report;
mod roles;
mod star;
mod tally;
mod transport;

use std::process::ExitCode;

use crate::cases::{Bench, CASES};
use crate::transport::BenchResult;

fn main() -> ExitCode {
    let args: Vec<String> = std::env::args().skip(1).collect();
    let done = match args.split_first() {
        Some((first, role)) if first == "--role" => roles::play(role),
        _ => measure(&args),
    };
    match done {
        Ok(()) => ExitCode::SUCCESS,
        Err(error) => {
            eprintln!("star: {error}");
            ExitCode::FAILURE
        }
    }
}

/// Runs the cases that are named, or all of them.
fn measure(args: &[String]) -> BenchResult {
    // Cargo says so when it benches; when it tests all targets it does not, and then there is nothing to do.
    let (flags, named): (Vec<&String>, Vec<&String>) = args.iter().partition(|a| a.starts_with("--"));
    if !flags.iter().any(|f| *f == "--bench") && named.is_empty() {
        println!("{}", usage());
        return Ok(());
    }
    if let Some(unknown) = named.iter().find(|n| CASES.iter().all(|case| case.name != n.as_str())) {
        return Err(format!("there is no case {unknown:?}\n{}", usage()).into());
    }
    let bench = Bench::new(flags.iter().any(|f| *f == "--quick"))?;
    println!("load of the machine at the start (1, 5, 15 min): {}", os::load_average()?);
    for case in CASES.iter().filter(|case| named.is_empty() || named.iter().any(|n| *n == case.name)) {
        (case.run)(&bench).map_err(|error| format!("{}: {error}", case.name))?;
    }
    println!("\nload of the machine at the end: {}", os::load_average()?);
    Ok(())
}

fn usage() -> String {
    let cases: String = CASES.iter().map(|case| format!("  {:14} {}\n", case.name, case.what)).collect();
    format!("cargo bench -p elk-bus --bench star -- [CASE…] [--quick]\n{cases}")
}
