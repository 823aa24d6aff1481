//! One app as an operating-system process: started so that it inherits nothing, with a text log, and ended for certain.

use std::fs::{File, OpenOptions};
use std::io::{self, Read, Seek, SeekFrom};
use std::os::fd::OwnedFd;
use std::os::unix::process::{CommandExt, ExitStatusExt};
use std::path::{Path, PathBuf};
use std::process::{Child, Command, ExitStatus, Stdio};
use std::time::Duration;

use rustix::event::{PollFd, PollFlags, Timespec, poll};
use rustix::process::{Pid, PidfdFlags, Signal, getppid, kill_process_group, pidfd_open};

use crate::error::LaunchError;

/// Lines of a dead app's log that its obituary quotes.
const TAIL_LINES: usize = 5;
/// How long the kernel may take to end a killed process.
const KILL_PATIENCE: Duration = Duration::from_secs(5);
/// Bytes of a log that are searched for them.
const TAIL_BYTES: i64 = 4096;

/// A started process, leader of a process group of its own.
pub(crate) struct Process {
    pub name: String,
    pub log: PathBuf,
    child: Child,
    pid: Pid,
    pidfd: OwnedFd,
    status: Option<ExitStatus>,
}

impl Process {
    /// Starts `command` with its output in `log`.
    ///
    /// It is sent SIGTERM when the thread that started it dies, so this has to be the launcher's main thread.
    pub fn spawn(name: &str, mut command: Command, log: &Path) -> Result<Self, LaunchError> {
        let unwritable = |source| LaunchError::File { file: log.to_owned(), source };
        let out = OpenOptions::new().create(true).append(true).open(log).map_err(unwritable)?;
        let err = out.try_clone().map_err(unwritable)?;
        command.stdin(Stdio::null()).stdout(out).stderr(err).process_group(0);
        keep_to_itself(&mut command);
        let program = PathBuf::from(command.get_program());
        let failed = |source| LaunchError::CannotStart { app: name.to_owned(), program, source };
        let mut child = command.spawn().map_err(failed)?;
        let pid = Pid::from_child(&child);
        let pidfd = pidfd_open(pid, PidfdFlags::empty()).map_err(|error| {
            // Without a handle it could not be waited for: better no child than one that nobody watches.
            let _ = child.kill().and_then(|()| child.wait());
            LaunchError::System { what: "no handle of a new process", source: error.into() }
        })?;
        let (name, log) = (name.to_owned(), log.to_owned());
        Ok(Self { name, log, child, pid, pidfd, status: None })
    }

    /// The process, which is also its group.
    pub fn pid(&self) -> Pid {
        self.pid
    }

    /// How it ended, if it has. What it had started then goes with it.
    pub fn ended(&mut self) -> Option<ExitStatus> {
        if self.status.is_none() {
            self.status = self.child.try_wait().ok().flatten();
            // Once only: later on, the number may be another group's.
            self.status.inspect(|_| self.signal(Signal::KILL));
        }
        self.status
    }

    /// Asks it to end (SIGTERM), and waits; after `patience` it is killed. Answers how it ended, and whether it had to be
    /// killed.
    pub fn stop(&mut self, patience: Duration) -> (Option<ExitStatus>, bool) {
        if self.ended().is_some() {
            return (self.status, false);
        }
        self.signal(Signal::TERM);
        let in_time = self.wait(patience);
        if !in_time {
            self.signal(Signal::KILL);
            self.wait(KILL_PATIENCE);
        }
        (self.ended(), !in_time)
    }

    /// Waits until it has ended, at most `patience`.
    fn wait(&self, patience: Duration) -> bool {
        let clock = elk_bus::clock::Stopwatch::start();
        loop {
            let left = patience.saturating_sub(clock.elapsed());
            let timeout = Timespec::try_from(left).ok();
            let mut ended = [PollFd::new(&self.pidfd, PollFlags::IN)];
            match poll(&mut ended, timeout.as_ref()) {
                Ok(0) => return false,
                Ok(_) => return true,
                Err(rustix::io::Errno::INTR) => {}
                Err(_) => return false,
            }
        }
    }

    /// Sends a signal to its group; that the group is gone already is no failure.
    fn signal(&self, signal: Signal) {
        let _ = kill_process_group(self.pid, signal);
    }

    /// The obituary of a process that ended too early.
    pub fn died(&self, status: ExitStatus, when: &'static str) -> LaunchError {
        LaunchError::Died {
            app: self.name.clone(),
            when,
            how: how(status),
            log: self.log.clone(),
            tail: tail(&self.log).unwrap_or_default(),
        }
    }
}

/// In words: `exit code 1`, `signal 9 (SIGKILL)`.
pub(crate) fn how(status: ExitStatus) -> String {
    match (status.code(), status.signal()) {
        (Some(code), _) => format!("exit code {code}"),
        (None, Some(signal)) => {
            let name = signal_hook::low_level::signal_name(signal).unwrap_or("unknown");
            format!("signal {signal} ({name})")
        }
        (None, None) => "for an unknown reason".to_owned(),
    }
}

/// The child gets no descriptor of ours, and SIGTERM when we are gone.
///
/// The launcher is a client of the bus, and iceoryx2's descriptors are not close-on-exec: a child would keep them open for
/// its whole life, and a dead launcher would look alive.
fn keep_to_itself(command: &mut Command) {
    let launcher = rustix::process::getpid();
    let before_exec = move || {
        rustix::process::set_parent_process_death_signal(Some(Signal::TERM))?;
        if getppid() != Some(launcher) {
            // The launcher died before the line above: nobody will tell us any more.
            return Err(io::Error::from_raw_os_error(libc::ESRCH));
        }
        // SAFETY: no pointer is involved; marking descriptors close-on-exec closes none before exec.
        match unsafe { libc::close_range(3, libc::c_uint::MAX, libc::CLOSE_RANGE_CLOEXEC as i32) } {
            0 => Ok(()),
            _ => Err(io::Error::last_os_error()),
        }
    };
    // SAFETY: between fork and exec only system calls are made: prctl, getppid, close_range. Nothing allocates, nothing
    // takes a lock (an error made from its number does neither).
    unsafe { command.pre_exec(before_exec) };
}

/// The last lines of a log.
pub(crate) fn tail(log: &Path) -> io::Result<Vec<String>> {
    let mut file = File::open(log)?;
    let length = file.metadata()?.len() as i64;
    file.seek(SeekFrom::End(-length.min(TAIL_BYTES)))?;
    let mut bytes = Vec::new();
    file.read_to_end(&mut bytes)?;
    let text = String::from_utf8_lossy(&bytes);
    let lines: Vec<&str> = text.lines().filter(|line| !line.trim().is_empty()).collect();
    let last = &lines[lines.len().saturating_sub(TAIL_LINES)..];
    Ok(last.iter().map(|line| (*line).to_owned()).collect())
}

#[cfg(test)]
mod tests {
    use super::*;

    fn shell(script: &str, log: &Path) -> Process {
        let mut command = Command::new("sh");
        command.args(["-c", script]);
        Process::spawn("Shell", command, log).unwrap()
    }

    fn logged(script: &str) -> (tempfile::TempDir, Process) {
        let folder = tempfile::tempdir().unwrap();
        let process = shell(script, &folder.path().join("shell.log"));
        (folder, process)
    }

    const PATIENCE: Duration = Duration::from_secs(60);

    #[test]
    fn an_obituary_says_how_and_quotes_the_log() {
        let (_folder, mut shell) = logged("seq 7; echo alas >&2; exit 3");
        assert!(shell.wait(PATIENCE));
        let status = shell.ended().unwrap();
        let said = shell.died(status, "at once").to_string();
        let lines: Vec<&str> = said.lines().collect();
        assert!(lines[0].starts_with("Shell ended at once: exit code 3; the end of /"), "{said}");
        assert_eq!(lines[1..], ["    4", "    5", "    6", "    7", "    alas"]);
    }

    #[test]
    fn a_process_that_ends_when_asked_is_not_killed() {
        let (_folder, mut shell) = logged("trap 'exit 4' TERM; echo up; while :; do sleep 0.01; done");
        while tail(&shell.log).unwrap() != ["up"] {
            std::thread::yield_now();
        }
        let (status, killed) = shell.stop(PATIENCE);
        assert_eq!((status.unwrap().code(), killed), (Some(4), false));
    }

    #[test]
    fn a_process_that_does_not_listen_is_killed_with_its_children() {
        let (_folder, mut shell) = logged("trap '' TERM; sleep 1000 & echo $!; wait");
        let child = loop {
            if let Some(line) = tail(&shell.log).unwrap().first() {
                break line.parse::<i32>().unwrap();
            }
            std::thread::yield_now();
        };
        let (status, killed) = shell.stop(Duration::ZERO);
        assert_eq!((how(status.unwrap()).as_str(), killed), ("signal 9 (SIGKILL)", true));
        // Killed, it is gone, or a zombie until whoever adopted it looks.
        let state = || std::fs::read_to_string(format!("/proc/{child}/stat")).unwrap_or_default();
        while !state().is_empty() && !state().contains(") Z ") {
            std::thread::yield_now();
        }
    }

    #[test]
    fn a_child_inherits_no_descriptor() {
        let leak = File::open("/proc/self/stat").unwrap();
        rustix::io::fcntl_setfd(&leak, rustix::io::FdFlags::empty()).unwrap();
        let (_folder, shell) = logged("ls -l /proc/$$/fd | grep -c self/stat || true; ls /proc/$$/fd");
        assert!(shell.wait(PATIENCE));
        let said = tail(&shell.log).unwrap();
        assert_eq!(said[0], "0");
        assert!(said.contains(&"2".to_owned()), "{said:?}");
    }

    #[test]
    fn what_cannot_be_started_is_named() {
        let folder = tempfile::tempdir().unwrap();
        let command = Command::new("./no-such-program");
        let log = folder.path().join("x.log");
        let error = Process::spawn("X", command, &log).err().unwrap().to_string();
        assert!(error.starts_with("X cannot be started: ./no-such-program: No such file"), "{error}");
    }
}
