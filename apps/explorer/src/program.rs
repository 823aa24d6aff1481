//! A program that is an explorer: one strategy, and a `main` that is a line.

use std::io::Write;
use std::path::Path;
use std::process::ExitCode;

use elk_bus::{Failure, RunOptions, run_app, tell};
use elk_mission::{ParamSpec, Params, describe_params};

use crate::app::{COMMON, TYPES, app};
use crate::strategy::{Strategy, type_name};

/// Runs a strategy without parameters of its own as this process' explorer: what a program's `main` returns.
///
/// It is told by a launcher who it is (see [`elk_bus::launched`]), has the parameters of every explorer
/// ([`crate::app::COMMON`]), and answers `--help` with them. It takes part in a mission whose file says
/// `<Explorer exec="./mine"/>`, or `elk launch … --set Explorer.exec=./mine`, or in a running one by
/// `elk swap Explorer exec=./mine`.
pub fn main(strategy: impl Strategy + 'static) -> ExitCode {
    main_with(&[], |_| strategy)
}

/// As [`main`], for a strategy with parameters of its own, `own`, which `make` makes it from. They are checked like those
/// of elk's own types: unit, range, spelling. `make` is given them and those of every explorer.
pub fn main_with<S: Strategy + 'static>(own: &[ParamSpec], make: impl FnOnce(&Params) -> S) -> ExitCode {
    match run(own, make) {
        Ok(()) => ExitCode::SUCCESS,
        Err(failure) => {
            tell(failure);
            ExitCode::FAILURE
        }
    }
}

fn run<S: Strategy + 'static>(own: &[ParamSpec], make: impl FnOnce(&Params) -> S) -> Result<(), Failure> {
    let who = format!("Explorer {}", type_name::<S>());
    let options = RunOptions::from_launcher()?;
    let table = table(own)?;
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
        options.params.iter().cloned().partition(|(name, _)| is_of_others(table, name));
    for (name, text) in others {
        tell(format_args!("{}: {name}={text} is for another explorer: left out", options.name));
    }
    let params = Params::check(&who, table, &told, Path::new(""))?;
    let strategy = Box::new(make(&params));
    Ok(run_app(app(&params, strategy)?, &options)?)
}

/// The parameters that all explorers have, and these.
fn table(own: &[ParamSpec]) -> Result<&'static [ParamSpec], Failure> {
    let common = |one: &&ParamSpec| COMMON.iter().any(|other| other.name.eq_ignore_ascii_case(one.name));
    if let Some(double) = own.iter().find(common) {
        return Err(format!(
            "{} is a parameter of every explorer; choose another name for that of your own",
            double.name
        )
        .into());
    }
    // Once a process: tables of app types live as long as that.
    Ok(Vec::leak(COMMON.iter().chain(own).copied().collect()))
}

/// Whether a parameter is one of elk's own explorers and none of this one: a mission that names an explorer and says
/// something to it alone can have that one exchanged for this one, nothing else changed.
fn is_of_others(table: &[ParamSpec], name: &str) -> bool {
    let has = |params: &[ParamSpec]| params.iter().any(|param| param.name.eq_ignore_ascii_case(name));
    !has(table) && TYPES.iter().any(|one| has(one.params))
}

#[cfg(test)]
mod tests {
    use super::*;
    use elk_mission::Kind;

    const fn flag(name: &'static str) -> ParamSpec {
        ParamSpec { name, kind: Kind::Flag, default: Some("true"), doc: "" }
    }

    #[test]
    fn a_strategy_has_the_parameters_of_every_explorer_and_its_own() {
        let table = table(&[flag("Slow")]).unwrap();
        assert_eq!(table.len(), COMMON.len() + 1);
        assert!(is_of_others(table, "solver") && !is_of_others(table, "Slow") && !is_of_others(table, "Res"));
        let error = super::table(&[flag("res")]).unwrap_err().to_string();
        assert!(error.starts_with("res is a parameter of every explorer"), "{error}");
    }
}
