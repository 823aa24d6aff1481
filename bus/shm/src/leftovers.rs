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

#[cfg(test)]
mod tests {
    use std::os::unix::fs::{chown, symlink};
    use std::path::PathBuf;

    use super::*;
    use crate::skip::skip;

    fn community(what: &str) -> Community {
        Community::new(format!("{what}-{}", std::process::id())).unwrap()
    }

    /// The mode of a file, or of what a link leads to.
    fn mode_of(path: &Path) -> u32 {
        path.metadata().unwrap().mode() & 0o777
    }

    fn in_shared_memory(community: &Community, name: &str) -> PathBuf {
        Path::new(SHARED_MEMORY).join(format!("{}{name}", prefix(community)))
    }

    #[test]
    fn of_what_lies_in_shared_memory_under_its_name_a_community_touches_only_plain_files_of_its_user() {
        let community = community("planted");
        let namespace = Namespace::make(&community).unwrap();
        let folder = tempfile::tempdir().unwrap();
        let victim = folder.path().join("victim");
        std::fs::write(&victim, "mine").unwrap();
        set_permissions(&victim, Permissions::from_mode(0o644)).unwrap();
        let [own, link, foreign] = ["own", "link", "foreign"].map(|name| in_shared_memory(&community, name));
        for file in [&own, &foreign] {
            std::fs::write(file, "").unwrap();
            set_permissions(file, Permissions::from_mode(0o666)).unwrap();
        }
        symlink(&victim, &link).unwrap();
        let is_foreign = chown(&foreign, Some(12_345), None).is_ok();
        close_shared_memory(&namespace).unwrap();
        assert_eq!((mode_of(&own), mode_of(&victim)), (0o600, 0o644));
        let mode = mode_of(&foreign);
        remove(&namespace);
        let left = [&own, &link, &foreign].map(|path| path.symlink_metadata().is_ok());
        [&link, &foreign].into_iter().for_each(|path| drop(std::fs::remove_file(path)));
        assert_eq!(left[..2], [false, true], "a link is whose who made it");
        assert_eq!(std::fs::read(&victim).unwrap(), b"mine");
        if !is_foreign {
            let why = "only root can give a file away";
            skip(
                "of_what_lies_in_shared_memory_under_its_name_a_community_touches_only_plain_files_of_its_user",
                "root",
                why,
            );
            return;
        }
        assert_eq!((mode, left[2]), (0o666, true));
    }

    /// Whoever starts a community clears away what is dead, and nothing else.
    #[test]
    fn a_community_where_somebody_listens_or_lives_is_not_cleared_away() {
        let community = community("swept");
        let listener = handshake::listen(&community).unwrap();
        drop(Namespace::make(&community).unwrap());
        let folder = home().join(community.as_str());
        sweep();
        assert!(folder.is_dir(), "somebody listens");
        let namespace = Namespace::make(&community).unwrap();
        let node = lane::node(&namespace).unwrap();
        drop((listener, namespace));
        sweep();
        assert!(folder.is_dir(), "somebody lives");
        drop(node);
        sweep();
        assert!(!folder.exists());
    }
}
