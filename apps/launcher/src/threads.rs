//! The crew as threads of this process, around a broker in memory: for tests, and where a mission is to be one process.

use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::thread::JoinHandle;

use elk_bus::memory::MemoryBroker;
use elk_bus::{App, BrokerConfig, Client, Clock, Community, run_app_on};
use elk_mission::{AppSpec, Program};

use crate::crew::{Crew, stop_order};
use crate::error::LaunchError;

/// Threads of one community.
pub(crate) struct Threads {
    broker: MemoryBroker,
    community: Community,
    apps: Vec<AppSpec>,
    started: Vec<Started>,
}

struct Started {
    app: AppSpec,
    stop: Arc<AtomicBool>,
    /// What it failed with, if it did.
    thread: Option<JoinHandle<Result<(), String>>>,
}

impl Threads {
    /// The crew of `apps`.
    pub fn new(community: &Community, apps: &[AppSpec]) -> Self {
        let broker = MemoryBroker::new(BrokerConfig::new(community.as_str()), Clock::new(1.0));
        let (community, apps) = (community.clone(), apps.to_owned());
        Self { broker, community, apps, started: Vec::new() }
    }

    fn connect(&self, name: &str) -> Result<Client, LaunchError> {
        connect(&self.broker, name, &self.community)
    }

    fn start(&self, app: AppSpec) -> Result<Started, LaunchError> {
        let Program::Builtin(app_type, params) = app.program.clone() else {
            return Err(LaunchError::NoThread(app.name));
        };
        let stop = Arc::new(AtomicBool::new(false));
        let (broker, community) = (self.broker.clone(), self.community.clone());
        let (name, stopped) = (app.name.clone(), stop.clone());
        // The client stays on the thread that it was made on.
        let run = move || {
            let mut made = (app_type.build)(&params).map_err(|error| error.to_string())?;
            let joined = connect(&broker, &name, &community);
            let mut client = joined.map_err(|error| error.to_string())?;
            run_app(&mut *made, &mut client, &stopped)
        };
        let spawned = std::thread::Builder::new().name(app.name.clone()).spawn(run);
        let what = "no thread for an app";
        let thread = spawned.map_err(|source| LaunchError::System { what, source })?;
        Ok(Started { app, stop, thread: Some(thread) })
    }
}

fn run_app(app: &mut dyn App, client: &mut Client, stop: &AtomicBool) -> Result<(), String> {
    run_app_on(app, client, stop).map_err(|error| error.to_string())
}

fn connect(broker: &MemoryBroker, name: &str, community: &Community) -> Result<Client, LaunchError> {
    let refused = |reason: elk_bus::broker::Refusal| elk_bus::ConnectError::Refused {
        community: community.clone(),
        reason: reason.to_string(),
    };
    let link = broker.connect(name).map_err(refused)?;
    Ok(Client::over(link, name, community))
}

impl Started {
    /// Waits for its end; what it failed with, if it did.
    fn join(&mut self) -> Result<(), String> {
        match self.thread.take().map(JoinHandle::join) {
            None => Ok(()),
            Some(Ok(result)) => result,
            Some(Err(_)) => Err("it panicked".to_owned()),
        }
    }

    fn check(&mut self, when: &'static str) -> Result<(), LaunchError> {
        if !self.thread.as_ref().is_some_and(JoinHandle::is_finished) {
            return Ok(());
        }
        let how = match self.join() {
            Ok(()) => "of its own accord".to_owned(),
            Err(error) => error,
        };
        Err(LaunchError::ThreadEnded { app: self.app.name.clone(), when, how })
    }
}

impl Crew for Threads {
    fn start_broker(&mut self, name: &str) -> Result<Client, LaunchError> {
        self.connect(name)
    }

    fn start_apps(&mut self, which: &dyn Fn(&str) -> bool) -> Result<Vec<String>, LaunchError> {
        let chosen: Vec<AppSpec> = self.apps.iter().filter(|app| which(&app.element)).cloned().collect();
        for app in &chosen {
            let started = self.start(app.clone())?;
            self.started.push(started);
        }
        Ok(chosen.into_iter().map(|app| app.name).collect())
    }

    fn check(&mut self, when: &'static str) -> Result<(), LaunchError> {
        self.started.iter_mut().try_for_each(|started| started.check(when))
    }

    fn stop_apps(&mut self) -> Vec<String> {
        let order = stop_order(self.started.iter().map(|started| started.app.element.as_str()));
        let mut complaints = Vec::new();
        for number in order {
            let started = &mut self.started[number];
            started.stop.store(true, Ordering::Relaxed);
            if let Err(error) = started.join() {
                complaints.push(format!("{}: {error}", started.app.name));
            }
        }
        self.started.clear();
        complaints
    }

    fn stop_broker(&mut self) -> Vec<String> {
        self.broker.stop();
        Vec::new()
    }
}

impl Drop for Threads {
    fn drop(&mut self) {
        self.stop_apps();
        self.stop_broker();
    }
}
