//! What a launcher leaves word of on the bus, so that another one can pick the mission up: `LAUNCH_STATE`, text, JSON.

use std::collections::BTreeSet;
use std::path::{Path, PathBuf};
use std::time::Duration;

use elk_bus::clock::Stopwatch;
use elk_bus::{Client, Community, ConnectError, ProcessId};
use elk_mission::{AppSpec, Exchange, Mission, Mode, Policy, Program, Registry, Restart, is_app_name};
use serde::{Deserialize, Serialize};

use crate::error::LaunchError;

/// The variable.
pub(crate) const KEY: &str = "LAUNCH_STATE";
/// Counts up when the words change.
const VERSION: u32 = 3;
/// How long the broker may take to say the variable's value.
const PATIENCE: Duration = Duration::from_secs(5);
/// How often it is asked.
const ASK_EVERY: Duration = Duration::from_millis(20);

/// A launched mission.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub(crate) struct LaunchState {
    version: u32,
    /// The run's folder.
    pub folder: PathBuf,
    /// The mission's name, and the file that it was read from.
    name: String,
    file: PathBuf,
    /// Whether it waits for a person before each step.
    pub manual: bool,
    pub paused: bool,
    /// The community's time of the first pose command (s).
    pub first_command: Option<f64>,
    /// The explorers that ran, in their order.
    pub explorers: Vec<String>,
    broker_policy: PolicyState,
    mailbox_mb: u32,
    pub broker: Option<ProcessId>,
    pub apps: Vec<AppState>,
}

/// An app of it.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub(crate) struct AppState {
    pub name: String,
    element: String,
    /// `None`: an executable.
    type_name: Option<String>,
    exec: Option<(PathBuf, Vec<String>)>,
    /// What was set of its parameters.
    settings: Vec<(String, String)>,
    policy: PolicyState,
    /// Whether it is stopped, or has ended well.
    pub idle: bool,
    pub process: Option<ProcessId>,
    /// The process that is to take its place, in the midst of a swap.
    pub successor: Option<ProcessId>,
    pub restarts: u32,
    pub swaps: u32,
    pub last_exit: Option<String>,
}

#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
struct PolicyState {
    restart: String,
    restarts: u32,
    window_secs: f64,
    health_secs: Option<f64>,
}

impl LaunchState {
    /// That of a mission before anything is started.
    pub fn of(mission: &Mission, folder: &Path, manual: bool) -> Self {
        Self {
            version: VERSION,
            folder: folder.to_owned(),
            name: mission.name.clone(),
            file: std::path::absolute(&mission.file).unwrap_or_else(|_| mission.file.clone()),
            manual,
            paused: manual,
            first_command: None,
            explorers: Vec::new(),
            broker_policy: PolicyState::of(&mission.broker),
            mailbox_mb: mission.mailbox_mb,
            broker: None,
            apps: mission.apps.iter().map(AppState::of).collect(),
        }
    }

    /// Asks the broker for what the last launcher left word of.
    pub fn read(community: &Community) -> Result<Self, LaunchError> {
        let refused = |why: String| LaunchError::Attach { community: community.clone(), why };
        let mut client = join(community)?;
        client.comms.register_text(KEY)?;
        let clock = Stopwatch::start();
        let mut found = None;
        while found.is_none() && clock.elapsed() < PATIENCE {
            client.receive(Duration::from_millis(50), |mail| {
                found = mail.as_text().filter(|_| mail.key() == KEY).map(str::to_owned);
            })?;
        }
        let nothing = "there is a broker, but no launcher left word of a mission; `elk launch --detach` does";
        let text = found.ok_or_else(|| refused(nothing.to_owned()))?;
        let state: Self = serde_json::from_str(&text)
            .map_err(|error| refused(format!("what its launcher left word of is not understood: {error}")))?;
        match state.version {
            VERSION => Ok(state),
            other => Err(refused(format!("its launcher spoke version {other} of {KEY}, this one speaks {VERSION}"))),
        }
    }

    /// The mission, checked against the registry as its file was.
    pub fn mission(&self, community: &Community, registry: &Registry) -> Result<Mission, LaunchError> {
        // They name files.
        if let Some(odd) = self.apps.iter().find(|app| !is_app_name(&app.name)) {
            let why = format!("what its launcher left word of names an app {:?}, which is no name for one", odd.name);
            return Err(LaunchError::Attach { community: community.clone(), why });
        }
        let apps = self.apps.iter().map(|app| app.spec(registry)).collect::<Result<_, _>>()?;
        Ok(Mission {
            name: self.name.clone(),
            file: self.file.clone(),
            mode: if self.manual { Mode::Manual } else { Mode::Auto },
            broker: self.broker_policy.policy(),
            mailbox_mb: self.mailbox_mb,
            apps,
        })
    }
}

/// Joins; the name of a launcher that died just now is free in a moment.
fn join(community: &Community) -> Result<Client, ConnectError> {
    let clock = Stopwatch::start();
    loop {
        match Client::connect(community, crate::NAME) {
            Err(ConnectError::Refused { .. }) if clock.elapsed() < PATIENCE => std::thread::sleep(ASK_EVERY),
            joined => return joined,
        }
    }
}

impl AppState {
    /// That of an app that was not started yet.
    pub fn of(app: &AppSpec) -> Self {
        let (type_name, exec) = match &app.program {
            Program::Builtin(app_type, _) => (Some(app_type.name.to_owned()), None),
            Program::Foreign { exec, args } => (None, Some((exec.clone(), args.clone()))),
        };
        Self {
            name: app.name.clone(),
            element: app.element.clone(),
            type_name,
            exec,
            settings: app.settings.iter().filter(|(name, _)| app.said.contains(name)).cloned().collect(),
            policy: PolicyState::of(&app.policy),
            idle: false,
            process: None,
            successor: None,
            restarts: 0,
            swaps: 0,
            last_exit: None,
        }
    }

    /// The app, checked.
    fn spec(&self, registry: &Registry) -> Result<AppSpec, LaunchError> {
        let said: BTreeSet<String> = self.settings.iter().map(|(name, _)| name.clone()).collect();
        let (exec, args) = self.exec.clone().unwrap_or_default();
        let stranger = AppSpec {
            name: self.name.clone(),
            element: self.element.clone(),
            program: Program::Foreign { exec, args },
            policy: self.policy.policy(),
            said,
            settings: self.settings.clone(),
        };
        match &self.type_name {
            None => Ok(stranger),
            // What was said of it makes it what it was, as if it took a stranger's place.
            Some(name) => {
                let wanted = Exchange { type_name: Some(name.clone()), ..Exchange::default() };
                Ok(stranger.exchange(&wanted, registry)?.app)
            }
        }
    }
}

impl PolicyState {
    fn of(policy: &Policy) -> Self {
        Self {
            restart: policy.restart.word().to_owned(),
            restarts: policy.restarts,
            window_secs: policy.window_secs,
            health_secs: policy.health_secs,
        }
    }

    fn policy(&self) -> Policy {
        Policy {
            restart: Restart::of_word(&self.restart).unwrap_or_default(),
            restarts: self.restarts,
            window_secs: self.window_secs,
            health_secs: self.health_secs,
        }
    }
}
