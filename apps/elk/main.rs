//! `elk`: explores worlds as missions say, one process per app.
//!
//! Raw arguments become a checked configuration (`cli`, `elk_mission`), and only then does anything start.

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
mod world;

use std::io::Write;
use std::process::ExitCode;

use clap::Parser;
use elk_bus::tell;
use elk_outside::colour::{self, Style};
use elk_outside::text;

use cli::Cli;

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

/// Says what is wrong on standard error. Names of files and of other people's apps may be in it: the terminal only shows
/// them, and only as much as is of use.
fn complain(words: &str) {
    const MOST: usize = 16_000;
    let words = text::clipped(words, MOST);
    let stderr = std::io::stderr();
    if colour::on(&stderr) {
        let line = format!("{} {}\n", Style::Bad.paint("elk:", true), text::printable_lines(&words));
        // A terminal that is gone shows nothing.
        let _ = stderr.lock().write_all(line.as_bytes());
    } else {
        tell(format_args!("elk: {words}"));
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
