//! Where a community's shared memory and folder lie, and what to say when there is trouble with them.

use std::fs::File;
use std::io::Write;
use std::ops::Deref;
use std::path::Path as FilePath;

use elk_proto::community::Community;
use elk_proto::link::LinkError;
use iceoryx2::config::Config;
use iceoryx2::prelude::{FileName, Path, SemanticString};

use super::folder::{Folder, FolderError};
use super::home::home;
use super::scarce;

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

/// A community's namespace on this machine: its folder, which nobody else can enter, and the prefix of its names in
/// shared memory.
#[derive(Debug)]
pub struct Namespace {
    community: Community,
    folder: Folder,
}

/// A namespace that this process alone may clear away: it has locked the mark. The lock keeps out whoever shares the
/// folder but not the network namespace, and so not the sockets' names. The kernel frees it with its process.
#[derive(Debug)]
pub struct HeldNamespace {
    namespace: Namespace,
    lock: File,
}

impl HeldNamespace {
    /// Sees that the folder is marked. Whoever holds the mark writes it, in place: another file in its place would be
    /// anybody's to lock.
    fn mark(&self) -> std::io::Result<()> {
        if is_marked(&self.folder, &self.community) {
            return Ok(());
        }
        self.lock.set_len(0)?;
        (&self.lock).write_all(self.community.as_str().as_bytes())
    }
}

impl Deref for HeldNamespace {
    type Target = Namespace;
    fn deref(&self) -> &Namespace {
        &self.namespace
    }
}

impl Namespace {
    /// Makes the folder of a community, or takes the one that the last broker left, and holds it.
    pub fn make(community: &Community) -> Result<HeldNamespace, FolderError> {
        let mut tries = 0;
        loop {
            tries += 1;
            match Self::try_to_make(&home(), community) {
                Err(FolderError::Io { source, .. })
                    if source.kind() == std::io::ErrorKind::NotFound && tries < TRIES => {}
                made => return made,
            }
        }
    }

    fn try_to_make(home: &FilePath, community: &Community) -> Result<HeldNamespace, FolderError> {
        let path = home.join(community.as_str());
        if !can_be_named(&path, community) {
            return Err(FolderError::Unspeakable { folder: path });
        }
        let folder = Folder::make(home)?.make_child(community.as_str())?;
        let failed = |source| FolderError::Io { folder: path.clone(), source };
        if !is_marked(&folder, community) && !holds_nothing(&folder, community).map_err(failed)? {
            return Err(FolderError::Unmarked { folder: path });
        }
        let namespace = Self { community: community.clone(), folder }.hold()?;
        namespace.mark().map_err(failed)?;
        Ok(namespace)
    }

    /// Holds it, if nobody does.
    pub fn hold(self) -> Result<HeldNamespace, FolderError> {
        let folder = || self.folder.path().to_owned();
        match self.folder.lock(MARK).map_err(|source| FolderError::Io { folder: folder(), source })? {
            Some(lock) => Ok(HeldNamespace { namespace: self, lock }),
            None => Err(FolderError::Held { folder: folder() }),
        }
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
    pub fn close_folder(&self) -> Result<(), FolderError> {
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

/// Whether there is nothing in a folder, or only a mark that was not written to its end.
fn holds_nothing(folder: &Folder, community: &Community) -> std::io::Result<bool> {
    let names = folder.names()?;
    let ours = |name: &std::ffi::OsString| {
        name.to_str().is_some_and(|name| {
            name == MARK && folder.read(name).is_ok_and(|written| community.as_str().as_bytes().starts_with(&written))
        })
    };
    Ok(names.iter().all(ours))
}

/// Whether iceoryx2 can name what it keeps in a community's folder.
fn can_be_named(path: &FilePath, community: &Community) -> bool {
    let names_community = path.file_name().is_some_and(|name| name == community.as_str());
    let length = path.as_os_str().len() + prefix(community).len() + LONGEST_ENDING;
    names_community && path.to_str().is_some() && length <= LONGEST_PATH
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
    fn only_an_empty_or_a_marked_folder_becomes_a_namespace() {
        let shared = tempfile::tempdir().unwrap();
        let home = Folder::make(&shared.path().join("home")).unwrap();
        let community = Community::new("lab").unwrap();
        let folder = home.make_child("lab").unwrap();
        folder.write("thesis.tex", b"mine").unwrap();
        assert!(matches!(Namespace::open_in(&home, &community), Err(FolderError::Unmarked { .. })));
        folder.write(MARK, b"another").unwrap();
        assert!(matches!(Namespace::open_in(&home, &community), Err(FolderError::Unmarked { .. })));
        folder.write(MARK, b"lab").unwrap();
        assert_eq!(Namespace::open(&community, folder.path()).unwrap().folder().path(), folder.path());
        let other = Community::new("other").unwrap();
        assert!(matches!(Namespace::open(&other, folder.path()), Err(FolderError::Unspeakable { .. })));
    }

    #[test]
    fn a_namespace_that_somebody_holds_is_neither_taken_nor_cleared_away() {
        let shared = tempfile::tempdir().unwrap();
        let (home, community) = (shared.path().join("home"), Community::new("lab").unwrap());
        let first = Namespace::try_to_make(&home, &community).unwrap();
        first.folder().write("places", b"mine").unwrap();
        let error = Namespace::try_to_make(&home, &community).unwrap_err();
        assert!(
            matches!(error, FolderError::Held { .. }) && error.to_string().contains("another container"),
            "{error}"
        );
        let looked_at = Namespace::open_in(&Folder::open(&home).unwrap(), &community).unwrap();
        assert!(matches!(looked_at.hold(), Err(FolderError::Held { .. })));
        assert_eq!(first.folder().read("places").unwrap(), b"mine");
        // The next one finds what was left, and takes it.
        drop(first);
        assert_eq!(Namespace::try_to_make(&home, &community).unwrap().folder().read("places").unwrap(), b"mine");
    }

    #[test]
    fn a_mark_that_was_not_written_to_its_end_keeps_nobody_out() {
        let shared = tempfile::tempdir().unwrap();
        let (home, community) = (shared.path().join("home"), Community::new("lab").unwrap());
        let folder = Folder::make(&home).unwrap().make_child("lab").unwrap();
        for written in ["", "la"] {
            std::fs::write(folder.path().join(MARK), written).unwrap();
            Namespace::try_to_make(&home, &community).unwrap();
            assert_eq!(folder.read(MARK).unwrap(), b"lab", "{written}");
            std::fs::remove_file(folder.path().join(MARK)).unwrap();
        }
        // Somebody else's file is no mark.
        std::fs::write(folder.path().join(MARK), "thesis").unwrap();
        assert!(matches!(Namespace::try_to_make(&home, &community), Err(FolderError::Unmarked { .. })));
    }

    #[test]
    fn paths_that_shared_memory_cannot_name_are_refused_by_name() {
        let community = Community::new("lab").unwrap();
        let long = FilePath::new("/tmp").join("x".repeat(200)).join("lab");
        let error = Namespace::open(&community, &long).unwrap_err().to_string();
        assert!(
            error.contains(&long.display().to_string()) && error.contains("set XDG_RUNTIME_DIR or TMPDIR"),
            "{error}"
        );
    }
}
