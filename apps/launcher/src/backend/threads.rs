//! The backend as threads of this process, around a broker in memory: for tests, and where a mission is to be one process.

use std::collections::BTreeSet;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::thread::JoinHandle;
use std::time::Duration;

use elk_bus::clock::Stopwatch;
use elk_bus::memory::MemoryBroker;
use elk_bus::{App, BrokerConfig, Client, Clock, Community, ConnectError, run_app_on};
use elk_mission::{AppSpec, Mission, Program, element};
use rustix::event::PollFd;

use crate::backend::Backend;
use crate::control::{AppRow, Order};
use crate::error::LaunchError;
use crate::reports::listener::Join;
use crate::reports::observer::{Losses, News};
use crate::run::launch_state::LaunchState;
use crate::supervisor::{State, Ticket, Word, stop_order};

/// Threads of one community.
pub(crate) struct Threads {
    broker: MemoryBroker,
    community: Community,
    apps: Vec<AppSpec>,
    started: Vec<Started>,
    running: Stopwatch,
    /// What an app could not do at the end, until somebody asks: the first failure is the mission's.
    failed: Option<LaunchError>,
    /// The others.
    sayings: Vec<String>,
    words: Vec<(Ticket, Word)>,
}

struct Started {
    app: AppSpec,
    stop: Arc<AtomicBool>,
    /// What it failed with, if it did.
    thread: Option<JoinHandle<Result<(), String>>>,
}

impl Threads {
    /// The backend of a mission.
    pub fn new(community: &Community, mission: &Mission) -> Self {
        let config = BrokerConfig::new(community.as_str()).with_mailbox_bytes((mission.mailbox_mb as usize) << 20);
        let broker = MemoryBroker::new(config, Clock::new(mission.time_warp));
        let (community, apps) = (community.clone(), mission.apps.clone());
        let (started, sayings, words) = (Vec::new(), Vec::new(), Vec::new());
        Self { broker, community, apps, started, running: Stopwatch::start(), failed: None, sayings, words }
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

    fn note_failure(&mut self, error: LaunchError) {
        match &self.failed {
            None => self.failed = Some(error),
            Some(_) => self.sayings.push(error.to_string()),
        }
    }
}

fn run_app(app: &mut dyn App, client: &mut Client, stop: &AtomicBool) -> Result<(), String> {
    run_app_on(app, client, stop).map_err(|error| error.to_string())
}

fn connect(broker: &MemoryBroker, name: &str, community: &Community) -> Result<Client, ConnectError> {
    let refused = |reason: elk_bus::broker::AdmissionError| ConnectError::Refused {
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

impl Backend for Threads {
    fn join(&self, name: &str) -> Join {
        let (broker, community, name) = (self.broker.clone(), self.community.clone(), name.to_owned());
        Box::new(move || connect(&broker, &name, &community))
    }

    fn start_broker(&mut self) -> Result<(), LaunchError> {
        Ok(())
    }

    fn start_apps(&mut self, which: &dyn Fn(&str, &str) -> bool) -> Result<(), LaunchError> {
        let chosen: Vec<AppSpec> = self.apps.iter().filter(|app| which(&app.element, &app.name)).cloned().collect();
        for app in chosen {
            let started = self.start(app)?;
            self.started.push(started);
        }
        Ok(())
    }

    /// An app that is a thread does not end of its own accord: that would be its failure.
    fn all_over(&self) -> bool {
        false
    }

    fn missing(&self, clients: &BTreeSet<String>) -> Vec<String> {
        let names = self.started.iter().map(|started| started.app.name.clone());
        names.filter(|name| !clients.contains(name)).collect()
    }

    fn hear(&mut self, _: &[News], _: &BTreeSet<String>) {}

    fn check(&mut self, when: &'static str) -> Result<(), LaunchError> {
        self.failed.take().map_or(Ok(()), Err)?;
        self.started.iter_mut().try_for_each(|started| started.check(when))
    }

    /// A thread's end makes nothing readable.
    fn watch<'a>(&'a self, _: &mut Vec<PollFd<'a>>) {}

    fn patience(&self) -> Option<Duration> {
        None
    }

    fn sayings(&mut self) -> Vec<String> {
        std::mem::take(&mut self.sayings)
    }

    fn order(&mut self, ticket: Ticket, _: Order) {
        let said = "this mission runs inside one process, where no app can be stopped, started or swapped: \
                    launch it without --in-process";
        self.words.push((ticket, Word::Failed(said.to_owned())));
    }

    fn words(&mut self) -> Vec<(Ticket, Word)> {
        std::mem::take(&mut self.words)
    }

    fn rows(&mut self, losses: &Losses) -> Vec<AppRow> {
        let secs = self.running.elapsed().as_secs_f64();
        let row = |started: &Started| AppRow {
            name: started.app.name.clone(),
            element: started.app.element.clone(),
            type_name: started.app.type_name().to_owned(),
            // They are threads of the launcher's process, whose row says what they use together.
            pid: None,
            state: State::Running.word().to_owned(),
            state_secs: secs,
            cpu_percent: None,
            cpu_percent_now: None,
            resident_bytes: None,
            dropped: losses.dropped.get(&started.app.name).copied(),
            rejected: losses.rejected.get(&started.app.name).copied(),
            restarts: 0,
            swaps: 0,
            last_exit: None,
        };
        self.started.iter().map(row).collect()
    }

    fn note_state(&self, _: &mut LaunchState) -> bool {
        false
    }

    fn explorers(&self) -> Vec<String> {
        let explorers = self.apps.iter().filter(|app| app.element == element::EXPLORER);
        explorers.map(|app| app.type_name().to_owned()).collect()
    }

    fn end_apps(&mut self) {
        let order = stop_order(self.started.iter().map(|started| started.app.element.as_str()));
        for number in order {
            let started = &mut self.started[number];
            started.stop.store(true, Ordering::Relaxed);
            if let Err(how) = started.join() {
                let (app, when) = (started.app.name.clone(), "and could not do what it had yet to do");
                self.note_failure(LaunchError::ThreadEnded { app, when, how });
            }
        }
        self.started.clear();
    }

    fn ended(&self) -> bool {
        self.started.is_empty()
    }

    fn stop_broker(&mut self) {
        self.broker.stop();
    }
}

impl Drop for Threads {
    fn drop(&mut self) {
        self.end_apps();
        self.stop_broker();
    }
}

#[cfg(test)]
mod tests {
    use std::collections::BTreeSet;

    use elk_mission::{Mode, Policy, Via};

    use super::*;

    fn failing(name: &str) -> Started {
        let app = AppSpec {
            name: name.to_owned(),
            element: name.to_owned(),
            program: Program::Foreign { exec: "none".into(), args: Vec::new(), via: Via::Itself },
            policy: Policy::default(),
            said: BTreeSet::new(),
            settings: Vec::new(),
        };
        let how = format!("{name} has no room");
        Started { app, stop: Arc::default(), thread: Some(std::thread::spawn(move || Err(how))) }
    }

    /// Regression: of several apps that failed at the end, one was heard of.
    #[test]
    fn whatever_fails_at_the_end_is_said() {
        let (broker, mailbox_mb, apps) = (Policy::BROKER, 4, Vec::new());
        let mission = Mission {
            name: "Test".into(),
            file: "test.xml".into(),
            bytes: vec![],
            mode: Mode::Auto,
            broker,
            mailbox_mb,
            time_warp: 1.0,
            community: None,
            launch_pause_secs: 0.0,
            notes: Vec::new(),
            moos: None,
            apps,
        };
        let mut threads = Threads::new(&Community::new("threads").unwrap(), &mission);
        threads.started.extend(["Logger", "Map"].map(failing));
        threads.end_apps();
        let first = threads.check("while the mission ended").unwrap_err().to_string();
        assert_eq!(first, "Map ended and could not do what it had yet to do: Map has no room");
        assert_eq!(threads.sayings(), ["Logger ended and could not do what it had yet to do: Logger has no room"]);
    }
}
