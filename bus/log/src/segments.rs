//! The files of a run's log: `log.mcap`, then `log.1.mcap`, `log.2.mcap`, …
//!
//! A new segment begins when the one before it is large or old enough, and when a logger finds a log that it has not
//! written itself: nothing that is there is ever overwritten.

use std::fs::{File, OpenOptions, TryLockError};
use std::io::ErrorKind;
use std::os::unix::fs::FileTypeExt;
use std::path::{Path, PathBuf};

use elk_outside::file;

use crate::error::LogError;
use crate::segment::Segment;

/// What logs are called.
const EXTENSION: &str = "mcap";
/// The run's log in its folder, unless the folder holds one of another name only.
const USUAL: &str = "log";

/// The files of the log at `path`, in their order: `path` itself, or, if it is a run's folder, all segments in it.
///
/// # Errors
/// The folder cannot be read, or holds no log, or several and none called `log.mcap`.
pub fn segments(path: &Path) -> Result<Vec<PathBuf>, LogError> {
    if !path.is_dir() {
        return Ok(vec![path.into()]);
    }
    let read = |source| LogError::Read { path: path.into(), source };
    let mut found = Vec::new();
    for entry in std::fs::read_dir(path).map_err(read)? {
        let file = entry.map_err(read)?.path();
        found.extend(split(&file).map(|(stem, number)| (stem, number, file)));
    }
    found.sort();
    let mut stems: Vec<&str> = found.iter().map(|(stem, ..)| stem.as_str()).collect();
    stems.dedup();
    let stem = match stems[..] {
        [] => {
            return Err(LogError::NoLog {
                path: path.into(),
                reason: "the folder holds no log.mcap, nor another .mcap file".into(),
            });
        }
        [only] => only.to_owned(),
        _ if stems.contains(&USUAL) => USUAL.to_owned(),
        _ => {
            let reason = format!("the folder holds several logs; name one of {}", stems.join(".mcap, ") + ".mcap");
            return Err(LogError::NoLog { path: path.into(), reason });
        }
    };
    Ok(found.into_iter().filter(|(other, ..)| *other == stem).map(|(.., file)| file).collect())
}

/// Which files of the log at `path`, of which `files` are there, are missing between and before these, in words. A file
/// that says itself to be a log's first is one, whatever it is called, and so is another tool's.
pub(crate) fn missing(path: &Path, files: &[PathBuf]) -> Vec<String> {
    let (mut missing, mut next) = (Vec::new(), 0);
    let files = if path.is_dir() { files } else { &[] }; // one of them was meant
    for (stem, number, file) in files.iter().filter_map(|file| split(file).map(|(stem, number)| (stem, number, file))) {
        let goes_on = || Segment::number_of(file).is_ok_and(|number| number.is_some_and(|number| number > 0));
        if number > next && goes_on() {
            let name = |number| segment(&path.join(format!("{stem}.{EXTENSION}")), number).display().to_string();
            let (first, last) = (name(next), name(number - 1));
            missing.push(match number - next {
                1 => format!("the file {first} of the log is missing"),
                count => format!("{count} files of the log are missing, {first} to {last}"),
            });
        }
        next = number.saturating_add(1);
    }
    missing
}

/// Stem and number of a segment: `log.2.mcap` is number 2 of `log`, `log.mcap` number 0.
fn split(file: &Path) -> Option<(String, u64)> {
    let name = file.file_name()?.to_str()?.strip_suffix(EXTENSION)?.strip_suffix('.')?;
    let numbered = name.rsplit_once('.').and_then(|(stem, number)| Some((stem.to_owned(), number.parse().ok()?)));
    Some(numbered.unwrap_or_else(|| (name.to_owned(), 0)))
}

/// Segment `number` of the log at `path`.
fn segment(path: &Path, number: u64) -> PathBuf {
    match number {
        0 => path.into(),
        _ => path.with_extension(match path.extension() {
            Some(extension) => format!("{number}.{}", extension.to_string_lossy()),
            None => number.to_string(),
        }),
    }
}

/// Whether the log file at `path` is being written by a process of this machine that lives: it holds the file until
/// then.
pub fn is_written(path: &Path) -> bool {
    path.extension().is_some_and(|extension| extension == EXTENSION)
        && file::open(path).is_ok_and(|file| matches!(file.try_lock_shared(), Err(TryLockError::WouldBlock)))
}

/// Creates the first segment of the log at `path`, from number `from` on, that is not there yet; answers its number too.
/// A device (`/dev/full`) is opened as it is; a FIFO or a socket is not waited for.
pub(crate) fn create(path: &Path, from: u64) -> Result<(File, PathBuf, u64), LogError> {
    let failed = |source| LogError::Create { path: path.into(), source };
    let special = path.metadata().ok().map(|there| there.file_type()).filter(|kind| !kind.is_file() && !kind.is_dir());
    if let Some(kind) = special {
        let mut options = OpenOptions::new();
        options.write(true);
        let opened = if kind.is_char_device() { options.open(path) } else { file::opened(&mut options, path) };
        return Ok((opened.map_err(failed)?, path.into(), from));
    }
    for number in from.. {
        let path = segment(path, number);
        match OpenOptions::new().write(true).create_new(true).open(&path) {
            Ok(file) => {
                // A file system without locks tells nobody that the log is written; that stops no logger.
                let _ = file.try_lock();
                return Ok((file, path, number));
            }
            Err(error) if error.kind() == ErrorKind::AlreadyExists && !path.is_dir() => {}
            Err(source) => return Err(LogError::Create { path, source }),
        }
    }
    Err(LogError::Create { path: path.into(), source: ErrorKind::AlreadyExists.into() })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn segments_are_numbered_and_never_overwritten() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("log.mcap");
        let made: Vec<PathBuf> = (0..12).map(|_| create(&path, 0).unwrap().1).collect();
        assert_eq!(made[0], path);
        assert_eq!(made[11], folder.path().join("log.11.mcap"));
        assert_eq!(segments(folder.path()).unwrap(), made, "in the order of their numbers");
        assert_eq!(segments(&made[3]).unwrap(), [made[3].clone()]);
    }

    #[test]
    fn a_folder_with_another_log_besides_gives_the_run_s() {
        let folder = tempfile::tempdir().unwrap();
        assert!(matches!(segments(folder.path()), Err(LogError::NoLog { .. })));
        create(&folder.path().join("probe.mcap"), 0).unwrap();
        assert_eq!(segments(folder.path()).unwrap().len(), 1);
        create(&folder.path().join("other.mcap"), 0).unwrap();
        let error = segments(folder.path()).unwrap_err().to_string();
        assert!(error.contains("other.mcap, probe.mcap"), "{error}");
        create(&folder.path().join("log.mcap"), 0).unwrap();
        assert_eq!(segments(folder.path()).unwrap(), [folder.path().join("log.mcap")]);
    }
}
