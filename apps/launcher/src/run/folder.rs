//! The folder that a run leaves behind: `logs/<mission>-<YYYYMMDD-HHMMSS>`.

use std::fs::DirBuilder;
use std::io::ErrorKind;
use std::os::unix::fs::DirBuilderExt;
use std::path::{Path, PathBuf};

use elk_bus::clock::Date;
use elk_mission::is_moos_file;

use crate::error::LaunchError;

/// Runs that can start in the same second before one is refused.
const TRIES: u32 = 1000;
/// The longest name that is taken over from a mission (bytes).
const LONGEST: usize = 100;

/// Makes, for its owner alone, a folder in `logs` that is called after `stem`, as far as a name can be, and after `now` (s
/// since 1970, UTC); a second one of the same second is numbered.
///
/// # Errors
/// It cannot be made in `logs`.
pub fn create(logs: &Path, stem: &str, now: f64) -> Result<PathBuf, LaunchError> {
    let name = format!("{}-{}", plain(stem), stamp(now));
    let unwritable = |source| LaunchError::Folder { folder: logs.to_owned(), source };
    std::fs::create_dir_all(logs).map_err(unwritable)?;
    let logs = std::path::absolute(logs).map_err(unwritable)?;
    for n in 1..TRIES {
        let numbered = if n == 1 { name.clone() } else { format!("{name}-{n}") };
        let folder = logs.join(numbered);
        match DirBuilder::new().mode(0o700).create(&folder) {
            Ok(()) => return Ok(folder),
            Err(error) if error.kind() == ErrorKind::AlreadyExists => {}
            Err(source) => return Err(LaunchError::Folder { folder, source }),
        }
    }
    Err(unwritable(ErrorKind::AlreadyExists.into()))
}

/// What a mission's run is called after: as far as it can be, its file's name.
pub(crate) fn stem(mission: &Path) -> String {
    plain(&mission.file_stem().unwrap_or_default().to_string_lossy())
}

/// A name for a file of the run that is one step of a path, no hidden file and no option of a command, whatever the name
/// is that it is made of.
fn plain(name: &str) -> String {
    let good = |c: char| if c.is_ascii_alphanumeric() || "-_.".contains(c) { c } else { '_' };
    let name: String = name.chars().map(good).collect();
    let name: String = name.trim_start_matches(['.', '-', '_']).chars().take(LONGEST).collect();
    if name.is_empty() { "mission".to_owned() } else { name }
}

/// What the copy of a mission file is called that the run keeps: its own name, and `.xml` or `.moos` behind it, so that it is
/// no name of a file that the run writes.
pub(crate) fn copy_name(mission: &Path) -> String {
    format!("{}.{}", stem(mission), if is_moos_file(mission) { "moos" } else { "xml" })
}

/// What the mission is called as it ran, defaults and command line included.
pub(crate) fn effective_name(mission: &Path) -> String {
    format!("{}.effective.xml", stem(mission))
}

/// `20261123-224512`, UTC.
pub(crate) fn stamp(now: f64) -> String {
    let Date { year, month, day, hour, minute, second, .. } = Date::of(now);
    format!("{year:04}{month:02}{day:02}-{hour:02}{minute:02}{second:02}")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn dates_are_those_of_the_calendar() {
        assert_eq!(stamp(0.0), "19700101-000000");
        assert_eq!(stamp(951_782_399.9), "20000228-235959");
        assert_eq!(stamp(951_782_400.0), "20000229-000000");
        assert_eq!(stamp(1_582_934_400.0), "20200229-000000");
        assert_eq!(stamp(4_107_542_399.0), "21000228-235959");
        assert_eq!(stamp(4_107_542_400.0), "21000301-000000");
        assert_eq!(stamp(-1.0), "19691231-235959");
    }

    #[test]
    fn runs_of_the_same_second_are_numbered() {
        let logs = tempfile::tempdir().unwrap();
        let name = |_| {
            let folder = create(logs.path(), &stem(Path::new("m/apartment.xml")), 0.0).unwrap();
            folder.file_name().unwrap().to_string_lossy().into_owned()
        };
        let names: Vec<String> = (0..3).map(name).collect();
        let first = "apartment-19700101-000000";
        assert_eq!(names, [first, &format!("{first}-2"), &format!("{first}-3")]);
    }

    #[test]
    fn a_mission_s_name_makes_one_plain_folder_in_the_logs() {
        let logs = tempfile::tempdir().unwrap();
        let long = format!("{}.xml", "x".repeat(250));
        for name in ["..xml", ".xml", "--help.xml", "a b\n.xml", "..", "", "ä*?.xml", "log.mcap", &long] {
            let folder = create(logs.path(), &stem(Path::new(name)), 0.0).unwrap();
            let made = folder.file_name().unwrap().to_str().unwrap();
            assert_eq!(folder.parent(), Some(logs.path()));
            assert!(made.starts_with(|c: char| c.is_ascii_alphanumeric()), "{made:?}");
            assert!(made.chars().all(|c| c.is_ascii_alphanumeric() || "-_.".contains(c)), "{made:?}");
            let copy = copy_name(Path::new(name));
            assert!(copy.ends_with(".xml") && !copy.starts_with(['.', '-']) && !copy.contains('/'), "{copy:?}");
        }
        assert_eq!(copy_name(Path::new("missions/apartment.xml")), "apartment.xml");
    }

    #[test]
    fn an_unwritable_place_is_named() {
        let logs = tempfile::tempdir().unwrap();
        let file = logs.path().join("file");
        std::fs::write(&file, "").unwrap();
        let error = create(&file, "m", 0.0).unwrap_err().to_string();
        assert!(error.starts_with(&format!("cannot make the run's folder in {}", file.display())));
    }
}
