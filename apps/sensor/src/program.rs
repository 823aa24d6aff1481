//! A program that is a sensor: one depth source, and a `main` of a line or two.

use std::process::ExitCode;

use elk_bus::AppError;
use elk_mission::{OutsideApp, ParamSpec, Params, element};

use crate::app::app;
use crate::parameters::COMMON;
use crate::source::DepthSource;
use crate::types::TYPES;

/// Runs a source with parameters of its own, `own`, which `make` makes it from, as this process' sensor: what a program's
/// `main` returns. They are checked like those of elk's own types: unit, range, spelling. `make` is given them and those of
/// every sensor ([`COMMON`]), and what it fails with is said.
///
/// The program is told by a launcher who it is (see [`elk_bus::launched`]), and answers `--help` with its parameters. It takes
/// part in a mission whose file says `<Sensor exec="./mine"/>`, or `elk launch … --set Sensor.exec=./mine`, or in a running one
/// by `elk swap Sensor exec=./mine`.
pub fn main<S: DepthSource + 'static>(
    own: &[ParamSpec],
    make: impl FnOnce(&Params) -> Result<S, AppError>,
) -> ExitCode {
    let name = elk_mission::type_name::<S>();
    let program = OutsideApp { element: element::SENSOR, name, common: COMMON, own, others: TYPES };
    program.run(|params| app(params, Box::new(make(params)?)))
}
