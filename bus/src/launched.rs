//! What a launcher hands over to an app: all of it is here, and nothing else is.
//!
//! | where | what | without it |
//! |---|---|---|
//! | `ELK_NAME` ([`NAME`]) | the app's name in the mission, which is to be its name on the bus | the program's file name |
//! | `ELK_COMMUNITY` ([`COMMUNITY`]) | the community to join | `elk`, as for every command of elk |
//! | `ELK_LEASE_SECS` ([`LEASE`]) | for how long its mail is kept if it dies: the mission starts it again | it is not kept |
//! | `ELK_SUCCEED` ([`SUCCEED`]) | `1`: it succeeds the app that has its name (`elk swap`) | it does not |
//! | arguments `Name=Value` | its parameters, as the mission says them, and what other apps have in common with it | none |
//! | other arguments | what the mission says in `args="…"`; they stand before the parameters | none |
//!
//! It is started in the folder that the launcher was started in, in a process group of its own, with nothing on standard
//! input, and with its output in `NAME.log` of the run's folder. SIGTERM asks it to end. It counts as started when it has
//! joined and its [`App::on_start_up`](crate::App::on_start_up) is through; [`run_app`](crate::run_app) sees to all of that.
//! By hand it is started as `ELK_COMMUNITY=lab ./my-app Param=Value`.

use std::ffi::OsString;
use std::fmt::{self, Display};
use std::path::Path;
use std::str::FromStr;
use std::time::Duration;

use elk_outside::time::parse_seconds;

use crate::community::{Community, CommunityNameError};
use crate::failure::write_words;

/// Environment variable of an app's process: [`RunOptions::name`].
pub const NAME: &str = "ELK_NAME";
/// Environment variable of an app's process: [`RunOptions::community`].
pub const COMMUNITY: &str = "ELK_COMMUNITY";
/// Environment variable of an app's process: [`RunOptions::lease`].
pub const LEASE: &str = "ELK_LEASE_SECS";
/// Environment variable of an app's process: `1` for [`RunOptions::succeeds`].
pub const SUCCEED: &str = "ELK_SUCCEED";

/// The community of an app that is told none, as of every command of elk.
pub const USUAL_COMMUNITY: &str = "elk";

/// How an app is to be run.
#[derive(Debug, Clone)]
pub struct RunOptions {
    /// The name that the broker will know it by.
    pub name: String,
    /// The community to join.
    pub community: Community,
    /// Which build of which program it is ([`own_build`], unless it says [`crate::build`]): where two builds have different
    /// versions of a type, both are told so.
    pub build: String,
    /// How long its registrations and its mail are kept after its death, for the next of its name; zero: not at all.
    pub lease: Duration,
    /// It succeeds the client that has its name.
    pub succeeds: bool,
    /// Its parameters, as they were said: name and text. See [`RunOptions::param`].
    pub params: Vec<(String, String)>,
    /// Its other arguments.
    pub args: Vec<String>,
}

/// What an app was told and cannot be.
#[derive(thiserror::Error)]
pub enum OptionError {
    /// The community's name is none.
    #[error("{COMMUNITY}: {0}")]
    Community(#[from] CommunityNameError),
    /// An argument or a variable of the environment is no text.
    #[error("{0:?} is no UTF-8; right are names and values that are")]
    Text(OsString),
    /// A variable of the environment says something that it cannot.
    #[error("{name}={said}: {right}")]
    Variable {
        /// The variable.
        name: &'static str,
        /// What it says.
        said: String,
        /// What would be right.
        right: String,
    },
    /// A parameter is said twice.
    #[error("{0} is said twice; once is enough")]
    Twice(String),
    /// A parameter's text is no value of its type.
    #[error("{name}={text}: {why}; without the parameter it is {default}")]
    Value {
        /// The parameter.
        name: String,
        /// What was said.
        text: String,
        /// Why it is none.
        why: String,
        /// What it is if nobody says it.
        default: String,
    },
    /// A parameter or an argument that the app does not have.
    #[error("{said} says nothing to this app; it has {known}")]
    Unknown {
        /// What was said.
        said: String,
        /// What can be said.
        known: String,
    },
}

impl fmt::Debug for OptionError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write_words(f, self)
    }
}

impl RunOptions {
    /// An app of this name in this community, without parameters.
    pub fn new(name: impl Into<String>, community: Community) -> Self {
        Self {
            name: name.into(),
            community,
            build: own_build(),
            lease: Duration::ZERO,
            succeeds: false,
            params: Vec::new(),
            args: Vec::new(),
        }
    }

    /// Its registrations and its mail are kept for so long after its death, for the next of its name.
    pub fn with_lease(self, lease: Duration) -> Self {
        Self { lease, ..self }
    }

    /// It is of this build of this program; [`crate::build`] is that of the crate where it stands.
    pub fn of_build(self, build: impl Into<String>) -> Self {
        Self { build: build.into(), ..self }
    }

    /// It succeeds the client that has its name.
    pub fn as_successor(self) -> Self {
        Self { succeeds: true, ..self }
    }

    /// What a launcher has handed over to this process (see the [module](self)), whether that was `elk launch`, `elk swap`,
    /// or a person at a terminal.
    ///
    /// # Errors
    /// What was handed over is no text, no community's name, no time, or says a parameter twice.
    pub fn from_launcher() -> Result<Self, OptionError> {
        let mut arguments = std::env::args_os();
        let program = arguments.next().map(text).transpose()?.unwrap_or_default();
        Self::from_arguments(&program, arguments.map(text).collect::<Result<_, _>>()?)
    }

    /// As [`RunOptions::from_launcher`], for a program whose arguments are not those of its process: one that is interpreted.
    ///
    /// # Errors
    /// As there.
    pub fn from_arguments(program: &str, arguments: Vec<String>) -> Result<Self, OptionError> {
        Self::told(program, &variable, arguments)
    }

    fn told(program: &str, variable: &Variables<'_>, arguments: Vec<String>) -> Result<Self, OptionError> {
        let own_name = || Path::new(program).file_stem().unwrap_or_default().to_string_lossy().into_owned();
        let community = Community::new(variable(COMMUNITY)?.unwrap_or_else(|| USUAL_COMMUNITY.to_owned()))?;
        let mut options = Self::new(variable(NAME)?.unwrap_or_else(own_name), community).succeeding(variable)?;
        for argument in arguments {
            match argument.split_once('=').map(|(name, text)| (name.trim(), text.trim())) {
                Some((name, _)) if options.text(name).is_some() => return Err(OptionError::Twice(name.to_owned())),
                Some((name, text)) if !name.is_empty() && !name.starts_with('-') => {
                    options.params.push((name.to_owned(), text.to_owned()));
                }
                _ => options.args.push(argument),
            }
        }
        Ok(options)
    }

    /// What a launcher has told this process about leases and succession, in its environment ([`LEASE`] and [`SUCCEED`]):
    /// for a program that is told its name and its community otherwise. [`RunOptions::from_launcher`] has it already.
    ///
    /// # Errors
    /// The lease is no time, or the other one is neither `1` nor `0`.
    pub fn as_launched(self) -> Result<Self, OptionError> {
        self.succeeding(&variable)
    }

    fn succeeding(mut self, variable: &Variables<'_>) -> Result<Self, OptionError> {
        let wrong = |name, said, right| OptionError::Variable { name, said, right };
        if let Some(said) = variable(LEASE)? {
            self.lease = match parse_seconds(&said).map(Duration::try_from_secs_f64) {
                Ok(Ok(lease)) => lease,
                Ok(Err(_)) => return Err(wrong(LEASE, said, "right is 0 s or more".to_owned())),
                Err(right) => return Err(wrong(LEASE, said, right)),
            };
        }
        if let Some(said) = variable(SUCCEED)? {
            self.succeeds = match said.as_str() {
                "1" => true,
                "0" | "" => false,
                _ => return Err(wrong(SUCCEED, said, "right is 1, or 0 as without it".to_owned())),
            };
        }
        Ok(self)
    }

    /// What was said of a parameter. As in MOOS, case does not count.
    pub fn text(&self, name: &str) -> Option<&str> {
        let said = self.params.iter().find(|(other, _)| other.eq_ignore_ascii_case(name));
        said.map(|(_, text)| text.as_str())
    }

    /// The value of a parameter, or `default` if nothing was said of it.
    ///
    /// ```
    /// # use elk_bus::{Community, RunOptions};
    /// # let mut options = RunOptions::new("greeter", Community::new("demo")?);
    /// # options.params.push(("Rate".into(), "4".into()));
    /// let rate_hz: f64 = options.param("Rate", 1.0)?;
    /// assert_eq!(rate_hz, 4.0);
    /// # Ok::<(), elk_bus::Failure>(())
    /// ```
    ///
    /// # Errors
    /// What was said is no such value.
    pub fn param<T>(&self, name: &str, default: T) -> Result<T, OptionError>
    where
        T: FromStr<Err: Display> + Display,
    {
        let Some(text) = self.text(name) else { return Ok(default) };
        text.parse().map_err(|why: T::Err| OptionError::Value {
            name: name.to_owned(),
            text: text.to_owned(),
            why: why.to_string(),
            default: default.to_string(),
        })
    }

    /// Sees that nothing else was said than these parameters: what a mission says is never ignored.
    ///
    /// # Errors
    /// The first argument that is none of them.
    pub fn only(&self, known: &[&str]) -> Result<(), OptionError> {
        let is_known = |name: &str| known.iter().any(|one| one.eq_ignore_ascii_case(name));
        let strange = self.params.iter().find(|(name, _)| !is_known(name)).map(|(name, text)| format!("{name}={text}"));
        match self.args.first().cloned().or(strange) {
            None => Ok(()),
            Some(said) => {
                let known = if known.is_empty() { "no parameters".to_owned() } else { known.join(", ") };
                Err(OptionError::Unknown { said, known })
            }
        }
    }
}

/// This process' program, by its file's name, and the version of elk-bus that is in it: what is to be known of a build of
/// which nobody says more.
pub fn own_build() -> String {
    let program = std::env::current_exe().unwrap_or_default();
    let program = program.file_stem().unwrap_or_default().to_string_lossy();
    format!("{program}, elk-bus {}", env!("CARGO_PKG_VERSION"))
}

/// The name and the version of the crate where it stands, for [`RunOptions::of_build`]: `my-app 0.3.1`.
///
/// ```
/// # use elk_bus::{Community, RunOptions};
/// let options = RunOptions::new("greeter", Community::new("demo")?).of_build(elk_bus::build!());
/// assert!(options.build.starts_with("elk-bus "));
/// # Ok::<(), elk_bus::Failure>(())
/// ```
#[macro_export]
macro_rules! build {
    () => {
        concat!(env!("CARGO_PKG_NAME"), " ", env!("CARGO_PKG_VERSION"))
    };
}

/// What a variable of the environment says.
type Variables<'a> = dyn Fn(&'static str) -> Result<Option<String>, OptionError> + 'a;

/// That of this process.
fn variable(name: &'static str) -> Result<Option<String>, OptionError> {
    std::env::var_os(name).map(text).transpose()
}

fn text(said: OsString) -> Result<String, OptionError> {
    said.into_string().map_err(OptionError::Text)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn launched(variables: &[(&str, &str)], arguments: &[&str]) -> Result<RunOptions, OptionError> {
        let variable = |name: &'static str| {
            let said = variables.iter().find(|(one, _)| *one == name);
            Ok(said.map(|(_, text)| (*text).to_owned()))
        };
        RunOptions::told("target/debug/my-app", &variable, arguments.iter().map(ToString::to_string).collect())
    }

    fn told(name: Option<&str>, community: Option<&str>, arguments: &[&str]) -> Result<RunOptions, OptionError> {
        let variables: Vec<_> =
            [(NAME, name), (COMMUNITY, community)].into_iter().filter_map(|(n, t)| Some((n, t?))).collect();
        launched(&variables, arguments)
    }

    #[test]
    fn a_lease_and_a_succession_are_what_the_environment_says_or_an_error() {
        let options = launched(&[(LEASE, "15"), (SUCCEED, "1")], &[]).unwrap();
        assert_eq!((options.lease, options.succeeds), (Duration::from_secs(15), true));
        let options = launched(&[(SUCCEED, "0")], &[]).unwrap();
        assert_eq!((options.lease, options.succeeds), (Duration::ZERO, false));
        for (name, wrong) in [(LEASE, "soon"), (LEASE, "-1"), (LEASE, "NaN"), (LEASE, ""), (SUCCEED, "yes")] {
            let error = launched(&[(name, wrong)], &[]).unwrap_err().to_string();
            assert!(error.starts_with(&format!("{name}={wrong}: ")) && error.contains("right is"), "{error}");
        }
    }

    #[test]
    fn who_is_told_nothing_has_the_name_of_its_program_in_the_usual_community() {
        let options = told(None, None, &[]).unwrap();
        assert_eq!((options.name.as_str(), options.community.as_str()), ("my-app", "elk"));
        let options = told(Some("Mine"), Some("lab"), &[]).unwrap();
        assert_eq!((options.name.as_str(), options.community.as_str()), ("Mine", "lab"));
    }

    #[test]
    fn parameters_are_told_from_other_arguments() {
        let options = told(None, None, &["-v", "--at=noon", "fast", "Rate=4", "Words= a = b ", "=5"]).unwrap();
        assert_eq!(options.args, ["-v", "--at=noon", "fast", "=5"]);
        assert_eq!(options.text("words"), Some("a = b"));
        assert_eq!(options.param("Rate", 1.5).unwrap(), 4.0);
        assert_eq!(options.param("Depth", 7).unwrap(), 7);
        assert_eq!(options.only(&["Rate"]).unwrap_err().to_string(), "-v says nothing to this app; it has Rate");
    }

    #[test]
    fn what_is_wrong_is_said_with_what_would_be_right() {
        let said = |arguments: &[&str]| told(None, None, arguments).unwrap();
        let error = said(&["Rate=fast"]).param("Rate", 2.5).unwrap_err().to_string();
        assert_eq!(error, "Rate=fast: invalid float literal; without the parameter it is 2.5");
        let error = said(&["Rat=1"]).only(&["Rate", "Depth"]).unwrap_err().to_string();
        assert_eq!(error, "Rat=1 says nothing to this app; it has Rate, Depth");
        assert!(said(&["rate=1"]).only(&["Rate"]).is_ok());
        let error = told(None, None, &["Rate=1", "RATE=2"]).unwrap_err().to_string();
        assert_eq!(error, "RATE is said twice; once is enough");
        let error = told(None, Some("a/b"), &[]).unwrap_err().to_string();
        assert!(error.starts_with("ELK_COMMUNITY: \"a/b\" is no name for a community"), "{error}");
    }
}
