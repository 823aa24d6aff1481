//! Processes that apps have started outside of their process groups: in a session of their own (`setsid`), say. A group's
//! signals do not reach them, and they outlive whoever started them; here it is kept in mind whose they are.

use std::collections::{BTreeMap, BTreeSet};
use std::os::fd::OwnedFd;
use std::os::unix::fs::MetadataExt;
use std::process::Command;
use std::time::Duration;

use elk_bus::{ProcessId, ProcessStat};
use rustix::process::{Pid, Signal, WaitOptions, geteuid, getpid, pidfd_send_signal, waitpid};
use serde::{Deserialize, Serialize};

use crate::error::LaunchError;
use crate::process::handle;

/// How long an escaped process may take to end when its app has.
pub(crate) const PATIENCE: Duration = Duration::from_secs(2);
/// How often it is looked for new ones.
const PERIOD: Duration = Duration::from_secs(1);
/// How long nobody looks at those that have no handle.
const UNSEEN: Duration = Duration::from_millis(5);

/// The environment variable by which whoever descends from a launcher's apps is known, whoever its parent is by now.
const RUN: &str = "ELK_RUN";

/// A number that no other mission has, whoever launches it by now.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
pub(crate) struct RunId(String);

impl RunId {
    /// A new one.
    pub fn fresh() -> Result<Self, LaunchError> {
        let number = std::fs::read_to_string("/proc/sys/kernel/random/uuid");
        let what = "no number by which the mission's processes are known";
        number.map(|number| Self(number.trim().to_owned())).map_err(|source| LaunchError::System { what, source })
    }

    /// The one that this process was given.
    pub fn own() -> Option<Self> {
        std::env::var(RUN).ok().filter(|number| !number.is_empty()).map(Self)
    }

    /// Gives it to whoever `command` starts, and so to all that they start.
    pub fn give(&self, command: &mut Command) {
        command.env(RUN, &self.0);
    }

    /// All processes of this user, but this one, that were given it.
    pub fn processes(&self) -> Vec<ProcessId> {
        processes_with(RUN, |text| text == self.0.as_bytes())
    }
}

/// All processes of this user, but this one, in whose environment a variable is as it is to be.
pub(crate) fn processes_with(variable: &str, is_right: impl Fn(&[u8]) -> bool) -> Vec<ProcessId> {
    let start = format!("{variable}=");
    let has_it = |pid: &i32| {
        let environment = std::fs::read(format!("/proc/{pid}/environ")).unwrap_or_default();
        let values = environment.split(|byte| *byte == 0).filter_map(|one| one.strip_prefix(start.as_bytes()));
        values.into_iter().any(&is_right)
    };
    let (own, user) = (getpid().as_raw_nonzero().get(), geteuid().as_raw());
    let entries = std::fs::read_dir("/proc").into_iter().flatten().flatten();
    // Root can read those of everybody.
    let of_user = entries.filter(|entry| entry.metadata().is_ok_and(|found| found.uid() == user));
    let all = of_user.filter_map(|entry| entry.file_name().to_str()?.parse::<i32>().ok()).filter(|pid| *pid != own);
    // Whose number has changed hands since it was looked at is another process.
    let seen = all.filter_map(|pid| Some((pid, ProcessId::of(pid)?)));
    seen.filter(|(pid, id)| has_it(pid) && id.lives()).map(|(_, id)| id).collect()
}

/// The escaped processes of a mission's apps, by number.
#[derive(Default)]
pub(crate) struct EscapedProcesses {
    known: BTreeMap<i32, EscapedProcess>,
    looked: Option<Duration>,
}

struct EscapedProcess {
    id: ProcessId,
    /// The app that it descends from; `None`: its parent had died, and it was the launcher's, before it was seen whose
    /// it was.
    app: Option<Pid>,
    termination: Termination,
}

/// How far the termination of an escaped process is.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Termination {
    /// Nothing, while its app lives.
    NotAsked,
    /// It was asked to end, as its app has; it is killed then.
    Asked { until: Duration },
    /// It was killed. The kernel ends it as soon as it can.
    Killed,
}

impl EscapedProcess {
    fn ask(&mut self, now: Duration) {
        signal(&self.id, Signal::TERM);
        self.termination = Termination::Asked { until: now + PATIENCE };
    }

    fn kill(&mut self) {
        signal(&self.id, Signal::KILL);
        self.termination = Termination::Killed;
    }

    /// When it is to be killed.
    fn deadline(&self) -> Option<Duration> {
        match self.termination {
            Termination::Asked { until } => Some(until),
            Termination::NotAsked | Termination::Killed => None,
        }
    }
}

/// What has become known of an escaped process.
#[derive(Debug, PartialEq, Eq)]
pub(crate) enum Sighting {
    /// There is one.
    Found(ProcessId),
    /// It has ended.
    Ended(ProcessId),
}

impl EscapedProcesses {
    /// Has the kernel give orphaned processes to this one, instead of to the machine's first one: so they remain within
    /// reach.
    pub fn become_subreaper() {
        // Where the system has no such thing, those are found that were seen while their parents lived.
        let _ = rustix::process::set_child_subreaper(Some(getpid()));
    }

    /// Looks who is there, if it is time: descendants of `apps`, and orphaned ones; `is_ours` says which children this
    /// process has started itself.
    pub fn look(&mut self, now: Duration, apps: &[Pid], is_ours: impl Fn(i32) -> bool) -> Vec<Sighting> {
        if self.looked.is_some_and(|then| now < then + PERIOD) {
            return Vec::new();
        }
        self.look_now(now, apps, is_ours)
    }

    /// Looks for descendants that are nobody's children any more: those that an ended launcher had been given are
    /// the machine's first process' now. Processes in the groups of `apps` are not among them.
    pub fn look_for_reparented(&mut self, run: &RunId, apps: &[Pid], is_ours: impl Fn(i32) -> bool) -> Vec<Sighting> {
        let groups: BTreeSet<i32> = apps.iter().map(|app| app.as_raw_nonzero().get()).collect();
        let is_reparented = |id: &ProcessId| {
            let is_of_app = group(id.pid).is_some_and(|group| groups.contains(&group));
            !is_of_app && !is_ours(id.pid) && self.known.get(&id.pid).is_none_or(|known| known.id != *id)
        };
        let reparented: Vec<ProcessId> = run.processes().into_iter().filter(is_reparented).collect();
        self.known.extend(
            reparented
                .iter()
                .map(|id| (id.pid, EscapedProcess { id: *id, app: None, termination: Termination::NotAsked })),
        );
        reparented.into_iter().map(Sighting::Found).collect()
    }

    /// As [`EscapedProcesses::look`], whatever the time.
    pub fn look_now(&mut self, now: Duration, apps: &[Pid], is_ours: impl Fn(i32) -> bool) -> Vec<Sighting> {
        self.looked = Some(now);
        let of_apps = apps.iter().flat_map(|app| outside(*app).into_iter().map(|pid| (pid, Some(*app))));
        let mut seen: Vec<(i32, Option<Pid>)> = of_apps.collect();
        // What the program around the launcher has started itself is of its own group.
        let own = getpid().as_raw_nonzero().get();
        let own_group = group(own);
        let reparented = children(own).into_iter().filter(|pid| !is_ours(*pid));
        seen.extend(reparented.filter(|pid| group(*pid) != own_group).map(|pid| (pid, None)));
        let mut sightings = Vec::new();
        for (pid, app) in seen {
            match ProcessId::of(pid) {
                Some(id) if self.known.get(&pid).is_none_or(|known| known.id != id) => {
                    self.known.insert(pid, EscapedProcess { id, app, termination: Termination::NotAsked });
                    sightings.push(Sighting::Found(id));
                }
                Some(_) => {}
                None => reap_child(pid),
            }
        }
        sightings
    }

    /// An app has ended: what it has started is asked to end as well. `None`: all have.
    pub fn dismiss(&mut self, app: Option<Pid>, now: Duration) {
        let meant =
            |one: &&mut EscapedProcess| one.termination == Termination::NotAsked && (app.is_none() || one.app == app);
        self.known.values_mut().filter(meant).for_each(|one| one.ask(now));
    }

    /// Kills those whose time is over, and forgets those that have ended.
    pub fn reap(&mut self, now: Duration) -> Vec<Sighting> {
        let mut sightings = Vec::new();
        self.known.retain(|pid, one| {
            if one.deadline().is_some_and(|until| until <= now) {
                one.kill();
            }
            let lives = one.id.lives();
            if !lives {
                reap_child(*pid);
                sightings.push(Sighting::Ended(one.id));
            }
            lives
        });
        sightings
    }

    /// When the next one is to be killed.
    pub fn deadline(&self) -> Option<Duration> {
        self.known.values().filter_map(EscapedProcess::deadline).min()
    }

    /// Waits until one of them has ended or is to be killed, at most `patience`.
    pub fn wait(&self, now: Duration, patience: Duration) {
        let handles: Vec<OwnedFd> = self.known.values().filter_map(|one| handle::of(&one.id)).collect();
        // One has ended already, unless there is no descriptor for its handle: that is no reason not to rest.
        let patience = if handles.len() < self.known.len() { patience.min(UNSEEN) } else { patience };
        let left = self.deadline().map_or(patience, |until| patience.min(until.saturating_sub(now)));
        handle::wait(&handles.iter().collect::<Vec<_>>(), left);
    }

    /// Whether nobody is left.
    pub fn is_empty(&self) -> bool {
        self.known.is_empty()
    }
}

/// Sends a signal to a process, if it is still the one that is meant.
pub(crate) fn signal(id: &ProcessId, signal: Signal) {
    if let Some(handle) = handle::of(id) {
        // That it has gone meanwhile is no failure.
        let _ = pidfd_send_signal(handle, signal);
    }
}

/// Waits for a child that has ended; whoever is no child of ours is waited for by somebody else.
fn reap_child(pid: i32) {
    let _ = waitpid(Pid::from_raw(pid), WaitOptions::NOHANG);
}

/// The descendants of a process that are not of its group.
fn outside(leader: Pid) -> Vec<i32> {
    let leader = leader.as_raw_nonzero().get();
    let mut found = vec![leader];
    let mut next = 0;
    while let Some(parent) = found.get(next) {
        let more: Vec<i32> = children(*parent).into_iter().filter(|pid| !found.contains(pid)).collect();
        found.extend(more);
        next += 1;
    }
    found.split_off(1).into_iter().filter(|pid| group(*pid) != Some(leader)).collect()
}

/// The number of a process' group; 0: its leader is not of this container (for which `getpgid` of rustix has no word).
fn group(pid: i32) -> Option<i32> {
    ProcessStat::of(pid).map(|stat| stat.group)
}

/// The children of all threads of a process.
fn children(pid: i32) -> Vec<i32> {
    let threads = std::fs::read_dir(format!("/proc/{pid}/task")).into_iter().flatten().flatten();
    let lists = threads.filter_map(|thread| std::fs::read_to_string(thread.path().join("children")).ok());
    let all: Vec<String> = lists.collect();
    all.iter().flat_map(|list| list.split_whitespace()).filter_map(|pid| pid.parse().ok()).collect()
}

#[cfg(test)]
mod tests {
    use std::io::{BufRead, BufReader, Read, Write};
    use std::os::unix::process::CommandExt;
    use std::process::{Child, Stdio};

    use elk_bus::clock::Stopwatch;

    use super::*;

    /// A shell, leader of its group, with a child in a session of its own: both, and the child's number.
    fn shell_with_escaped(script: &str) -> (Child, i32) {
        let mut command = Command::new("sh");
        let mut shell = command.args(["-c", script]).process_group(0).stdout(Stdio::piped()).spawn().unwrap();
        let mut line = String::new();
        BufReader::new(shell.stdout.take().unwrap()).read_line(&mut line).unwrap();
        (shell, line.trim().parse().unwrap())
    }

    #[test]
    fn a_child_in_a_session_of_its_own_is_found_asked_and_killed() {
        let (mut shell, number) =
            shell_with_escaped("setsid sh -c 'trap \"\" TERM; echo $$; exec sleep 1000' & sleep 1000");
        let app = Pid::from_child(&shell);
        let id = ProcessId::of(number).unwrap();
        let mut escaped = EscapedProcesses::default();
        // Children of other tests of this process are theirs.
        let is_ours = |pid| pid != number;
        let found = escaped.look(Duration::ZERO, &[app], is_ours);
        assert!(found.contains(&Sighting::Found(id)), "{found:?}");
        assert!(escaped.look(PERIOD / 2, &[app], is_ours).is_empty());
        assert!(escaped.look(PERIOD, &[app], is_ours).is_empty());
        let killed = rustix::process::kill_process_group(app, Signal::KILL);
        killed.unwrap();
        shell.wait().unwrap();
        assert!(id.lives());
        escaped.dismiss(Some(app), PERIOD);
        assert!(escaped.reap(PERIOD).is_empty() && id.lives());
        assert_eq!(escaped.deadline(), Some(PERIOD + PATIENCE));
        escaped.reap(PERIOD + PATIENCE);
        // Regression: until the kernel had ended it, its deadline was one that lay in the past, and nobody slept.
        assert_eq!(escaped.deadline(), None);
        // It may have ended already; and it rests for a moment only while it has no handle of one.
        while id.lives() {
            escaped.wait(PERIOD + PATIENCE, Duration::from_secs(60));
        }
        // Its handle tells of its end a moment after that can be seen.
        let waited = Stopwatch::start();
        while !escaped.is_empty() {
            assert!(waited.elapsed() < Duration::from_secs(60));
            escaped.reap(PERIOD + PATIENCE);
        }
    }

    #[test]
    fn whoever_was_given_a_run_is_found_by_it() {
        let (one, other) = (RunId::fresh().unwrap(), RunId::fresh().unwrap());
        let mut command = Command::new("cat");
        one.give(&mut command);
        let mut child = command.stdin(Stdio::piped()).stdout(Stdio::piped()).spawn().unwrap();
        // The kernel shows no environment until the program has begun.
        child.stdin.as_mut().unwrap().write_all(b"!").unwrap();
        child.stdout.as_mut().unwrap().read_exact(&mut [0]).unwrap();
        let id = ProcessId::of(child.id() as i32).unwrap();
        assert_eq!((one.processes(), other.processes()), (vec![id], vec![]));
        child.kill().unwrap();
        child.wait().unwrap();
    }

    #[test]
    fn a_process_that_has_an_escaped_process_s_number_by_now_is_left_alone() {
        let mut child = Command::new("sleep").arg("1000").spawn().unwrap();
        let mut other = ProcessId::of(child.id() as i32).unwrap();
        other.started -= 1;
        signal(&other, Signal::KILL);
        assert!(child.try_wait().unwrap().is_none());
        child.kill().unwrap();
        child.wait().unwrap();
    }
}
