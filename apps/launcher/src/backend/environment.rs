//! How the processes of a mission are started: by which lines, in which folder, under which names.

use std::path::PathBuf;
use std::process::Command;

use elk_bus::launched::{COMMUNITY, NAME};
use elk_bus::{Community, LEASE, SUCCEED};
use elk_mission::{AppSpec, Program, Registry, Restart};

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
    /// What starts the broker, with so much mail kept for each client (MB).
    pub fn broker_command(&self, mailbox_mb: u32) -> Command {
        let mut command = Command::new(&self.program);
        command.arg("db").args(["--community", self.community.as_str()]);
        command.args(["--mailbox", &mailbox_mb.to_string()]);
        command
    }

    /// What starts an app: the same line that a person would type.
    pub fn app_command(&self, app: &AppSpec) -> Command {
        let community = self.community.as_str();
        let settings = app.settings.iter().map(|(name, text)| format!("{name}={text}"));
        let mut command = match &app.program {
            Program::Builtin(app_type, _) => {
                let mut command = Command::new(&self.program);
                command.arg(app_type.element.to_lowercase()).args(["--type", app_type.name]);
                command.args(["--name", &app.name, "--community", community]);
                command
            }
            Program::Foreign { exec, args } => {
                let mut command = Command::new(exec);
                command.args(args).env(COMMUNITY, community).env(NAME, &app.name);
                command
            }
        };
        command.args(settings).env_remove(SUCCEED).env_remove(LEASE);
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
