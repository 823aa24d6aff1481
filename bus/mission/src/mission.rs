//! A mission, checked: what a launcher starts.

use std::collections::BTreeSet;
use std::path::{Path, PathBuf};

use elk_outside::file;

use crate::exchange::executable;
use crate::params::Params;
use crate::policy::Policy;
use crate::problem::{Findings, Problems};
use crate::registry::Registry;
use crate::scenario;
use crate::setting::Override;
use crate::source;
use crate::spec::AppType;

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
    /// Its apps, in the order of the file; a logger that the file does not name comes last.
    pub apps: Vec<AppSpec>,
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
        /// Arguments before its parameters.
        args: Vec<String>,
    },
}

/// Why there is no mission.
#[derive(Debug, thiserror::Error)]
pub enum MissionError {
    /// The file cannot be read.
    #[error("cannot read the mission file {}: {source}", .file.display())]
    Unreadable {
        /// The file.
        file: PathBuf,
        /// Why.
        source: std::io::Error,
    },
    /// The mission, or what the command line changes in it, is wrong.
    #[error(transparent)]
    Wrong(#[from] Problems),
}

impl Mission {
    /// The longest mission file that is read (bytes); one of a thousand apps is shorter.
    pub const LONGEST: u64 = 512_000;
    /// The longest mission that a run keeps as it ran (bytes): every default is said in it, and a character of a text may
    /// have become six.
    pub const LONGEST_EFFECTIVE: u64 = 16 * Self::LONGEST;

    /// Reads and checks a mission file, changed by `overrides`.
    ///
    /// # Errors
    /// The file cannot be read, or everything that is wrong with it.
    pub fn load(file: &Path, registry: &Registry, overrides: &[Override]) -> Result<Self, MissionError> {
        Self::load_up_to(Self::LONGEST, file, registry, overrides)
    }

    /// As [`Mission::load`], of a mission as it ran ([`Mission::to_xml`]).
    ///
    /// # Errors
    /// As there.
    pub fn load_effective(file: &Path, registry: &Registry, overrides: &[Override]) -> Result<Self, MissionError> {
        Self::load_up_to(Self::LONGEST_EFFECTIVE, file, registry, overrides)
    }

    fn load_up_to(
        longest: u64,
        file: &Path,
        registry: &Registry,
        overrides: &[Override],
    ) -> Result<Self, MissionError> {
        let unreadable = |source| MissionError::Unreadable { file: file.to_owned(), source };
        let bytes = file::read(file, longest).map_err(unreadable)?;
        let text = source::text_of(&bytes).map_err(|(findings, text)| findings.located(file, &text))?;
        Ok(Self { bytes, ..Self::parse(&text, file, registry, overrides)? })
    }

    /// Checks the text of a mission file; `file` is named in errors, and relative files are looked for beside it.
    ///
    /// # Errors
    /// Everything that is wrong with it.
    pub fn parse(text: &str, file: &Path, registry: &Registry, overrides: &[Override]) -> Result<Self, Problems> {
        let mut problems = Findings::default();
        let mission = scenario::check(text, file, registry, overrides, &mut problems);
        match mission {
            Some(mission) if problems.is_empty() => Ok(mission),
            _ => Err(problems.located(file, text)),
        }
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
    /// The type's name; `exec` for another executable.
    pub fn type_name(&self) -> &str {
        match &self.program {
            Program::Builtin(app_type, _) => app_type.name,
            Program::Foreign { .. } => "exec",
        }
    }

    /// The text of a parameter.
    pub fn setting(&self, name: &str) -> Option<&str> {
        let mut settings = self.settings.iter();
        settings.find(|(key, _)| key == name).map(|(_, text)| text.as_str())
    }

    /// Sets a parameter, checked as if it stood in the mission file.
    ///
    /// # Errors
    /// What is wrong with it.
    pub fn set(&mut self, name: &str, text: &str) -> Result<(), Problems> {
        let mut settings = self.settings.clone();
        match settings.iter_mut().find(|(key, _)| key == name) {
            Some((_, value)) => *value = text.to_owned(),
            None => settings.push((name.to_owned(), text.to_owned())),
        }
        if let Program::Builtin(app_type, params) = &mut self.program {
            *params = app_type.check(&settings, Path::new(""))?;
        }
        self.settings = settings;
        self.said.insert(name.to_owned());
        Ok(())
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
