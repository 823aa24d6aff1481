//! `elk log prune`: old runs, their logs and all, out of the way.

use std::path::{Path, PathBuf};
use std::process::ExitCode;
use std::time::UNIX_EPOCH;

use anyhow::{Context, Result, bail};
use clap::Args;
use elk_bus::clock::Clock;

use crate::commands::say;

/// The file that makes a folder a run's.
const LOG: &str = "log.mcap";
/// A log that was written so lately (s) may be written on.
const BUSY_SECS: f64 = 60.0;
const DAY_SECS: f64 = 86_400.0;

/// Which runs go.
#[derive(Debug, Args)]
pub struct PruneArgs {
    /// The folder that the runs' folders are in
    #[arg(default_value = "logs", value_name = "DIR")]
    folder: PathBuf,
    /// Keep so many of the newest runs
    #[arg(long, value_name = "N", required_unless_present = "older_than")]
    keep: Option<usize>,
    /// Only runs whose logs were last written more than so many days ago
    #[arg(long, value_name = "DAYS", value_parser = elk_outside::time::parse_seconds)]
    older_than: Option<f64>,
    /// Delete them; without this they are only named
    #[arg(long)]
    delete: bool,
}

/// A run's folder.
#[derive(Debug, Clone, PartialEq)]
struct Run {
    folder: PathBuf,
    /// How long ago its log was last written (s).
    age_secs: f64,
    bytes: u64,
}

/// `elk log prune`
pub fn run(arguments: &PruneArgs) -> Result<ExitCode> {
    let PruneArgs { folder, keep, older_than, delete } = arguments;
    let now = Clock::new(1.0).now();
    let runs = runs(folder, now).with_context(|| format!("cannot read the folder {}", folder.display()))?;
    let old = outdated(runs, keep.unwrap_or(0), older_than.map_or(0.0, |days| days * DAY_SECS));
    let mut failed = 0;
    for Run { folder, age_secs, bytes } in &old {
        let (megabytes, days) = (*bytes as f64 / 1e6, age_secs / DAY_SECS);
        say(&format!("{}: {megabytes:.1} MB, {days:.1} days old\n", folder.display()))?;
        if *delete && let Err(error) = std::fs::remove_dir_all(folder) {
            failed += 1;
            crate::complain(&format!("cannot delete {}: {error}", folder.display()));
        }
    }
    let megabytes = old.iter().map(|run| run.bytes).sum::<u64>() as f64 / 1e6;
    let count = old.len() - failed;
    say(&match delete {
        true => format!("{count} runs deleted, {megabytes:.1} MB\n"),
        false => format!("{count} runs, {megabytes:.1} MB; with --delete they are deleted\n"),
    })?;
    if failed > 0 {
        bail!("{failed} of {} runs are still there", old.len());
    }
    Ok(ExitCode::SUCCESS)
}

/// The runs' folders in `folder`: those that hold a log and are no links.
fn runs(folder: &Path, now: f64) -> std::io::Result<Vec<Run>> {
    let mut runs = Vec::new();
    for entry in std::fs::read_dir(folder)? {
        let entry = entry?;
        let log = entry.path().join(LOG);
        if entry.file_type()?.is_dir()
            && let Ok(metadata) = log.symlink_metadata()
            && metadata.is_file()
        {
            let written = newest(&entry.path())?;
            runs.push(Run { age_secs: now - written, bytes: bytes_in(&entry.path())?, folder: entry.path() });
        }
    }
    Ok(runs)
}

/// When any file of a folder was last written (s since 1970).
fn newest(folder: &Path) -> std::io::Result<f64> {
    let mut newest = 0.0_f64;
    for entry in std::fs::read_dir(folder)? {
        let modified = entry?.metadata()?.modified()?;
        newest = newest.max(modified.duration_since(UNIX_EPOCH).map_or(0.0, |since| since.as_secs_f64()));
    }
    Ok(newest)
}

fn bytes_in(folder: &Path) -> std::io::Result<u64> {
    let mut bytes = 0;
    for entry in std::fs::read_dir(folder)? {
        let entry = entry?;
        bytes += if entry.file_type()?.is_dir() { bytes_in(&entry.path())? } else { entry.metadata()?.len() };
    }
    Ok(bytes)
}

/// The runs beyond the newest `keep` that are older than `oldest_secs`, the oldest first; none that is still going on.
fn outdated(mut runs: Vec<Run>, keep: usize, oldest_secs: f64) -> Vec<Run> {
    runs.sort_by(|one, other| one.age_secs.total_cmp(&other.age_secs).then(one.folder.cmp(&other.folder)));
    let beyond = runs.into_iter().skip(keep);
    let mut old: Vec<Run> = beyond.filter(|run| run.age_secs > oldest_secs.max(BUSY_SECS)).collect();
    old.reverse();
    old
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_newest_are_kept_and_none_is_deleted_that_goes_on() {
        let run = |name: &str, age_secs| Run { folder: name.into(), age_secs, bytes: 1 };
        let runs = vec![run("a", 1e6), run("now", 1.0), run("b", 1e3), run("c", 1e4)];
        let names = |keep, oldest| {
            let old = outdated(runs.clone(), keep, oldest);
            old.iter().map(|run| run.folder.display().to_string()).collect::<Vec<_>>()
        };
        assert_eq!(names(2, 0.0), ["a", "c"]);
        assert_eq!(names(0, 0.0), ["a", "c", "b"], "what was written a second ago is still written");
        assert_eq!(names(1, 5e3), ["a", "c"]);
        assert!(names(4, 0.0).is_empty());
    }
}
