//! Where a community's shared memory lies, and what to say when there is trouble with it.

use std::path::PathBuf;

use iceoryx2::config::Config;
use iceoryx2::prelude::{FileName, Path, SemanticString};

use super::handshake;
use crate::community::Community;
use crate::link::LinkError;

/// Where the operating system keeps shared memory.
pub const SHARED_MEMORY: &str = "/dev/shm";
/// With less than this left (MB), an error of shared memory is most likely for want of room.
const SCARCE_MB: u64 = 64;
/// With less than this left (kB), nobody can join: a client's lanes cost as much.
const LEAST_KB: u64 = 1024;

/// What the names of a community's shared-memory files begin with. No name of a community holds a `=`: so no prefix is
/// the beginning of another community's files, however alike their names are.
pub fn prefix(community: &Community) -> String {
    format!("elk_{community}=")
}

/// The folder of a community's other files.
pub fn root(community: &Community) -> PathBuf {
    home().join(community.as_str())
}

/// The folder of all communities of this user.
pub fn home() -> PathBuf {
    std::env::temp_dir().join(format!("elk-{}", handshake::own_user()))
}

/// iceoryx2's settings for a community: its own prefix and folder, never a file that happens to lie around.
pub fn config(community: &Community) -> Result<Config, LinkError> {
    let mut config = Config::default();
    let prefix = prefix(community);
    config.global.prefix = FileName::new(prefix.as_bytes()).map_err(failed("the community's name in file names"))?;
    let root = root(community);
    let root = Path::new(root.to_string_lossy().as_bytes()).map_err(failed("the community's folder"))?;
    config.global.set_root_path(&root);
    Ok(config)
}

/// Turns whatever iceoryx2 fails with into a link error that says what was being done, and what to do if it was for want
/// of room.
pub fn failed<E: std::fmt::Debug>(what: impl std::fmt::Display) -> impl FnOnce(E) -> LinkError {
    move |e| LinkError::SharedMemory(format!("{what}: {e:?}{}", hint()))
}

/// Sees that there is room for one more client. It is refused then; later there would only be a SIGBUS.
pub fn room() -> Result<(), LinkError> {
    match free_kb() {
        Some(free_kb) if free_kb < LEAST_KB => {
            Err(LinkError::SharedMemory(format!("there is no room for one more client{}", hint())))
        }
        _ => Ok(()),
    }
}

fn free_kb() -> Option<u64> {
    let stat = rustix::fs::statvfs(SHARED_MEMORY).ok()?;
    Some((stat.f_bavail * stat.f_frsize) >> 10)
}

fn hint() -> String {
    match free_kb() {
        Some(free_kb) if free_kb >> 10 < SCARCE_MB => format!(
            " ({SHARED_MEMORY} has only {} MB left: remove what fills it, or enlarge it with \
             `mount -o remount,size=… {SHARED_MEMORY}`; in a container, --shm-size)",
            free_kb >> 10
        ),
        _ => String::new(),
    }
}
