//! Keys on a terminal: space, `.`, arrows, `+` and `-`, Home, `q`.

use std::io::{IsTerminal, Stdin, stdin};

use rustix::event::{PollFd, PollFlags, Timespec, poll};
use rustix::termios::{LocalModes, OptionalActions, SpecialCodeIndex, Termios, tcgetattr, tcsetattr};

use crate::player::Press;

/// How far an arrow goes (s of recorded time).
const SKIP_SECS: f64 = 5.0;

/// What the keys do, for people.
pub const HELP: &str =
    "space pauses, . steps, left and right go 5 s, + and - change the rate, Home begins again, q ends";

/// A terminal that gives keys as they are pressed; it is as before when this is dropped.
pub struct Keyboard {
    stdin: Stdin,
    before: Termios,
    /// What was read of a key that takes several bytes.
    unread: Vec<u8>,
}

impl Keyboard {
    /// The terminal at standard input; none: it is none.
    pub fn open() -> Option<Self> {
        let stdin = stdin();
        let before = if stdin.is_terminal() { tcgetattr(&stdin).ok()? } else { return None };
        let mut keys = before.clone();
        keys.local_modes -= LocalModes::ICANON | LocalModes::ECHO;
        keys.special_codes[SpecialCodeIndex::VMIN] = 0;
        keys.special_codes[SpecialCodeIndex::VTIME] = 0;
        tcsetattr(&stdin, OptionalActions::Now, &keys).ok()?;
        Some(Self { stdin, before, unread: Vec::new() })
    }

    /// What was pressed since the last call; waits for nothing.
    pub fn presses(&mut self) -> Vec<Press> {
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
        // A terminal that is gone needs no repair.
        let _ = tcsetattr(&self.stdin, OptionalActions::Now, &self.before);
    }
}

/// The keys in `bytes`; the beginning of one stays there. Others mean nothing.
fn presses(bytes: &mut Vec<u8>) -> Vec<Press> {
    let mut found = Vec::new();
    loop {
        let (used, press) = match bytes[..] {
            [] => return found,
            [0x1b] | [0x1b, b'[' | b'O'] => return found,
            [0x1b, b'[' | b'O', key, ..] => (
                3,
                match key {
                    b'C' => Some(Press::Skip(SKIP_SECS)),
                    b'D' => Some(Press::Skip(-SKIP_SECS)),
                    b'H' => Some(Press::Restart),
                    _ => None,
                },
            ),
            [key, ..] => (
                1,
                match key {
                    b' ' => Some(Press::Pause),
                    b'.' => Some(Press::Step),
                    b'+' | b'=' => Some(Press::Rate { faster: true }),
                    b'-' => Some(Press::Rate { faster: false }),
                    b'q' => Some(Press::Quit),
                    _ => None,
                },
            ),
        };
        found.extend(press);
        bytes.drain(..used);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn keys_of_several_bytes_may_come_in_pieces() {
        let mut bytes = b" x\x1b[C\x1b".to_vec();
        assert_eq!(presses(&mut bytes), [Press::Pause, Press::Skip(SKIP_SECS)]);
        bytes.extend_from_slice(b"OD+-.\x1b[Hq");
        assert_eq!(
            presses(&mut bytes),
            [
                Press::Skip(-SKIP_SECS),
                Press::Rate { faster: true },
                Press::Rate { faster: false },
                Press::Step,
                Press::Restart,
                Press::Quit
            ]
        );
    }
}
