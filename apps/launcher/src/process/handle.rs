//! Handles of processes (pidfd): they stay with the process that they were opened for, whoever has its number later.

use std::os::fd::OwnedFd;
use std::time::Duration;

use elk_bus::ProcessId;
use elk_bus::clock::Stopwatch;
use rustix::event::{PollFd, PollFlags, Timespec, poll};
use rustix::process::{Pid, PidfdFlags, pidfd_open};

/// A handle of a child that was not waited for: its number is nobody else's.
///
/// # Errors
/// The system has none left.
pub fn of_child(child: Pid) -> std::io::Result<OwnedFd> {
    Ok(pidfd_open(child, PidfdFlags::empty())?)
}

/// A handle of this very process; `None`: it has ended, or cannot be seen from here.
pub(crate) fn of(id: &ProcessId) -> Option<OwnedFd> {
    let handle = pidfd_open(Pid::from_raw(id.pid)?, PidfdFlags::empty()).ok()?;
    // Looked at behind the handle: a number that changes hands from here on is not mistaken.
    id.lives().then_some(handle)
}

/// Waits until one of these processes has ended, at most `patience`; whether one has.
pub fn wait(handles: &[&OwnedFd], patience: Duration) -> bool {
    let clock = Stopwatch::start();
    loop {
        let left = patience.saturating_sub(clock.elapsed());
        let timeout = Timespec::try_from(left).ok();
        let mut ended: Vec<PollFd> = handles.iter().map(|handle| PollFd::new(*handle, PollFlags::IN)).collect();
        match poll(&mut ended, timeout.as_ref()) {
            Err(rustix::io::Errno::INTR) => {}
            ended => return ended.is_ok_and(|count| count > 0),
        }
    }
}
