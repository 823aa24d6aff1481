//! `elk log prune`: old runs, their logs and all, out of the way.

use std::fs::DirEntry;
use std::io::ErrorKind;
use std::path::{Path, PathBuf};
use std::process::ExitCode;
use std::time::UNIX_EPOCH;

use anyhow::{Context, Result, bail};
use clap::Args;
use elk_bus::clock::Clock;

use crate::commands::say;

/// The file that makes a folder a run's.
const LOG: &str = "log.mcap";
/// A log that was written so lately (s) may be written on, also by an older elk, which does not hold it.
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
    let runs = runs(folder, now)?;
    let old = outdated(runs, keep.unwrap_or(0), older_than.map_or(0.0, |days| days * DAY_SECS));
    let (mut failed, mut left) = (0, 0);
    for Run { folder, age_secs, bytes } in &old {
        let (megabytes, days) = (*bytes as f64 / 1e6, age_secs / DAY_SECS);
        say(&format!("{}: {megabytes:.1} MB, {days:.1} days old\n", folder.display()))?;
        if *delete && let Err(error) = std::fs::remove_dir_all(folder) {
            failed += 1;
            left += bytes;
            crate::complain(&format!("cannot delete {}: {error}", folder.display()));
        }
    }
    let megabytes = (old.iter().map(|run| run.bytes).sum::<u64>() - left) as f64 / 1e6;
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

/// The runs' folders in `folder`: those that hold a log and are no links. None that somebody writes to.
fn runs(folder: &Path, now: f64) -> Result<Vec<Run>> {
    let unreadable = |folder: &Path| format!("cannot read the folder {}", folder.display());
    let mut runs = Vec::new();
    for entry in std::fs::read_dir(folder).with_context(|| unreadable(folder))? {
        let entry = entry.with_context(|| unreadable(folder))?;
        let folder = entry.path();
        let is_run = entry.file_type().is_ok_and(|kind| kind.is_dir())
            && folder.join(LOG).symlink_metadata().is_ok_and(|log| log.is_file());
        if !is_run {
            continue;
        }
        match Held::by(&folder) {
            Ok(held) if held.is_written => {}
            Ok(Held { newest, bytes, .. }) => runs.push(Run { age_secs: now - newest, bytes, folder }),
            Err(error) => crate::complain(&format!("{}: {error}; it is passed over", unreadable(&folder))),
        }
    }
    Ok(runs)
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
