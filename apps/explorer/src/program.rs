//! A program that is an explorer: one strategy, and a `main` that is a line.

use std::process::ExitCode;

use elk_mission::{OutsideApp, ParamSpec, Params, element, type_name};

use crate::app::{COMMON, app};
use crate::strategies::TYPES;
use crate::strategy::Strategy;

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
    let name = type_name::<S>();
    let program = OutsideApp { element: element::EXPLORER, name, common: COMMON, own, others: TYPES };
    program.run(|params| app(params, Box::new(make(params))))
}
