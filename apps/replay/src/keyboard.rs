//! Keys on a terminal: space, `.`, arrows, `+` and `-`, Home, `q`; Ctrl-Z.

use elk_outside::keys::{CTRL_Z, Keys};

use crate::player::Press;

/// How far an arrow goes (s of recorded time).
const SKIP_SECS: f64 = 5.0;
/// What keys of several bytes begin with.
const ESCAPE: u8 = 0x1b;

/// What the keys do, for people: one line of a terminal of 80 columns.
pub const HELP: &str = "space pauses, . steps, arrows go 5 s, + - set the rate, Home restarts, q ends";

/// A terminal whose keys rule a replay; it is as before when this is dropped.
pub struct Keyboard {
    keys: Keys,
    /// What was read of a key that takes several bytes.
    unread: Vec<u8>,
}

impl Keyboard {
    /// The terminal at standard input; none: it is none.
    pub fn open() -> Option<Self> {
        Keys::open().map(|keys| Self { keys, unread: Vec::new() })
    }

    /// What was pressed since the last call; waits for nothing.
    pub fn presses(&mut self) -> Vec<Press> {
        let Some(pressed) = self.keys.pressed() else { return vec![Press::Quit] };
        self.unread.extend(pressed);
        presses(&mut self.unread)
    }

    /// Whether the terminal is this program's: it runs in the foreground.
    pub fn is_ours(&self) -> bool {
        self.keys.is_ours()
    }

    /// Gives the terminal back, and stops this process and its job until the shell continues them.
    pub fn suspend(&mut self) {
        self.keys.suspend();
    }
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
