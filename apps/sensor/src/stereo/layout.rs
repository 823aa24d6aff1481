//! What lies in a recording's folder: as EuRoC's recordings have it, or KITTI's.

use std::collections::BTreeSet;
use std::path::{Path, PathBuf};

use elk_geometry::Pose;
use elk_stereo::{Camera, Distortion, StereoCalibration, calibration};
use nalgebra::{Isometry3, Translation3};

use super::images;
use crate::pose_estimator::level;
use crate::recording::{
    FolderError, Line, MOST_FRAMES, Timed, Times, entries, lines_in_order, of_line, of_row_euroc, of_rows, single,
};

/// The longest calibration that is read (bytes).
const LONGEST_CALIBRATION: u64 = 1 << 20;
const PNG: &str = ".png";

pub(super) const RIGHT: &str =
    "right is a folder of cam0 and cam1 with their YAMLs (EuRoC), or of image_0 and image_1 with calib.txt (KITTI)";

/// The left and the right image, or why there are none.
pub(super) type Images = Result<[PathBuf; 2], String>;

/// A pair that a folder speaks of.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Listed {
    /// What people call it.
    pub name: String,
    /// Its images.
    pub images: Images,
    /// Its time (s), where it is recorded.
    pub secs: Option<f64>,
    /// Where what poses are recorded of was (world), or why that is not known.
    pub pose: Result<Pose, String>,
}

/// A folder of pairs.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Folder {
    pub calibration: StereoCalibration,
    /// What the calibration is called.
    pub calibration_name: String,
    /// The left camera's frame in that of which poses are recorded: the body's, or the camera's own.
    pub posed_from_left: Isometry3<f64>,
    /// In their order.
    pub pairs: Vec<Listed>,
    /// What whoever plays them should know.
    pub remarks: Vec<String>,
}

/// The pairs of a folder, and what took them.
///
/// # Errors
/// It is none, or a file that all pairs need cannot be used.
pub(super) fn folder(folder: &Path) -> Result<Folder, FolderError> {
    let names = entries(folder, RIGHT)?;
    if names.contains("mav0") {
        let inner = folder.join("mav0");
        let names = entries(&inner, RIGHT)?;
        return euroc(&inner, &names);
    }
    match (names.contains("cam0"), names.contains("image_0")) {
        (true, _) => euroc(folder, &names),
        (false, true) => kitti(folder),
        (false, false) => Err(FolderError::Empty {
            folder: folder.to_owned(),
            what: "neither a cam0 nor an image_0, nor a mav0 with a cam0",
            right: RIGHT,
        }),
    }
}

/// As EuRoC has them: images by their time in nanoseconds, a YAML a camera, and the poses of the body that carries both.
fn euroc(folder: &Path, names: &BTreeSet<String>) -> Result<Folder, FolderError> {
    // As they were published, or without the folders between.
    let first_of = |places: [PathBuf; 2]| match places {
        [one, other] if !one.exists() => other,
        [one, _] => one,
    };
    let sides = ["cam0", "cam1"];
    let images = sides.map(|side| first_of([folder.join(side).join("data"), folder.join(side)]));
    let yamls =
        sides.map(|side| first_of([folder.join(side).join("sensor.yaml"), folder.join(format!("{side}.yaml"))]));
    let camera = |yaml: &PathBuf| {
        single(yaml, LONGEST_CALIBRATION, RIGHT, |text| {
            let body_from_camera = calibration::euroc_body_from_camera(text).map_err(|error| error.to_string())?;
            Ok((text.to_owned(), body_from_camera))
        })
    };
    let [(left, posed_from_left), (right, _)] = [camera(&yamls[0])?, camera(&yamls[1])?];
    let calibration_name = format!("{}, {}", yamls[0].display(), yamls[1].display());
    let unfit = |why: String| FolderError::File { file: calibration_name.clone().into(), why };
    let calibration = calibration::euroc(&left, &right).map_err(|error| unfit(error.to_string()))?;
    let poses = match names.contains("state_groundtruth_estimate0") {
        true => Timed::read(&folder.join("state_groundtruth_estimate0/data.csv"), of_row_euroc)?,
        false => Timed::read(&folder.join("groundtruth.txt"), of_line)?,
    };
    let listed = |stem: String, images: Images| {
        let secs = stem.parse::<u64>().map(|nanoseconds| nanoseconds as f64 * 1e-9);
        let untimed = || format!("{stem}{PNG}: its name is no time; nanoseconds, as EuRoC has them, would be right");
        let (images, pose) = match secs {
            Ok(secs) => (images, poses.at(secs)),
            Err(_) => (Err(untimed()), Err(untimed())),
        };
        Listed { name: format!("{stem}{PNG}"), images, secs: secs.ok(), pose }
    };
    let pairs = pairs(&images)?.into_iter().map(|(stem, images)| listed(stem, images)).collect();
    not_empty(folder, Folder { calibration, calibration_name, posed_from_left, pairs, remarks: poses.remarks() })
}

/// As KITTI's odometry benchmark has them: rectified images by their number, projections, times, and poses of the left camera.
fn kitti(folder: &Path) -> Result<Folder, FolderError> {
    let pairs = pairs(&["image_0", "image_1"].map(|side| folder.join(side)))?;
    let size = size(folder, &pairs)?;
    let projections = folder.join("calib.txt");
    let calibration = single(&projections, LONGEST_CALIBRATION, RIGHT, |text| projected(text, size))?;
    let times = in_order(folder.join("times.txt"), time)?;
    let poses = in_order(folder.join("poses.txt"), of_rows)?;
    let (mut last, mut times_so_far) = (f64::NEG_INFINITY, Times::new());
    let mut listed = |(stem, images): (String, Images)| {
        let number = stem.parse::<usize>().map_err(|_| format!("its name is no number; {stem:?} stands there"));
        let secs = match (&times, &number) {
            (None, _) | (_, Err(_)) => None,
            (Some(times), Ok(number)) => Some(line(times, *number, "times.txt").copied()),
        };
        let backwards = secs.iter().flatten().find_map(|secs| times_so_far.next(*secs).err());
        let backwards = backwards.map(|why| format!("{why}, as times.txt says: times go forwards"));
        last = secs.iter().flatten().copied().next().unwrap_or(last);
        let pose = match (&poses, &number) {
            (None, _) => Err("there is no poses.txt, so nobody knows where it was taken".to_owned()),
            (_, Err(why)) => Err(why.clone()),
            (Some(poses), Ok(number)) => line(poses, *number, "poses.txt").map(|pose| Pose(level().0 * pose.0)),
        };
        let timed = secs.clone().unwrap_or(Ok(0.0)).and(number.map(|_| 0.0));
        let images = backwards.map_or(timed, Err).and(images);
        // A pair without a time is none; until the next one no time goes by.
        let secs = secs.and_then(|secs| secs.ok().or(Some(last).filter(|last| last.is_finite())));
        Listed { name: format!("{stem}{PNG}"), images, secs, pose }
    };
    let pairs = pairs.into_iter().map(&mut listed).collect();
    let (calibration_name, posed_from_left) = (projections.display().to_string(), Isometry3::identity());
    not_empty(folder, Folder { calibration, calibration_name, posed_from_left, pairs, remarks: Vec::new() })
}

/// The lines of a list that has one for each pair, if there is such a file.
fn in_order<T>(list: PathBuf, read: impl Fn(&str) -> Result<T, String>) -> Result<Option<Vec<Line<T>>>, FolderError> {
    list.exists().then(|| lines_in_order(&list, MOST_FRAMES, read)).transpose()
}

/// What the list `name` says of a pair, or why it does not.
fn line<'a, T>(lines: &'a [Line<T>], pair: usize, name: &str) -> Result<&'a T, String> {
    let missing = || format!("{name} has no line for it: as many as there are pairs would be right");
    let Line { number, said } = lines.get(pair).ok_or_else(missing)?;
    said.as_ref().map_err(|why| format!("{name}: line {number}: {why}"))
}

fn not_empty(folder: &Path, found: Folder) -> Result<Folder, FolderError> {
    match found.pairs.is_empty() {
        true => Err(FolderError::Empty { folder: folder.to_owned(), what: "no image of either camera", right: RIGHT }),
        false => Ok(found),
    }
}

/// The images of two folders that have one name, and those without a partner.
fn pairs(sides: &[PathBuf; 2]) -> Result<Vec<(String, Images)>, FolderError> {
    let names = [entries(&sides[0], RIGHT)?, entries(&sides[1], RIGHT)?];
    let mut stems: Vec<&str> = names[0].union(&names[1]).filter_map(|name| name.strip_suffix(PNG)).collect();
    // Numbers of different length, too, in their order.
    stems.sort_by_key(|stem| (stem.parse::<u64>().unwrap_or(u64::MAX), *stem));
    let pair = |stem: &str| {
        let name = format!("{stem}{PNG}");
        let missing = names.iter().zip(sides).find(|(names, _)| !names.contains(&name));
        let images = match missing {
            None => Ok(sides.each_ref().map(|side| side.join(&name))),
            Some((_, side)) => {
                Err(format!("there is no {}: both images of a pair have one name", side.join(&name).display()))
            }
        };
        (stem.to_owned(), images)
    };
    Ok(stems.into_iter().map(pair).collect())
}

/// Columns and rows of the first image that can be read.
fn size(folder: &Path, pairs: &[(String, Images)]) -> Result<[usize; 2], FolderError> {
    let mut first = None;
    for (_, images) in pairs {
        match images.as_ref().map_err(Clone::clone).and_then(|[left, _]| images::read(left)) {
            Ok(image) => return Ok([image.width(), image.height()]),
            Err(why) => first = first.or(Some(why)),
        }
    }
    let first = first.unwrap_or_else(|| RIGHT.to_owned());
    Err(FolderError::Unusable { folder: folder.to_owned(), images: "pairs", frames: pairs.len(), first })
}

fn time(line: &str) -> Result<f64, String> {
    let secs = line.parse::<f64>().ok().filter(|secs| secs.is_finite());
    secs.ok_or_else(|| format!("{line:?} is no time: a finite number of seconds would be right"))
}

/// The cameras of two 3 × 4 projections, `P0:` and `P1:`, of rectified images (Geiger et al., IJRR 2013): K, and the fourth column
/// K times where the camera that all are measured from is in its frame.
fn projected(text: &str, size: [usize; 2]) -> Result<StereoCalibration, String> {
    let projection = |name: &'static str| -> Result<[f64; 12], String> {
        let right = "12 finite numbers, a projection of 3 rows of 4, would be right";
        let mut found = text.lines().enumerate().filter_map(|(i, line)| Some((i + 1, line.trim().strip_prefix(name)?)));
        let (line, said) = found.next().ok_or_else(|| format!("there is no {name} {right}"))?;
        if let Some((again, _)) = found.next() {
            return Err(format!(
                "line {again}: {name} stands there again, after line {line}: one of them would be right"
            ));
        }
        let numbers: Option<Vec<f64>> =
            said.split_ascii_whitespace().map(|number| number.parse().ok().filter(|x: &f64| x.is_finite())).collect();
        let numbers = numbers.and_then(|numbers| <[f64; 12]>::try_from(numbers).ok());
        let numbers = numbers.ok_or_else(|| format!("line {line}: {name} {right}"))?;
        match numbers[0] > 0.0 && numbers[5] > 0.0 {
            true => Ok(numbers),
            false => Err(format!(
                "line {line}: {name} focal lengths of {} and {} px, with which it is singular: positive ones would be right",
                numbers[0], numbers[5]
            )),
        }
    };
    let [left, right] = [projection("P0:")?, projection("P1:")?];
    let camera =
        |p: &[f64; 12]| Camera { size, focal: [p[0], p[5]], center: [p[2], p[6]], distortion: Distortion::default() };
    let place = |p: &[f64; 12]| Translation3::new(p[3] / p[0], p[7] / p[5], p[11]);
    let right_from_left = place(&right) * place(&left).inverse();
    Ok(StereoCalibration {
        left: camera(&left),
        right: camera(&right),
        right_from_left: Isometry3::from_parts(right_from_left, nalgebra::UnitQuaternion::identity()),
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    const SIZE: [usize; 2] = [1241, 376];
    const P0: &str =
        "P0: 7.188560000000e+02 0 6.071928000000e+02 0 0 7.188560000000e+02 1.852157000000e+02 0 0 0 1 0\n";
    const P1: &str = "P1: 7.188560000000e+02 0 6.071928000000e+02 -3.861448000000e+02 0 7.188560000000e+02 1.852157000000e+02 0 0 0 1 0\n";

    #[test]
    fn projections_say_cameras_and_how_far_they_are_apart() {
        let cameras = projected(&format!("{P0}{P1}P2: 1 2 3\n"), SIZE).unwrap();
        assert!((cameras.right_center().x - 0.537_165_718_864_417_8).abs() < 1e-12, "{}", cameras.right_center());
        assert_eq!((cameras.left.focal, cameras.right.center), ([718.856; 2], [607.1928, 185.2157]));
        let said = |text: &str| projected(text, SIZE).unwrap_err();
        assert!(said(P0).starts_with("there is no P1: 12 finite numbers"));
        assert!(said(&format!("\n{P0}P1: 1 2 nan\n")).starts_with("line 3: P1: 12 finite numbers, a projection"));
        assert!(
            said(&format!("{P0}{P1}{P0}")).starts_with("line 3: P0: stands there again, after line 1: one of them")
        );
        assert!(said(&P0.replacen("7.18", "-7.18", 1)).contains("with which it is singular"));
    }

    #[test]
    fn pairs_have_one_name_and_come_in_the_order_of_their_numbers() {
        let folder = tempfile::tempdir().unwrap();
        let sides = ["left", "right"].map(|side| folder.path().join(side));
        for (side, names) in sides.iter().zip([["9.png", "10.png", "11.png"], ["10.png", "9.png", "12.png"]]) {
            std::fs::create_dir(side).unwrap();
            names.iter().for_each(|name| std::fs::write(side.join(name), "").unwrap());
        }
        std::fs::write(sides[0].join("notes.txt"), "").unwrap();
        let found = pairs(&sides).unwrap();
        let names: Vec<(&str, bool)> = found.iter().map(|(stem, images)| (&stem[..], images.is_ok())).collect();
        assert_eq!(names, [("9", true), ("10", true), ("11", false), ("12", false)]);
        assert!(found[2].1.as_ref().unwrap_err().contains("right/11.png: both images of a pair have one name"));
        assert!(found[3].1.as_ref().unwrap_err().contains("left/12.png"));
    }
}
