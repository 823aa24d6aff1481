//! What a launcher leaves word of, so that another one can pick the mission up: text, JSON, on the bus as `LAUNCH_STATE`
//! and in the community's folder, for the case that the broker dies along with the launcher.

use std::collections::BTreeSet;
use std::io::ErrorKind;
use std::path::{Path, PathBuf};
use std::time::Duration;

use elk_bus::clock::Stopwatch;
use elk_bus::moos::gateway::{AddressError, GatewayOptions};
use elk_bus::moos::text::Texts;
use elk_bus::{Client, Community, ConnectError, FolderError, ProcessId, shm, text};
use elk_mission::variables::LAUNCH_STATE;
use elk_mission::{AppSpec, Exchange, Mission, Mode, Policy, Program, Registry, Restart, Via, is_app_name};
use serde::{Deserialize, Serialize};

use crate::error::LaunchError;
use crate::process::escaped::RunId;

/// Counts up when the words change.
const VERSION: u32 = 9;
/// What it is called in the community's folder.
const KEPT: &str = "launch-state";
/// How long the broker may take to say the variable's value.
const PATIENCE: Duration = Duration::from_secs(5);
/// How often it is asked.
const ASK_EVERY: Duration = Duration::from_millis(20);

/// A launched mission.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub(crate) struct LaunchState {
    version: u32,
    /// Counts up whenever it is said: of two the later one counts.
    number: u64,
    /// The run's folder.
    pub folder: PathBuf,
    /// By what the mission's processes are known, once there are any.
    pub run: Option<RunId>,
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
    time_warp: f64,
    moos: Option<MoosState>,
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
    /// How the executable comes to the bus.
    via: Via,
    /// What was set of its parameters.
    settings: Vec<(String, String)>,
    policy: PolicyState,
    /// Whether it is stopped, or has ended well.
    pub idle: bool,
    pub process: Option<ProcessId>,
    /// Its successor, in the midst of a swap.
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

/// Where clients of MOOS' may connect.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
struct MoosState {
    address: String,
    networks: Vec<String>,
    any_source: bool,
    texts: Vec<String>,
    connections: usize,
}

impl LaunchState {
    /// That of a mission before anything is started.
    pub fn of(mission: &Mission, folder: &Path, manual: bool) -> Self {
        Self {
            version: VERSION,
            number: 0,
            folder: folder.to_owned(),
            run: None,
            name: mission.name.clone(),
            file: std::path::absolute(&mission.file).unwrap_or_else(|_| mission.file.clone()),
            manual,
            paused: manual,
            first_command: None,
            explorers: Vec::new(),
            broker_policy: PolicyState::of(&mission.broker),
            mailbox_mb: mission.mailbox_mb,
            time_warp: mission.time_warp,
            moos: mission.moos.as_ref().map(MoosState::of),
            broker: None,
            apps: mission.apps.iter().map(AppState::of).collect(),
        }
    }

    /// Counts up, and answers the text to be said.
    ///
    /// # Errors
    /// It cannot be put into words; nothing is better than an empty text, which would overwrite the last one.
    pub fn next_text(&mut self) -> Result<String, LaunchError> {
        self.number = self.number.saturating_add(1);
        let failed = |error: serde_json::Error| LaunchError::System {
            what: "no words for whoever picks the mission up",
            source: error.into(),
        };
        serde_json::to_string(self).map_err(failed)
    }

    /// Keeps a text of it where no broker is needed.
    pub fn keep(community: &Community, text: &str) -> Result<(), LaunchError> {
        match shm::keep(community, KEPT, text.as_bytes()) {
            // No broker has made the folder yet: so far there is nothing to be picked up.
            Err(FolderError::Io { source, .. }) if source.kind() == ErrorKind::NotFound => Ok(()),
            kept => kept.map_err(LaunchError::Unkept),
        }
    }

    /// What the last launcher left word of, on the bus or in the community's folder, whichever it said later. What is kept
    /// of a mission of which nobody lives is a leftover.
    pub fn read(community: &Community) -> Result<Self, LaunchError> {
        let kept = Self::kept(community).filter(Self::is_alive);
        match (Self::said(community), kept) {
            (Ok(said), Some(kept)) if said.number < kept.number => Ok(kept),
            // A launcher that lives has the name.
            (Err(refused @ LaunchError::Connect(ConnectError::Refused { .. })), _) => Err(refused),
            (Err(_), Some(kept)) => Ok(kept),
            (said, _) => said,
        }
    }

    /// Asks the broker.
    fn said(community: &Community) -> Result<Self, LaunchError> {
        let refused = |why: String| LaunchError::Attach { community: community.clone(), why };
        let mut client = join(community)?;
        client.comms.register(text(LAUNCH_STATE))?;
        let clock = Stopwatch::start();
        let mut found = None;
        while found.is_none() && clock.elapsed() < PATIENCE {
            client.receive(Duration::from_millis(50), |mail| {
                found = mail.as_text().filter(|_| mail.key() == LAUNCH_STATE).map(str::to_owned);
            })?;
        }
        let nothing = "there is a broker, but no launcher left word of a mission; `elk launch --detach` does";
        let text = found.ok_or_else(|| refused(nothing.to_owned()))?;
        Self::parse(text.as_bytes()).map_err(refused)
    }

    /// Looks into the community's folder. What is not understood there is of another version.
    fn kept(community: &Community) -> Option<Self> {
        Self::parse(&shm::kept(community, KEPT).ok()?).ok()
    }

    /// Understands such a text.
    ///
    /// # Errors
    /// It is of another version; in words.
    pub fn parse(text: &[u8]) -> Result<Self, String> {
        let state: Self = serde_json::from_slice(text)
            .map_err(|error| format!("what its launcher left word of is not understood: {error}"))?;
        match state.version {
            VERSION => Ok(state),
            other => Err(format!("its launcher spoke version {other} of {LAUNCH_STATE}, this one speaks {VERSION}")),
        }
    }

    /// Whether any process of the mission lives.
    fn is_alive(&self) -> bool {
        let of_apps = self.apps.iter().flat_map(|app| [&app.process, &app.successor]);
        of_apps.chain([&self.broker]).flatten().any(ProcessId::lives)
    }

    /// The mission, checked against the registry as its file was.
    pub fn mission(&self, community: &Community, registry: &Registry) -> Result<Mission, LaunchError> {
        let odd = |why| LaunchError::Attach { community: community.clone(), why };
        // They name files.
        if let Some(odd) = self.apps.iter().find(|app| !is_app_name(&app.name)) {
            let why = format!("what its launcher left word of names an app {:?}, which is no name for one", odd.name);
            return Err(LaunchError::Attach { community: community.clone(), why });
        }
        let policies = self.apps.iter().map(|app| app.policy.policy()).collect::<Result<Vec<_>, _>>().map_err(odd)?;
        let specs = self.apps.iter().zip(policies).map(|(app, policy)| app.spec(policy, registry));
        let apps = specs.collect::<Result<_, _>>()?;
        Ok(Mission {
            name: self.name.clone(),
            file: self.file.clone(),
            bytes: Vec::new(),
            mode: if self.manual { Mode::Manual } else { Mode::Auto },
            broker: self.broker_policy.policy().map_err(odd)?,
            mailbox_mb: self.mailbox_mb,
            time_warp: self.time_warp,
            community: Some(community.clone()),
            launch_pause_secs: 0.0,
            notes: Vec::new(),
            moos: self.moos.as_ref().map(MoosState::options).transpose().map_err(odd)?,
            apps,
        })
    }
}

/// Joins; the name of a launcher that died just now is free in a moment, and a broker that dies just now is gone in one.
fn join(community: &Community) -> Result<Client, ConnectError> {
    let clock = Stopwatch::start();
    loop {
        match Client::connect(community, crate::reports::NAME) {
            Err(ConnectError::Refused { .. } | ConnectError::Handshake { .. }) if clock.elapsed() < PATIENCE => {
                std::thread::sleep(ASK_EVERY)
            }
            joined => return joined,
        }
    }
}

impl AppState {
    /// That of an app that was not started yet.
    pub fn of(app: &AppSpec) -> Self {
        let (type_name, exec, via) = match &app.program {
            Program::Builtin(app_type, _) => (Some(app_type.name.to_owned()), None, Via::Itself),
            Program::Foreign { exec, args, via } => (None, Some((exec.clone(), args.clone())), via.clone()),
        };
        Self {
            name: app.name.clone(),
            element: app.element.clone(),
            type_name,
            exec,
            via,
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
    fn spec(&self, policy: Policy, registry: &Registry) -> Result<AppSpec, LaunchError> {
        let said: BTreeSet<String> = self.settings.iter().map(|(name, _)| name.clone()).collect();
        let (exec, args) = self.exec.clone().unwrap_or_default();
        let foreign = AppSpec {
            name: self.name.clone(),
            element: self.element.clone(),
            program: Program::Foreign { exec, args, via: self.via.clone() },
            policy,
            said,
            settings: self.settings.clone(),
        };
        match &self.type_name {
            None => Ok(foreign),
            // What was said of it makes it what it was, as if it had replaced a foreign one.
            Some(name) => {
                let wanted = Exchange { type_name: Some(name.clone()), ..Exchange::default() };
                Ok(foreign.exchange(&wanted, registry)?.app)
            }
        }
    }
}

impl MoosState {
    fn of(moos: &GatewayOptions) -> Self {
        let networks = moos.networks.iter().map(ToString::to_string).collect();
        let texts = moos.texts.patterns().map(str::to_owned).collect();
        let GatewayOptions { any_source, connections, .. } = *moos;
        Self { address: moos.address.to_string(), networks, any_source, texts, connections }
    }

    /// The options, or what is wrong with their words.
    fn options(&self) -> Result<GatewayOptions, String> {
        let odd = |error: AddressError| format!("what its launcher left word of is odd: {error}");
        let networks = self.networks.iter().map(|one| one.parse()).collect::<Result<_, _>>().map_err(odd)?;
        let address = self.address.parse().map_err(odd)?;
        let (any_source, texts) = (self.any_source, Texts::new(self.texts.iter().cloned()));
        Ok(GatewayOptions { address, networks, any_source, texts, connections: self.connections })
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

    /// The policy, or what is wrong with its words.
    fn policy(&self) -> Result<Policy, String> {
        let unknown =
            || format!("what its launcher left word of restarts an app {:?}, which means nothing", self.restart);
        Ok(Policy {
            restart: Restart::of_word(&self.restart).ok_or_else(unknown)?,
            restarts: self.restarts,
            window_secs: self.window_secs,
            health_secs: self.health_secs,
        })
    }
}

#[cfg(test)]
mod tests {
    use serde_json::Value;

    use super::*;

    fn state() -> LaunchState {
        let text = "<Scenario><Sensor exec=\"/bin/sh\"/><Map exec=\"/bin/sh\"/><Explorer exec=\"/bin/sh\"/>\
                    <Controller exec=\"/bin/sh\"/></Scenario>";
        let mission = Mission::parse(text, Path::new("m.xml"), &Registry::default(), &[]).unwrap();
        LaunchState::of(&mission, Path::new("run"), false)
    }

    /// Anybody may write the variable, and what apps are called names files.
    #[test]
    fn words_that_no_launcher_says_are_refused_with_what_is_wrong() {
        let mission = |change: &dyn Fn(&mut Value)| {
            let mut said = serde_json::to_value(state()).unwrap();
            change(&mut said);
            let state = LaunchState::parse(said.to_string().as_bytes())?;
            let mission = state.mission(&Community::new("lab").unwrap(), &Registry::default());
            mission.map(|mission| mission.apps.len()).map_err(|error| error.to_string())
        };
        assert_eq!(mission(&|_| ()), Ok(4));
        for name in ["../../x", "a/b", "", ".", "-x", &"x".repeat(49)] {
            let said = mission(&|state| state["apps"][1]["name"] = name.into()).unwrap_err();
            assert!(said.contains(&format!("names an app {name:?}, which is no name for one")), "{said}");
        }
        let said = mission(&|state| state["version"] = (VERSION - 1).into()).unwrap_err();
        assert_eq!(
            said,
            format!("its launcher spoke version {} of LAUNCH_STATE, this one speaks {VERSION}", VERSION - 1)
        );
        let said = mission(&|state| state["apps"][0]["policy"]["restart"] = "sometimes".into()).unwrap_err();
        assert!(said.contains("restarts an app \"sometimes\", which means nothing"), "{said}");
    }

    #[test]
    fn a_mission_lives_as_long_as_one_of_its_processes_and_not_of_their_numbers() {
        let own = ProcessId::of(std::process::id() as i32);
        let mut of_another_time = own;
        of_another_time.as_mut().unwrap().started += 1;
        let alive = |change: &dyn Fn(&mut LaunchState)| {
            let mut state = state();
            change(&mut state);
            state.is_alive()
        };
        assert!(!alive(&|_| ()));
        assert!(alive(&|state| state.broker = own) && alive(&|state| state.apps[3].successor = own));
        assert!(!alive(&|state| (state.broker, state.apps[0].process) = (of_another_time, of_another_time)));
    }
}
