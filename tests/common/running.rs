//! A process that a test has started.

use std::process::Child;

use rustix::process::Signal;

use super::kill;

/// Killed, should the test fail before its end.
pub struct Running(pub Child);

impl Running {
    /// Asks it to end, which it does in good order.
    pub fn stop(mut self) {
        kill(self.0.id() as i32, Signal::TERM);
        assert!(self.0.wait().unwrap().success());
    }
}

impl Drop for Running {
    fn drop(&mut self) {
        let _ = self.0.kill();
        let _ = self.0.wait();
    }
}
