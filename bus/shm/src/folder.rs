//! Folders that only this user can enter. A path in a shared folder can be guessed, and somebody else may have put
//! something there first: so each folder is opened by descriptor and looked at before every use, and whatever is read,
//! written or removed in it goes through that descriptor.

use std::ffi::OsString;
use std::fs::File;
use std::io::{ErrorKind, Read, Write};
use std::os::fd::{AsRawFd, BorrowedFd, OwnedFd};
use std::path::{Path, PathBuf};

use rustix::fs::{
    AtFlags, CWD, FileType, FlockOperation, Mode, OFlags, Stat, fchmod, flock, fstat, mkdirat, openat, renameat,
    statat, unlinkat,
};

use super::scarce;
use elk_os::own_user;

/// Bits of a mode that let others write.
const WRITABLE: u32 = 0o022;
/// Bits of a mode that let others do anything at all.
const OTHERS: u32 = 0o077;
/// The bit by which, in a folder of everybody, each can remove only what is his own.
const STICKY: u32 = 0o1000;

/// Why a folder is not used.
#[derive(Debug, thiserror::Error)]
pub enum FolderError {
    /// Somebody else could change what lies in it.
    #[error("the folder {} is not used: {fault}", .folder.display())]
    Unsafe {
        /// The folder.
        folder: PathBuf,
        /// What is wrong with it, and what to do.
        fault: Fault,
    },
    /// It is there, but not elk's.
    #[error(
        "the folder {} is neither empty nor marked as one that elk made: remove it, if nothing in it is needed, or choose \
         another --community", .folder.display()
    )]
    Unmarked {
        /// The folder.
        folder: PathBuf,
    },
    /// Somebody has it, or clears it away.
    #[error(
        "the folder {} is in use by another broker, perhaps one in another container or network namespace that shares it: \
         stop that one, or choose another --community", .folder.display()
    )]
    Held {
        /// The folder.
        folder: PathBuf,
    },
    /// Paths in it would be longer than shared memory can name.
    #[error(
        "the folder {} has too long a path, or one that is not UTF-8: set XDG_RUNTIME_DIR or TMPDIR to a shorter one, of \
         this user alone", .folder.display()
    )]
    Unspeakable {
        /// The folder.
        folder: PathBuf,
    },
    /// The operating system refused.
    #[error(
        "the folder {}: {source}{}; XDG_RUNTIME_DIR or TMPDIR says where else it is to be", .folder.display(), scarce::hint()
    )]
    Io {
        /// The folder.
        folder: PathBuf,
        /// Why.
        source: std::io::Error,
    },
}

/// What is wrong with a folder.
#[derive(Debug, Clone, Copy, PartialEq, Eq, thiserror::Error)]
pub enum Fault {
    /// It leads elsewhere.
    #[error("it is a link, and whoever made it says where it leads; remove the link")]
    Link,
    /// It is something else.
    #[error("it is no folder; remove what is there")]
    NoFolder,
    /// It is somebody else's.
    #[error("it belongs to user {0}; have it removed, or set XDG_RUNTIME_DIR or TMPDIR to a folder of your own")]
    Foreign(u32),
    /// Others can write to it.
    #[error("others can write to it (mode {0:04o}); see what they left there, remove it, and start again")]
    Writable(u32),
    /// Others can exchange it for another.
    #[error(
        "others can remove it: the folder that it is in can be written to by others (mode {0:04o}) and has no sticky bit"
    )]
    Removable(u32),
}

/// A folder of this user that nobody else can enter.
#[derive(Debug)]
pub struct Folder {
    path: PathBuf,
    descriptor: OwnedFd,
}

/// Whether a folder is made if it is not there.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Missing {
    Make,
    Refuse,
}

impl Folder {
    /// The folder at an absolute path, made if it is not there; the folder that it is in has to be.
    pub fn make(path: &Path) -> Result<Self, FolderError> {
        Self::at(path, Missing::Make)
    }

    /// The folder at an absolute path.
    pub fn open(path: &Path) -> Result<Self, FolderError> {
        Self::at(path, Missing::Refuse)
    }

    fn at(path: &Path, missing: Missing) -> Result<Self, FolderError> {
        let failed = |source: std::io::Error| FolderError::Io { folder: path.to_owned(), source };
        let (Some(parent), Some(name)) = (path.parent(), path.file_name()) else {
            return Err(failed(ErrorKind::InvalidInput.into()));
        };
        // Whoever can write to that one could exchange this one, unless there each can do so only with his own.
        let parent = openat(CWD, parent, OFlags::PATH | OFlags::DIRECTORY | OFlags::CLOEXEC, Mode::empty());
        let parent = parent.map_err(|errno| failed(errno.into()))?;
        let mode = fstat(&parent).map_err(|errno| failed(errno.into()))?.st_mode;
        if mode & WRITABLE != 0 && mode & STICKY == 0 {
            let fault = Fault::Removable(mode & 0o7777);
            return Err(FolderError::Unsafe { folder: path.to_owned(), fault });
        }
        Self::within((&parent).into(), Path::new(name), path.to_owned(), missing)
    }

    /// A folder in this one, made if it is not there.
    pub fn make_child(&self, name: &str) -> Result<Self, FolderError> {
        Self::within((&self.descriptor).into(), Path::new(name), self.path.join(name), Missing::Make)
    }

    /// A folder in this one.
    pub fn child(&self, name: &str) -> Result<Self, FolderError> {
        Self::within((&self.descriptor).into(), Path::new(name), self.path.join(name), Missing::Refuse)
    }

    fn within(parent: Parent<'_>, name: &Path, path: PathBuf, missing: Missing) -> Result<Self, FolderError> {
        let failed = |errno: rustix::io::Errno| FolderError::Io { folder: path.clone(), source: errno.into() };
        if missing == Missing::Make {
            match mkdirat(parent.0, name, Mode::RWXU) {
                Ok(()) | Err(rustix::io::Errno::EXIST) => {}
                Err(errno) => return Err(failed(errno)),
            }
        }
        let flags = OFlags::RDONLY | OFlags::DIRECTORY | OFlags::NOFOLLOW | OFlags::CLOEXEC;
        let descriptor = openat(parent.0, name, flags, Mode::empty()).map_err(|errno| {
            match statat(parent.0, name, AtFlags::SYMLINK_NOFOLLOW).ok().and_then(|stat| what_else(&stat)) {
                Some(fault) => FolderError::Unsafe { folder: path.clone(), fault },
                None => failed(errno),
            }
        })?;
        let stat = fstat(&descriptor).map_err(failed)?;
        if let Some(fault) = fault_of(&stat) {
            return Err(FolderError::Unsafe { folder: path, fault });
        }
        if stat.st_mode & OTHERS != 0 {
            fchmod(&descriptor, Mode::RWXU).map_err(failed)?;
        }
        Ok(Self { path, descriptor })
    }

    /// Where it is.
    pub fn path(&self) -> &Path {
        &self.path
    }

    /// Names of what is in it, sorted.
    pub fn names(&self) -> std::io::Result<Vec<OsString>> {
        let entries = std::fs::read_dir(self.through_descriptor())?;
        let mut names = entries.map(|entry| Ok(entry?.file_name())).collect::<std::io::Result<Vec<_>>>()?;
        names.sort();
        Ok(names)
    }

    /// The bytes of a file in it.
    pub fn read(&self, name: &str) -> std::io::Result<Vec<u8>> {
        let flags = OFlags::RDONLY | OFlags::NOFOLLOW | OFlags::NONBLOCK | OFlags::CLOEXEC;
        let file = openat(&self.descriptor, name, flags, Mode::empty())?;
        if FileType::from_raw_mode(fstat(&file)?.st_mode) != FileType::RegularFile {
            return Err(ErrorKind::InvalidData.into());
        }
        let mut bytes = Vec::new();
        File::from(file).read_to_end(&mut bytes)?;
        Ok(bytes)
    }

    /// Writes a file in it, anew and in one step.
    pub fn write(&self, name: &str, bytes: &[u8]) -> std::io::Result<()> {
        let fresh = format!("{name}.new");
        let flags = OFlags::WRONLY | OFlags::CREATE | OFlags::TRUNC | OFlags::NOFOLLOW | OFlags::CLOEXEC;
        let file = openat(&self.descriptor, &fresh, flags, Mode::RUSR | Mode::WUSR)?;
        let written = File::from(file)
            .write_all(bytes)
            .and_then(|()| Ok(renameat(&self.descriptor, &fresh, &self.descriptor, name)?));
        if written.is_err() {
            // What is half written is of no use to anybody.
            let _ = unlinkat(&self.descriptor, &fresh, AtFlags::empty());
        }
        written
    }

    /// Locks a file in it, made if it is not there, until the file is closed; `None` if somebody else has locked it.
    ///
    /// # Errors
    /// The system's; that it is not found means that it was removed in the same moment.
    pub fn lock(&self, name: &str) -> std::io::Result<Option<File>> {
        let flags = OFlags::RDWR | OFlags::CREATE | OFlags::NOFOLLOW | OFlags::NONBLOCK | OFlags::CLOEXEC;
        let file = openat(&self.descriptor, name, flags, Mode::RUSR | Mode::WUSR)?;
        match flock(&file, FlockOperation::NonBlockingLockExclusive) {
            Err(rustix::io::Errno::AGAIN) => return Ok(None),
            locked => locked?,
        }
        // A lock on a file that has been removed meanwhile keeps nobody out.
        let (locked, found) = (fstat(&file)?, statat(&self.descriptor, name, AtFlags::SYMLINK_NOFOLLOW)?);
        match (locked.st_dev, locked.st_ino) == (found.st_dev, found.st_ino) {
            true => Ok(Some(file.into())),
            false => Err(ErrorKind::NotFound.into()),
        }
    }

    /// Removes a folder in it with everything that is in there; of links only the link.
    pub fn remove_child(&self, name: &str) -> std::io::Result<()> {
        std::fs::remove_dir_all(self.through_descriptor().join(name))
    }

    /// Sees that in the folders in it nobody else can enter: iceoryx2 makes some for its group as well.
    pub fn close_children(&self) -> Result<(), FolderError> {
        let failed = |source| FolderError::Io { folder: self.path.clone(), source };
        for entry in std::fs::read_dir(self.through_descriptor()).map_err(failed)? {
            let entry = entry.map_err(failed)?;
            let is_folder = entry.file_type().is_ok_and(|kind| kind.is_dir());
            match entry.file_name().to_str().filter(|_| is_folder).map(|name| self.child(name)) {
                // Somebody has left meanwhile.
                Some(Err(FolderError::Io { source, .. })) if source.kind() == ErrorKind::NotFound => {}
                Some(Err(error)) => return Err(error),
                _ => {}
            }
        }
        Ok(())
    }

    /// Sees that nobody else could read or write a file in it, were it somewhere else.
    pub fn close_file(&self, name: &str) -> std::io::Result<()> {
        let flags = OFlags::RDONLY | OFlags::NOFOLLOW | OFlags::NONBLOCK | OFlags::CLOEXEC;
        let file = openat(&self.descriptor, name, flags, Mode::empty())?;
        match fstat(&file)?.st_mode {
            mode if mode & OTHERS != 0 => Ok(fchmod(&file, Mode::from_raw_mode(mode & 0o700))?),
            _ => Ok(()),
        }
    }

    /// A path that leads through the descriptor: to this very folder, whatever is put in its place meanwhile.
    fn through_descriptor(&self) -> PathBuf {
        PathBuf::from(format!("/proc/self/fd/{}", self.descriptor.as_raw_fd()))
    }

    /// Removes it if it is empty.
    pub fn remove_if_empty(self) {
        // Whoever puts something into it meanwhile keeps it.
        let _ = unlinkat(CWD, &self.path, AtFlags::REMOVEDIR);
    }
}

/// The descriptor of the folder that a folder is in.
#[derive(Clone, Copy)]
struct Parent<'a>(BorrowedFd<'a>);

impl<'a> From<&'a OwnedFd> for Parent<'a> {
    fn from(descriptor: &'a OwnedFd) -> Self {
        Self(std::os::fd::AsFd::as_fd(descriptor))
    }
}

/// What stands where a folder was looked for.
fn what_else(stat: &Stat) -> Option<Fault> {
    match FileType::from_raw_mode(stat.st_mode) {
        FileType::Symlink => Some(Fault::Link),
        FileType::Directory => fault_of(stat),
        _ => Some(Fault::NoFolder),
    }
}

fn fault_of(stat: &Stat) -> Option<Fault> {
    if stat.st_uid != own_user() {
        return Some(Fault::Foreign(stat.st_uid));
    }
    (stat.st_mode & WRITABLE != 0).then_some(Fault::Writable(stat.st_mode & 0o7777))
}

#[cfg(test)]
mod tests {
    use std::fs::{Permissions, set_permissions};
    use std::os::unix::fs::{PermissionsExt, symlink};
    use std::sync::atomic::Ordering::SeqCst;
    use std::sync::atomic::{AtomicBool, AtomicU64};

    use super::*;
    use crate::skip::skip;

    fn mode_of(path: &Path) -> u32 {
        path.symlink_metadata().unwrap().permissions().mode() & 0o7777
    }

    fn fault(opened: Result<Folder, FolderError>) -> Fault {
        match opened {
            Err(FolderError::Unsafe { fault, .. }) => fault,
            other => panic!("{other:?}"),
        }
    }

    #[test]
    fn a_folder_is_made_for_its_owner_alone() {
        let shared = tempfile::tempdir().unwrap();
        let path = shared.path().join("home");
        Folder::make(&path).unwrap();
        assert_eq!(mode_of(&path), 0o700);
        // One that others can only look into is closed.
        set_permissions(&path, Permissions::from_mode(0o755)).unwrap();
        Folder::open(&path).unwrap();
        assert_eq!(mode_of(&path), 0o700);
    }

    #[test]
    fn what_somebody_else_may_have_planted_is_refused() {
        let shared = tempfile::tempdir().unwrap();
        let (path, elsewhere) = (shared.path().join("home"), shared.path().join("elsewhere"));
        std::fs::create_dir(&elsewhere).unwrap();
        symlink(&elsewhere, &path).unwrap();
        assert_eq!(fault(Folder::make(&path)), Fault::Link);
        std::fs::remove_file(&path).unwrap();
        std::fs::write(&path, "").unwrap();
        assert_eq!(fault(Folder::make(&path)), Fault::NoFolder);
        std::fs::remove_file(&path).unwrap();
        std::fs::create_dir(&path).unwrap();
        set_permissions(&path, Permissions::from_mode(0o777)).unwrap();
        assert_eq!(fault(Folder::make(&path)), Fault::Writable(0o777));
        set_permissions(&path, Permissions::from_mode(0o700)).unwrap();
        set_permissions(shared.path(), Permissions::from_mode(0o777)).unwrap();
        assert_eq!(fault(Folder::make(&path)), Fault::Removable(0o777));
        set_permissions(shared.path(), Permissions::from_mode(0o1777)).unwrap();
        Folder::make(&path).unwrap();
    }

    #[test]
    fn a_folder_of_another_user_is_refused() {
        let shared = tempfile::tempdir().unwrap();
        let path = shared.path().join("home");
        std::fs::create_dir(&path).unwrap();
        if std::os::unix::fs::chown(&path, Some(12_345), None).is_err() {
            skip("a_folder_of_another_user_is_refused", "root", "only root can give a folder away");
            return;
        }
        assert_eq!(fault(Folder::make(&path)), Fault::Foreign(12_345));
    }

    #[test]
    fn links_are_neither_read_nor_followed_when_a_folder_is_removed() {
        let shared = tempfile::tempdir().unwrap();
        let elsewhere = shared.path().join("elsewhere");
        std::fs::create_dir(&elsewhere).unwrap();
        std::fs::write(elsewhere.join("file"), "mine").unwrap();
        let home = Folder::make(&shared.path().join("home")).unwrap();
        let child = home.make_child("child").unwrap();
        symlink(&elsewhere, child.path().join("inside")).unwrap();
        symlink(elsewhere.join("file"), child.path().join("sessions")).unwrap();
        assert!(child.read("sessions").is_err());
        child.write("sessions", b"new").unwrap();
        assert_eq!(child.read("sessions").unwrap(), b"new");
        home.remove_child("child").unwrap();
        symlink(&elsewhere, home.path().join("child")).unwrap();
        assert_eq!(fault(home.child("child")), Fault::Link);
        assert_eq!(std::fs::read_to_string(elsewhere.join("file")).unwrap(), "mine");
    }

    #[test]
    fn a_link_in_the_place_of_a_draft_or_a_lock_leads_nowhere() {
        let shared = tempfile::tempdir().unwrap();
        let [mine, missing] = ["mine", "missing"].map(|name| shared.path().join(name));
        std::fs::write(&mine, "mine").unwrap();
        let home = Folder::make(&shared.path().join("home")).unwrap();
        for (to, draft, lock) in [(&mine, "one.new", "lock"), (&missing, "other.new", "other-lock")] {
            symlink(to, home.path().join(draft)).unwrap();
            symlink(to, home.path().join(lock)).unwrap();
            assert!(home.write(draft.trim_end_matches(".new"), b"new").is_err());
            assert!(home.lock(lock).is_err());
        }
        assert!(std::fs::read(&mine).unwrap() == b"mine" && !missing.exists());
    }

    #[test]
    fn what_is_no_plain_file_is_not_read_and_waited_for_by_nobody() {
        let shared = tempfile::tempdir().unwrap();
        let home = Folder::make(&shared.path().join("home")).unwrap();
        rustix::fs::mkfifoat(&home.descriptor, "mark", Mode::RWXU).unwrap();
        assert_eq!(home.read("mark").unwrap_err().kind(), ErrorKind::InvalidData);
    }

    #[test]
    fn what_is_written_is_for_its_owner_alone_whatever_the_umask_says() {
        let shared = tempfile::tempdir().unwrap();
        let home = Folder::make(&shared.path().join("home")).unwrap();
        home.write("sessions", b"mine").unwrap();
        home.lock("mark").unwrap().unwrap();
        for file in ["sessions", "mark"] {
            assert_eq!(mode_of(&home.path().join(file)) & OTHERS, 0, "{file}");
        }
    }

    /// Whoever opened a lock's file before it was removed holds nothing: the next one makes another file, and locks that.
    #[test]
    fn a_lock_is_held_by_one_however_often_its_file_is_removed() {
        let shared = tempfile::tempdir().unwrap();
        let home = Folder::make(&shared.path().join("home")).unwrap();
        let (is_held, times) = (AtomicBool::new(false), AtomicU64::new(0));
        let contend = || {
            for _ in 0..20_000 {
                let Ok(Some(lock)) = home.lock("mark") else { continue };
                assert!(!is_held.swap(true, SeqCst), "two hold it");
                times.fetch_add(1, SeqCst);
                is_held.store(false, SeqCst);
                std::fs::remove_file(home.path().join("mark")).unwrap();
                drop(lock);
            }
        };
        std::thread::scope(|threads| (0..3).for_each(|_| drop(threads.spawn(contend))));
        assert!(times.load(SeqCst) > 0);
    }

    #[test]
    fn what_could_not_be_written_is_not_left_there() {
        let shared = tempfile::tempdir().unwrap();
        let home = Folder::make(&shared.path().join("home")).unwrap();
        // A file cannot take a folder's place.
        home.make_child("sessions").unwrap();
        assert!(home.write("sessions", b"new").is_err());
        assert_eq!(home.names().unwrap(), ["sessions"]);
    }

    #[test]
    fn a_folder_that_was_exchanged_meanwhile_is_still_the_one_that_was_looked_at() {
        let shared = tempfile::tempdir().unwrap();
        let (path, aside) = (shared.path().join("home"), shared.path().join("aside"));
        let home = Folder::make(&path).unwrap();
        std::fs::rename(&path, &aside).unwrap();
        std::fs::create_dir(&path).unwrap();
        std::fs::create_dir(path.join("child")).unwrap();
        home.write("file", b"here").unwrap();
        assert_eq!(std::fs::read(aside.join("file")).unwrap(), b"here");
        assert!(home.remove_child("child").is_err());
        assert!(path.join("child").is_dir());
    }
}
