//! A launch from the checked mission to the finished run: everything is set up here, and a [`MissionRun`] carries it
//! out.

use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::sync::atomic::AtomicBool;
use std::time::Duration;

use elk_bus::clock::Stopwatch;
use elk_bus::{Clock, Community};
use elk_mission::{Mission, Mode, Registry};
use elk_outside::text;

use crate::backend::Backend;
use crate::backend::environment::Environment;
use crate::backend::processes::Processes;
use crate::backend::threads::Threads;
use crate::control::{Answer, Order, Server, ask};
use crate::error::LaunchError;
use crate::mission_run::MissionRun;
use crate::process::leftovers::end_leftovers;
use crate::reports::NAME;
use crate::reports::listener::Listener;
use crate::reports::observer::Observer;
use crate::run::files::{self, RunFiles};
use crate::run::launch_state::LaunchState;
use crate::run::summary::{Ran, Summary};
use crate::run::{folder, picture};
use crate::terminal::detach;
use crate::terminal::keyboard::{self, Keyboard};
use crate::terminal::progress::{Display, Shown, put};

/// How long a launcher in the background may take to make room, and how often it is seen whether it has.
const RELIEF_PATIENCE: Duration = Duration::from_secs(10);
/// How long a launcher may take to say which mission runs.
const ANSWER_PATIENCE: Duration = Duration::from_secs(10);
const ASK_EVERY: Duration = Duration::from_millis(20);

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
    /// The launcher gives the terminal back once the mission runs: it was started by `wait_until_begun`.
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

/// A run that is over, whether or not it came to its end.
#[derive(Debug)]
pub struct FinishedRun {
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
/// The run could not even begin. What goes wrong later is in the [`FinishedRun`].
pub fn launch(mut mission: Mission, options: &LaunchOptions) -> Result<FinishedRun, LaunchError> {
    let warnings = mission.preflight()?;
    let server = listen(options)?;
    let stop = keyboard::stop_signals(options.detached)?;
    let ended = end_leftovers(&options.community);
    let now = Clock::new(1.0).now();
    let folder =
        folder::create(&options.log_dir, &mission.file.file_stem().unwrap_or_default().to_string_lossy(), now)?;
    let manual = mission.mode == Mode::Manual && !options.auto;
    let files = RunFiles::new(&mission, &folder, manual);
    files.keep(&mission, &options.revision)?;
    mission.apps.iter_mut().try_for_each(|app| files.settle(app))?;
    mission.apps.iter().try_for_each(files::check_files)?;
    put(&text::printable_lines(&format!("{}: run {}\n", mission.name, folder.display())));
    for warning in ended.into_iter().chain(warnings) {
        put(&text::printable_lines(&format!("  note: {warning}\n")));
    }

    let LaunchOptions { program, community, headless, registry, detached, .. } = options;
    if options.in_process && mission.moos.is_some() {
        return Err(LaunchError::NoSockets);
    }
    settle_port(&mut mission)?;
    let state = LaunchState::of(&mission, &folder, manual);
    let backend: Box<dyn Backend> = match options.in_process {
        true => Box::new(Threads::new(community, &mission)),
        false => {
            let (program, community, registry) = (program.clone(), community.clone(), registry.clone());
            Box::new(Processes::new(
                &mission,
                Environment { program, community, files, registry, detached: *detached },
            )?)
        }
    };
    let (headless, background) = (*headless, options.background);
    let launch = Launch { mission: &mission, program, community, folder: &folder, headless, background, stop };
    launch.carry_out(backend, server, state, Observer::new(&mission), |run| run.begin())
}

/// Chooses the port at which clients of MOOS' connect, if the mission does not.
fn settle_port(mission: &mut Mission) -> Result<(), LaunchError> {
    let Some(moos) = &mut mission.moos else { return Ok(()) };
    let no_port = |source| LaunchError::NoPort { address: moos.address.host().to_owned(), source };
    let settled = moos.address.settled().map_err(no_port)?;
    if settled != moos.address {
        put(&format!("  note: clients of MOOS' connect at {settled}\n"));
        moos.address = settled;
    }
    Ok(())
}

/// Picks a mission up that was launched detached; from there on as [`launch`]. Its launcher is gone, or in the
/// background, and then makes room.
///
/// What the old launcher had counted of the mission comes back as far as it stands on the bus: all reports do, and the time
/// of the first pose command. The times of steps are those from now on.
///
/// # Errors
/// There is no such mission, or somebody launches it already.
pub fn attach(options: &AttachOptions) -> Result<FinishedRun, LaunchError> {
    let AttachOptions { program, community, headless, registry } = options;
    let server = take_over(community)?;
    let stop = keyboard::stop_signals(true)?;
    let state = LaunchState::read(community)?;
    let mission = state.mission(community, registry)?;
    let folder = state.folder.clone();
    put(&text::printable_lines(&format!("{}: attached to run {}\n", mission.name, folder.display())));

    let files = RunFiles::new(&mission, &folder, state.manual);
    let (own_program, community, registry) = (program.clone(), community.clone(), registry.clone());
    let environment = Environment { program: own_program, community, files, registry, detached: true };
    let backend = Box::new(Processes::adopt(&mission, environment, &state)?);
    let mut observer = Observer::new(&mission);
    observer.first_command = state.first_command;
    let community = &options.community;
    let (headless, background) = (*headless, false);
    let launch = Launch { mission: &mission, program, community, folder: &folder, headless, background, stop };
    launch.carry_out(backend, Some(server), state, observer, |run| run.join("before the mission was over"))
}

/// Takes the launcher's socket for orders. A mission inside one process has a community of its own, whatever its name:
/// it goes without if the socket is taken.
fn listen(options: &LaunchOptions) -> Result<Option<Server>, LaunchError> {
    match Server::listen(&options.community) {
        Err(LaunchError::Launched { .. }) if options.in_process => Ok(None),
        server => server.map(Some),
    }
}

/// Takes the launcher's socket for orders; a launcher in the background leaves it when it is asked to.
fn take_over(community: &Community) -> Result<Server, LaunchError> {
    let (asked, mut waited) = (Server::listen(community), Stopwatch::start());
    if !matches!(asked, Err(LaunchError::Launched { .. })) {
        return asked;
    }
    match ask(community, &Order::Leave, RELIEF_PATIENCE, |_| {}) {
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
struct Launch<'a> {
    mission: &'a Mission,
    program: &'a Path,
    community: &'a Community,
    folder: &'a Path,
    headless: bool,
    background: bool,
    stop: Arc<AtomicBool>,
}

impl Launch<'_> {
    /// Has a backend carry out the mission, from `begin` to its end, and sums up.
    fn carry_out(
        &self,
        mut backend: Box<dyn Backend>,
        server: Option<Server>,
        state: LaunchState,
        observer: Observer,
        begin: fn(&mut MissionRun) -> Result<(), LaunchError>,
    ) -> Result<FinishedRun, LaunchError> {
        let Self { mission, folder, .. } = self;
        let mut listener = Listener::start(backend.join(NAME), observer)?;
        let mut run = MissionRun {
            mission,
            backend: &mut *backend,
            listener: &mut listener,
            server,
            display: Display::new(self.headless, Shown::of(mission)),
            keyboard: Keyboard::default(),
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
        let begun = begin(&mut run).and_then(|()| match self.background {
            true => detach::leave_terminal(folder),
            false => Ok(()),
        });
        run.background = self.background;
        let failed = begun.and_then(|()| run.explore()).err();
        if let Some(relieved @ LaunchError::Relieved) = failed {
            run.hand_over();
            return Err(relieved);
        }
        let error = run.end(failed);
        for words in run.listener.observer().left_out() {
            run.display.say(&words);
        }
        let ran = Ran { explorers: run.backend.explorers(), swapped: run.backend.swapped() };
        let summary = Summary::of(mission, &run.listener.observer(), ran, error.as_ref());
        let unwritten = summary.write(folder).err();
        let picture = (summary.known_voxels > 0).then(|| match files::log_elsewhere(mission, folder) {
            None => picture::draw(self.program, folder),
            Some(log) => Err(format!("it is drawn of a log in the run's folder, and this one's is {}", log.display())),
        });
        let elsewhere = files::elsewhere(mission, folder).collect();
        Ok(FinishedRun { folder: (*folder).to_owned(), elsewhere, summary, error, unwritten, picture })
    }
}

/// The folder of the run of a community whose launcher answers.
pub fn run_folder(community: &Community) -> Option<PathBuf> {
    launched(community).map(|state| state.folder)
}

/// The mission of a community whose launcher answers, as it runs now, swaps included.
pub fn running_mission(community: &Community, registry: &Registry) -> Option<Mission> {
    launched(community)?.mission(community, registry).ok()
}

fn launched(community: &Community) -> Option<LaunchState> {
    match ask(community, &Order::Mission, ANSWER_PATIENCE, |_| {}) {
        Ok(Answer::Mission { text }) => LaunchState::parse(text.as_bytes()).ok(),
        _ => None,
    }
}
