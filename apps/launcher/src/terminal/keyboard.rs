//! The launcher's keyboard: Enter, and Ctrl-C.

use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};

use rustix::event::{PollFd, PollFlags, Timespec, poll};
use signal_hook::consts::SIGHUP;

use crate::error::LaunchError;

/// Whether the run is to stop: Ctrl-C, SIGTERM, or a terminal that is gone; the mission of a `detached` launcher outlives
/// the terminal. A second Ctrl-C ends the launcher at once; its guard then ends the rest.
pub(crate) fn stop_signals(detached: bool) -> Result<Arc<AtomicBool>, LaunchError> {
    let stop = Arc::new(AtomicBool::new(false));
    let what = "signals cannot be caught";
    for signal in elk_bus::stop_signals().filter(|signal| !detached || *signal != SIGHUP) {
        let second = signal_hook::flag::register_conditional_shutdown(signal, 130, stop.clone());
        let first = second.and_then(|_| signal_hook::flag::register(signal, stop.clone()));
        first.map_err(|source| LaunchError::System { what, source })?;
    }
    Ok(stop)
}

/// Whether one of them came.
pub(crate) fn stopped(stop: &AtomicBool) -> bool {
    stop.load(Ordering::Relaxed)
}

/// Standard input, at which somebody may press Enter.
#[derive(Debug, Default)]
pub(crate) struct Keyboard {
    /// The input has ended.
    gone: bool,
    /// And that has been said.
    missed: bool,
}

impl Keyboard {
    /// What has to be watched for Enter to be seen.
    pub fn watch<'a>(&'a self, watched: &mut Vec<PollFd<'a>>) {
        if !self.gone {
            watched.push(PollFd::from_borrowed_fd(rustix::stdio::stdin(), PollFlags::IN));
        }
    }

    /// How often Enter was pressed since the last call; waits for nothing.
    pub fn enters(&mut self) -> usize {
        let stdin = rustix::stdio::stdin();
        let at_once = Timespec::default();
        let mut ready = [PollFd::from_borrowed_fd(stdin, PollFlags::IN)];
        if self.gone || poll(&mut ready, Some(&at_once)).unwrap_or(0) == 0 {
            return 0;
        }
        let mut buffer = [0; 256];
        match rustix::io::read(stdin, &mut buffer) {
            Ok(0) | Err(_) => {
                self.gone = true;
                0
            }
            Ok(length) => buffer[..length].iter().filter(|byte| **byte == b'\n').count(),
        }
    }

    /// Whether the input has ended; said once.
    pub fn left(&mut self) -> bool {
        self.gone && !std::mem::replace(&mut self.missed, true)
    }
}
