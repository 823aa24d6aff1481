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

/// What the names of a community's shared-memory files begin with.
pub fn prefix(community: &Community) -> String {
    format!("elk_{community}_")
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

fn hint() -> String {
    let Ok(stat) = rustix::fs::statvfs(SHARED_MEMORY) else { return String::new() };
    let free_mb = (stat.f_bavail * stat.f_frsize) >> 20;
    match free_mb < SCARCE_MB {
        true => format!(
            " ({SHARED_MEMORY} has only {free_mb} MB left: remove what fills it, or enlarge it with \
             `mount -o remount,size=… {SHARED_MEMORY}`; in a container, --shm-size)"
        ),
        false => String::new(),
    }
}
