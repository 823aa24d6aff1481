//! Live apps: elk's own as threads of this process, programs of somebody else's as processes that do not outlive it.

mod meeting;
mod process;

use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::thread::JoinHandle;

use elk_bus::{Client, run_app_on};
use elk_mission::{AppSpec, AppType, Params, Program};

use crate::error::ReplayError;
use meeting::Meeting;
use process::Process;

/// A community of live apps.
pub(crate) struct Live {
    meeting: Meeting,
    folder: PathBuf,
    apps: Vec<(String, Running)>,
}

/// What runs as an app.
enum Running {
    Thread(Thread),
    Process(Process),
}

/// One of elk's own apps.
struct Thread {
    stop: Arc<AtomicBool>,
    running: Option<JoinHandle<Result<(), String>>>,
}

impl Live {
    /// A community in which `apps` are to live, with nobody in it yet. What programs of somebody else's print goes into
    /// `folder`.
    pub fn new(apps: &[AppSpec], folder: &Path) -> Result<Self, ReplayError> {
        let has_programs = apps.iter().any(|app| matches!(app.program, Program::Foreign { .. }));
        let meeting = if has_programs { Meeting::shared() } else { Meeting::in_memory() };
        Ok(Self { meeting: meeting?, folder: folder.into(), apps: Vec::new() })
    }

    /// Joins it under `name`.
    pub fn join(&self, name: &str) -> Result<Client, ReplayError> {
        self.meeting.place().join(name).map_err(|reason| ReplayError::App { app: name.into(), reason })
    }

    /// Starts an app.
    pub fn start(&mut self, app: &AppSpec) -> Result<(), ReplayError> {
        let started = match app.program.clone() {
            Program::Builtin(app_type, params) => self.thread(&app.name, app_type, &params).map(Running::Thread),
            Program::Foreign { .. } => self.process(app).map(Running::Process),
        };
        let running = started.map_err(|reason| ReplayError::App { app: app.name.clone(), reason })?;
        self.apps.push((app.name.clone(), running));
        Ok(())
    }

    fn thread(&self, name: &str, app_type: &'static AppType, params: &Params) -> Result<Thread, String> {
        // What its parameters cannot be built from is said before anything is played.
        let mut built = (app_type.build)(params).map_err(|error| error.to_string())?;
        let stop = Arc::new(AtomicBool::new(false));
        let (place, own_name, stopped) = (self.meeting.place().clone(), name.to_owned(), stop.clone());
        // A client stays on the thread that it was made on.
        let run = move || {
            let mut client = place.join(&own_name)?;
            run_app_on(&mut *built, &mut client, &stopped).map_err(|error| error.to_string())
        };
        let running = std::thread::Builder::new().name(name.to_owned()).spawn(run);
        Ok(Thread { stop, running: Some(running.map_err(|error| error.to_string())?) })
    }

    fn process(&self, app: &AppSpec) -> Result<Process, String> {
        // Only elk's own apps are run by elk's own program.
        if app.is_moos() {
            return Err("it is a client of MOOS', for whom a replay has no port; right is a mission without it".into());
        }
        let command = app.command(Path::new("elk"), self.meeting.place().community(), &self.folder);
        Process::start(command, &self.folder.join(format!("{}.log", app.name)))
    }

    /// Fails if an app has ended by itself.
    pub fn check(&mut self) -> Result<(), ReplayError> {
        let ended = self.apps.iter_mut().find_map(|(name, app)| Some((name.clone(), app.ended()?)));
        ended.map_or(Ok(()), |(app, end)| {
            let reason = end.err().unwrap_or_else(|| "it ended by itself".into());
            Err(ReplayError::App { app, reason })
        })
    }

    /// Ends an app, and waits until it has said its last.
    pub fn stop(&mut self, name: &str) -> Result<(), ReplayError> {
        let Some((_, app)) = self.apps.iter_mut().find(|(other, _)| other == name) else {
            return Ok(());
        };
        app.ask();
        app.wait().map_err(|reason| ReplayError::App { app: name.into(), reason })
    }
}

impl Drop for Live {
    fn drop(&mut self) {
        self.apps.iter_mut().for_each(|(_, app)| app.ask());
        for (_, app) in &mut self.apps {
            // Whatever it ended with, somebody has said already why this ends.
            let _ = app.wait();
        }
    }
}

impl Running {
    fn ask(&self) {
        match self {
            Self::Thread(thread) => thread.stop.store(true, Ordering::Relaxed),
            Self::Process(process) => process.ask(),
        }
    }

    fn wait(&mut self) -> Result<(), String> {
        match self {
            Self::Thread(thread) => thread.join(),
            Self::Process(process) => process.wait(),
        }
    }

    /// How it ended, if it has.
    fn ended(&mut self) -> Option<Result<(), String>> {
        match self {
            Self::Thread(thread) => thread.running.as_ref()?.is_finished().then(|| thread.join()),
            Self::Process(process) => process.ended(),
        }
    }
}

impl Thread {
    fn join(&mut self) -> Result<(), String> {
        match self.running.take().map(JoinHandle::join) {
            None => Ok(()),
            Some(Ok(result)) => result,
            Some(Err(_)) => Err("it panicked".into()),
        }
    }
}
