//! Recorded data that are not the project's.

use std::path::{Path, PathBuf};

/// Where they are: in the folder that `ELK_DATA` names, or else in `shared/data` beside the repository. They may not be there.
pub fn folder() -> PathBuf {
    let above = Path::new(env!("CARGO_MANIFEST_DIR")).ancestors();
    let beside = above.map(|folder| folder.join("shared/data")).find(|folder| folder.is_dir());
    std::env::var_os("ELK_DATA").map(PathBuf::from).or(beside).unwrap_or_else(|| "shared/data".into())
}
