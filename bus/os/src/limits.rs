//! The limits of the process that the operating system keeps low by habit.

use std::os::fd::OwnedFd;

use rustix::fs::Mode;
use rustix::io::fcntl_dupfd_cloexec;
use rustix::process::{Resource, getrlimit, setrlimit};

/// Above the descriptors of all who may connect to a process, and still a small table of them (128 KiB).
const ABOVE_OTHERS: u64 = 1 << 14;

/// Raises the number of file descriptors to the hard limit: every lane costs some.
pub fn raise_descriptors() {
    let mut limit = getrlimit(Resource::Nofile);
    limit.current = limit.maximum;
    // A refusal leaves the limit as it was; what then fails says so itself.
    let _ = setrlimit(Resource::Nofile, limit);
}

/// The same, under a number above all that the process will give to others; as it was, if the limit leaves no room for that.
///
/// Of a process that is killed Linux ends the files in the reverse order of their numbers. A socket that listens and has a
/// higher one than its connections has ended before these, so that whoever sees one of them end, and connects again at once,
/// is not let in by the dead: it is refused, and comes to the next process.
pub fn above_others(descriptor: OwnedFd) -> OwnedFd {
    let limit = getrlimit(Resource::Nofile).current.unwrap_or(u64::MAX);
    let number = limit.saturating_sub(1).min(ABOVE_OTHERS);
    i32::try_from(number).ok().and_then(|least| fcntl_dupfd_cloexec(&descriptor, least).ok()).unwrap_or(descriptor)
}

/// Has this process make files that their owner may read and write, and folders that it may enter, whatever the umask
/// says of the owner: what elk makes it has to find again. Of others the umask stays as it is.
pub fn let_owner_in() {
    let set = std::fs::read_to_string("/proc/self/status").unwrap_or_default();
    let umask = set.lines().find_map(|line| line.strip_prefix("Umask:"));
    // Looked at before it is set: another thread may make a file meanwhile.
    let Some(umask) = umask.and_then(|umask| u32::from_str_radix(umask.trim(), 8).ok()) else { return };
    let of_owner = Mode::RWXU.bits();
    if umask & of_owner != 0 {
        rustix::process::umask(Mode::from_raw_mode(umask & !of_owner));
    }
}
