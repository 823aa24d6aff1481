//! All that a mission's processes have started, wherever it went: marked when it begins, watched by the guard, and ended
//! with those who started it.

use std::collections::BTreeSet;
use std::path::Path;
use std::process::Command;
use std::time::Duration;

use elk_bus::Community;
use rustix::process::Pid;

use crate::error::LaunchError;
use crate::process::escaped::{EscapedProcesses, RunId, Sighting};
use crate::process::guard::Guard;
use crate::process::leftovers::Mark;

/// What is known of the descendants of one mission's processes.
pub(crate) struct Descendants {
    /// What tells them from all others.
    run: RunId,
    /// That of those who are to end with this launcher.
    mark: Option<Mark>,
    guard: Option<Guard>,
    /// What apps have started outside of their groups.
    escaped: EscapedProcesses,
    /// Whether a launcher which is gone has begun the mission.
    adopted: bool,
}

impl Descendants {
    /// Has orphaned processes become this one's children, and starts the guard of those who are to end with this
    /// launcher, unless they are `detached` from it. The guard is a command of `program`, elk itself.
    pub fn begin(run: RunId, program: &Path, community: &Community, detached: bool) -> Result<Self, LaunchError> {
        let guard = match detached {
            true => None,
            false => Some(Guard::start(program, &run)?),
        };
        let mark = Mark::own(community).filter(|_| !detached);
        EscapedProcesses::become_subreaper();
        Ok(Self { run, mark, guard, escaped: EscapedProcesses::default(), adopted: false })
    }

    /// They were begun by a launcher that is gone: what they have started since then has to be looked for.
    pub fn adopt(&mut self) {
        self.adopted = true;
    }

    /// What tells them from all others.
    pub fn run(&self) -> &RunId {
        &self.run
    }

    /// Marks whoever `command` starts, and all that they start.
    pub fn mark(&self, command: &mut Command) {
        self.run.give(command);
        match &self.mark {
            Some(mark) => mark.give(command),
            None => Mark::take(command),
        }
    }

    /// A process was started: it ends with the launcher.
    pub fn watch(&mut self, pid: Pid) {
        self.guard.iter_mut().for_each(|guard| guard.watch(pid));
    }

    /// A process has ended and was waited for: its number is somebody else's.
    pub fn forget(&mut self, pid: Pid) {
        self.guard.iter_mut().for_each(|guard| guard.forget(pid));
    }

    /// A process has ended: what it had started elsewhere is to end, too.
    pub fn ended(&mut self, pid: Pid, now: Duration) {
        self.escaped.dismiss(Some(pid), now);
        self.forget(pid);
    }

    /// Sees who descends from `apps`, if it is time, and ends whose time has come.
    pub fn reap(&mut self, now: Duration, apps: &[Pid]) {
        let ours = self.with_guard(apps);
        let mut sightings = self.escaped.look(now, apps, |pid| ours.contains(&pid));
        sightings.extend(self.escaped.reap(now));
        self.note(&sightings);
    }

    /// Sees who descends from `apps`, at once.
    pub fn look_now(&mut self, now: Duration, apps: &[Pid]) {
        let ours = self.with_guard(apps);
        let mut sightings = self.escaped.look_now(now, apps, |pid| ours.contains(&pid));
        if self.adopted {
            sightings.extend(self.escaped.look_for_reparented(&self.run, apps, |pid| ours.contains(&pid)));
        }
        self.note(&sightings);
    }

    /// Ends all that apps have started elsewhere; whether none is left.
    pub fn end_escaped(&mut self, now: Duration) -> bool {
        self.escaped.dismiss(None, now);
        let sightings = self.escaped.reap(now);
        self.note(&sightings);
        self.escaped.is_empty()
    }

    /// When somebody is to be looked at next.
    pub fn deadline(&self) -> Option<Duration> {
        self.escaped.deadline()
    }

    /// Waits for the end of one of them, `most` at most.
    pub fn wait(&self, now: Duration, most: Duration) {
        self.escaped.wait(now, most);
    }

    fn note(&mut self, sightings: &[Sighting]) {
        if let Some(guard) = &mut self.guard {
            sightings.iter().for_each(|sighting| guard.note(sighting));
        }
    }

    /// The numbers of the processes that this launcher has started itself.
    fn with_guard(&self, apps: &[Pid]) -> BTreeSet<i32> {
        let apps = apps.iter().map(|pid| pid.as_raw_nonzero().get());
        apps.chain(self.guard.as_ref().map(Guard::pid)).collect()
    }
}
