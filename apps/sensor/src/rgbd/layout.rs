//! What lies in a recording's folder.

use std::collections::BTreeSet;
use std::path::{Path, PathBuf};

use elk_geometry::Pose;
use elk_outside::file;

use crate::recording::{FolderError, Line, MOST_FRAMES, Timed, Times, entries, lines, of_line, of_matrix};

/// The longest file of one pose that is read (bytes).
const LONGEST_POSE: u64 = 1 << 14;
const DEPTH: &str = ".depth.png";
const POSE: &str = ".pose.txt";
/// The list of images, as TUM has it.
const LIST: &str = "depth.txt";

const RIGHT: &str = "right is a folder of frame-000000.depth.png with frame-000000.pose.txt (7-Scenes), or of depth.txt with groundtruth.txt (TUM)";

/// A frame that a folder speaks of.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Listed {
    /// What people call it.
    pub name: String,
    /// Its depths, or why there are none.
    pub depths: Result<PathBuf, String>,
    /// Its time (s), where it is recorded.
    pub secs: Option<f64>,
    pose: Posed,
}

#[derive(Debug, Clone, PartialEq)]
enum Posed {
    In(PathBuf),
    Known(Result<Pose, String>),
}

impl Listed {
    /// Where it was taken, or why that is not known.
    pub fn pose(&self) -> Result<Pose, String> {
        match &self.pose {
            Posed::In(file) => {
                let name = file.file_name().unwrap_or_default().to_string_lossy().into_owned();
                let text = file::read_text(file, LONGEST_POSE).map_err(|error| format!("its pose, {name}: {error}"))?;
                of_matrix(&text).map_err(|why| format!("its pose, {name}: {why}"))
            }
            Posed::Known(pose) => pose.clone(),
        }
    }
}

/// A folder of frames.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Folder {
    /// In their order.
    pub frames: Vec<Listed>,
    /// What whoever plays them should know.
    pub remarks: Vec<String>,
}

/// The frames of a folder.
///
/// # Errors
/// There is none, or a list cannot be used.
pub(super) fn folder(folder: &Path) -> Result<Folder, FolderError> {
    let names = entries(folder, RIGHT)?;
    let found = match names.contains(LIST) {
        true => timed(folder)?,
        false => Folder { frames: numbered(folder, &names), remarks: Vec::new() },
    };
    match found.frames.iter().any(|frame| frame.depths.is_ok()) {
        true => Ok(found),
        false => Err(FolderError::Empty {
            folder: folder.to_owned(),
            what: "neither a depth.txt nor a frame-….depth.png",
            right: RIGHT,
        }),
    }
}

/// As 7-Scenes has them: a file of depths and one of a pose each.
fn numbered(folder: &Path, names: &BTreeSet<String>) -> Vec<Listed> {
    let stems = names.iter().filter(|name| name.starts_with("frame-"));
    let stems: BTreeSet<&str> =
        stems.filter_map(|name| name.strip_suffix(DEPTH).or_else(|| name.strip_suffix(POSE))).collect();
    let partner = |stem: &str, end: &str| {
        let name = format!("{stem}{end}");
        match names.contains(&name) {
            true => Ok(folder.join(name)),
            false => Err(format!("there is no {name}: depths and pose of a frame belong together")),
        }
    };
    let listed = |stem: &&str| Listed {
        name: format!("{stem}{DEPTH}"),
        depths: partner(stem, DEPTH),
        secs: None,
        pose: partner(stem, POSE).map_or_else(|why| Posed::Known(Err(why)), Posed::In),
    };
    stems.iter().map(listed).collect()
}

/// As TUM's benchmark has them: lists of images and of poses, with their times. A line of the first that is none is a frame that is none.
fn timed(folder: &Path) -> Result<Folder, FolderError> {
    let poses = Timed::read(&folder.join("groundtruth.txt"), of_line)?;
    let image = |line: &str| {
        let (time, name) = line.split_once(char::is_whitespace).ok_or("a time and a file would be right")?;
        let secs: f64 =
            time.parse().ok().filter(|secs: &f64| secs.is_finite()).ok_or(format!("{time:?} is no time"))?;
        let path = Path::new(name.trim());
        // What a list names lies in its folder.
        let inside = path.components().all(|step| matches!(step, std::path::Component::Normal(_)));
        if inside { Ok((secs, path.to_owned())) } else { Err(format!("{name:?} is no file of this folder")) }
    };
    let images = lines(&folder.join(LIST), MOST_FRAMES, image)?;
    let mut last = images.iter().find_map(|line| Some(line.said.as_ref().ok()?.0)).unwrap_or_default();
    let mut times = Times::new();
    let mut listed = |Line { number, said }: Line<(f64, PathBuf)>| match said {
        Ok((secs, name)) => {
            let forwards = times.next(secs).map_err(|why| format!("{why}: times go forwards"));
            last = secs;
            Listed {
                name: name.display().to_string(),
                depths: forwards.map(|()| folder.join(&name)),
                secs: Some(secs),
                pose: Posed::Known(poses.at(secs)),
            }
        }
        // Until the next one no time goes by.
        Err(why) => Listed {
            name: format!("{LIST}:{number}"),
            depths: Err(why.clone()),
            secs: Some(last),
            pose: Posed::Known(Err(why)),
        },
    };
    Ok(Folder { frames: images.into_iter().map(&mut listed).collect(), remarks: poses.remarks() })
}

#[cfg(test)]
mod tests {
    use super::*;

    fn written(files: &[(&str, &str)]) -> tempfile::TempDir {
        let folder = tempfile::tempdir().unwrap();
        files.iter().for_each(|(name, text)| std::fs::write(folder.path().join(name), text).unwrap());
        folder
    }

    #[test]
    fn frames_without_their_partner_are_among_the_others() {
        let pose = "1 0 0 1 0 1 0 0 0 0 1 0 0 0 0 1";
        let folder = written(&[
            ("frame-000002.depth.png", ""),
            ("frame-000001.depth.png", ""),
            ("frame-000001.pose.txt", pose),
            ("frame-000003.pose.txt", pose),
            ("notes.txt", ""),
        ]);
        let frames = super::folder(folder.path()).unwrap().frames;
        let said: Vec<_> =
            frames.iter().map(|frame| (frame.name.as_str(), frame.depths.is_ok(), frame.pose().is_ok())).collect();
        let [one, two, three] = ["frame-000001.depth.png", "frame-000002.depth.png", "frame-000003.depth.png"];
        assert_eq!(said, [(one, true, true), (two, true, false), (three, false, true)]);
        assert!(frames[1].pose().unwrap_err().starts_with("there is no frame-000002.pose.txt: depths and pose"));
    }

    #[test]
    fn timed_images_have_the_pose_that_is_nearest() {
        let folder = written(&[
            ("depth.txt", "# time file\n10.0 depth/a.png\n10.5 depth/b.png\n10.1 depth/c.png\n10.6 depth/d.png\n"),
            ("groundtruth.txt", "9.99 1 0 0 0 0 0 1\n10.005 2 0 0 0 0 0 1\n10.61 3 0 0 0 0 0 1\n"),
        ]);
        let frames = super::folder(folder.path()).unwrap().frames;
        let place = |i: usize| frames[i].pose().map(|pose| pose.position().x);
        assert_eq!((place(0), place(3)), (Ok(2.0), Ok(3.0)));
        assert_eq!(place(1), Err("groundtruth.txt has no pose within 0.02 s of 10.5 s".into()));
        let backwards = "a time of 10.1 s after one of 10.5 s: times go forwards";
        assert_eq!(frames[2].depths, Err(backwards.to_owned()));
    }

    #[test]
    fn folders_that_are_no_recordings_are_said_with_what_would_be_right() {
        let said = |path: &Path| folder(path).unwrap_err().to_string();
        let none = said(Path::new("no/such/folder"));
        assert!(
            none.contains("there is no folder no/such/folder")
                && none.contains("ELK_DATA")
                && none.contains("7-Scenes"),
            "{none}"
        );
        let empty = written(&[]);
        assert!(said(empty.path()).contains("neither a depth.txt nor a frame-….depth.png in it; right is"));
        for (lists, why) in [
            (
                [("depth.txt", "10.0\n"), ("groundtruth.txt", "")],
                "depth.txt: no line of it can be used; line 1: a time and a file would be right",
            ),
            ([("depth.txt", "1 ../a.png\n"), ("groundtruth.txt", "")], "is no file of this folder"),
            (
                [("depth.txt", "1 a.png"), ("groundtruth.txt", "\n1 2 3\nnone")],
                "groundtruth.txt: no line of it can be used; line 2: 3 numbers",
            ),
        ] {
            let folder = written(&lists);
            assert!(said(folder.path()).contains(why), "{}", said(folder.path()));
        }
    }

    /// Regression: one line that is none in either list, and nothing of the recording was played.
    #[test]
    fn a_line_that_is_none_is_a_frame_that_is_none_or_a_pose_that_is_missed() {
        let folder = written(&[
            ("depth.txt", "1\n2 ../a.png\n# times and files\n10 a.png\nx b.png\n11 c.png\n12 d.png\n"),
            ("groundtruth.txt", "10 1 0 0 0 0 0 1\n11 2 0 0 0 0 0 0.5\n12 3 0 0 0 0 0 1\n"),
        ]);
        let Folder { frames, remarks } = super::folder(folder.path()).unwrap();
        let said: Vec<_> = frames.iter().map(|frame| (frame.name.as_str(), frame.depths.is_ok(), frame.secs)).collect();
        let wanted = [
            ("depth.txt:1", false, 10.0),
            ("depth.txt:2", false, 10.0),
            ("a.png", true, 10.0),
            ("depth.txt:5", false, 10.0),
            ("c.png", true, 11.0),
            ("d.png", true, 12.0),
        ];
        assert_eq!(said, wanted.map(|(name, is_whole, secs)| (name, is_whole, Some(secs))));
        assert_eq!(frames[3].depths, Err("\"x\" is no time".to_owned()));
        let length = "a quaternion of length 0.500: 1 would be right";
        assert_eq!(
            frames[4].pose(),
            Err(format!("groundtruth.txt has no pose within 0.02 s of 11 s (line 2: {length})"))
        );
        assert!(frames[2].pose().is_ok() && frames[5].pose().is_ok());
        assert_eq!(remarks, [format!("groundtruth.txt: line 2: {length}; it is left out")]);
    }

    #[test]
    fn a_list_is_read_up_to_its_longest() {
        let lists = written(&[("depth.txt", "1 a.png\n"), ("groundtruth.txt", "1 0 0 0 0 0 0 1\n")]);
        let list = std::fs::File::options().write(true).open(lists.path().join("depth.txt")).unwrap();
        list.set_len((128 << 20) + 1).unwrap();
        let said = folder(lists.path()).unwrap_err().to_string();
        assert!(said.contains("depth.txt: it is longer than 134 MB"), "{said}");
    }

    /// Regression: lists of a quarter of a gigabyte became gigabytes of frames.
    #[test]
    fn lists_are_as_long_as_a_recording() {
        let said = |lists: &[(&str, &str)]| folder(written(lists).path()).unwrap_err().to_string();
        let images = "1 a.png\n".repeat(MOST_FRAMES + 1);
        assert!(said(&[("depth.txt", &images)]).contains("depth.txt: there are more than 262144 lines in it"));
        let poses = "1 0 0 0 0 0 0 1\n".repeat(4 * MOST_FRAMES + 1);
        let lists = [("depth.txt", "1 a.png\n"), ("groundtruth.txt", &poses)];
        assert!(said(&lists).contains("groundtruth.txt: there are more than 1048576 lines in it"));
        let most = written(&[("depth.txt", &images[8..])]);
        assert_eq!(folder(most.path()).unwrap().frames.len(), MOST_FRAMES);
    }
}
