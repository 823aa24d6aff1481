//! How the processes of a mission are started: by which lines, in which folder, under which names.

use std::path::PathBuf;
use std::process::Command;

use elk_bus::moos::gateway::GatewayOptions;
use elk_bus::{Community, LEASE};
use elk_mission::{AppSpec, Registry, Restart};

use crate::run::files::RunFiles;

/// The broker's name among the processes.
pub(crate) const DB: &str = "db";
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

impl Environment {
    /// What starts the broker, with so much mail kept for each client (MB), and perhaps with clients of MOOS'.
    pub fn broker_command(&self, mailbox_mb: u32, moos: Option<&GatewayOptions>) -> Command {
        let mut command = Command::new(&self.program);
        command.arg("db").args(["--community", self.community.as_str()]);
        command.args(["--mailbox", &mailbox_mb.to_string()]);
        if let Some(moos) = moos {
            command.args(["--moos", &moos.address.to_string()]);
            moos.networks.iter().for_each(|one| _ = command.args(["--moos-from", &one.to_string()]));
            command.args(moos.any_source.then_some("--moos-any-source"));
            moos.texts.patterns().for_each(|one| _ = command.args(["--moos-text", one]));
        }
        command
    }

    /// What starts an app, and says how long its mail is kept should it die.
    pub fn app_command(&self, app: &AppSpec) -> Command {
        let mut command = app.command(&self.program, &self.community);
        if app.policy.restart != Restart::Never {
            command.env(LEASE, LEASE_SECS.to_string());
        }
        command
    }

    /// The text log of the broker or an app. Names of apps have a grammar (see `elk_mission`): none is a path.
    pub fn log_of(&self, name: &str) -> PathBuf {
        self.files.folder.join(format!("{name}.log"))
    }
}
