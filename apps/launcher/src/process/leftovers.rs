//! Processes that were to end with their launcher and were not told: launcher, guard and broker were killed together,
//! and nobody was left who knew of them. The next launcher or broker of their community ends them.

use std::process::Command;

use elk_bus::{Community, ProcessId, ProcessStat};
use rustix::process::getpid;
use serde::{Deserialize, Serialize};

use crate::process::escaped::processes_with;
use crate::process::guard::Watched;

/// The environment variable that says of whoever descends from a mission's processes with whom they are to end.
const LAUNCHER: &str = "ELK_LAUNCHER";

/// What it says.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub(crate) struct Mark {
    community: String,
    launcher: ProcessId,
}

impl Mark {
    /// That of the processes that are to end with this one; `None`: it cannot be told from others of its number.
    pub fn own(community: &Community) -> Option<Self> {
        let launcher = ProcessId::of(getpid().as_raw_nonzero().get())?;
        Some(Self { community: community.to_string(), launcher })
    }

    /// Gives it to whoever `command` starts, and so to all that they start.
    pub fn give(&self, command: &mut Command) {
        // Numbers and a name can always be said.
        let _ = serde_json::to_string(self).map(|text| command.env(LAUNCHER, text));
    }

    /// Sees that whoever `command` starts has none.
    pub fn take(command: &mut Command) {
        command.env_remove(LAUNCHER);
    }

    fn read(text: &[u8]) -> Option<Self> {
        serde_json::from_slice(text).ok()
    }
}

/// Ends what a mission of this community has left whose launcher is gone; says so, if there was anything.
pub fn end_leftovers(community: &Community) -> Option<String> {
    let leftovers = leftovers_of(community);
    if leftovers.is_empty() {
        return None;
    }
    let numbers: Vec<String> = leftovers.iter().map(|id| id.pid.to_string()).collect();
    Watched::of(leftovers).end(None);
    Some(format!(
        "of a mission of community {community} whose launcher and guard were killed there was left, and is ended now: \
         process {}",
        numbers.join(", ")
    ))
}

/// Processes of this user that were to end with a launcher of this community that has ended for certain. Whoever this
/// process descends from is none: that is where it was called from.
fn leftovers_of(community: &Community) -> Vec<ProcessId> {
    let callers = callers();
    let is_leftover = |text: &[u8]| {
        Mark::read(text).is_some_and(|mark| mark.community == community.as_str() && mark.launcher.has_ended())
    };
    processes_with(LAUNCHER, is_leftover).into_iter().filter(|id| !callers.contains(&id.pid)).collect()
}

/// The processes that this one descends from.
fn callers() -> Vec<i32> {
    let parent = |pid: &i32| ProcessStat::of(*pid).map(|stat| stat.parent).filter(|parent| *parent > 0);
    std::iter::successors(Some(getpid().as_raw_nonzero().get()), parent).collect()
}

#[cfg(test)]
mod tests {
    use std::io::{Read, Write};
    use std::process::{Child, Stdio};

    use super::*;

    /// A process that was given this mark; it runs its program already.
    fn marked(mark: &Mark) -> Child {
        let mut command = Command::new("cat");
        mark.give(&mut command);
        let mut child = command.stdin(Stdio::piped()).stdout(Stdio::piped()).spawn().unwrap();
        child.stdin.as_mut().unwrap().write_all(b"!").unwrap();
        child.stdout.as_mut().unwrap().read_exact(&mut [0]).unwrap();
        child
    }

    #[test]
    fn only_those_are_ended_whose_launcher_in_this_community_has_ended_for_certain() {
        let community = Community::new(format!("leftovers-{}", std::process::id())).unwrap();
        let own = Mark::own(&community).unwrap();
        // Somebody else has the launcher's number by now.
        let mut ended = own.clone();
        ended.launcher.started += 1;
        let other = Mark { community: format!("{community}x"), ..ended.clone() };
        // A launcher that is in another container, or was before the machine was started again.
        let changed = |field: &str| {
            let mut text = serde_json::to_value(&ended).unwrap();
            text["launcher"][field] = 1.into();
            Mark::read(text.to_string().as_bytes()).unwrap()
        };
        let mut spared: Vec<Child> = [own, other, changed("namespace"), changed("boot")].iter().map(marked).collect();
        let mut leftover = marked(&ended);
        let id = ProcessId::of(leftover.id() as i32).unwrap();
        assert_eq!(leftovers_of(&community), [id]);
        // It would end by itself if nobody could write to it any more.
        let _input = leftover.stdin.take();
        let reaper = std::thread::spawn(move || leftover.wait().unwrap());
        assert!(end_leftovers(&community).unwrap().contains(&id.pid.to_string()));
        assert_eq!(elk_bus::child::how(reaper.join().unwrap()), "signal 15 (SIGTERM)");
        assert_eq!(end_leftovers(&community), None);
        for child in &mut spared {
            assert!(child.try_wait().unwrap().is_none());
            child.kill().unwrap();
            child.wait().unwrap();
        }
    }
}
