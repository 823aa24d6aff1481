//! One app as an operating-system process: started so that it inherits nothing, with a text log, and ended for certain.

use std::fs::{File, OpenOptions};
use std::io::{self, Read, Seek, SeekFrom};
use std::os::fd::{AsFd, BorrowedFd, OwnedFd};
use std::os::unix::process::{CommandExt, ExitStatusExt};
use std::path::{Path, PathBuf};
use std::process::{Child, Command, ExitStatus, Stdio};
use std::time::Duration;

use elk_bus::ProcessId;
use elk_bus::child::{Bond, how, keep_to_itself};
use rustix::process::{Pid, Signal, kill_process_group};

use crate::error::LaunchError;
use crate::process::handle;
use crate::supervisor::Exit;

/// Lines of an ended app's log that the message about its end quotes.
const TAIL_LINES: usize = 5;
/// How long the kernel may take to end a killed process.
const KILL_PATIENCE: Duration = Duration::from_secs(5);
/// Bytes of a log that are searched for them.
const TAIL_BYTES: u64 = 64 << 10;

/// A process, leader of a process group of its own: a child, or one that a launcher which is gone has left behind.
pub(crate) struct Process {
    pub log: PathBuf,
    /// `None`: it is no child of ours, so nobody tells how it ends.
    child: Option<Child>,
    pid: Pid,
    /// What tells it from others that had or will have its number; `None`: it had ended before it could be seen.
    id: Option<ProcessId>,
    pidfd: OwnedFd,
    /// Where in the log its own words begin.
    log_from: u64,
    exit: Option<Exit>,
}

impl Process {
    /// Starts `command` with its output in `log`, behind what is there already.
    pub fn spawn(name: &str, mut command: Command, log: &Path, bond: Bond) -> Result<Self, LaunchError> {
        let unwritable = |source| LaunchError::File { file: log.to_owned(), source };
        let out = OpenOptions::new().create(true).append(true).open(log).map_err(unwritable)?;
        let log_from = out.metadata().map_err(unwritable)?.len();
        let err = out.try_clone().map_err(unwritable)?;
        command.stdin(Stdio::null()).stdout(out).stderr(err).process_group(0);
        keep_to_itself(&mut command, bond);
        let program = PathBuf::from(command.get_program());
        let failed = |source| LaunchError::CannotStart { app: name.to_owned(), program, source };
        let mut child = command.spawn().map_err(failed)?;
        let pid = Pid::from_child(&child);
        let pidfd = handle::of_child(pid).map_err(|source| {
            // Without a handle it could not be waited for: better no child than one that nobody watches.
            let _ = child.kill().and_then(|()| child.wait());
            LaunchError::System { what: "no handle of a new process", source }
        })?;
        let log = log.to_owned();
        let id = ProcessId::of(pid.as_raw_nonzero().get());
        Ok(Self { log, child: Some(child), pid, id, pidfd, log_from, exit: None })
    }

    /// Takes over a process; `None`: it is gone, and its number may be another's.
    pub fn adopt(id: ProcessId, log: &Path) -> Option<Self> {
        let (pid, pidfd) = (Pid::from_raw(id.pid)?, handle::of(&id)?);
        let log = log.to_owned();
        Some(Self { log, child: None, pid, id: Some(id), pidfd, log_from: 0, exit: None })
    }

    /// The process, which is also its group.
    pub fn pid(&self) -> Pid {
        self.pid
    }

    /// What tells it from others that had or will have its number.
    pub fn id(&self) -> Option<ProcessId> {
        self.id
    }

    /// Becomes readable when it ends.
    pub fn handle(&self) -> BorrowedFd<'_> {
        self.pidfd.as_fd()
    }

    /// How it ended, if it has. What it had started then goes with it.
    pub fn ended(&mut self) -> Option<&Exit> {
        if self.exit.is_none() && self.has_ended() {
            // Until a child is waited for, its number is nobody else's; a stranger's may be.
            if self.child.is_some() {
                self.signal(Signal::KILL);
            }
            let status = self.child.as_mut().map(Child::wait);
            self.exit = Some(self.exit_of(status.and_then(Result::ok)));
        }
        self.exit.as_ref()
    }

    fn exit_of(&self, status: Option<ExitStatus>) -> Exit {
        Exit {
            how: status.map_or_else(unseen, how),
            fine: status.is_some_and(|status| status.success()),
            asked: status.is_none_or(|status| status.signal() == Some(libc::SIGTERM)),
            log: self.log.clone(),
            tail: tail(&self.log, self.log_from).unwrap_or_default(),
        }
    }

    /// Whether nobody can tell how it will have ended.
    pub fn is_adopted(&self) -> bool {
        self.child.is_none()
    }

    /// Asks it to end (SIGTERM), and waits; after `patience` it is killed. Answers how it ended, and whether it had to be
    /// killed.
    pub fn stop(&mut self, patience: Duration) -> (Option<&Exit>, bool) {
        if self.ended().is_some() {
            return (self.exit.as_ref(), false);
        }
        self.ask();
        let in_time = self.wait(patience);
        if !in_time {
            self.kill();
            self.wait(KILL_PATIENCE);
        }
        (self.ended(), !in_time)
    }

    /// Asks it to end.
    pub fn ask(&self) {
        self.signal(Signal::TERM);
    }

    /// Ends it.
    pub fn kill(&self) {
        self.signal(Signal::KILL);
    }

    /// Ends it, and waits until it has.
    pub fn kill_and_wait(&mut self) {
        self.kill();
        self.wait(KILL_PATIENCE);
        self.ended();
    }

    fn has_ended(&self) -> bool {
        self.wait(Duration::ZERO)
    }

    /// Waits until it has ended, at most `patience`; whether it has.
    pub fn wait(&self, patience: Duration) -> bool {
        handle::wait(&[&self.pidfd], patience)
    }

    /// Sends a signal to its group, unless it has been waited for; that the group is gone already is no failure.
    fn signal(&self, signal: Signal) {
        if self.exit.is_none() {
            let _ = kill_process_group(self.pid, signal);
        }
    }
}

/// The end of a process that is no child of ours.
fn unseen() -> String {
    "unseen: it was the child of a launcher that is gone".to_owned()
}

/// The last lines of a log, of those that begin at `from` or later.
pub(crate) fn tail(log: &Path, from: u64) -> io::Result<Vec<String>> {
    let mut file = File::open(log)?;
    let length = file.metadata()?.len();
    file.seek(SeekFrom::Start(from.max(length.saturating_sub(TAIL_BYTES))))?;
    let mut bytes = Vec::new();
    file.read_to_end(&mut bytes)?;
    let text = String::from_utf8_lossy(&bytes);
    let lines: Vec<&str> = without_backtraces(&text).filter(|line| !line.trim().is_empty()).collect();
    let last = &lines[lines.len().saturating_sub(TAIL_LINES)..];
    Ok(last.iter().map(|line| (*line).to_owned()).collect())
}

/// The lines of a Rust program's words but for those that say where it panicked from, and how to see that: they come behind
/// the reason, and are in the log.
fn without_backtraces(text: &str) -> impl Iterator<Item = &str> {
    let mut within = false;
    let hint = |line: &str| line.starts_with("note: ") && line.contains("RUST_BACKTRACE");
    text.lines().filter(move |line| {
        within = *line == "stack backtrace:" || within && line.starts_with(' ');
        !within && !hint(line)
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    fn shell(script: &str, log: &Path) -> Process {
        let mut command = Command::new("sh");
        command.args(["-c", script]);
        Process::spawn("Shell", command, log, Bond::Parent).unwrap()
    }

    fn logged(script: &str) -> (tempfile::TempDir, Process) {
        let folder = tempfile::tempdir().unwrap();
        let process = shell(script, &folder.path().join("shell.log"));
        (folder, process)
    }

    const PATIENCE: Duration = Duration::from_secs(60);

    #[test]
    fn the_message_about_an_end_says_how_and_quotes_the_log() {
        let (_folder, mut shell) = logged("seq 7; echo alas >&2; exit 3");
        assert!(shell.wait(PATIENCE));
        let exit = shell.ended().unwrap();
        assert_eq!((exit.how.as_str(), exit.fine), ("exit code 3", false));
        assert_eq!(exit.tail, ["4", "5", "6", "7", "alas"]);
        assert_eq!(exit.in_short(), "exit code 3; last line: alas");
    }

    /// Regression: the reason of a panic was driven out by the backtrace behind it, or by the word on how to get one.
    #[test]
    fn the_message_about_an_end_quotes_a_panic_and_not_its_backtrace() {
        let frames = "stack backtrace:\n   0: one\n             at ./x.rs:1\n   1: two\n   2: three\n   3: four\n";
        let hints = ["run with `RUST_BACKTRACE=1` environment variable", "details are omitted, `RUST_BACKTRACE=full`"];
        for (frames, hint) in [("", hints[0]), (frames, hints[1])] {
            let said = format!("up\n\nthread 'main' panicked at x.rs:1:\nno gravity\n{frames}note: {hint}");
            let (_folder, mut shell) = logged(&format!("cat <<'END'\n{said}\nEND\nexit 101"));
            assert!(shell.wait(PATIENCE));
            let exit = shell.ended().unwrap();
            assert_eq!(exit.tail, ["up", "thread 'main' panicked at x.rs:1:", "no gravity"]);
        }
    }

    #[test]
    fn a_process_that_ends_when_asked_is_not_killed() {
        let (_folder, mut shell) = logged("trap 'exit 4' TERM; echo up; while :; do sleep 0.01; done");
        while tail(&shell.log, 0).unwrap() != ["up"] {
            std::thread::yield_now();
        }
        let (exit, killed) = shell.stop(PATIENCE);
        assert_eq!((exit.unwrap().how.as_str(), killed), ("exit code 4", false));
    }

    #[test]
    fn a_process_that_does_not_listen_is_killed_with_its_children() {
        let (_folder, mut shell) = logged("trap '' TERM; sleep 1000 & echo $!; wait");
        let child = loop {
            if let Some(line) = tail(&shell.log, 0).unwrap().first() {
                break line.parse::<i32>().unwrap();
            }
            std::thread::yield_now();
        };
        let (exit, killed) = shell.stop(Duration::ZERO);
        assert_eq!((exit.unwrap().how.as_str(), killed), ("signal 9 (SIGKILL)", true));
        // Killed, it is gone, or a zombie until whoever adopted it looks.
        while elk_bus::ProcessStat::of(child).is_some_and(|stat| !stat.has_ended()) {
            std::thread::yield_now();
        }
    }

    #[test]
    fn a_child_inherits_no_descriptor() {
        let folder = tempfile::tempdir().unwrap();
        let leak = File::create(folder.path().join("leak")).unwrap();
        rustix::io::fcntl_setfd(&leak, rustix::io::FdFlags::empty()).unwrap();
        // What the shell has, `ls` has from it.
        let mut shell = shell("ls -l /proc/self/fd", &folder.path().join("shell.log"));
        assert!(shell.wait(PATIENCE));
        assert!(shell.ended().unwrap().fine);
        let said = std::fs::read_to_string(&shell.log).unwrap();
        assert!(said.contains("shell.log") && !said.contains("leak"), "{said}");
    }

    #[test]
    fn what_cannot_be_started_is_named() {
        let folder = tempfile::tempdir().unwrap();
        let command = Command::new("./no-such-program");
        let log = folder.path().join("x.log");
        let error = Process::spawn("X", command, &log, Bond::Parent).err().unwrap().to_string();
        assert!(error.starts_with("X cannot be started: ./no-such-program: No such file"), "{error}");
    }

    #[test]
    fn a_log_that_goes_on_is_quoted_from_the_last_start_on() {
        let (folder, mut first) = logged("echo old words");
        assert!(first.wait(PATIENCE));
        assert_eq!(first.ended().unwrap().tail, ["old words"]);
        let mut second = shell("echo new words", &folder.path().join("shell.log"));
        assert!(second.wait(PATIENCE));
        assert_eq!(second.ended().unwrap().tail, ["new words"]);
    }

    #[test]
    fn a_process_that_is_no_child_is_adopted_by_its_number_and_its_start() {
        let (_folder, mut parent) = logged("sleep 1000 & echo $!; wait");
        let pid = loop {
            if let Some(line) = tail(&parent.log, 0).unwrap().first() {
                break Pid::from_raw(line.parse().unwrap()).unwrap();
            }
            std::thread::yield_now();
        };
        let id = ProcessId::of(pid.as_raw_nonzero().get()).unwrap();
        let mut other = id;
        other.started += 1;
        assert!(Process::adopt(other, &parent.log).is_none());
        let mut sleep = Process::adopt(id, &parent.log).unwrap();
        assert!(sleep.is_adopted() && sleep.ended().is_none());
        parent.kill();
        assert!(sleep.wait(PATIENCE));
        assert!(sleep.ended().unwrap().how.starts_with("unseen"));
        parent.kill_and_wait();
    }
}
