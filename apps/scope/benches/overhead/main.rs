//! What a scope costs those whom it looks at: `cargo bench -p elk-scope --bench overhead -- [--quick]`.
//!
//! Method: separate processes; a publisher, a broker, two readers, and beside them a scope or nobody, taking turns in
//! the same run. Each figure is the median of its turns, and stands beside that without a scope. Two loads: 100,000
//! messages a second, and as many as the readers take, when whatever the scope uses is missing elsewhere.
//!
//! | module | one idea |
//! |---|---|
//! | [`turn`] | one turn: the processes, and what came of it |
//! | [`children`] | processes that are started, listened to, and never left behind |
//! | [`roles`] | what such a process does; the same executable, run with `--role` |

mod children;
mod roles;
mod turn;

use std::process::ExitCode;

use turn::{Load, Turn};

/// What goes wrong here ends the measurement.
pub type BenchResult<T = ()> = Result<T, Box<dyn std::error::Error>>;

/// The scopes that are measured, `nobody` first: all others are held against it.
const SCOPES: [&str; 5] = ["nobody", "echo-pipe", "echo-terminal", "hz", "top"];

fn main() -> ExitCode {
    let args: Vec<String> = std::env::args().skip(1).collect();
    let done = match args.split_first() {
        Some((first, role)) if first == "--role" => roles::play(role),
        // Cargo says so when it benches; when it tests all targets it does not, and then there is nothing to do.
        _ if args.iter().any(|arg| arg == "--bench") => measure(args.iter().any(|arg| arg == "--quick")),
        _ => {
            println!("cargo bench -p elk-scope --bench overhead -- [--quick]");
            Ok(())
        }
    };
    match done {
        Ok(()) => ExitCode::SUCCESS,
        Err(error) => {
            eprintln!("overhead: {error}");
            ExitCode::FAILURE
        }
    }
}

fn measure(quick: bool) -> BenchResult {
    let turns = if quick { 3 } else { 5 };
    let seconds = if quick { 0.5 } else { 1.0 };
    for load in [Load::paced(seconds), Load::flat_out(seconds)] {
        println!("\n{load}, 64 bytes each, two readers; median of {turns} turns");
        println!(
            "| scope | readers got, a second each | ratio | p50 / p99 to a reader | CPU broker | CPU scope | scope wrote |"
        );
        println!("|---|---|---|---|---|---|---|");
        let mut all: Vec<Vec<Turn>> = SCOPES.map(|_| Vec::new()).into();
        for _ in 0..turns {
            for (scope, turns) in SCOPES.iter().zip(&mut all) {
                turns.push(turn::take(scope, &load)?);
            }
        }
        let alone = median(&all[0], |turn| turn.rate);
        for (scope, turns) in SCOPES.iter().zip(&all) {
            println!("{}", row(scope, turns, alone));
        }
    }
    Ok(())
}

fn row(scope: &str, turns: &[Turn], alone: f64) -> String {
    let of = |figure: fn(&Turn) -> f64| median(turns, figure);
    format!(
        "| {scope} | {:.0} | {:.3} | {:.0} / {:.0} µs | {:.0} % | {:.0} % | {:.0} kB/s |",
        of(|turn| turn.rate),
        of(|turn| turn.rate) / alone,
        of(|turn| turn.p50_micros),
        of(|turn| turn.p99_micros),
        100.0 * of(|turn| turn.broker_cpu),
        100.0 * of(|turn| turn.scope_cpu),
        of(|turn| turn.scope_output) / 1e3,
    )
}

fn median(turns: &[Turn], figure: impl Fn(&Turn) -> f64) -> f64 {
    let mut figures: Vec<f64> = turns.iter().map(figure).collect();
    figures.sort_by(f64::total_cmp);
    figures.get(figures.len() / 2).copied().unwrap_or(f64::NAN)
}
