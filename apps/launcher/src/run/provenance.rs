//! What a run was made of, so that it can be had again: `run.json` and the effective mission in the run's folder.

use std::path::{Component, Path, PathBuf};

use elk_mission::{AppSpec, Kind, Mission, MissionError, Override, Program, Registry, Via, element};
use elk_outside::checksum::fnv1a_of_file;
use elk_outside::file;
use serde::{Deserialize, Serialize};

use crate::error::LaunchError;
use crate::run::folder::{copy_name, effective_name};
use crate::run::summary;

/// The file in the run's folder.
pub(crate) const RUN: &str = "run.json";
/// The longest that is read (bytes): it names a file of each app at least.
const LONGEST: u64 = 16 * Mission::LONGEST;

/// What a run was made of.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub(crate) struct Provenance {
    /// Version of elk.
    version: String,
    /// The git revision that elk was built from.
    revision: String,
    /// The run's seed.
    seed: Option<i64>,
    /// The mission file as it was found: its copy in the run's folder.
    mission: String,
    /// The mission as it ran, defaults and command line included.
    effective_mission: String,
    /// What it was made of besides.
    files: Vec<Ingredient>,
}

/// A file that an app of a run read, or that was its program.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
struct Ingredient {
    app: String,
    /// The parameter that names it; `exec`: the app's program.
    param: String,
    file: PathBuf,
    /// FNV-1a (64 bits, hexadecimal); empty: it cannot be read.
    checksum: String,
}

/// Why a run cannot be had again.
#[derive(Debug, thiserror::Error)]
pub enum RerunError {
    /// The folder is none of a run.
    #[error("{} is no run's folder: {source}; right is a mission file, or a folder with a {RUN}", .file.display())]
    NoRun {
        /// Its `run.json`.
        file: PathBuf,
        /// Why not.
        source: std::io::Error,
    },
    /// A world is not what it was.
    #[error(
        "{app}.{param}: {} is not what it was when this run was made (checksum {found}, then {was}): put it back, or say \
         --set {app}.{param}=FILE for another run",
        .file.display()
    )]
    Changed {
        /// The app that reads it.
        app: String,
        /// The parameter that names it.
        param: String,
        /// The file.
        file: PathBuf,
        /// Its checksum now.
        found: String,
        /// Its checksum then.
        was: String,
    },
    /// The effective mission is wrong for this elk.
    #[error(transparent)]
    Mission(#[from] MissionError),
}

impl Provenance {
    /// That of a mission as it is about to run.
    fn of(mission: &Mission, revision: &str) -> Self {
        Self {
            version: env!("CARGO_PKG_VERSION").to_owned(),
            revision: revision.to_owned(),
            seed: summary::seed(mission),
            mission: copy_name(&mission.file),
            effective_mission: effective_name(&mission.file),
            files: mission.apps.iter().flat_map(ingredients).collect(),
        }
    }

    fn read(folder: &Path) -> Result<Self, RerunError> {
        let file = folder.join(RUN);
        let no_run = |source| RerunError::NoRun { file: file.clone(), source };
        let text = file::read_text(&file, LONGEST).map_err(no_run)?;
        let read: Self = serde_json::from_str(&text).map_err(|error| no_run(error.into()))?;
        let names = [&read.mission, &read.effective_mission];
        match names.iter().find(|name| !is_file_name(name)) {
            None => Ok(read),
            Some(odd) => Err(no_run(std::io::Error::other(format!("{odd:?} is no name of a file in it")))),
        }
    }

    /// What is to be said if elk itself is another one, and perhaps another run follows.
    fn other_elk(&self, built: &str) -> Option<String> {
        let (version, revision) = (&self.version, &self.revision);
        if (version.as_str(), revision.as_str()) != (env!("CARGO_PKG_VERSION"), built) {
            Some(format!("this run was made by elk {version} ({revision}), this is another: it may go another way"))
        } else if revision == "unknown" || revision.ends_with("-changed") {
            let said = "this run was made by an elk of sources that no revision has: if this is another, it may go another way";
            Some(said.to_owned())
        } else {
            None
        }
    }

    /// Sees that what apps read is what it was, but for what is said anew: another world makes another run.
    fn check_files(&self, anew: &[Override]) -> Result<(), RerunError> {
        let said =
            |one: &Ingredient| anew.iter().any(|set| set.app == one.app && set.param.eq_ignore_ascii_case(&one.param));
        for one in self.files.iter().filter(|one| one.param != EXEC && !said(one)) {
            let (found, was) = (checksum(&one.file), one.checksum.clone());
            if found != was {
                let (app, param, file) = (one.app.clone(), one.param.clone(), one.file.clone());
                return Err(RerunError::Changed { app, param, file, found, was });
            }
        }
        Ok(())
    }

    /// What is to be said of the programs that `mission`, this run's, would start now, but for those that are said anew: one
    /// that is not what it was perhaps makes another run.
    fn other_programs(&self, mission: &Mission, anew: &[Override]) -> Vec<String> {
        let said = |app: &str| anew.iter().any(|set| set.app == app && ["type", EXEC].contains(&set.param.as_str()));
        let before = self.files.iter().filter(|one| one.param == EXEC && !said(&one.app));
        let words = before.filter_map(|was| {
            let found = mission.apps.iter().find(|app| app.name == was.app).and_then(program)?;
            let (app, file, then) = (&was.app, found.file.display(), was.file.display());
            match (found.checksum == was.checksum, was.checksum.is_empty()) {
                (true, false) => None,
                (_, true) => Some(format!("{app}: nobody can tell whether {file} is the program that it was")),
                _ if found.file == was.file => {
                    Some(format!("{app}: {file} is not the program that it was: it may go another way"))
                }
                _ => Some(format!("{app}: {file} is not the program that {then} was: it may go another way")),
            }
        });
        words.collect()
    }
}

const EXEC: &str = "exec";

/// One step of a path, and no other.
fn is_file_name(name: &str) -> bool {
    let mut steps = Path::new(name).components();
    matches!((steps.next(), steps.next()), (Some(Component::Normal(_)), None))
}

impl Ingredient {
    fn of(app: &AppSpec, param: &str, file: &Path) -> Self {
        let (app, param, file, checksum) = (app.name.clone(), param.to_owned(), file.to_owned(), checksum(file));
        Self { app, param, file, checksum }
    }
}

/// An app's program, where it is found now, if it is not elk.
fn program(app: &AppSpec) -> Option<Ingredient> {
    let Program::Foreign { exec, .. } = &app.program else { return None };
    // One that is not there is told by whoever would start it.
    let found = app.program.executable().ok().flatten().unwrap_or_else(|| exec.clone());
    Some(Ingredient::of(app, EXEC, &std::path::absolute(&found).unwrap_or(found)))
}

/// Files that an app reads before anything else, and its program.
fn ingredients(app: &AppSpec) -> Vec<Ingredient> {
    let files = match &app.program {
        Program::Builtin(app_type, _) => app_type.params,
        Program::Foreign { .. } => &[],
    };
    let files = files.iter().filter_map(|param| match param.kind {
        Kind::File { builtin, .. } => Some((param.name, app.setting(param.name)?, builtin)),
        _ => None,
    });
    let named = files.filter(|(_, file, builtin)| !file.is_empty() && !builtin.contains(file));
    let named = named.map(|(param, file, _)| Ingredient::of(app, param, Path::new(file)));
    let told = match &app.program {
        Program::Foreign { via: Via::Moos(Some(file)), .. } => Some(Ingredient::of(app, "moos", file)),
        _ => None,
    };
    named.chain(told).chain(program(app)).collect()
}

fn checksum(file: &Path) -> String {
    fnv1a_of_file(file).map(|sum| format!("{sum:016x}")).unwrap_or_default()
}

/// Puts down in a run's folder what the run is made of.
pub(crate) fn keep(mission: &Mission, folder: &Path, revision: &str) -> Result<(), LaunchError> {
    let provenance = Provenance::of(mission, revision);
    let unwritten = |error: serde_json::Error| LaunchError::File { file: folder.join(RUN), source: error.into() };
    let json = serde_json::to_string_pretty(&provenance).map_err(unwritten)? + "\n";
    let effective = mission.to_xml(&|app, param| is_of_run(app, param));
    for (name, text) in [(provenance.effective_mission.as_str(), effective), (RUN, json)] {
        let file = folder.join(name);
        file::write(&file, text.as_bytes()).map_err(|source| LaunchError::File { file, source })?;
    }
    Ok(())
}

/// Whether a parameter tells an app what is this one run's: where it is kept, and whether a person steps.
fn is_of_run(app: &AppSpec, param: &str) -> bool {
    match (app.element.as_str(), param) {
        (element::CONTROLLER, "Manual") => true,
        (element::MAP, "File") | (element::LOGGER, _) => app.is_builtin() && !app.said.contains(param),
        _ => false,
    }
}

/// What is to be said of apps that were swapped in the midst of a run: the mission knows those that it began with.
fn swaps_not_repeated(folder: &Path) -> Option<String> {
    let swapped = summary::swapped(folder);
    let was = if swapped.len() == 1 { "was" } else { "were" };
    (!swapped.is_empty()).then(|| {
        format!("{} {was} swapped in this run; that is not repeated: it goes on as it began", swapped.join(", "))
    })
}

/// Whether a folder is a run's.
pub fn is_run(folder: &Path) -> bool {
    folder.join(RUN).is_file()
}

/// The mission of a run, from the run's folder, changed by `overrides`; and what is to be said of it: that `revision`, which
/// this program was built from, or an app's program is not the run's.
///
/// # Errors
/// It is no run's folder, its files are not what they were, or its mission is wrong.
pub fn mission_of_run(
    folder: &Path,
    registry: &Registry,
    overrides: &[Override],
    revision: &str,
) -> Result<(Mission, Vec<String>), RerunError> {
    let provenance = Provenance::read(folder)?;
    provenance.check_files(overrides)?;
    let mut mission = Mission::load_effective(&folder.join(&provenance.effective_mission), registry, overrides)?;
    let programs = provenance.other_programs(&mission, overrides);
    let notes = provenance.other_elk(revision).into_iter().chain(programs).chain(swaps_not_repeated(folder)).collect();
    // The next run is called after the file of the first, and keeps that.
    mission.file = folder.join(&provenance.mission);
    let no_run = |source| RerunError::NoRun { file: mission.file.clone(), source };
    mission.bytes = file::read(&mission.file, Mission::LONGEST_EFFECTIVE).map_err(no_run)?;
    Ok((mission, notes))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_of_files_lead_nowhere_else() {
        assert!(is_file_name("apartment.xml"));
        for odd in ["", ".", "..", "a/b", "/etc/passwd", "../x"] {
            assert!(!is_file_name(odd), "{odd}");
        }
        let folder = tempfile::tempdir().unwrap();
        let error = mission_of_run(folder.path(), &Registry::default(), &[], "").unwrap_err().to_string();
        assert!(error.contains("run.json is no run's folder: No such file"), "{error}");
        let odd = r#"{"version":"1","revision":"","seed":1,"mission":"../x","effective_mission":"y","files":[]}"#;
        std::fs::write(folder.path().join(RUN), odd).unwrap();
        let error = mission_of_run(folder.path(), &Registry::default(), &[], "").unwrap_err().to_string();
        assert!(error.contains("\"../x\" is no name of a file in it"), "{error}");
    }

    /// A run of five programs of these names, kept in a folder.
    fn kept_run(folder: &Path, explorer: &str, more: &str) -> Mission {
        let text = format!(
            "<Scenario><Sensor exec=\"/bin/sh\"/><Map exec=\"sh\"/><Explorer exec=\"{explorer}\">{more}</Explorer>\
             <Controller exec=\"/bin/sh\"/></Scenario>"
        );
        let file = folder.join("m.xml");
        std::fs::write(&file, text).unwrap();
        let mission = Mission::load(&file, &Registry::default(), &[]).unwrap();
        keep(&mission, folder, "abc").unwrap();
        mission
    }

    fn script(file: &Path, text: &str) {
        use std::os::unix::fs::PermissionsExt;
        std::fs::write(file, format!("#!/bin/sh\n{text}\n")).unwrap();
        std::fs::set_permissions(file, std::fs::Permissions::from_mode(0o755)).unwrap();
    }

    #[test]
    fn a_program_is_known_by_what_is_in_it_wherever_it_was_found() {
        let folder = tempfile::tempdir().unwrap();
        let mine = folder.path().join("mine");
        script(&mine, "exit 1");
        kept_run(folder.path(), "./mine", "");
        let provenance = Provenance::read(folder.path()).unwrap();
        let recorded = |app: &str| provenance.files.iter().find(|one| one.app == app && one.param == EXEC).unwrap();
        let shell = recorded("Map");
        assert!(shell.file.is_absolute() && shell.checksum.len() == 16, "found in PATH: {shell:?}");
        assert_eq!(recorded("Explorer").file, mine);

        let again = |sets: &[Override]| mission_of_run(folder.path(), &Registry::default(), sets, "abc").unwrap().1;
        assert_eq!(again(&[]), [""; 0]);
        script(&mine, "exit 2");
        let words = again(&[]);
        assert_eq!(words.len(), 1, "{words:?}");
        assert!(
            words[0].starts_with("Explorer: ")
                && words[0].ends_with("is not the program that it was: it may go another way")
        );
        let anew = Override { app: "Explorer".into(), param: "exec".into(), text: "/bin/sh".into() };
        assert_eq!(again(&[anew]), [""; 0], "it is said anew");

        // Another one is found in PATH than then, as after an update.
        let mut moved = provenance.clone();
        let map = moved.files.iter_mut().find(|one| one.app == "Map").unwrap();
        (map.file, map.checksum) = ("/old/bin/sh".into(), "0".repeat(16));
        let (mission, _) = mission_of_run(folder.path(), &Registry::default(), &[], "abc").unwrap();
        let words = moved.other_programs(&mission, &[]);
        assert!(
            words[0].starts_with("Map: ") && words[0].contains("is not the program that /old/bin/sh was"),
            "{words:?}"
        );
        // Of a run of an older elk nobody knows.
        moved.files.iter_mut().filter(|one| one.app == "Map").for_each(|one| one.checksum.clear());
        assert!(moved.other_programs(&mission, &[])[0].contains("nobody can tell whether"));
    }

    #[test]
    fn swaps_that_are_not_repeated_are_said() {
        let folder = tempfile::tempdir().unwrap();
        let said = |summary: &str| {
            std::fs::write(folder.path().join("summary.json"), summary).unwrap();
            swaps_not_repeated(folder.path())
        };
        assert_eq!(swaps_not_repeated(folder.path()), None, "it was never summed up");
        assert!(said(r#"{"swapped":["Map","Explorer"],"scans":7}"#).unwrap().starts_with("Map, Explorer were swapped"));
        for nothing in [r#"{"swapped":[]}"#, r#"{"scans":7}"#, "no JSON"] {
            assert_eq!(said(nothing), None);
        }
    }

    #[test]
    fn a_mission_that_became_longer_as_it_ran_is_had_again() {
        let folder = tempfile::tempdir().unwrap();
        let text = "\"".repeat(400_000);
        kept_run(folder.path(), "sh", &format!("<Words>{text}</Words>"));
        assert!(folder.path().join("m.effective.xml").metadata().unwrap().len() > Mission::LONGEST);
        let (mission, notes) = mission_of_run(folder.path(), &Registry::default(), &[], "def").unwrap();
        assert!(notes[0].contains("(abc), this is another: it may go another way"), "{notes:?}");
        let explorer = mission.of_element(element::EXPLORER).next().unwrap();
        assert_eq!(explorer.setting("Words").map(str::len), Some(text.len()));
    }
}
