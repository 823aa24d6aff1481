//! What a crashed run leaves behind, and how the next one clears it away unasked. Only what elk has made goes: folders
//! that it has marked, and in shared memory plain files of this user with a community's prefix.

use std::ffi::OsString;
use std::fs::{Permissions, set_permissions};
use std::os::unix::fs::{MetadataExt, PermissionsExt};
use std::path::Path;

use elk_proto::community::Community;
use iceoryx2::node::{Node, NodeState};
use iceoryx2::prelude::CallbackProgression;

use super::folder::Folder;
use super::home::{SHARED_MEMORY, home};
use super::namespace::{HeldNamespace, Namespace, prefix};
use super::{handshake, lane};

/// Clears away what dead communities of this user left. A community is dead when nobody listens in its name and none
/// of its processes lives; nor, where others share the folder but not the network, anybody holds its namespace.
pub fn sweep() {
    let Ok(home) = Folder::open(&home()) else {
        return;
    };
    let names = home.names().unwrap_or_default();
    let communities = names.into_iter().filter_map(|name| Community::new(name.into_string().ok()?).ok());
    for community in communities.filter(handshake::nobody_listens) {
        if let Ok(namespace) = Namespace::open_in(&home, &community).and_then(Namespace::hold)
            && !anyone_lives(&namespace)
        {
            remove(&namespace);
        }
    }
}

fn anyone_lives(namespace: &Namespace) -> bool {
    let Ok(config) = namespace.config() else {
        return true;
    };
    let mut alive = false;
    let listed = Node::<lane::Service>::list(&config, |state| {
        alive |= matches!(state, NodeState::Alive(_) | NodeState::Inaccessible(_) | NodeState::Undefined(_));
        CallbackProgression::Continue
    });
    alive || listed.is_err()
}

/// Removes all files of a community.
pub fn remove(namespace: &HeldNamespace) {
    for name in shared_memory_of(namespace.community()) {
        // What cannot be removed is left to the next one who comes by.
        let _ = std::fs::remove_file(Path::new(SHARED_MEMORY).join(name));
    }
    if let Some(Ok(home)) = namespace.folder().path().parent().map(Folder::open) {
        let _ = home.remove_child(namespace.community().as_str());
        home.remove_if_empty();
    }
}

/// The names of a community's files in shared memory. Another user's are not this community's, whatever they are called,
/// and neither is anything but a plain file.
fn shared_memory_of(community: &Community) -> Vec<OsString> {
    let prefix = prefix(community);
    let entries = std::fs::read_dir(SHARED_MEMORY).into_iter().flatten().flatten();
    let named = entries.filter(|entry| entry.file_name().as_encoded_bytes().starts_with(prefix.as_bytes()));
    let ours =
        named.filter(|entry| entry.metadata().is_ok_and(|found| found.is_file() && found.uid() == elk_os::own_user()));
    ours.map(|entry| entry.file_name()).collect()
}

/// Sees that nobody else can read or write what a community has made: iceoryx2 makes its files for their owner alone, and
/// this is where that is held to.
pub fn close_shared_memory(namespace: &Namespace) -> std::io::Result<()> {
    for name in shared_memory_of(namespace.community()) {
        let path = Path::new(SHARED_MEMORY).join(name);
        let Ok(found) = path.symlink_metadata() else { continue };
        if found.mode() & 0o077 != 0 {
            set_permissions(path, Permissions::from_mode(found.mode() & 0o700))?;
        }
    }
    Ok(())
}
