//! Keys as they are pressed: the terminal at standard input, as long as it is this program's.

use std::io::{IsTerminal, Stdin, stdin};

use rustix::event::{PollFd, PollFlags, Timespec, poll};
use rustix::io::Errno;
use rustix::process::{Signal, getpgrp, kill_current_process_group};
use rustix::termios::{LocalModes, OptionalActions, SpecialCodeIndex, Termios, tcgetattr, tcgetpgrp, tcsetattr};

/// What the terminal sends for Ctrl-Z, which is a key like any other here.
pub const CTRL_Z: u8 = 0x1a;
/// A special code that no key has.
const NO_KEY: u8 = 0;

/// A terminal that gives keys as they are pressed; it is as before when this is dropped.
pub struct Keys {
    stdin: Stdin,
    /// How the terminal was; none: it was not this program's yet.
    before: Option<Termios>,
    hold: Hold,
}

/// Whose the terminal is.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Hold {
    /// This program's.
    Ours,
    /// The shell's, or another job's: who then reads from it or changes its settings is stopped.
    Others,
    /// Nobody's: its window was closed, its connection cut.
    Gone,
}

impl Keys {
    /// The terminal at standard input; none: it is none.
    pub fn open() -> Option<Self> {
        let stdin = stdin();
        if !stdin.is_terminal() {
            return None;
        }
        let mut keys = Self { stdin, before: None, hold: Hold::Others };
        keys.look();
        Some(keys)
    }

    /// What was pressed since the last call, as the terminal sends it; waits for nothing. None: the terminal has gone.
    pub fn pressed(&mut self) -> Option<Vec<u8>> {
        match (self.hold, self.look()) {
            // Whoever was in the background when the terminal went was to go on without it.
            (Hold::Ours, Hold::Gone) => None,
            (_, Hold::Ours) => Some(self.read()),
            _ => Some(Vec::new()),
        }
    }

    /// Whether the terminal is this program's: it runs in the foreground.
    pub fn is_ours(&self) -> bool {
        self.hold == Hold::Ours
    }

    /// Gives the terminal back, and stops this process and its job until the shell continues them.
    pub fn suspend(&mut self) {
        self.give_back();
        // The kernel stops nobody whom no shell could continue.
        let _ = kill_current_process_group(Signal::TSTP);
    }

    /// Looks whose the terminal is, and sees to it that it gives keys: a shell has its own settings while it has it.
    fn look(&mut self) -> Hold {
        self.hold = self.held_by();
        if self.hold == Hold::Ours {
            self.take();
        }
        self.hold
    }

    fn held_by(&self) -> Hold {
        match tcgetpgrp(&self.stdin) {
            Ok(group) if group == getpgrp() => Hold::Ours,
            // It controls no session of ours: nobody else has a claim to it.
            Err(Errno::NOTTY) => Hold::Ours,
            Err(Errno::IO) => Hold::Gone,
            Ok(_) | Err(_) => Hold::Others,
        }
    }

    fn take(&mut self) {
        match tcgetattr(&self.stdin) {
            Ok(now) if self.before.is_none() || now.local_modes.contains(LocalModes::ICANON) => {
                // A terminal that takes no settings gives its keys with Enter.
                let _ = tcsetattr(&self.stdin, OptionalActions::Now, &giving_keys(now.clone()));
                self.before = Some(now);
            }
            _ => {}
        }
    }

    fn give_back(&mut self) {
        if let Some(before) = self.before.take_if(|_| self.hold == Hold::Ours) {
            // A terminal that is gone needs no repair.
            let _ = tcsetattr(&self.stdin, OptionalActions::Now, &before);
        }
    }

    fn read(&self) -> Vec<u8> {
        let mut ready = [PollFd::new(&self.stdin, PollFlags::IN)];
        let mut buffer = [0; 64];
        let count = match poll(&mut ready, Some(&Timespec::default())).unwrap_or(0) {
            0 => 0,
            _ => rustix::io::read(&self.stdin, &mut buffer).unwrap_or(0),
        };
        buffer[..count].to_vec()
    }
}

impl Drop for Keys {
    fn drop(&mut self) {
        self.hold = self.held_by();
        self.give_back();
    }
}

/// The settings of a terminal that gives each key at once and shows none. Ctrl-C still is a signal; Ctrl-Z is a key, so
/// that the terminal can be given back first.
fn giving_keys(mut settings: Termios) -> Termios {
    settings.local_modes -= LocalModes::ICANON | LocalModes::ECHO;
    settings.special_codes[SpecialCodeIndex::VMIN] = 0;
    settings.special_codes[SpecialCodeIndex::VTIME] = 0;
    settings.special_codes[SpecialCodeIndex::VSUSP] = NO_KEY;
    settings
}
