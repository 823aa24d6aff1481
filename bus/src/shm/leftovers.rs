//! What a crashed run leaves behind, and how the next one clears it away unasked.

use iceoryx2::node::{Node, NodeState};
use iceoryx2::prelude::CallbackProgression;

use super::place::{self, SHARED_MEMORY, home, prefix, root};
use super::{handshake, lane};
use crate::community::Community;

/// Clears away what dead communities of this user left. A community is dead when nobody listens in its name and none
/// of its processes lives.
pub fn sweep() {
    let Ok(folders) = std::fs::read_dir(home()) else {
        return;
    };
    let names = folders.flatten().filter_map(|f| Community::new(f.file_name().to_string_lossy()).ok());
    for community in names.filter(|c| handshake::dial(c).is_err() && !anyone_lives(c)) {
        remove(&community);
    }
}

fn anyone_lives(community: &Community) -> bool {
    let Ok(config) = place::config(community) else {
        return true;
    };
    let mut alive = false;
    let listed = Node::<lane::Service>::list(&config, |state| {
        alive |= matches!(state, NodeState::Alive(_) | NodeState::Inaccessible(_) | NodeState::Undefined(_));
        CallbackProgression::Continue
    });
    alive || listed.is_err()
}

/// Removes all files of a community, whose name the caller holds or nobody does.
pub fn remove(community: &Community) {
    let prefix = prefix(community);
    for file in std::fs::read_dir(SHARED_MEMORY).into_iter().flatten().flatten() {
        if file.file_name().to_string_lossy().starts_with(&prefix) {
            // Another user's file cannot be removed, and need not be: it is not this community's.
            let _ = std::fs::remove_file(file.path());
        }
    }
    let _ = std::fs::remove_dir_all(root(community));
    let _ = std::fs::remove_dir(home()); // only if this was the last one
}
