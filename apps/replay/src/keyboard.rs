//! Keys on a terminal: space, `.`, arrows, `+` and `-`, Home, `q`; Ctrl-Z.

use std::io::{IsTerminal, Stdin, stdin};

use rustix::event::{PollFd, PollFlags, Timespec, poll};
use rustix::io::Errno;
use rustix::process::{Signal, getpgrp, kill_current_process_group};
use rustix::termios::{LocalModes, OptionalActions, SpecialCodeIndex, Termios, tcgetattr, tcgetpgrp, tcsetattr};

use crate::player::Press;

/// How far an arrow goes (s of recorded time).
const SKIP_SECS: f64 = 5.0;
/// What keys of several bytes begin with.
const ESCAPE: u8 = 0x1b;
/// What the terminal sends for Ctrl-Z once it is a key like any other.
const CTRL_Z: u8 = 0x1a;
/// A special code that no key has.
const NO_KEY: u8 = 0;

/// What the keys do, for people: one line of a terminal of 80 columns.
pub const HELP: &str = "space pauses, . steps, arrows go 5 s, + - set the rate, Home restarts, q ends";

/// A terminal that gives keys as they are pressed; it is as before when this is dropped.
pub struct Keyboard {
    stdin: Stdin,
    /// How the terminal was; none: it was not this program's yet.
    before: Option<Termios>,
    hold: Hold,
    /// What was read of a key that takes several bytes.
    unread: Vec<u8>,
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

impl Keyboard {
    /// The terminal at standard input; none: it is none.
    pub fn open() -> Option<Self> {
        let stdin = stdin();
        if !stdin.is_terminal() {
            return None;
        }
        let mut keyboard = Self { stdin, before: None, hold: Hold::Others, unread: Vec::new() };
        keyboard.look();
        Some(keyboard)
    }

    /// What was pressed since the last call; waits for nothing.
    pub fn presses(&mut self) -> Vec<Press> {
        match (self.hold, self.look()) {
            // Whoever was in the background when the terminal went was to go on without it.
            (Hold::Ours, Hold::Gone) => vec![Press::Quit],
            (_, Hold::Ours) => self.read(),
            _ => Vec::new(),
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

    fn read(&mut self) -> Vec<Press> {
        let mut ready = [PollFd::new(&self.stdin, PollFlags::IN)];
        let mut buffer = [0; 64];
        if poll(&mut ready, Some(&Timespec::default())).unwrap_or(0) > 0 {
            let count = rustix::io::read(&self.stdin, &mut buffer).unwrap_or(0);
            self.unread.extend_from_slice(&buffer[..count]);
        }
        presses(&mut self.unread)
    }
}

impl Drop for Keyboard {
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

/// The keys in `bytes`; the beginning of one stays there. Others mean nothing.
fn presses(bytes: &mut Vec<u8>) -> Vec<Press> {
    let mut found = Vec::new();
    while let Some((used, press)) = first_key(bytes) {
        found.extend(press);
        bytes.drain(..used);
    }
    found
}

/// How many bytes the first key takes, and what it asks for; nothing: it is not there as a whole.
fn first_key(bytes: &[u8]) -> Option<(usize, Option<Press>)> {
    match bytes {
        [] | [ESCAPE] | [ESCAPE, b'O'] => None,
        [ESCAPE, b'O', key, ..] => Some((3, moving(&[*key]))),
        [ESCAPE, b'[', rest @ ..] => {
            let parameters = rest.iter().take_while(|byte| (b' '..=b'?').contains(byte)).count();
            Some((parameters + 3, moving(rest.get(..=parameters)?)))
        }
        [key, ..] => Some((1, single(*key))),
    }
}

/// What a key that is sent as an escape, a bracket and `code` asks for.
fn moving(code: &[u8]) -> Option<Press> {
    match code {
        b"C" => Some(Press::Skip(SKIP_SECS)),
        b"D" => Some(Press::Skip(-SKIP_SECS)),
        // As xterm, as the console and tmux, and as rxvt send Home.
        b"H" | b"1~" | b"7~" => Some(Press::Restart),
        _ => None,
    }
}

/// What a key of one byte asks for.
fn single(key: u8) -> Option<Press> {
    match key {
        b' ' => Some(Press::Pause),
        b'.' => Some(Press::Step),
        b'+' | b'=' => Some(Press::Rate { faster: true }),
        b'-' => Some(Press::Rate { faster: false }),
        b'q' => Some(Press::Quit),
        CTRL_Z => Some(Press::Suspend),
        _ => None,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn keys_of_several_bytes_may_come_in_pieces() {
        let mut bytes = b" x\x1b[C\x1b".to_vec();
        assert_eq!(presses(&mut bytes), [Press::Pause, Press::Skip(SKIP_SECS)]);
        bytes.extend_from_slice(b"OD+-.\x1b[Hq\x1a\x1b[1");
        assert_eq!(
            presses(&mut bytes),
            [
                Press::Skip(-SKIP_SECS),
                Press::Rate { faster: true },
                Press::Rate { faster: false },
                Press::Step,
                Press::Restart,
                Press::Quit,
                Press::Suspend
            ]
        );
        bytes.push(b'~');
        assert_eq!((presses(&mut bytes), bytes), (vec![Press::Restart], vec![]));
    }

    #[test]
    fn keys_that_mean_nothing_are_passed_over_as_a_whole() {
        // Delete, an arrow with the control key, F5; and Escape by itself, before a key.
        let mut bytes = b"\x1b[3~\x1b[1;5C\x1b[15~\x1b q".to_vec();
        assert_eq!(presses(&mut bytes), [Press::Pause, Press::Quit]);
    }
}
