//! Folders with a file a frame, and lists of their times and poses.

use std::collections::BTreeSet;
use std::path::{Path, PathBuf};

use elk_geometry::Pose;
use elk_outside::file;

/// The longest list of a folder that is read (bytes).
const LONGEST_LIST: u64 = 1 << 27;
/// The most frames of a recording (two hours at 30 a second).
pub(crate) const MOST_FRAMES: usize = 1 << 18;
/// The most names in a folder, of which a frame has a few, and the most poses that a list has for them.
const MOST: usize = 4 * MOST_FRAMES;

/// Why a folder is no recording.
#[derive(Debug, thiserror::Error)]
pub enum FolderError {
    /// It is not there.
    #[error(
        "there is no folder {} ({why}): where the recorded data lie elsewhere, ELK_DATA or Sensor.Recording has to name it; \
         {right}", .folder.display()
    )]
    Missing {
        /// The folder.
        folder: PathBuf,
        /// What the operating system says.
        why: std::io::Error,
        /// What would be right.
        right: &'static str,
    },
    /// There are no frames in it.
    #[error("{}: there is {what} in it; {right}", .folder.display())]
    Empty {
        /// The folder.
        folder: PathBuf,
        /// What was looked for.
        what: &'static str,
        /// What would be right.
        right: &'static str,
    },
    /// A file in it that all frames need cannot be read, or says something that cannot be.
    #[error("{}: {why}", .file.display())]
    File {
        /// The file.
        file: PathBuf,
        /// What was found, and what would be right.
        why: String,
    },
    /// There is too much in it.
    #[error("{}: there are more than {MOST} files in it; right is a part of it", .0.display())]
    Long(PathBuf),
    /// None of its images can be used.
    #[error("none of the {frames} {images} in {} can be used; {first}", .folder.display())]
    Unusable {
        /// The folder.
        folder: PathBuf,
        /// What kind of images they are.
        images: &'static str,
        /// Images that were tried.
        frames: usize,
        /// What is wrong with the first.
        first: String,
    },
}

/// The names in a folder, in their order.
pub(crate) fn entries(folder: &Path, right: &'static str) -> Result<BTreeSet<String>, FolderError> {
    let missing = |why| FolderError::Missing { folder: folder.to_owned(), why, right };
    let entries = std::fs::read_dir(folder).map_err(missing)?;
    let names = entries.flatten().filter_map(|entry| entry.file_name().into_string().ok());
    let names: BTreeSet<String> = names.take(MOST + 1).collect();
    if names.len() > MOST { Err(FolderError::Long(folder.to_owned())) } else { Ok(names) }
}

/// A text that all frames need, and what is said in it.
pub(crate) fn single<T>(
    path: &Path,
    most: u64,
    read: impl FnOnce(&str) -> Result<T, String>,
) -> Result<T, FolderError> {
    let text = file::read_text(path, most).map_err(|error| error.to_string());
    let said = text.and_then(|text| read(&text));
    said.map_err(|why| FolderError::File { file: path.to_owned(), why })
}

/// The lines of a list that are no comments, at most so many.
pub(crate) fn lines<T>(
    list: &Path,
    most: usize,
    read: impl Fn(&str) -> Result<T, String>,
) -> Result<Vec<T>, FolderError> {
    single(list, LONGEST_LIST, |text| {
        let lines = text.lines().map(str::trim).enumerate();
        let lines = lines.filter(|(_, line)| !line.is_empty() && !line.starts_with('#'));
        let read = |(nth, (i, line)): (usize, (usize, &str))| match nth < most {
            true => read(line).map_err(|why| format!("line {}: {why}", i + 1)),
            false => Err(format!("there are more than {most} lines in it")),
        };
        lines.enumerate().map(read).collect()
    })
}

/// Poses with their times, in a file.
#[derive(Debug, Clone, PartialEq, Default)]
pub(crate) struct Timed {
    file: String,
    poses: Vec<(f64, Pose)>,
}

impl Timed {
    /// An image's pose is the nearest in time, up to so far away (s), as the TUM benchmark's own tools have it.
    const APART_SECS: f64 = 0.02;

    /// Those of a list; none, if there is no such file.
    pub fn read(list: &Path, read: impl Fn(&str) -> Result<(f64, Pose), String>) -> Result<Self, FolderError> {
        let mut poses = if list.exists() { lines(list, MOST, read)? } else { Vec::new() };
        poses.sort_by(|one, other| one.0.total_cmp(&other.0));
        Ok(Self { file: list.file_name().unwrap_or_default().to_string_lossy().into_owned(), poses })
    }

    /// The pose at a time, or that there is none.
    pub fn at(&self, secs: f64) -> Result<Pose, String> {
        let after = self.poses.partition_point(|(time, _)| *time < secs);
        let beside = self.poses[after.saturating_sub(1)..].iter().take(2);
        let apart = |(time, _): &&(f64, Pose)| (time - secs).abs();
        let near = beside.min_by(|one, other| apart(one).total_cmp(&apart(other)));
        let none = || format!("{} has no pose within {} s of {secs} s", self.file, Self::APART_SECS);
        near.filter(|near| apart(near) <= Self::APART_SECS).map(|near| near.1).ok_or_else(none)
    }
}
