//! Starts a mission's broker and apps as processes, watches over them, sums up.
//!
//! | module | one idea |
//! |---|---|
//! | `conduct` | a mission from its first app to its last word |
//! | `crew` | those who carry it out: `processes`, or `threads` of this process |
//! | `process`, `guard` | one process that inherits nothing and ends for certain; what ends the rest when the launcher dies |
//! | `observer`, `steps` | what the mission says of itself on the bus; where the time of a step goes |
//! | `progress`, `summary`, `run_folder` | what people see meanwhile, what the run came to, where it is kept |

mod conduct;
mod crew;
mod error;
mod guard;
mod observer;
mod person;
mod process;
mod processes;
mod progress;
mod run_folder;
mod steps;
mod summary;
mod threads;

use std::path::{Path, PathBuf};
use std::process::Command;
use std::sync::atomic::AtomicBool;

use elk_bus::{Clock, Community};
use elk_mission::{AppSpec, Mission, Mode, Program};

pub use error::LaunchError;
pub use guard::guard;
pub use steps::{Spread, StepTimes};
pub use summary::Summary;

use conduct::Conduct;
use crew::Crew;
use observer::Observer;
use progress::{Display, put};

/// The launcher's own name on the bus.
pub(crate) const NAME: &str = "launcher";

/// How a mission is to be launched.
#[derive(Debug, Clone)]
pub struct LaunchOptions {
    /// The program whose commands `db`, `sensor`, …, `picture` and `guard` are run: elk itself.
    pub program: PathBuf,
    /// The community to start.
    pub community: Community,
    /// Where the run's folder is made.
    pub log_dir: PathBuf,
    /// Plain lines in place of a line that changes.
    pub headless: bool,
    /// Run a manual mission through.
    pub auto: bool,
    /// Everything in this process, over a bus in memory.
    pub in_process: bool,
}

/// What a launch came to.
#[derive(Debug)]
pub struct Outcome {
    /// The run's folder.
    pub folder: PathBuf,
    /// The run, summed up.
    pub summary: Summary,
    /// Why it ended before its time, if it did.
    pub error: Option<LaunchError>,
    /// The picture, or why there is none; `None`: nothing was seen that could be drawn.
    pub picture: Option<Result<PathBuf, String>>,
}

/// Runs a mission: starts everyone, waits until exploration is over, stops everyone, sums up. The run's folder then holds
/// the mission file, the log, the map, the picture, the summary, and a text log of each app.
///
/// # Errors
/// The run could not even begin. What goes wrong later is in the [`Outcome`].
pub fn launch(mut mission: Mission, options: &LaunchOptions) -> Result<Outcome, LaunchError> {
    let stop = person::stop_signals()?;
    let now = Clock::new(1.0).now();
    let folder = run_folder::create(&options.log_dir, &mission.file, now)?;
    let manual = mission.mode == Mode::Manual && !options.auto;
    prepare(&mut mission, &folder, manual)?;
    put(&format!("{}: run {}\n", mission.name, folder.display()));

    let mut observer = Observer::new(&mission);
    let error = carry_out(&mission, options, &folder, manual, &stop, &mut observer).err();
    let summary = Summary::of(&mission, &observer, error.as_ref());
    summary.write(&folder)?;
    let picture = (summary.scans > 0).then(|| draw(&options.program, &folder));
    Ok(Outcome { folder, summary, error, picture })
}

fn carry_out(
    mission: &Mission,
    options: &LaunchOptions,
    folder: &Path,
    manual: bool,
    stop: &AtomicBool,
    observer: &mut Observer,
) -> Result<(), LaunchError> {
    let mut crew = hire(mission, options, folder)?;
    let mut display = Display::new(options.headless);
    let client = crew.start_broker(NAME)?;
    let mut conduct = Conduct { crew: &mut *crew, client, observer, display: &mut display, stop, folder, manual };
    let ran = conduct.run();
    conduct.display.clear();
    let mut complaints = conduct.crew.stop_apps();
    // Nobody is on the bus any more when the broker goes.
    drop(conduct);
    complaints.extend(crew.stop_broker());
    for complaint in complaints {
        eprintln!("{complaint}");
    }
    ran
}

fn hire(mission: &Mission, options: &LaunchOptions, folder: &Path) -> Result<Box<dyn Crew>, LaunchError> {
    let LaunchOptions { program, community, .. } = options;
    match options.in_process {
        true => Ok(Box::new(threads::Threads::new(community, &mission.apps))),
        false => Ok(Box::new(processes::Processes::new(program, community, folder, &mission.apps)?)),
    }
}

/// Tells the apps where this run is kept, and keeps the mission file there.
fn prepare(mission: &mut Mission, folder: &Path, manual: bool) -> Result<(), LaunchError> {
    let file_name = mission.file.file_name().unwrap_or_default().to_owned();
    let copy = folder.join(&file_name);
    let failed = |source| LaunchError::File { file: copy.clone(), source };
    std::fs::copy(&mission.file, &copy).map_err(failed)?;
    let in_folder = |name: &str| folder.join(name).to_string_lossy().into_owned();
    let seed = summary::seed(mission).unwrap_or_default().to_string();
    let mission_copy = copy.to_string_lossy().into_owned();
    let world = mission.of_element("Sensor").find_map(|sensor| sensor.setting("World")).unwrap_or_default().to_owned();
    for app in &mut mission.apps {
        match app.element.as_str() {
            "Map" => suppose(app, "File", &in_folder("map.bt"))?,
            "Controller" if manual => suppose(app, "Manual", "true")?,
            "Logger" => {
                suppose(app, "File", &in_folder("log.mcap"))?;
                suppose(app, "MissionFile", &mission_copy)?;
                suppose(app, "Seed", &seed)?;
                suppose(app, "World", &world)?;
            }
            _ => {}
        }
    }
    Ok(())
}

/// Sets a parameter that the mission left at its default.
fn suppose(app: &mut AppSpec, param: &str, text: &str) -> Result<(), LaunchError> {
    let Program::Builtin(app_type, _) = app.program else {
        return Ok(());
    };
    match app_type.param(param) {
        Some(spec) if app.setting(param) == spec.default => Ok(app.set(param, text)?),
        _ => Ok(()),
    }
}

/// Draws the run as a process of its own: a picture that cannot be drawn costs no run.
fn draw(program: &Path, folder: &Path) -> Result<PathBuf, String> {
    let drawn = Command::new(program).arg("picture").arg(folder).output();
    match drawn {
        Ok(output) if output.status.success() => Ok(folder.join("picture.png")),
        Ok(output) => Err(String::from_utf8_lossy(&output.stderr).trim().to_owned()),
        Err(error) => Err(format!("{}: {error}", program.display())),
    }
}
