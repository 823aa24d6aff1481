//! `elk pipe`: a program in any language as an app.

use std::process::{Command, ExitCode};

use anyhow::{Result, bail};
use clap::Args;
use elk_bus::{RunOptions, run_app};
use elk_pipe::{PipeApp, Registration};

use crate::arguments::CommunityArgs;
use crate::version::BUILD;

/// Which program, under which name.
#[derive(Debug, Args)]
pub struct PipeArgs {
    /// Its name on the bus
    pub name: String,
    /// Hear these variables, at most RATE messages a second of each; without any, the program says itself what it wants to hear,
    /// and when it is ready
    #[arg(long, value_name = "PATTERN[@RATE]")]
    pub subscribe: Vec<Registration>,
    /// Which community.
    #[command(flatten)]
    pub community: CommunityArgs,
    /// Parameters that the program is told
    #[arg(value_name = "PARAM=VALUE", value_parser = crate::arguments::setting)]
    pub settings: Vec<(String, String)>,
    /// The program and its arguments
    #[arg(last = true, required = true, value_name = "PROGRAM")]
    pub program: Vec<String>,
}

/// `elk pipe`
pub fn pipe(arguments: PipeArgs) -> Result<ExitCode> {
    let PipeArgs { name, subscribe, community, settings, program } = arguments;
    let [program, arguments @ ..] = &program[..] else { bail!("there is no program; right is -- PROGRAM ARGUMENTS") };
    let mut command = Command::new(program);
    command.args(arguments);
    let app = PipeApp::new(command, settings, subscribe);
    let options = RunOptions::new(name, community.community).of_build(BUILD).as_launched()?;
    run_app(Box::new(app), &options)?;
    Ok(ExitCode::SUCCESS)
}
