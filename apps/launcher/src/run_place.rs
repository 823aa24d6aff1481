//! Where a run is kept, and what its apps are told of that.

use std::path::{Path, PathBuf};

use elk_mission::{AppSpec, Mission, Program};

use crate::error::LaunchError;
use crate::run_folder::copy_name;
use crate::summary;

/// Where a run is kept.
#[derive(Debug, Clone)]
pub(crate) struct RunPlace {
    /// The run's folder.
    pub folder: PathBuf,
    /// The mission file as it was.
    mission_copy: PathBuf,
    seed: String,
    /// The world, as the sensor's setting names it.
    world: String,
    manual: bool,
}

impl RunPlace {
    /// That of a mission in `folder`.
    pub fn new(mission: &Mission, folder: &Path, manual: bool) -> Self {
        let seed = summary::seed(mission).unwrap_or_default().to_string();
        let world = mission.of_element("Sensor").find_map(|sensor| sensor.setting("World")).unwrap_or_default();
        let (folder, mission_copy) = (folder.to_owned(), folder.join(copy_name(&mission.file)));
        Self { folder, mission_copy, seed, world: world.to_owned(), manual }
    }

    /// Keeps the mission file.
    pub fn keep(&self, mission: &Mission) -> Result<(), LaunchError> {
        let failed = |source| LaunchError::File { file: self.mission_copy.clone(), source };
        std::fs::copy(&mission.file, &self.mission_copy).map(|_| ()).map_err(failed)
    }

    /// Tells an app where the run is kept.
    pub fn settle(&self, app: &mut AppSpec) -> Result<(), LaunchError> {
        let in_folder = |name: &str| self.folder.join(name).to_string_lossy().into_owned();
        match app.element.as_str() {
            "Map" => suppose(app, "File", &in_folder("map.bt")),
            "Controller" if self.manual => suppose(app, "Manual", "true"),
            "Logger" => {
                suppose(app, "File", &in_folder("log.mcap"))?;
                suppose(app, "MissionFile", &self.mission_copy.to_string_lossy())?;
                suppose(app, "Seed", &self.seed)?;
                suppose(app, "World", &self.world)
            }
            _ => Ok(()),
        }
    }
}

/// Sets a parameter that the mission left at its default.
fn suppose(app: &mut AppSpec, param: &str, text: &str) -> Result<(), LaunchError> {
    let Program::Builtin(app_type, _) = app.program else {
        return Ok(());
    };
    match app_type.param(param) {
        Some(_) if !app.said.contains(param) => Ok(app.set(param, text)?),
        _ => Ok(()),
    }
}
