//! `elk log prune`: old runs and comparisons, their logs and all, out of the way.

use std::fs::DirEntry;
use std::io::ErrorKind;
use std::path::{Path, PathBuf};
use std::process::ExitCode;
use std::time::UNIX_EPOCH;

use anyhow::{Context, Result, bail};
use clap::Args;
use elk_bus::clock::Clock;
use elk_outside::time;

use crate::compare::run_name;
use crate::terminal::{complain, say};

/// The files that make a folder a run's: its log may lie elsewhere, and a log may have come without a launcher.
const OF_A_RUN: [&str; 2] = ["log.mcap", "run.json"];
/// A log that was written so lately (s) may be written on, also by an older elk, which does not hold it.
const BUSY_SECS: f64 = 60.0;
const DAY_SECS: f64 = 86_400.0;

/// Which runs go.
#[derive(Debug, Args)]
pub struct PruneArgs {
    /// The folder that the runs' folders are in
    #[arg(default_value = "logs", value_name = "DIR")]
    folder: PathBuf,
    /// Keep so many of the newest runs; a comparison counts as one
    #[arg(long, value_name = "N", required_unless_present = "older_than")]
    keep: Option<usize>,
    /// Only runs whose files were last written longer ago: so many days, or 36h, 90m, 2w
    #[arg(long, value_name = "TIME", value_parser = parse_age)]
    older_than: Option<Age>,
    /// Delete them; without this they are only named
    #[arg(long)]
    delete: bool,
}

/// How long ago something was, and how that was said.
#[derive(Debug, Clone, PartialEq)]
struct Age {
    secs: f64,
    said: String,
}

/// Reads a number of days, or of the unit behind it.
fn parse_age(said: &str) -> Result<Age, String> {
    const UNITS: [(char, f64); 5] = [('w', 7.0 * DAY_SECS), ('d', DAY_SECS), ('h', 3600.0), ('m', 60.0), ('s', 1.0)];
    let unit = UNITS.iter().find_map(|(name, secs)| Some((said.strip_suffix(*name)?, *secs, said.to_owned())));
    let (number, unit_secs, said) = unit.unwrap_or_else(|| (said, DAY_SECS, format!("{said} days")));
    let number = number.trim().parse().ok().filter(|number| (0.0..time::LAST / DAY_SECS).contains(number));
    let secs = number.map(|number: f64| number * unit_secs);
    secs.map(|secs| Age { secs, said }).ok_or_else(|| "right is a number of days (7), or 36h, 90m, 2w".to_owned())
}

/// The folder of a run, or of a comparison.
#[derive(Debug, Clone, PartialEq)]
struct Run {
    folder: PathBuf,
    /// How long ago any of its files was last written (s).
    age_secs: f64,
    bytes: u64,
    /// Whether somebody writes to its log.
    is_written: bool,
}

/// What becomes of the runs in a folder.
#[derive(Debug, Default, PartialEq)]
struct Sorted {
    /// Those that go, the oldest first.
    old: Vec<Run>,
    /// How many stay because they are among the newest, …
    newest: usize,
    /// … too young, …
    young: usize,
    /// … or not over yet.
    going_on: usize,
}

/// `elk log prune`
pub fn run(arguments: &PruneArgs) -> Result<ExitCode> {
    let PruneArgs { folder, keep, older_than, delete } = arguments;
    let now = Clock::new(1.0).now();
    let (runs, others) = runs(folder, now)?;
    let sorted = sorted(runs, keep.unwrap_or(0), older_than.as_ref().map_or(0.0, |age| age.secs));
    let kept = kept(&sorted, older_than.as_ref(), others);
    let old = sorted.old;
    let (mut failed, mut left) = (0, 0);
    for Run { folder, age_secs, bytes, .. } in &old {
        let (megabytes, days) = (*bytes as f64 / 1e6, age_secs / DAY_SECS);
        say(&format!("{}: {megabytes:.1} MB, {days:.1} days old\n", folder.display()))?;
        if *delete && let Err(error) = std::fs::remove_dir_all(folder) {
            failed += 1;
            left += bytes;
            complain(&format!("cannot delete {}: {error}", folder.display()));
        }
    }
    let megabytes = (old.iter().map(|run| run.bytes).sum::<u64>() - left) as f64 / 1e6;
    let count = old.len() - failed;
    say(&match delete {
        true => format!("{count} runs deleted, {megabytes:.1} MB\n"),
        false => format!("{count} runs, {megabytes:.1} MB; with --delete they are deleted\n"),
    })?;
    say(&kept)?;
    if failed > 0 {
        bail!("{failed} of {} runs are still there", old.len());
    }
    Ok(ExitCode::SUCCESS)
}

/// What is kept, and why.
fn kept(sorted: &Sorted, older_than: Option<&Age>, others: usize) -> String {
    let age = older_than.map_or("", |age| age.said.as_str());
    let reasons = [
        (sorted.newest, "the newest".to_owned()),
        (sorted.young, format!("not older than {age}")),
        (sorted.going_on, "still being written, or written within the last minute".to_owned()),
        (others, "neither a run nor a comparison".to_owned()),
    ];
    let said: Vec<String> =
        reasons.iter().filter(|(count, _)| *count > 0).map(|(count, why)| format!("{count} {why}")).collect();
    if said.is_empty() { String::new() } else { format!("kept: {}\n", said.join("; ")) }
}

/// The runs' and comparisons' folders in `folder`, no links, and how many other folders there are.
fn runs(folder: &Path, now: f64) -> Result<(Vec<Run>, usize)> {
    let unreadable = |folder: &Path| format!("cannot read the folder {}", folder.display());
    let (mut runs, mut others) = (Vec::new(), 0);
    for entry in std::fs::read_dir(folder).with_context(|| unreadable(folder))? {
        let entry = entry.with_context(|| unreadable(folder))?;
        if !entry.file_type().is_ok_and(|kind| kind.is_dir()) {
            continue;
        }
        let folder = entry.path();
        if !is_run(&folder) {
            others += 1;
            continue;
        }
        match Held::by(&folder) {
            Ok(Held { newest, bytes, is_written }) => {
                runs.push(Run { age_secs: now - newest, bytes, folder, is_written });
            }
            Err(error) => complain(&format!("{}: {error}; it is passed over", unreadable(&folder))),
        }
    }
    Ok((runs, others))
}

/// Whether a folder is a run's or a comparison's.
fn is_run(folder: &Path) -> bool {
    let there = |name: &str| folder.join(name).symlink_metadata();
    OF_A_RUN.iter().any(|name| there(name).is_ok_and(|file| file.is_file()))
        || there(&run_name(0)).is_ok_and(|first| first.is_dir())
}

/// What a folder holds, with all that lies in it.
#[derive(Default)]
struct Held {
    bytes: u64,
    /// When any file was last written (s since 1970).
    newest: f64,
    /// Whether a log in it is being written: its logger holds it, however long it has had nothing to say.
    is_written: bool,
}

impl Held {
    fn by(folder: &Path) -> std::io::Result<Self> {
        let mut held = Self::default();
        for entry in std::fs::read_dir(folder)? {
            match entry.and_then(|entry| held.add(&entry)) {
                Err(error) if error.kind() != ErrorKind::NotFound => return Err(error),
                _ => {} // what is gone meanwhile is not held
            }
        }
        Ok(held)
    }

    fn add(&mut self, entry: &DirEntry) -> std::io::Result<()> {
        let metadata = entry.metadata()?;
        if metadata.is_dir() {
            let Self { bytes, newest, is_written } = Self::by(&entry.path())?;
            self.bytes += bytes;
            self.newest = self.newest.max(newest);
            self.is_written |= is_written;
            return Ok(());
        }
        let written = metadata.modified()?.duration_since(UNIX_EPOCH);
        self.newest = self.newest.max(written.map_or(0.0, |since| since.as_secs_f64()));
        self.bytes += metadata.len();
        self.is_written |= metadata.is_file() && elk_log::is_written(&entry.path());
        Ok(())
    }
}

/// The runs beyond the newest `keep` that are older than `oldest_secs`; none that is still going on.
fn sorted(mut runs: Vec<Run>, keep: usize, oldest_secs: f64) -> Sorted {
    runs.sort_by(|one, other| one.age_secs.total_cmp(&other.age_secs).then(one.folder.cmp(&other.folder)));
    let all = runs.len();
    runs.retain(|run| !run.is_written);
    let mut sorted = Sorted { going_on: all - runs.len(), ..Sorted::default() };
    for (place, run) in runs.into_iter().enumerate() {
        match run {
            _ if place < keep => sorted.newest += 1,
            Run { age_secs, .. } if age_secs <= BUSY_SECS => sorted.going_on += 1,
            Run { age_secs, .. } if age_secs <= oldest_secs => sorted.young += 1,
            run => sorted.old.push(run),
        }
    }
    sorted.old.reverse();
    sorted
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_newest_are_kept_and_none_is_deleted_that_goes_on() {
        let run = |name: &str, age_secs| Run { folder: name.into(), age_secs, bytes: 1, is_written: name == "written" };
        let runs = vec![run("a", 1e6), run("now", 1.0), run("b", 1e3), run("written", 1e5), run("c", 1e4)];
        let found = |keep, oldest| {
            let Sorted { old, newest, young, going_on } = sorted(runs.clone(), keep, oldest);
            (
                old.iter().map(|run| run.folder.display().to_string()).collect::<Vec<_>>().join(" "),
                [newest, young, going_on],
            )
        };
        assert_eq!(found(2, 0.0), ("a c".to_owned(), [2, 0, 1]));
        assert_eq!(found(0, 0.0), ("a c b".to_owned(), [0, 0, 2]), "what was written a second ago is still written");
        assert_eq!(found(1, 5e3), ("a c".to_owned(), [1, 1, 1]));
        assert_eq!(found(5, 0.0), (String::new(), [4, 0, 1]));
    }

    #[test]
    fn an_age_is_days_or_what_its_unit_says() {
        let secs = |said: &str| parse_age(said).map(|age| age.secs);
        assert_eq!(["7", "7d", "1w", "168h", "10080m", "604800s"].map(secs), [const { Ok(604_800.0) }; 6]);
        assert_eq!(parse_age("7").unwrap().said, "7 days");
        for wrong in ["", "d", "-1", "nan", "inf", "1e300", "7 days", "1y"] {
            assert!(secs(wrong).is_err(), "{wrong}");
        }
    }
}
