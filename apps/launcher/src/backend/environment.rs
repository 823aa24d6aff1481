//! How the processes of a mission are started: by which lines, in which folder, under which names.

use std::path::PathBuf;
use std::process::Command;

use elk_bus::moos::gateway::GatewayOptions;
use elk_bus::{Community, LEASE};
use elk_mission::{AppSpec, Mission, MoosServer, Registry, Restart};

use crate::error::LaunchError;
use crate::run::files::RunFiles;

/// The broker's name among the processes.
pub(crate) const DB: &str = "db";
/// The folder within the run's where programs of MOOS' find their files.
const MOOS_FILES: &str = "moos";
/// How long the broker keeps what a restarted app missed: longer than the longest pause before a restart and the start
/// itself.
const LEASE_SECS: u32 = 15;

/// Where a mission's processes are started, and as whose.
pub(crate) struct Environment {
    /// The program whose commands are run: elk itself.
    pub program: PathBuf,
    pub community: Community,
    pub files: RunFiles,
    pub registry: Registry,
    /// Whether they go on when the launcher is gone.
    pub detached: bool,
}

/// How a mission's broker is to be.
#[derive(Debug, Clone)]
pub(crate) struct BrokerSetup {
    /// Mail that is kept for each client (MB).
    mailbox_mb: u32,
    /// How many times as fast as the wall's its clock runs.
    time_warp: f64,
    /// Where clients of MOOS' connect, if they may.
    moos: Option<GatewayOptions>,
}

impl BrokerSetup {
    /// That of a mission.
    pub fn of(mission: &Mission) -> Self {
        let Mission { mailbox_mb, time_warp, moos, .. } = mission;
        Self { mailbox_mb: *mailbox_mb, time_warp: *time_warp, moos: moos.clone() }
    }
}

impl Environment {
    /// What starts the broker.
    pub fn broker_command(&self, setup: &BrokerSetup) -> Command {
        let mut command = Command::new(&self.program);
        command.arg("db").args(["--community", self.community.as_str()]);
        command.args(["--mailbox", &setup.mailbox_mb.to_string(), "--time-warp", &setup.time_warp.to_string()]);
        if let Some(moos) = &setup.moos {
            let connections = moos.connections.to_string();
            command.args(["--moos", &moos.address.to_string(), "--moos-connections", &connections]);
            moos.networks.iter().for_each(|one| _ = command.args(["--moos-from", &one.to_string()]));
            command.args(moos.any_source.then_some("--moos-any-source"));
            moos.texts.patterns().for_each(|one| _ = command.args(["--moos-text", one]));
        }
        command
    }

    /// What starts an app, and says how long its mail is kept should it die. A program of MOOS' finds in its file where the
    /// broker is that is set up so.
    pub fn app_command(&self, app: &AppSpec, setup: &BrokerSetup) -> Result<Command, LaunchError> {
        let moos_files = self.files.folder.join(MOOS_FILES);
        if let Some(moos) = &setup.moos {
            let server = MoosServer {
                host: moos.address.host_to_connect_to(),
                port: moos.address.port(),
                community: self.community.as_str(),
                time_warp: setup.time_warp,
            };
            let file = app.moos_file(&moos_files);
            let unwritable = |source| LaunchError::MoosFile { app: app.name.clone(), file: file.clone(), source };
            if let Some(text) = app.moos_text(&server).map_err(unwritable)? {
                let written = std::fs::create_dir_all(&moos_files)
                    .and_then(|()| elk_outside::file::place(&file, text.as_bytes()));
                written.map_err(unwritable)?;
            }
        }
        let mut command = app.command(&self.program, &self.community, &moos_files);
        if app.policy.restart != Restart::Never {
            command.env(LEASE, LEASE_SECS.to_string());
        }
        Ok(command)
    }

    /// The text log of the broker or an app. Names of apps have a grammar (see `elk_mission`): none is a path.
    pub fn log_of(&self, name: &str) -> PathBuf {
        self.files.folder.join(format!("{name}.log"))
    }
}
