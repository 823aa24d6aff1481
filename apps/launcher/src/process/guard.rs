//! A small process that outlives the launcher by moments: when the launcher is gone, however it went, it ends what is left.
//!
//! The kernel already sends SIGTERM to the launcher's children when it dies. The guard is there for children that do not
//! listen, and for children's children. It knows the process groups from a pipe, and that the launcher is gone from the
//! pipe's end.

use std::collections::{BTreeSet, HashSet};
use std::io::{self, BufRead, Write};
use std::os::unix::process::CommandExt;
use std::path::Path;
use std::process::{Child, ChildStdin, Command, Stdio};
use std::time::Duration;

use elk_bus::ProcessId;
use elk_bus::clock::Stopwatch;
use rustix::process::{Pid, Signal, getppid, kill_process_group, parent_process_death_signal, test_kill_process_group};

use crate::error::LaunchError;
use crate::process::escaped::{self, RunId, Sighting};

/// How long groups may take to end before they are killed: two seconds after the launcher, nobody is left.
const PATIENCE: Duration = Duration::from_millis(1500);
/// How often it is looked whether they have.
const LOOK_EVERY: Duration = Duration::from_millis(20);

/// The launcher's end of the pipe.
pub(crate) struct Guard {
    child: Child,
    pipe: Option<ChildStdin>,
}

impl Guard {
    /// Starts the guard: `program guard`. By `run` it knows those of whom the launcher did not live to tell.
    pub fn start(program: &Path, run: &RunId) -> Result<Self, LaunchError> {
        let mut command = Command::new(program);
        run.give(&mut command);
        command.arg("guard").stdin(Stdio::piped()).stdout(Stdio::null()).process_group(0);
        let failed =
            |source| LaunchError::CannotStart { app: "the guard".to_owned(), program: program.to_owned(), source };
        let mut child = command.spawn().map_err(failed)?;
        let pipe = child.stdin.take();
        Ok(Self { child, pipe })
    }

    /// From now on this group ends with the launcher.
    pub fn watch(&mut self, group: Pid) {
        self.say('+', group);
    }

    /// This group has ended; its number may become another's.
    pub fn forget(&mut self, group: Pid) {
        self.say('-', group);
    }

    /// From now on this process, which is of no group that is watched, ends with the launcher; or it has ended.
    pub fn note(&mut self, sighting: &Sighting) {
        let (what, id) = match sighting {
            Sighting::Found(id) => ('>', id),
            Sighting::Ended(id) => ('<', id),
        };
        if let (Some(pipe), Ok(id)) = (&mut self.pipe, serde_json::to_string(id)) {
            let _ = writeln!(pipe, "{what}{id}");
        }
    }

    /// The guard's own process.
    pub fn pid(&self) -> i32 {
        self.child.id() as i32
    }

    /// A guard that is gone is no reason to end the mission: the kernel's signal remains.
    fn say(&mut self, what: char, group: Pid) {
        if let Some(pipe) = &mut self.pipe {
            let _ = writeln!(pipe, "{what}{}", group.as_raw_nonzero());
        }
    }
}

impl Drop for Guard {
    fn drop(&mut self) {
        self.pipe = None;
        let _ = self.child.wait();
    }
}

/// The guard itself: reads groups from `launcher` until its end, then ends those that are left.
///
/// # Errors
/// The pipe cannot be read; what is left is ended all the same.
pub fn guard(launcher: impl BufRead) -> io::Result<()> {
    let mut watched = Watched::default();
    let read = watched.follow(launcher);
    watched.end(RunId::own().as_ref());
    read
}

/// The guard's standby is the broker of a mission that ends with its launcher. If launcher and guard are killed
/// together, the kernel asks the broker to end, and nobody else is left who knows of the mission's processes.
pub struct StandbyGuard {
    launcher: Option<Pid>,
    run: RunId,
}

impl StandbyGuard {
    /// `None`: this process does not end with a launcher.
    pub fn of_launcher() -> Option<Self> {
        parent_process_death_signal().ok().flatten()?;
        Some(Self { launcher: getppid(), run: RunId::own()? })
    }

    /// Ends what is left, if the launcher is gone, and its guard as well.
    pub fn take_over(self) {
        if getppid() != self.launcher && !self.run.processes().iter().any(is_guard) {
            Watched::default().end(Some(&self.run));
        }
    }
}

/// Whether a process was started as [`Guard::start`] does.
fn is_guard(id: &ProcessId) -> bool {
    let arguments = std::fs::read(format!("/proc/{}/cmdline", id.pid)).unwrap_or_default();
    arguments.split(|byte| *byte == 0).skip(1).eq([&b"guard"[..], b""])
}

/// Who is to end with the launcher.
#[derive(Default)]
pub(crate) struct Watched {
    groups: BTreeSet<i32>,
    processes: HashSet<ProcessId>,
}

impl Watched {
    /// These, and nobody else.
    pub fn of(processes: impl IntoIterator<Item = ProcessId>) -> Self {
        Self { processes: processes.into_iter().collect(), ..Self::default() }
    }

    fn follow(&mut self, launcher: impl BufRead) -> io::Result<()> {
        for line in launcher.lines() {
            let line = line?;
            let Some((what, text)) = line.split_at_checked(1) else { continue };
            let group = || text.parse::<i32>().ok().filter(|group| *group > 1);
            let process = || serde_json::from_str(text).ok();
            match what {
                "+" => self.groups.extend(group()),
                "-" => drop(group().map(|group| self.groups.remove(&group))),
                ">" => self.processes.extend(process()),
                "<" => drop(process().map(|process: ProcessId| self.processes.remove(&process))),
                _ => {}
            }
        }
        Ok(())
    }

    /// Ends them, and all processes of `run`.
    pub fn end(&mut self, run: Option<&RunId>) {
        let groups: Vec<Pid> = self.groups.iter().filter_map(|group| Pid::from_raw(*group)).collect();
        // Those that the launcher did not live to see.
        self.processes.extend(run.map(RunId::processes).unwrap_or_default());
        let all = |signal| {
            for group in &groups {
                // That it has gone meanwhile is no failure.
                let _ = kill_process_group(*group, signal);
            }
            self.processes.iter().for_each(|process| escaped::signal(process, signal));
        };
        let clock = Stopwatch::start();
        all(Signal::TERM);
        let group_lives = |group: &Pid| test_kill_process_group(*group).is_ok();
        let alive = || groups.iter().any(group_lives) || self.processes.iter().any(ProcessId::lives);
        while alive() && clock.elapsed() < PATIENCE {
            std::thread::sleep(LOOK_EVERY);
        }
        all(Signal::KILL);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn ends_the_groups_that_are_left_and_no_other() {
        let start = || Command::new("sleep").arg("1000").process_group(0).spawn().unwrap();
        let (mut left, mut forgotten) = (start(), start());
        let said = format!("+{}\n+{}\n-{}\nwhat?\n+1\n", left.id(), forgotten.id(), forgotten.id());
        // Reaped elsewhere, so that the guard sees the group go.
        let id = left.id();
        let reaper = std::thread::spawn(move || (left.wait().unwrap(), id));
        guard(said.as_bytes()).unwrap();
        let (status, _) = reaper.join().unwrap();
        assert_eq!(elk_bus::child::how(status), "signal 15 (SIGTERM)");
        assert!(forgotten.try_wait().unwrap().is_none());
        forgotten.kill().unwrap();
        forgotten.wait().unwrap();
    }
}
