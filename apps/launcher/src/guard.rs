//! A small process that outlives the launcher by moments: when the launcher is gone, however it went, it ends what is left.
//!
//! The kernel already sends SIGTERM to the launcher's children when it dies. The guard is there for children that do not
//! listen, and for children's children. It knows the process groups from a pipe, and that the launcher is gone from the
//! pipe's end.

use std::collections::BTreeSet;
use std::io::{self, BufRead, Write};
use std::os::unix::process::CommandExt;
use std::path::Path;
use std::process::{Child, ChildStdin, Command, Stdio};
use std::time::Duration;

use elk_bus::clock::Stopwatch;
use rustix::process::{Pid, Signal, kill_process_group, test_kill_process_group};

use crate::error::LaunchError;

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
    /// Starts the guard: `program guard`.
    pub fn start(program: &Path) -> Result<Self, LaunchError> {
        let mut command = Command::new(program);
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
    let mut groups = BTreeSet::new();
    let read = follow(launcher, &mut groups);
    end(&groups);
    read
}

fn follow(launcher: impl BufRead, groups: &mut BTreeSet<i32>) -> io::Result<()> {
    for line in launcher.lines() {
        let line = line?;
        let group = |text: &str| text.parse::<i32>().ok().filter(|group| *group > 1);
        if let Some(group) = line.strip_prefix('+').and_then(group) {
            groups.insert(group);
        } else if let Some(group) = line.strip_prefix('-').and_then(group) {
            groups.remove(&group);
        }
    }
    Ok(())
}

fn end(groups: &BTreeSet<i32>) {
    let groups: Vec<Pid> = groups.iter().filter_map(|group| Pid::from_raw(*group)).collect();
    let clock = Stopwatch::start();
    for group in &groups {
        let _ = kill_process_group(*group, Signal::TERM);
    }
    let alive = || groups.iter().any(|group| test_kill_process_group(*group).is_ok());
    while alive() && clock.elapsed() < PATIENCE {
        std::thread::sleep(LOOK_EVERY);
    }
    for group in &groups {
        let _ = kill_process_group(*group, Signal::KILL);
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
        assert_eq!(crate::process::how(status), "signal 15 (SIGTERM)");
        assert!(forgotten.try_wait().unwrap().is_none());
        forgotten.kill().unwrap();
        forgotten.wait().unwrap();
    }
}
