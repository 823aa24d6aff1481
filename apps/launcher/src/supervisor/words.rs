//! What a supervisor is told and says: how a process ended, how an order goes, what is to be done.

use std::path::PathBuf;

use crate::error::LaunchError;

/// As much of a log's last line as stands in an exit's reason.
const LINE_CHARS: usize = 120;

/// Whom to tell how an order went.
pub(crate) type Ticket = u64;

/// Which process of a unit.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub(crate) enum Role {
    /// The one that has the name.
    Holder,
    /// The one that is to have it.
    Successor,
}

/// How a process ended.
#[derive(Debug, Clone, PartialEq, Eq, Default)]
pub(crate) struct Exit {
    /// `exit code 1`, `signal 9 (SIGKILL)`.
    pub how: String,
    /// With exit code 0.
    pub fine: bool,
    /// By the signal that asks to end, as far as anybody could see.
    pub asked: bool,
    /// Its text log.
    pub log: PathBuf,
    /// The last lines that it wrote there.
    pub tail: Vec<String>,
}

impl Exit {
    /// `exit code 1; last line: no room`
    pub fn in_short(&self) -> String {
        match self.tail.last() {
            // Whoever ended well has nothing to explain.
            Some(line) if !self.fine => {
                let line: String = line.chars().take(LINE_CHARS).collect();
                format!("{}; last line: {line}", self.how)
            }
            _ => self.how.clone(),
        }
    }
}

/// How an order goes.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(crate) enum Word {
    /// It is under way.
    Progress(String),
    /// It is done.
    Done(String),
    /// It could not be done.
    Failed(String),
}

/// What is to be done.
#[derive(Debug)]
pub(crate) enum Action {
    /// Start a unit's process.
    Start(usize, Role),
    /// Ask the holder to end.
    Ask(usize),
    /// Kill the holder.
    Kill(usize),
    /// Kill the successor, and forget it.
    Discard(usize),
    /// The successor is the holder from now on; the old one is on its way out.
    TakeOver(usize),
    /// Nobody has the name: who is started next is what the app is to be, and then, should that fail, what it was.
    Exchange(usize),
    /// Tell the person at the terminal.
    Say(String),
    /// Tell who gave an order.
    Tell(Ticket, Word),
    /// The mission has failed.
    Fail(LaunchError),
}
