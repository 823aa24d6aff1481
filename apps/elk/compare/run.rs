//! One run of a comparison: a mission launched as a process of its own, and what came of it.

use std::fmt;
use std::fs::File;
use std::os::fd::OwnedFd;
use std::os::unix::process::CommandExt;
use std::path::{Path, PathBuf};
use std::process::{Child, Command, Stdio};
use std::time::Duration;

use anyhow::{Context, Result};
use elk_launcher::handle;
use elk_mission::Override;
use elk_outside::file;
use rustix::process::{Pid, Signal, pidfd_send_signal};
use serde_json::Value as Json;

/// The longest summary, and the longest of a run's last words, that are read (bytes).
const LONGEST: u64 = 1 << 20;

/// A run that is to be.
#[derive(Debug)]
pub struct Plan {
    pub strategy: String,
    /// `None`: as the mission says.
    pub seed: Option<u64>,
    pub mission: PathBuf,
    pub sets: Vec<Override>,
    /// Edge of the map's voxels (m), if it is known.
    pub edge_m: Option<f64>,
}

/// A run that was begun.
pub struct Running {
    child: Child,
    handle: OwnedFd,
    place: PathBuf,
    row: Row,
    edge_m: Option<f64>,
    asked: bool,
}

/// What came of a run. What nobody said is `None`.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Row {
    pub strategy: String,
    pub seed: Option<u64>,
    /// Whether it came to its end and summed itself up.
    pub ended: bool,
    pub complete: bool,
    pub reason: String,
    pub way_m: Option<f64>,
    pub scans: Option<f64>,
    pub seconds: Option<f64>,
    pub known_voxels: Option<f64>,
    pub known_m3: Option<f64>,
    pub contacts: Option<f64>,
    pub accuracy: Option<f64>,
    /// The run's folder.
    pub run: String,
}

impl Row {
    /// Of a run that came to nothing.
    pub fn failed(plan: &Plan, reason: &str) -> Self {
        let (strategy, seed, reason) = (plan.strategy.clone(), plan.seed, reason.to_owned());
        Self { strategy, seed, reason, ..Self::default() }
    }
}

impl fmt::Display for Row {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let seed = self.seed.map_or(String::new(), |seed| format!(", seed {seed}"));
        let word = if self.complete { "complete" } else { "NOT complete" };
        write!(f, "{}{seed}: {word}: {}", self.strategy, self.reason)?;
        match (self.scans, self.way_m, self.seconds) {
            (Some(scans), Some(way), Some(secs)) => write!(f, "; {scans} scans, {way:.1} m, {secs:.1} s"),
            _ => Ok(()),
        }
    }
}

/// The folder of a comparison's run, counted from 0.
pub fn run_name(number: usize) -> String {
    format!("run-{:03}", number + 1)
}

impl Running {
    /// Launches it, in a process group of its own: a Ctrl-C at the terminal is the comparison's, which then ends it.
    pub fn start(plan: &Plan, number: usize, folder: &Path) -> Result<Self> {
        let place = folder.join(run_name(number));
        std::fs::create_dir_all(&place).with_context(|| format!("cannot make {}", place.display()))?;
        let said =
            File::create(place.join("said.txt")).with_context(|| format!("cannot write to {}", place.display()))?;
        let program = std::env::current_exe().context("elk does not know where it is itself")?;
        let mut command = Command::new(program);
        command.arg("launch").arg(&plan.mission).args(["--headless", "--auto", "--log-dir"]).arg(&place);
        command.arg(format!("--community=compare-{}-{number}", std::process::id()));
        command.args(plan.sets.iter().map(|set| format!("--set={}.{}={}", set.app, set.param, set.text)));
        command.stdin(Stdio::null()).stdout(said.try_clone()?).stderr(said).process_group(0);
        let mut child = command.spawn().context("elk cannot be started")?;
        let handle = handle::of_child(Pid::from_child(&child)).inspect_err(|_| {
            // Nobody could wait for it.
            let _ = child.kill().and_then(|()| child.wait());
        });
        let handle = handle.context("no handle of a new process")?;
        let row = Row { reason: "it said nothing".to_owned(), ..Row::failed(plan, "") };
        Ok(Self { child, handle, place, row, edge_m: plan.edge_m, asked: false })
    }

    /// Asks it, once, to end: a second time would cut its own end short.
    pub fn end(&mut self) {
        if !std::mem::replace(&mut self.asked, true) {
            // It may have ended by itself just now.
            let _ = pidfd_send_signal(&self.handle, Signal::TERM);
        }
    }

    /// Whether it has ended.
    pub fn has_ended(&self) -> bool {
        handle::wait(&[&self.handle], Duration::ZERO)
    }

    /// What tells when it ends.
    pub fn handle(&self) -> &OwnedFd {
        &self.handle
    }

    /// What came of it, once it has ended.
    pub fn row(mut self) -> Row {
        let how = self.child.wait().map(|status| status.to_string()).unwrap_or_default();
        let mut row = std::mem::take(&mut self.row);
        match self.summary() {
            Some((run, summary)) => take_up(&mut row, &summary, run, self.edge_m),
            None => row.reason = self.last_words().unwrap_or(how),
        }
        row
    }

    /// The run's folder and its summary, if it came to that.
    fn summary(&self) -> Option<(PathBuf, Json)> {
        let folders = self.place.read_dir().ok()?.flatten().map(|entry| entry.path());
        let run = folders.into_iter().find(|path| path.join("summary.json").is_file())?;
        let text = file::read_text(&run.join("summary.json"), LONGEST).ok()?;
        Some((run, serde_json::from_str(&text).ok()?))
    }

    /// Its last line that says why.
    fn last_words(&self) -> Option<String> {
        let said = file::read(&self.place.join("said.txt"), LONGEST).ok()?;
        let said = String::from_utf8_lossy(&said).into_owned();
        let lines = || said.lines().map(str::trim).filter(|line| !line.is_empty());
        lines().find(|line| line.starts_with("elk: ")).or(lines().next_back()).map(|line| line.replacen("elk: ", "", 1))
    }
}

fn take_up(row: &mut Row, summary: &Json, run: PathBuf, edge_m: Option<f64>) {
    let number = |name: &str| summary[name].as_f64();
    row.ended = true;
    row.complete = summary["complete"] == true;
    row.reason = summary["reason"].as_str().unwrap_or_default().to_owned();
    // A run without a scan has measured nothing.
    if number("scans").is_some_and(|scans| scans > 0.0) {
        (row.way_m, row.scans, row.seconds) = (number("path_length_m"), number("scans"), number("seconds"));
        row.known_voxels = number("known_voxels");
        row.known_m3 = row.known_voxels.zip(edge_m).map(|(voxels, edge)| voxels * edge.powi(3));
        (row.contacts, row.accuracy) = (number("contacts"), number("accuracy"));
    }
    row.run = run.to_string_lossy().into_owned();
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_summary_becomes_a_row() {
        let summary = serde_json::json!({
            "complete": true, "reason": "all is seen", "scans": 4, "path_length_m": 2.5, "seconds": 1.5,
            "known_voxels": 1000, "contacts": 0, "accuracy": null,
        });
        let mut row = Row::default();
        take_up(&mut row, &summary, "run".into(), Some(0.1));
        assert!(row.ended && row.complete && (row.known_m3.unwrap() - 1.0).abs() < 1e-9);
        assert_eq!((row.way_m, row.scans, row.accuracy), (Some(2.5), Some(4.0), None));
        let nothing = serde_json::json!({ "complete": false, "reason": "stopped", "scans": 0, "path_length_m": 0 });
        let mut row = Row::default();
        take_up(&mut row, &nothing, "run".into(), Some(0.1));
        assert_eq!((row.complete, row.way_m, row.reason.as_str()), (false, None, "stopped"));
    }
}
