//! `elk`: explores worlds as missions say, one process per app.
//!
//! Raw arguments become a checked configuration (`cli`, `elk_mission`), and only then does anything start.

mod arguments;
mod cli;
mod commands;
mod compare;
mod control;
mod log;
mod manual;
mod missions;
mod new;
mod prune;
mod registry;
mod replay;
mod scope;
mod target;
mod terminal;
mod version;
mod world;

use std::process::ExitCode;

use clap::Parser;
use elk_launcher::Request;

use cli::{Cli, Command};
use terminal::complain;

fn main() -> ExitCode {
    elk_bus::let_owner_in();
    let done = match Cli::parse().command {
        Command::Launch(arguments) => commands::launch(arguments),
        Command::Attach(arguments) => commands::attach(arguments),
        Command::Apps(arguments) => control::apps(&arguments),
        Command::Stop(arguments) => control::stop(arguments),
        Command::Start(arguments) => control::start(arguments),
        Command::Swap(arguments) => control::swap(arguments),
        Command::Pause(arguments) => control::motion(&arguments.community, &Request::Pause),
        Command::Resume(arguments) => control::motion(&arguments.community, &Request::Resume),
        Command::Step(arguments) => control::motion(&arguments.community, &Request::Step),
        Command::Check(arguments) => commands::check(&arguments),
        Command::Compare(arguments) => compare::compare(&arguments),
        Command::New(arguments) => new::new(&arguments),
        Command::Missions => commands::missions(),
        Command::Completions { shell } => manual::completions(shell),
        Command::Man { folder } => manual::man(&folder),
        Command::Types { element } => commands::types(element.as_deref()),
        Command::Db(arguments) => commands::db(arguments),
        Command::Sensor(app) => commands::app("Sensor", app),
        Command::Filter(app) => commands::app("Filter", app),
        Command::Map(app) => commands::app("Map", app),
        Command::Explorer(app) => commands::app("Explorer", app),
        Command::Controller(app) => commands::app("Controller", app),
        Command::Logger(app) => commands::app("Logger", app),
        Command::Scope(command) => scope::run(command),
        Command::Replay(arguments) => replay::run(*arguments),
        Command::Log { command } => log::run(command),
        Command::World { command } => world::run(command),
        Command::Picture { run } => commands::picture(&run),
        Command::Guard => commands::guard(),
    };
    match done {
        Ok(code) => code,
        Err(error) => {
            complain(&in_one_line(&error));
            ExitCode::FAILURE
        }
    }
}

/// An error and its causes; a cause that an error quotes itself is not said again.
fn in_one_line(error: &anyhow::Error) -> String {
    error.chain().map(ToString::to_string).fold(String::new(), |said, next| match said.as_str() {
        "" => next,
        _ if said.contains(&next) => said,
        _ => format!("{said}: {next}"),
    })
}
