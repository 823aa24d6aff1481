//! A program outside elk that is an app of a mission, its parameters checked as those of elk's own types are.

use std::io::Write;
use std::path::Path;
use std::process::ExitCode;

use elk_bus::{App, AppError, Failure, RunOptions, run_app, tell};

use crate::describe::describe_params;
use crate::kind::ParamSpec;
use crate::params::Params;
use crate::spec::AppType;

/// What such a program is: what a row of a table of app types is to an app of elk's own.
pub struct OutsideApp<'a> {
    /// The element whose place it takes ([`crate::element`]).
    pub element: &'static str,
    /// What it is called in messages.
    pub name: &'a str,
    /// The parameters that all apps of the element have.
    pub common: &'static [ParamSpec],
    /// Its own parameters.
    pub own: &'a [ParamSpec],
    /// Elk's own types of the element: a mission that names one of them, and says something to it alone, can have it exchanged
    /// for this program, nothing else changed.
    pub others: &'static [AppType],
}

impl OutsideApp<'_> {
    /// Runs the app that `build` makes from its checked parameters, until it ends: what a program's `main` returns.
    ///
    /// It is told by a launcher who it is (see [`elk_bus::launched`]), and answers `--help` with its parameters.
    pub fn run(&self, build: impl FnOnce(&Params) -> Result<Box<dyn App>, AppError>) -> ExitCode {
        match self.serve(build) {
            Ok(()) => ExitCode::SUCCESS,
            Err(failure) => {
                tell(failure);
                ExitCode::FAILURE
            }
        }
    }

    fn serve(&self, build: impl FnOnce(&Params) -> Result<Box<dyn App>, AppError>) -> Result<(), Failure> {
        let who = format!("{} {}", self.element, self.name);
        let options = RunOptions::from_launcher()?;
        let table = self.table()?;
        if options.args.iter().any(|one| one == "--help" || one == "-h") {
            let usage = "as an app of a mission, or by hand: ELK_COMMUNITY=elk PROGRAM Param=Value …";
            let help = format!("{who}, {usage}\n{}", describe_params(table));
            // A reader that has gone is no failure.
            let _ = std::io::stdout().write_all(help.as_bytes());
            return Ok(());
        }
        if let Some(odd) = options.args.first() {
            return Err(format!("{odd:?} says nothing to {who}; right is Param=Value, or --help").into());
        }
        let (others, told): (Vec<_>, Vec<_>) =
            options.params.iter().cloned().partition(|(name, _)| self.is_of_others(table, name));
        for (name, text) in others {
            tell(format_args!("{}: {name}={text} is for another {}: left out", options.name, self.element));
        }
        let params = Params::check(&who, table, &told, Path::new(""))?;
        Ok(run_app(build(&params)?, &options)?)
    }

    /// The parameters that all apps of the element have, and its own.
    fn table(&self) -> Result<&'static [ParamSpec], Failure> {
        let common = |one: &&ParamSpec| self.common.iter().any(|other| other.name.eq_ignore_ascii_case(one.name));
        if let Some(double) = self.own.iter().find(common) {
            return Err(format!(
                "{} is a parameter of every {}; choose another name for that of your own",
                double.name, self.element
            )
            .into());
        }
        // Once a process: tables of app types live as long as that.
        Ok(Vec::leak(self.common.iter().chain(self.own).copied().collect()))
    }

    /// Whether a parameter is one of elk's own types and none of this program's.
    fn is_of_others(&self, table: &[ParamSpec], name: &str) -> bool {
        let has = |params: &[ParamSpec]| params.iter().any(|param| param.name.eq_ignore_ascii_case(name));
        !has(table) && self.others.iter().any(|one| has(one.params))
    }
}

/// The last word of a type's name: `Level` of `mine::Level`. What an app is called that is made of one type.
pub fn type_name<T: ?Sized>() -> &'static str {
    let name = std::any::type_name::<T>();
    let name = name.split('<').next().unwrap_or(name);
    name.rsplit("::").next().unwrap_or(name)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::kind::Kind;

    const fn flag(name: &'static str) -> ParamSpec {
        ParamSpec { name, kind: Kind::Flag, default: Some("true"), doc: "" }
    }

    fn unbuilt(_: &Params) -> Result<Box<dyn App>, AppError> {
        Err("it is only looked at".into())
    }

    static COMMON: &[ParamSpec] = &[flag("Res")];
    static OTHERS: &[AppType] = &[AppType {
        element: "Explorer",
        name: "Other",
        summary: "",
        params: &[flag("Res"), flag("Solver")],
        build: unbuilt,
        preflight: None,
    }];

    #[test]
    fn a_program_has_the_parameters_of_its_element_and_its_own() {
        let own = [flag("Slow")];
        let mut program = OutsideApp { element: "Explorer", name: "Mine", common: COMMON, own: &own, others: OTHERS };
        let table = program.table().unwrap();
        assert_eq!(table.iter().map(|param| param.name).collect::<Vec<_>>(), ["Res", "Slow"]);
        assert!(program.is_of_others(table, "solver"));
        assert!(!program.is_of_others(table, "Slow") && !program.is_of_others(table, "Res"));
        let double = [flag("res")];
        program.own = &double;
        let error = program.table().unwrap_err().to_string();
        assert!(error.starts_with("res is a parameter of every Explorer"), "{error}");
    }
}
