//! What the command line says of itself, for shells and for `man`.

use std::io::Write;
use std::path::Path;
use std::process::ExitCode;

use anyhow::{Context, Result};
use clap::Command;
use clap_complete::Shell;

use crate::terminal::say;

/// `elk completions`, of a command line `elk`.
pub fn completions(mut elk: Command, shell: Shell) -> Result<ExitCode> {
    let mut script = Vec::new();
    clap_complete::generate(shell, &mut elk, "elk", &mut script);
    // As it is: a shell reads it.
    match std::io::stdout().write_all(&script) {
        Err(error) if error.kind() != std::io::ErrorKind::BrokenPipe => Err(error.into()),
        _ => Ok(ExitCode::SUCCESS),
    }
}

/// `elk man`, of a command line `elk`.
pub fn man(elk: Command, folder: &Path) -> Result<ExitCode> {
    let unwritable = || format!("cannot write the pages into {}", folder.display());
    std::fs::create_dir_all(folder).with_context(unwritable)?;
    clap_mangen::generate_to(elk, folder).with_context(unwritable)?;
    say(&format!("the pages are in {0}: `man {0}/elk.1` shows the first\n", folder.display()))?;
    Ok(ExitCode::SUCCESS)
}
