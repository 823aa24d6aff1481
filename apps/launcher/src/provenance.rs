//! What a run was made of, so that it can be had again: `run.json` and the effective mission in the run's folder.

use std::path::{Component, Path, PathBuf};

use elk_bus::key::fnv1a_of_file;
use elk_bus::tell;
use elk_mission::{AppSpec, Kind, Mission, MissionError, Override, Program, Registry, element};
use elk_outside::file;
use serde::{Deserialize, Serialize};

use crate::error::LaunchError;
use crate::run_folder::{copy_name, effective_name};
use crate::summary;

/// The file in the run's folder.
pub(crate) const RUN: &str = "run.json";
/// The longest that is read (bytes).
const LONGEST: u64 = 1 << 20;

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

    /// Sees that everything is what it was, but for what is said anew: another world makes another run, and another program
    /// perhaps one.
    fn check(&self, anew: &[Override], built: &str) -> Result<(), RerunError> {
        let (version, revision) = (&self.version, &self.revision);
        if (version.as_str(), revision.as_str()) != (env!("CARGO_PKG_VERSION"), built) {
            tell(format_args!(
                "this run was made by elk {version} ({revision}), this is another: it may go another way"
            ));
        } else if revision == "unknown" || revision.ends_with("-changed") {
            tell(
                "this run was made by an elk of sources that no revision has: if this is another, it may go another way",
            );
        }
        let said =
            |one: &Ingredient| anew.iter().any(|set| set.app == one.app && set.param.eq_ignore_ascii_case(&one.param));
        for one in self.files.iter().filter(|one| !said(one)) {
            let (found, was, file) = (checksum(&one.file), one.checksum.clone(), one.file.clone());
            if found == was {
                continue;
            }
            if one.param == EXEC {
                let app = &one.app;
                tell(format_args!("{app}: {} is not the program that it was: it may go another way", file.display()));
                continue;
            }
            let (app, param) = (one.app.clone(), one.param.clone());
            return Err(RerunError::Changed { app, param, file, found, was });
        }
        Ok(())
    }
}

const EXEC: &str = "exec";

/// One step of a path, and no other.
fn is_file_name(name: &str) -> bool {
    let mut steps = Path::new(name).components();
    matches!((steps.next(), steps.next()), (Some(Component::Normal(_)), None))
}

/// Files that an app reads before anything else, and its program if it is not elk.
fn ingredients(app: &AppSpec) -> Vec<Ingredient> {
    let of = |param: &str, file: &Path| {
        let (app, param, file, checksum) = (app.name.clone(), param.to_owned(), file.to_owned(), checksum(file));
        Ingredient { app, param, file, checksum }
    };
    match &app.program {
        Program::Foreign { exec, .. } => {
            let path = std::path::absolute(exec).ok().filter(|_| exec.as_os_str().to_string_lossy().contains('/'));
            vec![of(EXEC, path.as_deref().unwrap_or(exec))]
        }
        Program::Builtin(app_type, _) => {
            let files = app_type.params.iter().filter_map(|param| match param.kind {
                Kind::File { builtin } => Some((param.name, app.setting(param.name)?, builtin)),
                _ => None,
            });
            let named = files.filter(|(_, file, builtin)| !file.is_empty() && !builtin.contains(file));
            named.map(|(param, file, _)| of(param, Path::new(file))).collect()
        }
    }
}

fn checksum(file: &Path) -> String {
    fnv1a_of_file(file).map(|sum| format!("{sum:016x}")).unwrap_or_default()
}

/// Puts down in a run's folder what the run is made of.
pub(crate) fn keep(mission: &Mission, folder: &Path, revision: &str) -> Result<(), LaunchError> {
    let provenance = Provenance::of(mission, revision);
    let json = serde_json::to_string_pretty(&provenance).unwrap_or_default() + "\n";
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

/// The mission of a run, from the run's folder, changed by `overrides`. That `revision`, which this program was built from,
/// is not the run's is said.
///
/// # Errors
/// It is no run's folder, its files are not what they were, or its mission is wrong.
pub fn mission_of_run(
    folder: &Path,
    registry: &Registry,
    overrides: &[Override],
    revision: &str,
) -> Result<Mission, RerunError> {
    let provenance = Provenance::read(folder)?;
    provenance.check(overrides, revision)?;
    let mut mission = Mission::load(&folder.join(&provenance.effective_mission), registry, overrides)?;
    // The next run is called after the file of the first, and keeps that.
    mission.file = folder.join(&provenance.mission);
    let no_run = |source| RerunError::NoRun { file: mission.file.clone(), source };
    mission.bytes = file::read(&mission.file, LONGEST).map_err(no_run)?;
    Ok(mission)
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
}
