//! Where communities lie: their folders, and their shared memory.

use std::os::unix::fs::MetadataExt;
use std::path::{Path, PathBuf};

/// Where the operating system keeps shared memory.
pub const SHARED_MEMORY: &str = "/dev/shm";

/// The folder of all communities of this user: `elk` in the folder that the system has made for this user alone until
/// the next start, else `elk-UID` in the one for temporary files.
pub fn home() -> PathBuf {
    let user = elk_os::own_user();
    match std::env::var_os("XDG_RUNTIME_DIR").map(PathBuf::from).filter(|folder| is_private(folder)) {
        Some(folder) => folder.join("elk"),
        None => {
            let folder = std::env::temp_dir().join(format!("elk-{user}"));
            std::path::absolute(&folder).unwrap_or(folder)
        }
    }
}

/// Whether a folder is there that this user can use as its own.
fn is_private(folder: &Path) -> bool {
    let found = folder.symlink_metadata();
    let ours =
        |found: &std::fs::Metadata| found.is_dir() && found.uid() == elk_os::own_user() && found.mode() & 0o022 == 0;
    folder.is_absolute() && found.is_ok_and(|found| ours(&found))
}
