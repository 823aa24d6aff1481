//! From an argument to a mission, for every command: a file, a run's folder, or one of those that are built into the program
//! with their worlds, which run from anywhere.

use std::path::Path;

use anyhow::{Result, anyhow};
use elk_launcher::{is_run, mission_of_run};
use elk_mission::{Mission, MissionError, Override, instead};

use crate::registry::registry;
use crate::version::REVISION;

/// The folder that a built-in mission's errors name: there is none.
const FOLDER: &str = "built-in";

/// A mission that comes with the program.
pub struct BuiltIn {
    /// What `elk launch` calls it.
    pub name: &'static str,
    /// What is explored, in a few words.
    pub about: &'static str,
    /// Its file, which names its world by a file, too.
    text: &'static str,
}

/// One of `mission-files`.
macro_rules! built_in {
    ($name:literal, $about:literal) => {
        BuiltIn { name: $name, about: $about, text: include_str!(concat!("../../mission-files/", $name, ".xml")) }
    };
}

/// All of them.
pub const BUILT_IN: [BuiltIn; 7] = [
    built_in!("apartment", "an apartment, 6 x 8 x 2 m"),
    built_in!("car", "the inside of a car, 7 x 4 x 4 m"),
    built_in!("garage", "a garage, 7 x 9 x 2 m"),
    built_in!("hall", "a hall, 10 x 10 x 5 m"),
    built_in!("hall-long", "a long hall, 8 x 18 x 5 m"),
    built_in!("kitchen", "a kitchen, 8 x 8 x 3 m"),
    built_in!("thesis-listing-2", "the thesis' own mission file: Enter takes a step"),
];

impl BuiltIn {
    /// The mission file, whose world is the built-in one of the same name.
    fn text(&self) -> String {
        self.text.replace(&format!("worlds/{}.obj", self.name), self.name)
    }

    /// The one of this name, with or without `.xml`.
    fn called(name: &Path) -> Option<&'static Self> {
        let name = name.to_str()?;
        let name = name.strip_suffix(".xml").unwrap_or(name);
        BUILT_IN.iter().find(|one| one.name == name)
    }
}

/// The mission in the file `mission`, that of the run in the folder `mission`, or, if there is neither, the built-in one of
/// that name: a folder of another kind hides none. With it, what is to be said of it.
pub fn load(mission: &Path, sets: &[Override]) -> Result<(Mission, Vec<String>)> {
    match BuiltIn::called(mission).filter(|_| !mission.is_file() && !is_run(mission)) {
        Some(one) => {
            let file = Path::new(FOLDER).join(format!("{}.xml", one.name));
            Ok((Mission::parse(&one.text(), &file, &registry(), sets)?, Vec::new()))
        }
        None if mission.is_dir() => Ok(mission_of_run(mission, &registry(), sets, REVISION)?),
        None => match Mission::load(mission, &registry(), sets) {
            Ok(loaded) => Ok((loaded, Vec::new())),
            Err(error) => Err(with_others(error, mission)),
        },
    }
}

/// What could have been meant by a file that is not there.
fn with_others(error: MissionError, mission: &Path) -> anyhow::Error {
    match (&error, mission.to_str()) {
        (MissionError::Unreadable { source, .. }, Some(name)) if source.kind() == std::io::ErrorKind::NotFound => {
            let names = BUILT_IN.map(|one| one.name);
            anyhow!("{error}; of the missions that are built in: {}", instead(name.trim_end_matches(".xml"), &names))
        }
        _ => error.into(),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_built_in_mission_is_right_and_needs_no_file() {
        for one in &BUILT_IN {
            for name in [one.name.to_owned(), format!("{}.xml", one.name)] {
                let (mission, _) = load(Path::new(&name), &[]).unwrap();
                let world = mission.of_element("Sensor").find_map(|app| app.setting("World")).unwrap().to_owned();
                let expected = if one.name == "thesis-listing-2" { "car-interior" } else { one.name };
                assert_eq!(world, expected, "{name}");
                assert!(elk_world::World::load(&world, &elk_world::Placement::default()).is_ok(), "{world}");
                assert_eq!(mission.bytes, one.text().as_bytes(), "what the run keeps");
            }
        }
    }

    #[test]
    fn a_file_comes_before_a_built_in_mission_and_a_slip_is_answered() {
        let said = |name: &str| load(Path::new(name), &[]).unwrap_err().to_string();
        assert!(said("apartmnt").ends_with("built in: did you mean apartment?"), "{}", said("apartmnt"));
        assert!(said("no/such/file.xml").contains("built in: known: apartment, car, garage, "));
        let folder = tempfile::tempdir().unwrap();
        let file = folder.path().join("apartment");
        std::fs::write(&file, "<Scenario/>").unwrap();
        assert!(load(&file, &[]).is_err(), "it is read, although a built-in one has its name");
        let other = folder.path().join("of-another-kind");
        std::fs::create_dir(&other).unwrap();
        assert!(said(&other.display().to_string()).contains("run.json is no run's folder"));
    }
}
