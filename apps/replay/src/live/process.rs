//! A program of somebody else's that is live in a replay.

use std::fs::File;
use std::os::unix::process::CommandExt;
use std::path::{Path, PathBuf};
use std::process::{Child, Command, Stdio};
use std::time::Duration;

use elk_bus::child::{Bond, how, keep_to_itself};
use elk_bus::clock::Stopwatch;
use elk_bus::stop::STOP_PATIENCE;
use rustix::process::{Pid, Signal, WaitId, WaitIdOptions, kill_process_group, waitid};

/// How often it is looked whether it has ended.
const LOOK: Duration = Duration::from_millis(5);

/// A child, leader of a process group of its own. When it is dropped, nobody of that group is left.
pub(crate) struct Process {
    child: Child,
    log: PathBuf,
    /// Whether it has been waited for: its number may be another's since.
    has_ended: bool,
}

impl Process {
    /// Starts it, with what it prints in `log`. It ends with the thread that this is called on.
    pub fn start(mut command: Command, log: &Path) -> Result<Self, String> {
        let unwritable = |error| format!("its output cannot be written to {}: {error}", log.display());
        let out = File::create(log).map_err(unwritable)?;
        let err = out.try_clone().map_err(unwritable)?;
        command.stdin(Stdio::null()).stdout(out).stderr(err).process_group(0);
        keep_to_itself(&mut command, Bond::Parent);
        let program = Path::new(command.get_program()).display().to_string();
        let child = command.spawn().map_err(|error| format!("{program} cannot be started: {error}"))?;
        Ok(Self { child, log: log.into(), has_ended: false })
    }

    /// Asks it to end.
    pub fn ask(&self) {
        self.signal(Signal::TERM);
    }

    /// How it ended, if it has; what it had started then ends too.
    pub fn ended(&mut self) -> Option<Result<(), String>> {
        if self.has_ended {
            return Some(Ok(()));
        }
        // Until it is waited for its number is nobody else's, and its group can be ended.
        let options = WaitIdOptions::EXITED | WaitIdOptions::NOHANG | WaitIdOptions::NOWAIT;
        if let Ok(None) = waitid(WaitId::Pid(Pid::from_child(&self.child)), options) {
            return None;
        }
        self.signal(Signal::KILL);
        self.has_ended = true;
        let said_in = self.log.display();
        Some(match self.child.wait() {
            Ok(status) if status.success() => Ok(()),
            Ok(status) => Err(format!("it ended with {}; what it said is in {said_in}", how(status))),
            Err(error) => Err(format!("how it ended is not known: {error}; what it said is in {said_in}")),
        })
    }

    /// Waits until it has ended; after a while it is killed.
    pub fn wait(&mut self) -> Result<(), String> {
        let waited = Stopwatch::start();
        loop {
            if let Some(end) = self.ended() {
                return end;
            }
            if waited.elapsed() > STOP_PATIENCE {
                self.signal(Signal::KILL);
                let _ = self.child.wait();
                self.has_ended = true;
                return Err(format!("it did not end within {} s of being asked", STOP_PATIENCE.as_secs()));
            }
            std::thread::sleep(LOOK);
        }
    }

    /// That its group is gone already is no failure.
    fn signal(&self, signal: Signal) {
        if !self.has_ended {
            let _ = kill_process_group(Pid::from_child(&self.child), signal);
        }
    }
}

impl Drop for Process {
    fn drop(&mut self) {
        self.signal(Signal::KILL);
        let _ = self.child.wait();
    }
}
