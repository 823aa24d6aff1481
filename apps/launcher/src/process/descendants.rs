//! All that a mission's processes have started, wherever it went: marked when it begins, watched by the guard, and ended
//! with those who started it.

use std::collections::BTreeSet;
use std::path::Path;
use std::process::Command;
use std::time::Duration;

use elk_bus::Community;
use rustix::process::Pid;

use crate::error::LaunchError;
use crate::process::guard::Guard;
use crate::process::orphans::Mark;
use crate::process::strays::{Run, Sight, Strays};

/// What is known of the descendants of one mission's processes.
pub(crate) struct Descendants {
    /// What tells them from all others.
    run: Run,
    /// That of those who are to end with this launcher.
    mark: Option<Mark>,
    guard: Option<Guard>,
    /// What apps have started outside of their groups.
    strays: Strays,
    /// Whether a launcher which is gone has begun the mission.
    adopted: bool,
}

impl Descendants {
    /// Has orphans become this process' children, and starts the guard of those who are to end with this launcher, unless
    /// they are `detached` from it. The guard is a command of `program`, elk itself.
    pub fn begin(run: Run, program: &Path, community: &Community, detached: bool) -> Result<Self, LaunchError> {
        let guard = match detached {
            true => None,
            false => Some(Guard::start(program, &run)?),
        };
        let mark = Mark::own(community).filter(|_| !detached);
        Strays::gather_orphans();
        Ok(Self { run, mark, guard, strays: Strays::default(), adopted: false })
    }

    /// They were begun by a launcher that is gone: what they have started since then has to be looked for.
    pub fn adopt(&mut self) {
        self.adopted = true;
    }

    /// What tells them from all others.
    pub fn run(&self) -> &Run {
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
        self.strays.dismiss(Some(pid), now);
        self.forget(pid);
    }

    /// Sees who descends from `apps`, if it is time, and ends whose time has come.
    pub fn reap(&mut self, now: Duration, apps: &[Pid]) {
        let ours = self.with_guard(apps);
        let mut sights = self.strays.look(now, apps, &ours);
        sights.extend(self.strays.reap(now));
        self.note(&sights);
    }

    /// Sees who descends from `apps`, at once.
    pub fn look_now(&mut self, now: Duration, apps: &[Pid]) {
        let ours = self.with_guard(apps);
        let mut sights = self.strays.look_now(now, apps, &ours);
        if self.adopted {
            sights.extend(self.strays.look_for_lost(&self.run, apps, &ours));
        }
        self.note(&sights);
    }

    /// Ends all that apps have started elsewhere; whether none is left.
    pub fn end_strays(&mut self, now: Duration) -> bool {
        self.strays.dismiss(None, now);
        let sights = self.strays.reap(now);
        self.note(&sights);
        self.strays.is_empty()
    }

    /// When somebody is to be looked at next.
    pub fn deadline(&self) -> Option<Duration> {
        self.strays.deadline()
    }

    /// Waits for the end of one of them, `most` at most.
    pub fn wait(&self, now: Duration, most: Duration) {
        self.strays.wait(now, most);
    }

    fn note(&mut self, sights: &[Sight]) {
        if let Some(guard) = &mut self.guard {
            sights.iter().for_each(|sight| guard.note(sight));
        }
    }

    /// The numbers of the processes that this launcher has started itself.
    fn with_guard(&self, apps: &[Pid]) -> BTreeSet<i32> {
        let apps = apps.iter().map(|pid| pid.as_raw_nonzero().get());
        apps.chain(self.guard.as_ref().map(Guard::pid)).collect()
    }
}
