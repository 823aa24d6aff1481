//! The files in which a run is kept, and what its apps are told of them.

use std::path::{Path, PathBuf};

use elk_mission::{AppSpec, Mission, Mode, element};
use elk_outside::file;

use crate::error::LaunchError;
use crate::run::folder::{copy_name, effective_name};
use crate::run::provenance;
use crate::run::summary;

/// The parameter of loggers and maps that names what they write.
const FILE: &str = "File";

/// The files of a run.
#[derive(Debug, Clone)]
pub(crate) struct RunFiles {
    /// The run's folder.
    pub folder: PathBuf,
    /// The mission file as it was.
    mission_copy: PathBuf,
    /// The mission as it ran.
    effective: PathBuf,
    seed: String,
    /// The world, as the sensor's setting names it.
    world: String,
    manual: bool,
}

impl RunFiles {
    /// That of a mission in `folder`.
    pub fn new(mission: &Mission, folder: &Path, manual: bool) -> Self {
        let seed = summary::seed(mission).unwrap_or_default().to_string();
        let world = mission.of_element(element::SENSOR).find_map(|sensor| sensor.setting("World")).unwrap_or_default();
        let effective = folder.join(effective_name(&mission.file));
        let (folder, mission_copy) = (folder.to_owned(), folder.join(copy_name(&mission.file)));
        Self { folder, mission_copy, effective, seed, world: world.to_owned(), manual }
    }

    /// Keeps the mission file, as it was read, and what else the run is made of.
    pub fn keep(&self, mission: &Mission, revision: &str) -> Result<(), LaunchError> {
        let failed = |source| LaunchError::File { file: self.mission_copy.clone(), source };
        std::fs::write(&self.mission_copy, &mission.bytes).map_err(failed)?;
        let mode = if self.manual { Mode::Manual } else { Mode::Auto };
        provenance::keep(&Mission { mode, ..mission.clone() }, &self.folder, revision)
    }

    /// Tells an app where the run is kept.
    pub fn settle(&self, app: &mut AppSpec) -> Result<(), LaunchError> {
        let in_folder = |name: &str| self.folder.join(name).to_string_lossy().into_owned();
        match app.element.as_str() {
            element::MAP => suppose(app, FILE, &in_folder("map.bt")),
            // Said by the mission or by its controller's own parameter, it means the same to both, and to the launcher.
            element::CONTROLLER => settle(app, "Manual", if self.manual { "true" } else { "false" }),
            element::LOGGER => {
                suppose(app, FILE, &in_folder("log.mcap"))?;
                suppose(app, "MissionFile", &self.mission_copy.to_string_lossy())?;
                suppose(app, "EffectiveMission", &self.effective.to_string_lossy())?;
                suppose(app, "Run", &in_folder(provenance::RUN))?;
                suppose(app, "Seed", &self.seed)?;
                suppose(app, "World", &self.world)
            }
            _ => Ok(()),
        }
    }
}

/// Sets a parameter that the mission left at its default.
fn suppose(app: &mut AppSpec, param: &str, text: &str) -> Result<(), LaunchError> {
    if app.said.contains(param) { Ok(()) } else { settle(app, param, text) }
}

/// Sets a parameter, if the app's type has it and it is another one.
fn settle(app: &mut AppSpec, param: &str, text: &str) -> Result<(), LaunchError> {
    let known = app.is_builtin() && app.takes(param);
    if known && app.setting(param) != Some(text) { Ok(app.set(param, text)?) } else { Ok(()) }
}

/// The files that the mission has logs and maps written to, and that are not in the run's `folder`; and the parameters that
/// say so.
pub(crate) fn elsewhere(mission: &Mission, folder: &Path) -> impl Iterator<Item = (String, PathBuf)> {
    let writers = mission.apps.iter().filter(|app| [element::LOGGER, element::MAP].contains(&app.element.as_str()));
    writers.filter_map(move |app| Some((format!("{}.{FILE}", app.name), file_elsewhere(app, folder)?)))
}

/// The log of a run of whose logs none is in its `folder`; nothing: one is, or there is none.
pub(crate) fn log_elsewhere(mission: &Mission, folder: &Path) -> Option<PathBuf> {
    let logs: Option<Vec<PathBuf>> =
        mission.of_element(element::LOGGER).map(|logger| file_elsewhere(logger, folder)).collect();
    logs?.into_iter().next()
}

/// The file that an app writes, if that is said and not in the run's `folder`.
fn file_elsewhere(app: &AppSpec, folder: &Path) -> Option<PathBuf> {
    let said = app.is_builtin() && app.said.contains(FILE);
    let file = app.setting(FILE).filter(|file| said && !file.is_empty())?;
    std::path::absolute(file).ok().filter(|file| !file.starts_with(folder))
}

/// Sees that an app can write what it is to write when the mission is over; hours may lie before that.
pub(crate) fn check_files(app: &AppSpec) -> Result<(), LaunchError> {
    match app.setting(FILE) {
        Some(file) if app.element == element::MAP && app.is_builtin() && !file.is_empty() => {
            let unwritable = |source| {
                let (app, file) = (app.name.clone(), file.into());
                LaunchError::Unwritable { app, param: FILE, file, source }
            };
            file::try_write(Path::new(file)).map_err(unwritable)
        }
        _ => Ok(()),
    }
}
