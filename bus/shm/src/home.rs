//! Where communities lie: their folders, and their shared memory.

use std::os::unix::fs::MetadataExt;
use std::path::{Path, PathBuf};

/// Where the operating system keeps shared memory.
pub const SHARED_MEMORY: &str = "/dev/shm";

/// The folder of all communities of this user: `elk` in the folder that the system has made for this user alone until
/// the next start, else `elk-UID` in the one for temporary files.
pub fn home() -> PathBuf {
    home_in(std::env::var_os("XDG_RUNTIME_DIR").map(PathBuf::from))
}

/// The same, where this is the session's folder; one that is not this user's alone is passed over.
fn home_in(session: Option<PathBuf>) -> PathBuf {
    match session.filter(|folder| is_private(folder)) {
        Some(folder) => folder.join("elk"),
        None => {
            let folder = std::env::temp_dir().join(format!("elk-{}", elk_os::own_user()));
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

#[cfg(test)]
mod tests {
    use std::fs::{Permissions, set_permissions};
    use std::os::unix::fs::{PermissionsExt, chown, symlink};

    use super::*;
    use crate::skip::skip;

    #[test]
    fn a_session_s_folder_that_is_not_this_user_s_alone_is_passed_over() {
        let shared = tempfile::tempdir().unwrap();
        let [private, open, link, file, foreign] =
            ["private", "open", "link", "file", "foreign"].map(|name| shared.path().join(name));
        for (folder, mode) in [(&private, 0o700), (&open, 0o777), (&foreign, 0o700)] {
            std::fs::create_dir(folder).unwrap();
            set_permissions(folder, Permissions::from_mode(mode)).unwrap();
        }
        symlink(&private, &link).unwrap();
        std::fs::write(&file, "").unwrap();
        set_permissions(&file, Permissions::from_mode(0o600)).unwrap();
        assert_eq!(home_in(Some(private.clone())), private.join("elk"));
        // A folder of this user's, as this process sees it.
        let relative = PathBuf::from("src");
        assert!(relative.is_dir());
        for passed_over in [&open, &link, &file, &shared.path().join("missing"), &relative] {
            assert_eq!(home_in(Some(passed_over.clone())), home_in(None), "{}", passed_over.display());
        }
        if chown(&foreign, Some(12_345), None).is_err() {
            let why = "only root can give a folder away";
            skip("a_session_s_folder_that_is_not_this_user_s_alone_is_passed_over", "root", why);
            return;
        }
        assert_eq!(home_in(Some(foreign)), home_in(None));
    }
}
