//! Where a community's shared memory lies, and what to say when there is trouble with it.

use std::path::{Path as FilePath, PathBuf};

use iceoryx2::config::Config;
use iceoryx2::prelude::{FileName, Path, SemanticString};

use super::folder::{Folder, FolderError};
use super::handshake;
use super::scarce;
use crate::community::Community;
use crate::link::LinkError;

/// Where the operating system keeps shared memory.
pub const SHARED_MEMORY: &str = "/dev/shm";
/// The longest path that iceoryx2 can name (bytes).
const LONGEST_PATH: usize = 255;
/// What iceoryx2 puts behind a community's folder and its prefix at most: a folder, a node's or port's number, an ending.
const LONGEST_ENDING: usize = 100;
/// A file that says of a folder that elk made it, for a community. Nothing is removed from a folder without it.
const MARK: &str = "made-by-elk";
/// How often a folder is made anew that the last community to leave has removed in the same moment.
const TRIES: u32 = 5;
/// What the name of iceoryx2's counter of nodes ends with: it is made for everybody to write to, in a folder that nobody
/// else can enter.
const COUNTER: &str = ".global_mgmt";
/// The folder in which iceoryx2 keeps one for each of its nodes.
const NODES: &str = "nodes";

/// What the names of a community's shared-memory files begin with. No name of a community holds a `=`: so no prefix is
/// the beginning of another community's files, however alike their names are.
pub fn prefix(community: &Community) -> String {
    format!("elk_{community}=")
}

/// A community's place on this machine: its folder, which nobody else can enter, and a prefix in shared memory.
#[derive(Debug)]
pub struct Place {
    community: Community,
    folder: Folder,
}

impl Place {
    /// Makes the folder of a community whose name the caller holds, or takes the one that the last broker left.
    pub fn make(community: &Community) -> Result<Self, FolderError> {
        let mut tries = 0;
        loop {
            tries += 1;
            match Self::try_to_make(community) {
                Err(FolderError::Io { source, .. })
                    if source.kind() == std::io::ErrorKind::NotFound && tries < TRIES => {}
                made => return made,
            }
        }
    }

    fn try_to_make(community: &Community) -> Result<Self, FolderError> {
        let path = home().join(community.as_str());
        if !can_be_named(&path, community) {
            return Err(FolderError::Unspeakable { folder: path });
        }
        let folder = Folder::make(&home())?.make_child(community.as_str())?;
        let failed = |source| FolderError::Io { folder: path.clone(), source };
        let names = folder.names().map_err(failed)?;
        if names.is_empty() {
            folder.write(MARK, community.as_str().as_bytes()).map_err(failed)?;
        } else if !is_marked(&folder, community) {
            return Err(FolderError::Unmarked { folder: path });
        }
        Ok(Self { community: community.clone(), folder })
    }

    /// The folder that a community's broker says it has, looked at in the same way.
    pub fn open(community: &Community, path: &FilePath) -> Result<Self, FolderError> {
        if !path.is_absolute() || !can_be_named(path, community) {
            return Err(FolderError::Unspeakable { folder: path.to_owned() });
        }
        let home = path.parent().ok_or_else(|| FolderError::Unspeakable { folder: path.to_owned() })?;
        Self::open_in(&Folder::open(home)?, community)
    }

    /// The folder of a community in this home.
    pub fn open_in(home: &Folder, community: &Community) -> Result<Self, FolderError> {
        let folder = home.child(community.as_str())?;
        match is_marked(&folder, community) {
            true => Ok(Self { community: community.clone(), folder }),
            false => Err(FolderError::Unmarked { folder: folder.path().to_owned() }),
        }
    }

    /// Whose it is.
    pub fn community(&self) -> &Community {
        &self.community
    }

    /// Its folder.
    pub fn folder(&self) -> &Folder {
        &self.folder
    }

    /// Sees that nobody else can enter what iceoryx2 has made in the folder: it makes some for its group as well.
    pub fn close_to_others(&self) -> Result<(), FolderError> {
        let failed = |source| FolderError::Io { folder: self.folder.path().to_owned(), source };
        let names = self.folder.names().map_err(failed)?;
        for counter in names.iter().filter_map(|name| name.to_str()).filter(|name| name.ends_with(COUNTER)) {
            self.folder.close_file(counter).map_err(failed)?;
        }
        self.folder.close_children()?;
        match self.folder.child(NODES) {
            Err(FolderError::Io { source, .. }) if source.kind() == std::io::ErrorKind::NotFound => Ok(()),
            nodes => nodes?.close_children(),
        }
    }

    /// iceoryx2's settings for the community: its own prefix and folder, never a file that happens to lie around.
    pub fn config(&self) -> Result<Config, LinkError> {
        let mut config = Config::default();
        let prefix = prefix(&self.community);
        config.global.prefix =
            FileName::new(prefix.as_bytes()).map_err(failed("the community's name in file names"))?;
        let root = self.folder.path().to_string_lossy();
        let root = Path::new(root.as_bytes()).map_err(failed("the community's folder"))?;
        config.global.set_root_path(&root);
        Ok(config)
    }
}

fn is_marked(folder: &Folder, community: &Community) -> bool {
    folder.read(MARK).is_ok_and(|marked| marked == community.as_str().as_bytes())
}

/// Whether iceoryx2 can name what it keeps in a community's folder.
fn can_be_named(path: &FilePath, community: &Community) -> bool {
    let names_community = path.file_name().is_some_and(|name| name == community.as_str());
    let length = path.as_os_str().len() + prefix(community).len() + LONGEST_ENDING;
    names_community && path.to_str().is_some() && length <= LONGEST_PATH
}

/// The folder of all communities of this user: `elk` in the folder that the system has made for this user alone until
/// the next start, else `elk-UID` in the one for temporary files.
pub fn home() -> PathBuf {
    let user = handshake::own_user();
    match std::env::var_os("XDG_RUNTIME_DIR").map(PathBuf::from).filter(|folder| is_private(folder)) {
        Some(folder) => folder.join("elk"),
        None => {
            let folder = std::env::temp_dir().join(format!("elk-{user}"));
            std::path::absolute(&folder).unwrap_or(folder)
        }
    }
}

/// Whether a folder is there that this user can use as its own.
fn is_private(folder: &FilePath) -> bool {
    use std::os::unix::fs::MetadataExt;
    let found = folder.symlink_metadata();
    let ours =
        |found: &std::fs::Metadata| found.is_dir() && found.uid() == handshake::own_user() && found.mode() & 0o022 == 0;
    folder.is_absolute() && found.is_ok_and(|found| ours(&found))
}

/// Turns whatever iceoryx2 fails with into a link error that says what was being done, and what to do if it was for want
/// of something.
pub fn failed<E: std::fmt::Debug>(what: impl std::fmt::Display) -> impl FnOnce(E) -> LinkError {
    move |e| LinkError::SharedMemory(format!("{what}: {e:?}{}", scarce::hint()))
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    proptest! {
        #![proptest_config(ProptestConfig::with_cases(10_000))]
        #[test]
        fn no_community_s_prefix_begins_another_s_files(one in "[a-c._-]{1,5}", other in "[a-c._-]{1,5}", end in "[a-c_=.]{0,6}") {
            if let (Ok(one), Ok(other)) = (Community::new(one), Community::new(other)) {
                let file = format!("{}{end}", prefix(&other));
                prop_assert_eq!(file.starts_with(&prefix(&one)), one == other);
                prop_assert!(FileName::new(file.as_bytes()).is_ok());
            }
        }
    }

    #[test]
    fn only_an_empty_or_a_marked_folder_becomes_a_place() {
        let shared = tempfile::tempdir().unwrap();
        let home = Folder::make(&shared.path().join("home")).unwrap();
        let community = Community::new("lab").unwrap();
        let folder = home.make_child("lab").unwrap();
        folder.write("thesis.tex", b"mine").unwrap();
        assert!(matches!(Place::open_in(&home, &community), Err(FolderError::Unmarked { .. })));
        folder.write(MARK, b"another").unwrap();
        assert!(matches!(Place::open_in(&home, &community), Err(FolderError::Unmarked { .. })));
        folder.write(MARK, b"lab").unwrap();
        assert_eq!(Place::open(&community, folder.path()).unwrap().folder().path(), folder.path());
        let other = Community::new("other").unwrap();
        assert!(matches!(Place::open(&other, folder.path()), Err(FolderError::Unspeakable { .. })));
    }

    #[test]
    fn paths_that_shared_memory_cannot_name_are_refused_by_name() {
        let community = Community::new("lab").unwrap();
        let long = FilePath::new("/tmp").join("x".repeat(200)).join("lab");
        let error = Place::open(&community, &long).unwrap_err().to_string();
        assert!(
            error.contains(&long.display().to_string()) && error.contains("set XDG_RUNTIME_DIR or TMPDIR"),
            "{error}"
        );
    }
}
