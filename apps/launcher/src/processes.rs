//! The crew as operating-system processes: `elk db`, `elk sensor`, …, or any other executable.

use std::os::unix::process::ExitStatusExt;
use std::path::{Path, PathBuf};
use std::process::Command;
use std::time::Duration;

use elk_bus::clock::Stopwatch;
use elk_bus::{Client, Community, ConnectError};
use elk_mission::{AppSpec, Program, Restart};

use crate::crew::{Crew, stop_order};
use crate::error::LaunchError;
use crate::guard::Guard;
use crate::process::{Process, how};

/// How long the broker may take to answer.
const BROKER_PATIENCE: Duration = Duration::from_secs(20);
/// How often it is asked.
const ASK_EVERY: Duration = Duration::from_millis(5);
/// How long an app may take to end after SIGTERM: the map and the log are written then.
const STOP_PATIENCE: Duration = Duration::from_secs(20);
/// An app that did not come to catch SIGTERM ends of it, as it was asked to.
const ASKED_TO: Option<i32> = Some(signal_hook::consts::SIGTERM);
/// How often an app with `restart="on-failure"` is started again.
const RESTARTS: u32 = 3;

/// Processes of one community.
pub(crate) struct Processes {
    program: PathBuf,
    community: Community,
    folder: PathBuf,
    apps: Vec<AppSpec>,
    /// Those that were started, in the order of their start.
    started: Vec<Started>,
    broker: Option<Process>,
    guard: Guard,
}

struct Started {
    app: AppSpec,
    process: Process,
    restarts: u32,
    /// It has ended, and that is all right.
    over: bool,
}

impl Processes {
    /// The crew of `apps`; text logs go to `folder`. Nothing but the guard is started yet.
    pub fn new(program: &Path, community: &Community, folder: &Path, apps: &[AppSpec]) -> Result<Self, LaunchError> {
        Ok(Self {
            program: program.to_owned(),
            community: community.clone(),
            folder: folder.to_owned(),
            apps: apps.to_owned(),
            started: Vec::new(),
            broker: None,
            guard: Guard::start(program)?,
        })
    }

    fn spawn(&mut self, name: &str, command: Command) -> Result<Process, LaunchError> {
        let log = self.folder.join(format!("{name}.log"));
        let process = Process::spawn(name, command, &log)?;
        self.guard.watch(process.pid());
        Ok(process)
    }

    fn broker_command(&self) -> Command {
        let mut command = Command::new(&self.program);
        command.arg("db").args(["--community", self.community.as_str()]);
        command
    }

    /// What starts an app: the same line that a person would type.
    fn app_command(&self, app: &AppSpec) -> Command {
        let settings = app.settings.iter().map(|(name, text)| format!("{name}={text}"));
        match &app.program {
            Program::Builtin(app_type, _) => {
                let mut command = Command::new(&self.program);
                command.arg(app_type.element.to_lowercase()).args(["--type", app_type.name]);
                command.args(["--name", &app.name, "--community", self.community.as_str()]);
                command.args(settings);
                command
            }
            Program::Foreign { exec, args } => {
                let mut command = Command::new(exec);
                command.args(args).args(settings);
                command.env("ELK_COMMUNITY", self.community.as_str()).env("ELK_NAME", &app.name);
                command
            }
        }
    }

    fn check_app(&mut self, number: usize, when: &'static str) -> Result<(), LaunchError> {
        let started = &mut self.started[number];
        if started.over {
            return Ok(());
        }
        let Some(status) = started.process.ended() else {
            return Ok(());
        };
        self.guard.forget(started.process.pid());
        let again = started.app.restart == Restart::OnFailure && started.restarts < RESTARTS;
        match status.success() {
            // A program of somebody else's may have done all that it was there for.
            true if started.app.element == "App" => {
                started.over = true;
                Ok(())
            }
            false if again => self.restart(number),
            _ => {
                started.over = true;
                Err(started.process.died(status, when))
            }
        }
    }

    fn restart(&mut self, number: usize) -> Result<(), LaunchError> {
        let app = self.started[number].app.clone();
        let process = self.spawn(&app.name, self.app_command(&app))?;
        let started = &mut self.started[number];
        started.process = process;
        started.restarts += 1;
        eprintln!("{} failed and was started again ({} of {RESTARTS})", app.name, started.restarts);
        Ok(())
    }
}

impl Crew for Processes {
    fn start_broker(&mut self, name: &str) -> Result<Client, LaunchError> {
        let broker = self.spawn("db", self.broker_command())?;
        let broker = self.broker.insert(broker);
        let clock = Stopwatch::start();
        loop {
            match Client::connect(&self.community, name) {
                Ok(client) => return still_ours(broker).map(|()| client),
                Err(ConnectError::NoBroker(_)) if clock.elapsed() < BROKER_PATIENCE => {}
                Err(error) => return still_ours(broker).and(Err(error.into())),
            }
            still_ours(broker)?;
            std::thread::sleep(ASK_EVERY);
        }
    }

    fn start_apps(&mut self, which: &dyn Fn(&str) -> bool) -> Result<Vec<String>, LaunchError> {
        let chosen: Vec<AppSpec> = self.apps.iter().filter(|app| which(&app.element)).cloned().collect();
        for app in &chosen {
            let process = self.spawn(&app.name, self.app_command(app))?;
            let app = app.clone();
            self.started.push(Started { app, process, restarts: 0, over: false });
        }
        Ok(chosen.into_iter().map(|app| app.name).collect())
    }

    fn check(&mut self, when: &'static str) -> Result<(), LaunchError> {
        // Without a broker every app ends: it is looked at first, so that it is the one that is named.
        if let Some(broker) = &mut self.broker
            && let Some(status) = broker.ended()
        {
            return Err(broker.died(status, when));
        }
        (0..self.started.len()).try_for_each(|number| self.check_app(number, when))
    }

    fn stop_apps(&mut self) -> Vec<String> {
        let order = stop_order(self.started.iter().map(|started| started.app.element.as_str()));
        let mut complaints = Vec::new();
        for number in order {
            let Started { process, over, .. } = &mut self.started[number];
            if !*over {
                complaints.extend(stop(process));
                self.guard.forget(process.pid());
            }
        }
        self.started.clear();
        complaints
    }

    fn stop_broker(&mut self) -> Vec<String> {
        let broker = self.broker.take();
        broker
            .into_iter()
            .filter_map(|mut broker| {
                let complaint = stop(&mut broker);
                self.guard.forget(broker.pid());
                complaint
            })
            .collect()
    }
}

/// Whoever leaves early, by an error or a panic, leaves nobody behind.
impl Drop for Processes {
    fn drop(&mut self) {
        self.stop_apps();
        self.stop_broker();
    }
}

/// The broker that answers has to be the one that was started: another one of the same community makes it end.
fn still_ours(broker: &mut Process) -> Result<(), LaunchError> {
    match broker.ended() {
        Some(status) => Err(broker.died(status, "at once")),
        None => Ok(()),
    }
}

fn stop(process: &mut Process) -> Option<String> {
    let log = process.log.display().to_string();
    match process.stop(STOP_PATIENCE) {
        (_, true) => {
            let secs = STOP_PATIENCE.as_secs();
            Some(format!("{} did not stop within {secs} s and was killed; see {log}", process.name))
        }
        (Some(status), false) if !status.success() && status.signal() != ASKED_TO => {
            Some(format!("{} stopped with {}; see {log}", process.name, how(status)))
        }
        (_, false) => None,
    }
}
