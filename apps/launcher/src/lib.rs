//! Starts a mission's broker and apps as processes, watches over them, sums up.
//!
//! | module | one idea |
//! |---|---|
//! | `conduct` | a mission from its first app to its last word |
//! | `backend`, `environment` | what carries it out: `processes`, or `threads` of this process; how processes are started |
//! | `supervisor` | who is to run, who does, and what to do about it: a state machine without processes, bus or clock |
//! | `process`, `handle`, `descendants`, `strays`, `guard`, `orphans`, `usage` | one process that inherits nothing and ends for certain, and what stays with it alone; all that descends from a mission's; what it has started elsewhere; what ends the rest when the launcher dies, and when all die who know of it; what they use |
//! | `listener` | the launcher's place on the bus, a thread of its own |
//! | `observer`, `steps` | what the mission says of itself there; where the time of a step goes |
//! | `control` | orders to a running mission: `elk apps`, `elk swap`, … |
//! | `launch_state` | what another launcher has to know to pick the mission up |
//! | `provenance` | what a run was made of, so that it can be had again |
//! | `detach` | giving the terminal back |
//! | `progress`, `summary`, `shortfall`, `run_folder`, `run_place` | what people see meanwhile, what the run came to, why it came to nothing, where it is kept |

mod backend;
mod conduct;
mod control;
mod descendants;
mod detach;
mod environment;
mod error;
mod guard;
pub mod handle;
mod launch_state;
mod listener;
mod observer;
mod orphans;
mod person;
mod picture;
mod process;
mod processes;
mod progress;
mod provenance;
mod run_folder;
mod run_place;
mod shortfall;
mod steps;
mod strays;
mod summary;
mod supervisor;
mod threads;
mod usage;

use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::sync::atomic::AtomicBool;
use std::time::Duration;

use elk_bus::clock::Stopwatch;
use elk_bus::{Clock, Community};
use elk_mission::{Mission, Mode, Registry};
use elk_outside::text;

pub use control::{Answer, AppRow, AskError, Request, ask};
pub use detach::wait_until_begun;
pub use error::LaunchError;
pub use guard::{Deputy, guard};
pub use orphans::end_orphans;
pub use provenance::{RerunError, is_run, mission_of_run};
pub use run_folder::create as create_run_folder;
pub use steps::{Spread, StepTimes};
pub use summary::Summary;

use backend::Backend;
use conduct::Conduct;
use control::Server;
use environment::Environment;
use launch_state::LaunchState;
use listener::Listener;
use observer::Observer;
use person::Person;
use processes::Processes;
use progress::{Display, Shown, put};
use run_place::RunPlace;

/// How long a launcher in the background may take to make room, and how often it is seen whether it has.
const RELIEF_PATIENCE: Duration = Duration::from_secs(10);
const ASK_EVERY: Duration = Duration::from_millis(20);

/// The launcher's own name on the bus.
pub(crate) const NAME: &str = "launcher";

/// How a mission is to be launched.
#[derive(Debug, Clone)]
pub struct LaunchOptions {
    /// The program whose commands `db`, `sensor`, …, `picture` and `guard` are run: elk itself.
    pub program: PathBuf,
    /// The git revision that it was built from, for the record.
    pub revision: String,
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
    /// Broker and apps go on when the launcher dies, and [`attach`] picks them up.
    pub detached: bool,
    /// The launcher gives the terminal back once the mission runs: it was started by [`wait_until_begun`].
    pub background: bool,
    /// The app types that a swap can name.
    pub registry: Registry,
}

/// How a mission is to be picked up that a launcher which is gone has left behind.
#[derive(Debug, Clone)]
pub struct AttachOptions {
    /// The program whose commands are run: elk itself.
    pub program: PathBuf,
    /// The mission's community.
    pub community: Community,
    /// Plain lines in place of a line that changes.
    pub headless: bool,
    /// The app types that a mission can name.
    pub registry: Registry,
}

/// What a launch came to.
#[derive(Debug)]
pub struct Outcome {
    /// The run's folder.
    pub folder: PathBuf,
    /// What the mission had written elsewhere, logs and maps, and the parameters that say so (`Logger.File`). A log that was
    /// there already has stayed: this run's is the one of the highest number beside it.
    pub elsewhere: Vec<(String, PathBuf)>,
    /// The run, summed up.
    pub summary: Summary,
    /// Why it ended before its time, if it did.
    pub error: Option<LaunchError>,
    /// Why there is no `summary.json`, if there is none.
    pub unwritten: Option<LaunchError>,
    /// The picture, or why there is none; `None`: nothing was seen that could be drawn.
    pub picture: Option<Result<PathBuf, String>>,
}

/// Runs a mission: starts everyone, waits until exploration is over, stops everyone, sums up. The run's folder then holds
/// the mission file, the mission as it ran, the log, the map, the picture, the summary, and a text log of each app.
///
/// # Errors
/// The run could not even begin. What goes wrong later is in the [`Outcome`].
pub fn launch(mut mission: Mission, options: &LaunchOptions) -> Result<Outcome, LaunchError> {
    let warnings = mission.preflight()?;
    let server = listen(options)?;
    let stop = person::stop_signals(options.detached)?;
    let ended = end_orphans(&options.community);
    let now = Clock::new(1.0).now();
    let folder = run_folder::create(&options.log_dir, &run_folder::stem(&mission.file), now)?;
    let manual = mission.mode == Mode::Manual && !options.auto;
    let place = RunPlace::new(&mission, &folder, manual);
    place.keep(&mission, &options.revision)?;
    mission.apps.iter_mut().try_for_each(|app| place.settle(app))?;
    mission.apps.iter().try_for_each(run_place::check_files)?;
    put(&text::printable_lines(&format!("{}: run {}\n", mission.name, folder.display())));
    for warning in ended.into_iter().chain(warnings) {
        put(&text::printable_lines(&format!("  note: {warning}\n")));
    }

    let LaunchOptions { program, community, headless, registry, detached, .. } = options;
    let state = LaunchState::of(&mission, &folder, manual);
    let backend: Box<dyn Backend> = match options.in_process {
        true => Box::new(threads::Threads::new(community, &mission)),
        false => {
            let (program, community, registry) = (program.clone(), community.clone(), registry.clone());
            Box::new(Processes::new(
                &mission,
                Environment { program, community, place, registry, detached: *detached },
            )?)
        }
    };
    let (headless, background) = (*headless, options.background);
    let stage = Stage { mission: &mission, program, community, folder: &folder, headless, background, stop };
    stage.perform(backend, server, state, Observer::new(&mission), |conduct| conduct.begin())
}

/// Picks a mission up that was launched detached; from there on as [`launch`]. Its launcher is gone, or in the
/// background, and then makes room.
///
/// What the old launcher had counted of the mission comes back as far as it stands on the bus: all reports do, and the time
/// of the first pose command. The times of steps are those from now on.
///
/// # Errors
/// There is no such mission, or somebody launches it already.
pub fn attach(options: &AttachOptions) -> Result<Outcome, LaunchError> {
    let AttachOptions { program, community, headless, registry } = options;
    let server = take_over(community)?;
    let stop = person::stop_signals(true)?;
    let state = LaunchState::read(community)?;
    let mission = state.mission(community, registry)?;
    let folder = state.folder.clone();
    put(&text::printable_lines(&format!("{}: attached to run {}\n", mission.name, folder.display())));

    let place = RunPlace::new(&mission, &folder, state.manual);
    let (own_program, community, registry) = (program.clone(), community.clone(), registry.clone());
    let environment = Environment { program: own_program, community, place, registry, detached: true };
    let backend = Box::new(Processes::adopt(&mission, environment, &state)?);
    let mut observer = Observer::new(&mission);
    observer.first_command = state.first_command;
    let community = &options.community;
    let (headless, background) = (*headless, false);
    let stage = Stage { mission: &mission, program, community, folder: &folder, headless, background, stop };
    stage.perform(backend, Some(server), state, observer, |conduct| conduct.join("before the mission was over"))
}

/// Takes the launcher's place for orders. A mission inside one process has a community of its own, whatever its name: it
/// goes without if the place is taken.
fn listen(options: &LaunchOptions) -> Result<Option<Server>, LaunchError> {
    match Server::listen(&options.community) {
        Err(LaunchError::Launched { .. }) if options.in_process => Ok(None),
        server => server.map(Some),
    }
}

/// Takes the launcher's place for orders; a launcher in the background leaves it when it is asked to.
fn take_over(community: &Community) -> Result<Server, LaunchError> {
    let (asked, mut waited) = (Server::listen(community), Stopwatch::start());
    if !matches!(asked, Err(LaunchError::Launched { .. })) {
        return asked;
    }
    match ask(community, &Request::Leave, RELIEF_PATIENCE, |_| {}) {
        Ok(Answer::Done { .. }) => waited = Stopwatch::start(),
        Ok(_) => return asked,
        // It may have gone just now.
        Err(_) => {}
    }
    loop {
        match Server::listen(community) {
            Err(LaunchError::Launched { .. }) if waited.elapsed() < RELIEF_PATIENCE => std::thread::sleep(ASK_EVERY),
            taken => return taken,
        }
    }
}

/// What stays the same while a mission runs.
struct Stage<'a> {
    mission: &'a Mission,
    program: &'a Path,
    community: &'a Community,
    folder: &'a Path,
    headless: bool,
    background: bool,
    stop: Arc<AtomicBool>,
}

impl Stage<'_> {
    /// Has a backend carry out the mission, from `begin` to its end, and sums up.
    fn perform(
        &self,
        mut backend: Box<dyn Backend>,
        server: Option<Server>,
        state: LaunchState,
        observer: Observer,
        begin: fn(&mut Conduct) -> Result<(), LaunchError>,
    ) -> Result<Outcome, LaunchError> {
        let Self { mission, folder, .. } = self;
        let mut listener = Listener::start(backend.join(NAME), observer)?;
        let mut conduct = Conduct {
            backend: &mut *backend,
            listener: &mut listener,
            server,
            display: Display::new(self.headless, Shown::of(mission)),
            person: Person::default(),
            stop: &self.stop,
            community: self.community,
            folder,
            state,
            said_state: None,
            // Until everybody is there, there is nothing that another launcher could go on with.
            background: false,
            leaves: None,
            running: Stopwatch::start(),
        };
        let begun = begin(&mut conduct).and_then(|()| match self.background {
            true => detach::leave_terminal(folder),
            false => Ok(()),
        });
        conduct.background = self.background;
        let failed = begun.and_then(|()| conduct.run()).err();
        if let Some(relieved @ LaunchError::Relieved) = failed {
            conduct.hand_over();
            return Err(relieved);
        }
        let error = conduct.end(failed);
        for words in conduct.listener.observer().left_out() {
            conduct.display.say(&words);
        }
        let summary = Summary::of(mission, &conduct.listener.observer(), &*conduct.backend, error.as_ref());
        let unwritten = summary.write(folder).err();
        let picture = (summary.known_voxels > 0).then(|| match run_place::log_elsewhere(mission, folder) {
            None => picture::draw(self.program, folder),
            Some(log) => Err(format!("it is drawn of a log in the run's folder, and this one's is {}", log.display())),
        });
        let elsewhere = run_place::elsewhere(mission, folder).collect();
        Ok(Outcome { folder: (*folder).to_owned(), elsewhere, summary, error, unwritten, picture })
    }
}
