//! The person at the keyboard: Enter, and Ctrl-C.

use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};

use rustix::event::{PollFd, PollFlags, Timespec, poll};
use signal_hook::consts::{SIGHUP, SIGINT, SIGTERM};

use crate::error::LaunchError;

/// Whether the run is to stop: Ctrl-C, SIGTERM, or a terminal that is gone. A second Ctrl-C ends the launcher at once; its
/// guard then ends the rest.
pub(crate) fn stop_signals() -> Result<Arc<AtomicBool>, LaunchError> {
    let stop = Arc::new(AtomicBool::new(false));
    let what = "signals cannot be caught";
    for signal in [SIGINT, SIGTERM, SIGHUP] {
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

/// How often Enter was pressed since the last call; waits for nothing.
pub(crate) fn enters() -> Result<usize, LaunchError> {
    let stdin = std::io::stdin();
    let at_once = Timespec::default();
    let mut ready = [PollFd::new(&stdin, PollFlags::IN)];
    if poll(&mut ready, Some(&at_once)).unwrap_or(0) == 0 {
        return Ok(0);
    }
    let mut buffer = [0; 256];
    match rustix::io::read(&stdin, &mut buffer) {
        Ok(0) | Err(_) => Err(LaunchError::NoPerson),
        Ok(length) => Ok(buffer[..length].iter().filter(|byte| **byte == b'\n').count()),
    }
}
