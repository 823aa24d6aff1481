//! The limits of the process that the operating system keeps low by habit.

use rustix::fs::Mode;
use rustix::process::{Resource, getrlimit, setrlimit};

/// Raises the number of file descriptors to the hard limit: every lane costs some.
pub fn raise_descriptors() {
    let mut limit = getrlimit(Resource::Nofile);
    limit.current = limit.maximum;
    // A refusal leaves the limit as it was; what then fails says so itself.
    let _ = setrlimit(Resource::Nofile, limit);
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
