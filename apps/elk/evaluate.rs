//! `elk evaluate`: strategies × worlds × starts, on equal terms.

use std::io::IsTerminal;
use std::path::{Path, PathBuf};
use std::process::ExitCode;
use std::sync::atomic::Ordering;

use anyhow::{Context, Result, bail};
use clap::Args;
use elk_bus::stop_on_signals;
use elk_evaluate::{Evaluation, Finished, Missions, Step, Suite};
use elk_mission::{Mission, Override};

use crate::missions::load;
use crate::registry::registry;
use crate::terminal::{draw, say};
use crate::version::BUILD;

/// What is to be evaluated.
#[derive(Debug, Args)]
pub struct EvaluateArgs {
    /// The suite: a file as those of mission-files/suites
    suite: PathBuf,
    /// Runs at the same time; as many as there are processors if not said. It changes nothing in what comes of them
    #[arg(short, long, value_parser = clap::value_parser!(u16).range(1..=1024))]
    jobs: Option<u16>,
    /// The results' folder; one in results/ of the suite's name if not said. What is in it already is not run again
    #[arg(short, long, value_name = "DIR")]
    output: Option<PathBuf>,
    /// Writes the tables as a page (PAGE.md), too, with the pictures in a folder beside it (PAGE/)
    #[arg(long, value_name = "PAGE")]
    table: Option<PathBuf>,
}

/// Runs a suite, or what is left of it.
pub fn evaluate(arguments: &EvaluateArgs) -> Result<ExitCode> {
    let suite = Suite::load(&arguments.suite)?;
    let missions = Missions { registry: registry(), load: Box::new(mission) };
    let evaluation = Evaluation::new(suite, missions, BUILD)?;
    let folder = arguments.output.clone().unwrap_or_else(|| evaluation.folder(Path::new("results")));
    let processors = std::thread::available_parallelism().map_or(1, usize::from);
    let jobs = arguments.jobs.map_or(processors, usize::from);
    let stop = stop_on_signals().context("signals cannot be caught")?;
    let bar = std::io::stderr().is_terminal();
    let finished = evaluation.run(&folder, (jobs, &stop), |step| show(step, bar));
    if bar {
        draw("\r\x1b[K");
    }
    let finished = finished?;
    conclude(&finished)?;
    if let Some(page) = &arguments.table {
        evaluation.write_page(&finished, page).with_context(|| format!("{} cannot be written", page.display()))?;
    }
    if stop.load(Ordering::Relaxed) && finished.done < finished.all {
        bail!("stopped: {} of {} runs are done; the same command goes on from there", finished.done, finished.all);
    }
    Ok(if finished.incomplete == 0 { ExitCode::SUCCESS } else { ExitCode::FAILURE })
}

fn mission(file: &Path, sets: &[Override]) -> Result<Mission, String> {
    load(file, sets).map(|(mission, _)| mission).map_err(|error| format!("{error:#}"))
}

/// A bar with the time left on a terminal, a line a run in a pipe; what is not complete is said in either.
fn show(step: &Step, bar: bool) {
    let Step { run, outcome, done, all, left_secs } = step;
    let line =
        format!("{run}: {}: {}; {} scans, {:.1} m", outcome.end.word(), outcome.reason, outcome.scans, outcome.way_m);
    if !bar {
        elk_bus::tell(format_args!("[{done}/{all}] {line}"));
        return;
    }
    draw("\r\x1b[K");
    if !outcome.is_complete() {
        elk_bus::tell(&line);
    }
    const WIDTH: usize = 30;
    let full = WIDTH * done / (*all).max(1);
    draw(&format!(
        "[{}{}] {done} of {all} runs, {} left",
        "#".repeat(full),
        "-".repeat(WIDTH - full),
        shown(*left_secs)
    ));
}

/// `1:02:03`, `4:05`
fn shown(secs: f64) -> String {
    let secs = secs.ceil() as u64;
    match secs / 3600 {
        0 => format!("{}:{:02}", secs / 60, secs % 60),
        hours => format!("{hours}:{:02}:{:02}", secs / 60 % 60, secs % 60),
    }
}

/// The first table, and where the others are.
fn conclude(finished: &Finished) -> Result<()> {
    let Finished { folder, before, done, all, incomplete, tables } = finished;
    say(&tables.first().map_or(String::new(), |table| table.markdown()))?;
    let again = if *before > 0 { format!(", {before} of them from before") } else { String::new() };
    let failed = if *incomplete > 0 {
        format!("; {incomplete} are not complete, and no part of any mean")
    } else {
        String::new()
    };
    say(&format!("{done} of {all} runs{again}{failed}\n"))?;
    say(&format!("report.html, table.md, runs.csv and pictures are in {}\n", folder.display()))
}

#[cfg(test)]
mod tests {
    #[test]
    fn times_are_shown_as_clocks_show_them() {
        assert_eq!([0.0, 59.2, 245.0, 3723.0].map(super::shown), ["0:00", "1:00", "4:05", "1:02:03"]);
    }
}
