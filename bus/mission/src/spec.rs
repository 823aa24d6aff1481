//! What a mission is made of: types of apps, and apps of these types, all of it checked.
//!
//! A type can look at the mission that its app is part of before it starts, so both stand here.

use std::collections::BTreeSet;
use std::path::{Path, PathBuf};
use std::process::Command;

use elk_bus::launched::{COMMUNITY, LEASE, NAME, SUCCEED};
use elk_bus::moos::gateway::GatewayOptions;
use elk_bus::{App, AppError, Community};
use serde::{Deserialize, Serialize};

use crate::element::CONTROLLER;
use crate::executable::executable;
use crate::kind::ParamSpec;
use crate::params::Params;
use crate::policy::Policy;

/// One type of app, as it is offered to mission files and to `elk types`.
pub struct AppType {
    /// The element that names it in a mission file: `Sensor`, `Filter`, `Map`, `Explorer`, `Controller`, `Logger`.
    pub element: &'static str,
    /// The value of the element's `type` attribute.
    pub name: &'static str,
    /// One sentence for people.
    pub summary: &'static str,
    /// Its parameters.
    pub params: &'static [ParamSpec],
    /// Makes the app from checked parameters; what the parameters cannot show (a file that does not parse) is an error.
    pub build: fn(&Params) -> Result<Box<dyn App>, AppError>,
    /// Looks at what an app needs before a mission is started; `None`: it is enough that it can be built.
    pub preflight: Option<Preflight>,
}

/// How an app type looks at what one of its apps needs, in the mission that it is part of. It starts and changes
/// nothing.
pub type Preflight = fn(&Params, &Mission) -> PreflightReport;

/// What such a look came to.
#[derive(Debug, Clone, PartialEq, Eq, Default)]
pub struct PreflightReport {
    /// Why the app could not do its work; what was found and what would be right.
    pub faults: Vec<String>,
    /// What will probably not be as it was meant.
    pub warnings: Vec<String>,
}

impl PreflightReport {
    /// One fault.
    pub fn fault(what: impl ToString) -> Self {
        Self { faults: vec![what.to_string()], warnings: Vec::new() }
    }
}

/// A checked mission.
#[derive(Debug, Clone)]
pub struct Mission {
    /// Its name, for people.
    pub name: String,
    /// The file that it was read from.
    pub file: PathBuf,
    /// That file, byte for byte; empty: it was not read from one.
    pub bytes: Vec<u8>,
    /// Whether it waits for a person before each step: as `Manual` of its controller says, else as the Scenario's type does.
    pub mode: Mode,
    /// What happens when its broker dies.
    pub broker: Policy,
    /// Mail that its broker keeps for each client (MB).
    pub mailbox_mb: u32,
    /// How many times as fast as the wall's the community's clock runs.
    pub time_warp: f64,
    /// The community that it is launched in, unless somebody says another; `None`: the usual one.
    pub community: Option<Community>,
    /// How long the start of an `<App>` waits for the one before (s).
    pub launch_pause_secs: f64,
    /// Where clients of MOOS' may connect; `None`: nowhere.
    pub moos: Option<GatewayOptions>,
    /// Its apps, in the order of the file; a logger that the file does not name comes last.
    pub apps: Vec<AppSpec>,
    /// What of its file is not as it says, with file and line.
    pub notes: Vec<String>,
}

/// How a mission runs.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Mode {
    /// Straight through.
    Auto,
    /// Waits for a person before each step.
    Manual,
}

/// One app of a mission.
#[derive(Debug, Clone)]
pub struct AppSpec {
    /// Its name, unique in the mission; it is also its name on the bus.
    pub name: String,
    /// Its element: `Sensor`, `Filter`, …
    pub element: String,
    /// What runs.
    pub program: Program,
    /// What happens when it dies or hangs.
    pub policy: Policy,
    /// Names of the parameters that somebody set; the others have their type's defaults.
    pub said: BTreeSet<String>,
    /// Its parameters as text that says the same wherever it is read, defaults included: `elk <element> Param=Value…`.
    pub settings: Vec<(String, String)>,
}

/// What runs as an app.
#[derive(Debug, Clone)]
pub enum Program {
    /// One of the registry's types.
    Builtin(&'static AppType, Params),
    /// Any other executable.
    Foreign {
        /// The executable: a path, or a name that is looked for in `PATH`.
        exec: PathBuf,
        /// Its arguments; what it is told besides comes behind them, to a program of MOOS' before them.
        args: Vec<String>,
        /// How it comes to the bus.
        via: Via,
    },
}

/// How a program of somebody else's comes to the bus.
#[derive(Debug, Clone, Default, PartialEq, Eq, Serialize, Deserialize)]
pub enum Via {
    /// By itself: it finds the broker by its environment, and has its parameters as arguments.
    #[default]
    Itself,
    /// It reads and writes lines, and `elk pipe` is on the bus for it.
    Lines,
    /// As a client of MOOS': a `.moos` file says where to, and what its parameters are. The one in here is what that file
    /// says besides.
    Moos(Option<PathBuf>),
}

/// Whether a file is one of MOOS', by its name.
pub fn is_moos_file(file: &Path) -> bool {
    file.extension().is_some_and(|extension| extension.eq_ignore_ascii_case("moos"))
}

impl Via {
    /// Its word in missions and tables: `exec`, `pipe`, `moos`.
    pub fn word(&self) -> &'static str {
        match self {
            Self::Itself => "exec",
            Self::Lines => "pipe",
            Self::Moos(_) => "moos",
        }
    }

    /// As a client of MOOS', told what this `.moos` file says, wherever it is started.
    pub fn of_file(file: &Path) -> Self {
        Self::Moos(Some(std::path::absolute(file).unwrap_or_else(|_| file.to_owned())))
    }

    /// What is meant by `moos="…"`: `true`, `false`, or a `.moos` file, looked for from `folder`.
    ///
    /// # Errors
    /// It is none of these, in words.
    pub fn of_moos(said: &str, folder: &Path) -> Result<Self, String> {
        match said {
            "true" => Ok(Self::Moos(None)),
            "false" => Ok(Self::Itself),
            file if is_moos_file(Path::new(file)) => Ok(Self::of_file(&folder.join(file))),
            other => Err(format!("moos {other:?} is not offered; right is true, false or a .moos file")),
        }
    }
}

impl AppType {
    /// The parameter of this name. As in MOOS, case does not count.
    pub fn param(&self, name: &str) -> Option<&'static ParamSpec> {
        self.params.iter().find(|param| param.name.eq_ignore_ascii_case(name))
    }

    /// `Filter Distance`
    pub(crate) fn title(&self) -> String {
        format!("{} {}", self.element, self.name)
    }
}

impl std::fmt::Debug for AppType {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        write!(f, "{} {}", self.element, self.name)
    }
}

impl Mission {
    /// Whether it explores, and so comes to an end of its own; or it is programs that want a community, for as long as they run.
    pub fn explores(&self) -> bool {
        self.of_element(CONTROLLER).next().is_some()
    }

    /// The apps of an element, in the order of the file.
    pub fn of_element(&self, element: &str) -> impl Iterator<Item = &AppSpec> {
        self.apps.iter().filter(move |app| app.element == element)
    }
}

impl Program {
    /// The file that runs, found as it will be at the start: a path as it is, a bare name in `PATH`; none: it is elk itself.
    ///
    /// # Errors
    /// There is none that can be run, in words.
    pub fn executable(&self) -> Result<Option<PathBuf>, String> {
        match self {
            Self::Builtin(..) => Ok(None),
            Self::Foreign { exec, .. } => executable(&exec.to_string_lossy(), Path::new("")).map(Some),
        }
    }
}

impl AppSpec {
    /// The type's name; `exec` for another executable, `pipe` for one that reads and writes lines, `moos` for one of MOOS'.
    pub fn type_name(&self) -> &str {
        match &self.program {
            Program::Builtin(app_type, _) => app_type.name,
            Program::Foreign { via, .. } => via.word(),
        }
    }

    /// What starts it as a process of its own in this community: the same line that a person would type. `elk` is elk's own
    /// program, which has the built-in types. In `folder` a program of MOOS' finds its file ([`AppSpec::moos_file`]).
    pub fn command(&self, elk: &Path, community: &Community, folder: &Path) -> Command {
        let settings = self.settings.iter().map(|(name, text)| format!("{name}={text}"));
        let mut command = match &self.program {
            Program::Builtin(app_type, _) => {
                let mut command = Command::new(elk);
                command.arg(app_type.element.to_lowercase()).args(["--type", app_type.name]);
                command.args(["--name", &self.name, "--community", community.as_str()]).args(settings);
                command
            }
            Program::Foreign { exec, args, via: Via::Itself } => {
                let mut command = Command::new(exec);
                command.args(args).env(COMMUNITY, community.as_str()).env(NAME, &self.name).args(settings);
                command
            }
            // As pAntler does it.
            Program::Foreign { exec, args, via: Via::Moos(_) } => {
                let mut command = Command::new(exec);
                command.arg(self.moos_file(folder)).arg(&self.name).args(args);
                command
            }
            Program::Foreign { exec, args, via: Via::Lines } => {
                let mut command = Command::new(elk);
                command.args(["pipe", &self.name, "--community", community.as_str()]).args(settings);
                command.arg("--").arg(exec).args(args);
                command
            }
        };
        command.env_remove(SUCCEED).env_remove(LEASE);
        command
    }

    /// The text of a parameter.
    pub fn setting(&self, name: &str) -> Option<&str> {
        let mut settings = self.settings.iter();
        settings.find(|(key, _)| key == name).map(|(_, text)| text.as_str())
    }

    /// Where the file of a program of MOOS' is, of those in `folder`.
    pub fn moos_file(&self, folder: &Path) -> PathBuf {
        folder.join(format!("{}.moos", self.name))
    }

    /// Whether it comes as a client of MOOS', of whom no two can have one name, not even for a moment.
    pub fn is_moos(&self) -> bool {
        matches!(self.program, Program::Foreign { via: Via::Moos(_), .. })
    }

    /// Whether it is one of the registry's types.
    pub fn is_builtin(&self) -> bool {
        matches!(self.program, Program::Builtin(..))
    }

    /// Whether its type has a parameter of this name; another executable has whatever it is given.
    pub fn takes(&self, name: &str) -> bool {
        match &self.program {
            Program::Builtin(app_type, _) => app_type.param(name).is_some(),
            Program::Foreign { .. } => self.setting(name).is_some(),
        }
    }
}
