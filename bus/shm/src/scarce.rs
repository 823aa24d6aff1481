//! What a process has run out of, or nearly: the resources behind errors that name none, and what to do about each.

use std::fmt::Write;
use std::os::fd::AsRawFd;
use std::path::Path;

use elk_proto::link::LinkError;
use rustix::fs::{Access, AtFlags, CWD, accessat, statvfs};
use rustix::io::Errno;
use rustix::mm::{MapFlags, ProtFlags, mmap_anonymous, munmap};
use rustix::process::{Resource, getrlimit};

use super::home::{SHARED_MEMORY, home};

/// With less than this left (MB), an error of shared memory is most likely for want of room.
const SCARCE_MB: u64 = 64;
/// With less than this left (kB), nobody can join: a client's lanes cost as much.
const LEAST_KB: u64 = 1024;
/// With fewer descriptors left nobody can join, and an error of shared memory is most likely for want of them: iceoryx2
/// gives back those that it had when it failed.
const SCARCE_DESCRIPTORS: u64 = 24;
/// Descriptors that have to be free before a segment is mapped.
const DESCRIPTORS_OF_A_SEGMENT: usize = 4;
/// With fewer addresses left (MB), an error of shared memory is most likely for want of them: a segment has room for many
/// values.
const SCARCE_ADDRESSES_MB: u64 = 256;
/// A number of descriptors that does for every mission.
const ENOUGH_DESCRIPTORS: u64 = 1024;
/// With fewer files left that can be made, an error is most likely for want of them.
const SCARCE_FILES: u64 = 32;

/// Sees that there is room for one more client, at either end. It is refused then, with the reason; later there would be
/// a SIGBUS, or nothing left for those who are there.
pub fn room() -> Result<(), LinkError> {
    let no_memory = free_kb(Path::new(SHARED_MEMORY)).is_some_and(|free_kb| free_kb < LEAST_KB);
    match no_memory || !has_descriptors() {
        true => Err(LinkError::SharedMemory(format!("there is no room for one more client{}", hint()))),
        false => Ok(()),
    }
}

/// Whether a client's worth of descriptors is left. The system gives out the lowest number that is free: where that many
/// numbers below the limit none is taken, none above it is, most likely; else they are counted.
fn has_descriptors() -> bool {
    let Some(allowed) = getrlimit(Resource::Nofile).current else { return true };
    let high = i32::try_from(allowed.saturating_sub(SCARCE_DESCRIPTORS)).unwrap_or(i32::MAX);
    let free = rustix::io::fcntl_dupfd_cloexec(std::io::stderr(), high);
    free.is_ok_and(|free| free.as_raw_fd() == high) || allowed.saturating_sub(open(allowed)) >= SCARCE_DESCRIPTORS
}

/// Whether a segment of so many bytes could be mapped.
pub fn can_map(bytes: usize) -> bool {
    let stderr = std::io::stderr();
    let free = || rustix::io::fcntl_dupfd_cloexec(&stderr, 0).ok();
    let descriptors: Vec<_> = std::iter::from_fn(free).take(DESCRIPTORS_OF_A_SEGMENT).collect();
    descriptors.len() == DESCRIPTORS_OF_A_SEGMENT && has_addresses(bytes)
}

/// Whether so many bytes have a place among this process' addresses. None of them is touched, so they cost nothing.
fn has_addresses(bytes: usize) -> bool {
    let flags = MapFlags::PRIVATE | MapFlags::NORESERVE;
    // SAFETY: a new mapping, which nobody uses, aliases no Rust object, and is gone at the end.
    unsafe {
        let at = mmap_anonymous(std::ptr::null_mut(), bytes, ProtFlags::empty(), flags);
        at.and_then(|at| munmap(at, bytes)).is_ok()
    }
}

/// The number of descriptors that are open.
fn open(allowed: u64) -> u64 {
    // A process that cannot even open that folder has none left.
    std::fs::read_dir("/proc/self/fd").map_or(allowed, |entries| entries.count() as u64)
}

/// What is scarce, and what to do, in parentheses behind an error; empty if nothing is.
pub fn hint() -> String {
    let mut all = String::new();
    let home = home();
    // Until the first community there is only the folder that it will be in.
    let home = if home.exists() { &home } else { home.parent().unwrap_or(&home) };
    let of_memory = [unusable(), memory(), files(Path::new(SHARED_MEMORY))];
    let of_home = [room_on_disk(home), files(home)];
    for found in [descriptors(), addresses()].into_iter().chain(of_memory).chain(of_home).flatten() {
        // Writing to a String cannot fail.
        let _ = write!(all, " ({found})");
    }
    all
}

fn descriptors() -> Option<String> {
    let allowed = getrlimit(Resource::Nofile).current?;
    let open = open(allowed);
    let scarce = allowed.saturating_sub(open) < SCARCE_DESCRIPTORS;
    scarce.then(|| {
        let more = ENOUGH_DESCRIPTORS.max(4 * allowed);
        format!(
            "{open} descriptors are open and only {allowed} are allowed: raise that with `ulimit -n {more}`; in a \
             container, --ulimit nofile={more}"
        )
    })
}

fn addresses() -> Option<String> {
    let allowed_mb = getrlimit(Resource::As).current? >> 20;
    let taken = std::fs::read_to_string("/proc/self/statm").ok()?;
    let pages: u64 = taken.split_whitespace().next()?.parse().ok()?;
    let taken_mb = (pages * rustix::param::page_size() as u64) >> 20;
    (allowed_mb.saturating_sub(taken_mb) < SCARCE_ADDRESSES_MB).then(|| {
        format!("{taken_mb} MB of addresses are taken and only {allowed_mb} are allowed: raise that with `ulimit -v`")
    })
}

fn free_kb(folder: &Path) -> Option<u64> {
    let stat = statvfs(folder).ok()?;
    Some((stat.f_bavail * stat.f_frsize) >> 10)
}

fn memory() -> Option<String> {
    let free_mb = free_kb(Path::new(SHARED_MEMORY))? >> 10;
    (free_mb < SCARCE_MB).then(|| {
        format!(
            "{SHARED_MEMORY} has only {free_mb} MB left: remove what fills it, or enlarge it with \
             `mount -o remount,size=… {SHARED_MEMORY}`; in a container, --shm-size"
        )
    })
}

/// Shared memory that nobody can write to: a container without it, or with it for reading only.
fn unusable() -> Option<String> {
    let error = accessat(CWD, SHARED_MEMORY, Access::WRITE_OK | Access::EXEC_OK, AtFlags::empty()).err()?;
    let error = std::io::Error::from(error);
    Some(format!(
        "{SHARED_MEMORY} cannot be written to: {error}: it has to be a tmpfs that this user may write to, as \
         `mount -t tmpfs -o mode=1777 tmpfs {SHARED_MEMORY}` makes it"
    ))
}

fn room_on_disk(folder: &Path) -> Option<String> {
    (free_kb(folder)? < LEAST_KB).then(|| {
        let folder = folder.display();
        format!(
            "the file system of {folder} is full: remove what fills it, or set XDG_RUNTIME_DIR or TMPDIR to another one"
        )
    })
}

fn files(folder: &Path) -> Option<String> {
    let stat = statvfs(folder).ok()?;
    // A file system that does not count its files says that it has none.
    let scarce = stat.f_files > 0 && stat.f_favail < SCARCE_FILES;
    let remedy = match folder == Path::new(SHARED_MEMORY) {
        true => "allow more with `mount -o remount,nr_inodes=… /dev/shm`",
        false => "set XDG_RUNTIME_DIR or TMPDIR to a folder of another file system",
    };
    scarce.then(|| {
        format!(
            "{} can hold only {} more files (inodes): remove what is left over there, or {remedy}",
            folder.display(),
            stat.f_favail
        )
    })
}

/// What to do about an error that a new process or thread has met, in parentheses; empty if the error says it all.
pub fn remedy(error: &std::io::Error) -> &'static str {
    match error.raw_os_error() == Some(Errno::AGAIN.raw_os_error()) {
        true => {
            " (no more processes and threads are allowed to this user: end some, or raise that with `ulimit -u`; in a \
             container, --pids-limit)"
        }
        false => "",
    }
}
