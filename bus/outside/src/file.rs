//! Files that somebody names: a FIFO, a device or a folder in their place is an error at once, and nothing waits for it.

use std::fs::{File, Metadata, OpenOptions};
use std::io::{Error, ErrorKind, Read, Result, Write};
use std::os::unix::fs::{FileTypeExt, OpenOptionsExt};
use std::path::Path;

use rustix::fs::OFlags;

/// Opening waits for nobody (a FIFO would wait for its other end), and a terminal does not become the process' own.
const AT_ONCE: OFlags = OFlags::NONBLOCK.union(OFlags::NOCTTY);

/// Opens an ordinary file for reading.
///
/// # Errors
/// It cannot be opened, or is no ordinary file: a FIFO, a folder, a device, a socket.
pub fn open(path: &Path) -> Result<File> {
    opened(OpenOptions::new().read(true), path)
}

/// Opens a file as `how` says, without waiting for anybody, and sees that it is an ordinary one.
///
/// # Errors
/// As [`open`].
pub fn opened(how: &mut OpenOptions, path: &Path) -> Result<File> {
    let file = how.custom_flags(AT_ONCE.bits().cast_signed()).open(path)?;
    ordinary(&file.metadata()?)?;
    Ok(file)
}

/// All of an ordinary file of at most `most` bytes.
///
/// # Errors
/// As [`open`]; the file is longer, or turns out to be while it is read.
pub fn read(path: &Path, most: u64) -> Result<Vec<u8>> {
    let file = open(path)?;
    let length = file.metadata()?.len();
    if length > most {
        return Err(too_long(most));
    }
    let mut bytes = Vec::new();
    // A file may grow while it is read; one of /proc says that it has no length at all.
    file.take(most + 1).read_to_end(&mut bytes)?;
    match bytes.len() as u64 > most {
        true => Err(too_long(most)),
        false => Ok(bytes),
    }
}

/// All of an ordinary file of text (UTF-8) of at most `most` bytes.
///
/// # Errors
/// As [`read`]; it is no text.
pub fn read_text(path: &Path, most: u64) -> Result<String> {
    let bytes = read(path, most)?;
    String::from_utf8(bytes).map_err(|error| {
        let at = error.utf8_error().valid_up_to();
        Error::new(ErrorKind::InvalidData, format!("it is no text: byte {} is not UTF-8", at + 1))
    })
}

/// Writes an ordinary file, in place of one that is there; its folder is made.
///
/// # Errors
/// The folder cannot be made, or the file not written, or it is no ordinary file.
pub fn write(path: &Path, bytes: &[u8]) -> Result<()> {
    let mut file = writable(path)?;
    file.set_len(0)?;
    file.write_all(bytes)
}

/// Puts an ordinary file in the place of one that is there, or of none, in one step: whoever looks finds the old one or all of
/// the new one, whatever happens meanwhile. Its folder is made.
///
/// # Errors
/// As [`write()`]; what was there before is there still.
pub fn replace(path: &Path, bytes: &[u8]) -> Result<()> {
    // It is the file itself that is replaced, not what leads to it.
    let path = &path.canonicalize().unwrap_or_else(|_| path.to_owned());
    match (path.exists(), path.parent()) {
        // What is no ordinary file, or may not be written, stays.
        (true, _) => drop(opened(OpenOptions::new().write(true), path)?),
        (false, Some(folder)) => std::fs::create_dir_all(folder)?,
        (false, None) => {}
    }
    put(path, bytes)
}

/// Writes a draft beside a path, and gives it that name.
fn put(path: &Path, bytes: &[u8]) -> Result<()> {
    let mut draft = path.as_os_str().to_owned();
    draft.push(format!(".{}.new", std::process::id()));
    let written = File::create_new(&draft).and_then(|mut file| {
        file.write_all(bytes)?;
        file.sync_all()
    });
    let placed = written.and_then(|()| std::fs::rename(&draft, path));
    if placed.is_err() {
        // What cannot be removed harms nobody.
        let _ = std::fs::remove_file(&draft);
    }
    placed
}

/// Puts an ordinary file into a folder that may come from elsewhere, in one step, as [`replace`] does: a link in its place is
/// itself replaced, and nothing is written where it leads.
///
/// # Errors
/// As [`write()`]; what is there is neither an ordinary file nor a link.
pub fn place(path: &Path, bytes: &[u8]) -> Result<()> {
    match std::fs::symlink_metadata(path) {
        Ok(found) if !found.is_symlink() => ordinary(&found)?,
        Ok(_) => {}
        Err(error) if error.kind() == ErrorKind::NotFound => {}
        Err(error) => return Err(error),
    }
    put(path, bytes)
}

/// Sees that [`write()`] could write a file there, which need not be there yet: its folder is made.
///
/// # Errors
/// As [`write()`].
pub fn try_write(path: &Path) -> Result<()> {
    let new = !path.exists();
    writable(path)?;
    if new { std::fs::remove_file(path) } else { Ok(()) }
}

fn writable(path: &Path) -> Result<File> {
    if let Some(folder) = path.parent() {
        std::fs::create_dir_all(folder)?;
    }
    opened(OpenOptions::new().write(true).create(true).truncate(false), path)
}

/// Whether `found` is that of an ordinary file; the error says what it is instead.
fn ordinary(found: &Metadata) -> Result<()> {
    let kind = found.file_type();
    let what = match () {
        () if kind.is_file() => return Ok(()),
        () if kind.is_dir() => return Err(Error::new(ErrorKind::IsADirectory, "it is a folder; right is a file")),
        () if kind.is_fifo() => "a FIFO",
        () if kind.is_socket() => "a socket",
        () => "a device",
    };
    Err(Error::new(ErrorKind::InvalidInput, format!("it is {what}; right is an ordinary file")))
}

fn too_long(most: u64) -> Error {
    Error::new(ErrorKind::FileTooLarge, format!("it is longer than {}", size(most)))
}

/// A number of bytes for people: `256 kB`, `64 MB`.
fn size(bytes: u64) -> String {
    match bytes {
        bytes if bytes < 10_000 => format!("{bytes} bytes"),
        bytes if bytes < 10_000_000 => format!("{} kB", bytes / 1000),
        bytes => format!("{} MB", bytes / 1_000_000),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn said(path: &Path) -> String {
        read_text(path, 100).unwrap_err().to_string()
    }

    #[test]
    fn what_is_no_file_is_said_at_once_and_waited_for_by_nobody() {
        let folder = tempfile::tempdir().unwrap();
        let fifo = folder.path().join("fifo");
        rustix::fs::mkfifoat(rustix::fs::CWD, &fifo, rustix::fs::Mode::RWXU).unwrap();
        assert_eq!(said(&fifo), "it is a FIFO; right is an ordinary file");
        assert_eq!(said(folder.path()), "it is a folder; right is a file");
        assert_eq!(said(Path::new("/dev/zero")), "it is a device; right is an ordinary file");
        let _listener = std::os::unix::net::UnixListener::bind(folder.path().join("socket")).unwrap();
        assert!(open(&folder.path().join("socket")).is_err());
        let writer = opened(OpenOptions::new().write(true), &fifo).unwrap_err();
        assert_eq!(writer.raw_os_error(), Some(rustix::io::Errno::NXIO.raw_os_error()), "nobody reads it");
    }

    #[test]
    fn what_can_be_written_is_known_before_and_nothing_is_changed_to_know_it() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("runs/1/map.bt");
        try_write(&path).unwrap();
        assert!(!path.exists() && path.parent().unwrap().is_dir());
        write(&path, b"a map").unwrap();
        try_write(&path).unwrap();
        assert_eq!(read(&path, 100).unwrap(), b"a map");
        write(&path, b"map").unwrap();
        assert_eq!(read(&path, 100).unwrap(), b"map");
        for wrong in [folder.path(), &path.join("more"), Path::new("/proc/self/map.bt"), Path::new("/dev/full")] {
            assert!(try_write(wrong).is_err() && write(wrong, b"").is_err(), "{}", wrong.display());
        }
    }

    #[test]
    fn a_file_is_replaced_whole_or_not_at_all() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("runs/1/map.elkmap");
        for bytes in ["a map", "another"] {
            replace(&path, bytes.as_bytes()).unwrap();
            assert_eq!(read(&path, 100).unwrap(), bytes.as_bytes());
        }
        let link = folder.path().join("link");
        std::os::unix::fs::symlink(&path, &link).unwrap();
        replace(&link, b"by the link").unwrap();
        assert!(link.is_symlink() && read(&path, 100).unwrap() == b"by the link");
        assert_eq!(std::fs::read_dir(path.parent().unwrap()).unwrap().count(), 1, "no draft is left");
        for wrong in [folder.path(), &path.join("more"), Path::new("/proc/self/map.bt"), Path::new("/dev/full")] {
            assert!(replace(wrong, b"").is_err(), "{}", wrong.display());
        }
    }

    /// Regression: a run's folder with a link in it had its picture written over whatever file the link named.
    #[test]
    fn what_is_placed_follows_no_link() {
        let folder = tempfile::tempdir().unwrap();
        let [mine, link, missing, to_missing, fifo] =
            ["mine", "link", "missing", "to_missing", "fifo"].map(|name| folder.path().join(name));
        std::fs::write(&mine, "mine").unwrap();
        std::os::unix::fs::symlink(&mine, &link).unwrap();
        std::os::unix::fs::symlink(&missing, &to_missing).unwrap();
        for path in [&link, &to_missing, &folder.path().join("new")] {
            for bytes in ["a picture", "another"] {
                place(path, bytes.as_bytes()).unwrap();
                assert!(path.symlink_metadata().unwrap().is_file() && read(path, 100).unwrap() == bytes.as_bytes());
            }
        }
        assert!(std::fs::read(&mine).unwrap() == b"mine" && !missing.exists());
        rustix::fs::mkfifoat(rustix::fs::CWD, &fifo, rustix::fs::Mode::RWXU).unwrap();
        for (wrong, why) in [(&fifo, "it is a FIFO"), (&folder.path().to_owned(), "it is a folder")] {
            assert!(place(wrong, b"").unwrap_err().to_string().starts_with(why), "{}", wrong.display());
        }
    }

    #[test]
    fn a_file_is_read_up_to_its_limit_even_if_it_is_all_hole() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("file");
        std::fs::write(&path, "x".repeat(100)).unwrap();
        assert_eq!(read_text(&path, 100).unwrap().len(), 100);
        assert_eq!(read(&path, 99).unwrap_err().to_string(), "it is longer than 99 bytes");
        File::options().write(true).open(&path).unwrap().set_len(1 << 40).unwrap();
        assert_eq!(read(&path, 64_000_000).unwrap_err().to_string(), "it is longer than 64 MB");
        std::fs::write(&path, b"elk \xff").unwrap();
        assert_eq!(said(&path), "it is no text: byte 5 is not UTF-8");
        assert!(
            read(Path::new("/proc/self/status"), 1 << 20).unwrap().starts_with(b"Name:"),
            "a file without a length"
        );
    }
}
