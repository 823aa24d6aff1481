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
/// Of what is wrong with a line so many characters are said: a word of it may be as long as its file.
const LONGEST_REASON: usize = 200;
/// Lines of a list that are left out are named one by one, up to so many.
const NAMED: usize = 20;

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

/// A text that all frames need, and what is said in it; `right`: what the folder should have.
pub(crate) fn single<T>(
    path: &Path,
    most: u64,
    right: &str,
    read: impl FnOnce(&str) -> Result<T, String>,
) -> Result<T, FolderError> {
    let text = file::read_text(path, most).map_err(|error| format!("{error}; {right}"));
    let said = text.and_then(|text| read(&text));
    said.map_err(|why| FolderError::File { file: path.to_owned(), why })
}

/// A line of a list.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct Line<T> {
    /// Which it is, from 1.
    pub number: usize,
    /// What it says, or what is wrong with it and what would be right.
    pub said: Result<T, String>,
}

/// The lines of a list that are neither empty nor comments, at most so many.
///
/// # Errors
/// It cannot be read, is longer, or no line of it can be used.
pub(crate) fn lines<T>(
    list: &Path,
    most: usize,
    read: impl Fn(&str) -> Result<T, String>,
) -> Result<Vec<Line<T>>, FolderError> {
    list_of(list, most, |line| !line.is_empty(), read)
}

/// The same of a list whose order alone says of which frame a line is: an empty one has its place in it, too.
///
/// # Errors
/// As [`lines`].
pub(crate) fn lines_in_order<T>(
    list: &Path,
    most: usize,
    read: impl Fn(&str) -> Result<T, String>,
) -> Result<Vec<Line<T>>, FolderError> {
    list_of(list, most, |_| true, read)
}

fn list_of<T>(
    list: &Path,
    most: usize,
    counts: impl Fn(&str) -> bool,
    read: impl Fn(&str) -> Result<T, String>,
) -> Result<Vec<Line<T>>, FolderError> {
    let unfit = |why: String| FolderError::File { file: list.to_owned(), why };
    let bytes = file::read(list, LONGEST_LIST).map_err(|error| unfit(error.to_string()))?;
    // A byte that is none of a text spoils its line alone.
    let text = String::from_utf8_lossy(&bytes);
    let all = text.lines().map(str::trim).enumerate();
    let all = all.filter(|(_, line)| !line.starts_with('#') && counts(line));
    let lines: Vec<Line<T>> =
        all.take(most + 1).map(|(i, line)| Line { number: i + 1, said: read(line).map_err(shortened) }).collect();
    if lines.len() > most {
        return Err(unfit(format!("there are more than {most} lines in it")));
    }
    match &lines[..] {
        [Line { number, said: Err(why) }, others @ ..] if others.iter().all(|line| line.said.is_err()) => {
            Err(unfit(format!("no line of it can be used; line {number}: {why}")))
        }
        _ => Ok(lines),
    }
}

fn shortened(why: String) -> String {
    match why.char_indices().nth(LONGEST_REASON) {
        Some((end, _)) => format!("{}…", &why[..end]),
        None => why,
    }
}

/// Poses with their times, in a file.
#[derive(Debug, Clone, PartialEq, Default)]
pub(crate) struct Timed {
    file: String,
    /// By their times (s), each with the line that says it.
    poses: Vec<(f64, usize, Pose)>,
    /// Lines that are none, in their order, and why.
    left_out: Vec<(usize, String)>,
}

impl Timed {
    /// An image's pose is the nearest in time, up to so far away (s), as the TUM benchmark's own tools have it.
    const APART_SECS: f64 = 0.02;

    /// Those of a list; none, if there is no such file. A line that is none is left out.
    ///
    /// # Errors
    /// The list cannot be read, or no line of it used.
    pub fn read(list: &Path, read: impl Fn(&str) -> Result<(f64, Pose), String>) -> Result<Self, FolderError> {
        let file = list.file_name().unwrap_or_default().to_string_lossy().into_owned();
        let mut timed = Self { file, ..Self::default() };
        let lines = if list.exists() { lines(list, MOST, read)? } else { Vec::new() };
        for Line { number, said } in lines {
            match said {
                Ok((secs, pose)) => timed.poses.push((secs, number, pose)),
                Err(why) => timed.left_out.push((number, why)),
            }
        }
        timed.poses.sort_by(|one, other| one.0.total_cmp(&other.0));
        Ok(timed)
    }

    /// The pose at a time, or that there is none.
    pub fn at(&self, secs: f64) -> Result<Pose, String> {
        let after = self.poses.partition_point(|(time, ..)| *time < secs);
        let beside = self.poses[after.saturating_sub(1)..].iter().take(2);
        let apart = |(time, ..): &&(f64, usize, Pose)| (time - secs).abs();
        let near = beside.min_by(|one, other| apart(one).total_cmp(&apart(other)));
        let none = || {
            let why = self.left_out_at(after).map(|(line, why)| format!(" (line {line}: {why})")).unwrap_or_default();
            format!("{} has no pose within {} s of {secs} s{why}", self.file, Self::APART_SECS)
        };
        near.filter(|near| apart(near) <= Self::APART_SECS).map(|near| near.2).ok_or_else(none)
    }

    /// The first line that was left out between the pose before and the one at `after`.
    fn left_out_at(&self, after: usize) -> Option<&(usize, String)> {
        let line = |i: usize| self.poses.get(i).map(|(_, line, _)| *line);
        let ends = [after.checked_sub(1).and_then(line).unwrap_or(0), line(after).unwrap_or(usize::MAX)];
        let first = self.left_out.partition_point(|(line, _)| *line < ends[0].min(ends[1]));
        self.left_out.get(first).filter(|(line, _)| *line < ends[0].max(ends[1]))
    }

    /// The lines that were left out.
    pub fn remarks(&self) -> Vec<String> {
        let (named, others) = self.left_out.split_at(self.left_out.len().min(NAMED));
        let named = named.iter().map(|(line, why)| format!("{}: line {line}: {why}; it is left out", self.file));
        let others = (!others.is_empty()).then(|| format!("{}: {} more lines are left out", self.file, others.len()));
        named.chain(others).collect()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::recording::of_line;

    fn timed(lines: &str) -> Result<Timed, FolderError> {
        let folder = tempfile::tempdir().unwrap();
        let list = folder.path().join("poses.txt");
        std::fs::write(&list, lines).unwrap();
        Timed::read(&list, of_line)
    }

    /// Regression: one line that was no pose, and nothing of a recording could be played.
    #[test]
    fn a_line_that_is_no_pose_is_left_out_and_named_where_its_pose_is_missed() {
        let lines = "1 1 0 0 0 0 0 1\n# a comment\n2 2 0 0 0 0 0 1\n3 3 0 0\n\n4 4 0 0 0 0 0 1\n5 1 1 1 0 0 0 x\n6 6 0 0 0 0 0 1\n";
        let poses = timed(lines).unwrap();
        let x = |secs| poses.at(secs).map(|pose| pose.position().x);
        assert_eq!([1.0, 2.01, 4.0, 6.0].map(x), [1.0, 2.0, 4.0, 6.0].map(Ok));
        let fourth = "poses.txt has no pose within 0.02 s of 3 s (line 4: 4 numbers: a time, a position and a quaternion, 8, would be right)";
        assert_eq!(x(3.0), Err(fourth.into()));
        assert_eq!(
            x(5.0),
            Err("poses.txt has no pose within 0.02 s of 5 s (line 7: \"x\" is no finite number)".into())
        );
        for elsewhere in [0.5, 1.5, 6.5] {
            assert!(x(elsewhere).unwrap_err().ends_with(&format!("of {elsewhere} s")), "no line was left out there");
        }
        let remarks = poses.remarks();
        assert_eq!(remarks.len(), 2);
        assert_eq!(remarks[1], "poses.txt: line 7: \"x\" is no finite number; it is left out");
    }

    #[test]
    fn many_lines_that_are_none_are_counted_and_long_ones_said_in_short() {
        let good = "1 1 0 0 0 0 0 1\n";
        let remarks = timed(&(good.to_owned() + &"none\n".repeat(30))).unwrap().remarks();
        assert_eq!((remarks.len(), remarks[20].as_str()), (21, "poses.txt: 10 more lines are left out"));
        let long = timed(&(good.to_owned() + &"x".repeat(100_000))).unwrap().remarks();
        assert!(long[0].len() < 300 && long[0].contains("xxx…; it is left out"), "{}", long[0].len());
        let none = timed("\n1 2\n3 4\n").unwrap_err().to_string();
        assert!(none.contains("poses.txt: no line of it can be used; line 2: 2 numbers"), "{none}");
    }

    #[test]
    fn bytes_that_are_no_text_spoil_their_line_alone_and_empty_ones_have_a_place_where_the_order_counts() {
        let folder = tempfile::tempdir().unwrap();
        let list = folder.path().join("times.txt");
        std::fs::write(&list, b"# s\n0\n\n\xff1\n2\n").unwrap();
        let number = |line: &str| line.parse::<u8>().map_err(|_| format!("{line:?} is none"));
        let said = |lines: Vec<Line<u8>>| -> Vec<(usize, Option<u8>)> {
            lines.into_iter().map(|line| (line.number, line.said.ok())).collect()
        };
        assert_eq!(said(lines(&list, 9, number).unwrap()), [(2, Some(0)), (4, None), (5, Some(2))]);
        let in_order = said(lines_in_order(&list, 9, number).unwrap());
        assert_eq!(in_order, [(2, Some(0)), (3, None), (4, None), (5, Some(2))]);
    }
}
