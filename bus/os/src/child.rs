//! Child processes: what they inherit, whether they outlive who started them, and how they ended.

use std::io;
use std::os::unix::process::{CommandExt, ExitStatusExt};
use std::process::{Command, ExitStatus};

use rustix::process::{Signal, getppid};

/// Whether a process ends with the one that started it.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Bond {
    /// The kernel sends it SIGTERM when the thread that started it ends: that has to be one that lives as long as its process.
    Parent,
    /// It goes on.
    None,
}

/// The child gets no descriptor of ours but its standard ones, and, if it is bound to us, SIGTERM when we are gone.
///
/// Whoever starts apps is a client of the bus itself, and iceoryx2's descriptors are not close-on-exec: a child would keep
/// them open for its whole life, and its parent, dead, would look alive.
pub fn keep_to_itself(command: &mut Command, bond: Bond) {
    let parent = rustix::process::getpid();
    let before_exec = move || {
        if bond == Bond::Parent {
            rustix::process::set_parent_process_death_signal(Some(Signal::TERM))?;
            if getppid() != Some(parent) {
                // The parent died before the line above: nobody will tell us any more.
                return Err(io::Error::from_raw_os_error(libc::ESRCH));
            }
        }
        // SAFETY: no pointer is involved; marking descriptors close-on-exec closes none before exec.
        match unsafe { libc::close_range(3, libc::c_uint::MAX, libc::CLOSE_RANGE_CLOEXEC as i32) } {
            0 => Ok(()),
            _ => Err(io::Error::last_os_error()),
        }
    };
    // SAFETY: between fork and exec only system calls are made: prctl, getppid, close_range. Nothing allocates, nothing
    // takes a lock (an error made from its number does neither).
    unsafe { command.pre_exec(before_exec) };
}

/// How a process ended, in words: `exit code 1`, `signal 9 (SIGKILL)`.
pub fn how(status: ExitStatus) -> String {
    match (status.code(), status.signal()) {
        (Some(code), _) => format!("exit code {code}"),
        (None, Some(signal)) => {
            let name = signal_hook::low_level::signal_name(signal).unwrap_or("unknown");
            format!("signal {signal} ({name})")
        }
        (None, None) => "for an unknown reason".to_owned(),
    }
}
