//! `elk`: explores worlds as missions say, one process per app.
//!
//! Raw arguments become a checked configuration (`cli`, `elk_mission`), and only then does anything start.

mod arguments;
mod cli;
mod commands;
mod compare;
mod control;
mod evaluate;
mod log;
mod manual;
mod mapfile;
mod missions;
mod new;
mod pipe;
mod prune;
mod registry;
mod replay;
mod scenery;
mod scope;
mod sensor;
mod target;
mod terminal;
mod version;
mod view;
mod world;

use std::process::ExitCode;

use clap::Parser;

use cli::Cli;
use terminal::complain;

fn main() -> ExitCode {
    elk_bus::let_owner_in();
    match Cli::parse().command.run() {
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
