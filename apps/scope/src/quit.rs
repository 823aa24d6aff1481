//! When a command that goes on and on is to end: at a signal, or when a person at the terminal presses `q`.

use std::sync::atomic::{AtomicBool, Ordering};

use elk_bus::clock::Stopwatch;
use elk_outside::keys::{CTRL_Z, Keys};

use crate::output::Output;
use crate::session::LOOK_EVERY;

/// Whoever may ask for the end.
pub(crate) struct Quit<'a> {
    stop: &'a AtomicBool,
    keys: Option<Keys>,
    /// Since the keys were looked at: every look is several system calls, too many for every batch.
    looked: Stopwatch,
}

impl<'a> Quit<'a> {
    /// `stop`, and the person who looks at `output`, if one does.
    pub fn new(stop: &'a AtomicBool, output: &Output<'_>) -> Self {
        Self { stop, keys: output.is_terminal().then(Keys::open).flatten(), looked: Stopwatch::start() }
    }

    /// Whether one of them has asked for it by now.
    pub fn is_asked_for(&mut self) -> bool {
        if self.stop.load(Ordering::Relaxed) {
            return true;
        }
        let Some(keys) = self.keys.as_mut().filter(|_| self.looked.elapsed() >= LOOK_EVERY) else { return false };
        self.looked = Stopwatch::start();
        let Some(pressed) = keys.pressed() else { return true };
        if pressed.contains(&CTRL_Z) {
            keys.suspend();
        }
        pressed.contains(&b'q')
    }
}
