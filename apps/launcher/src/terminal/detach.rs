//! A launcher that gives the terminal back once its mission runs, and the one at the terminal who waits for that.

use std::fs::OpenOptions;
use std::io::{Read, Write};
use std::os::fd::AsFd;
use std::path::Path;
use std::process::{Command, ExitStatus, Stdio};

use rustix::stdio::{dup2_stderr, dup2_stdin, dup2_stdout};

use crate::error::LaunchError;

/// What the launcher says last to who waits, if the mission runs; no text holds it.
const BEGUN: u8 = 0;
/// Where it says everything from then on, in the run's folder.
const LOG: &str = "launcher.log";

/// Gives the terminal back: what is said from now on goes to a file in the run's folder, and neither Ctrl-C nor the end
/// of the terminal is heard here.
pub(crate) fn leave_terminal(folder: &Path) -> Result<(), LaunchError> {
    let file = folder.join(LOG);
    let unwritable = |source| LaunchError::File { file: file.clone(), source };
    let log = OpenOptions::new().create(true).append(true).open(&file).map_err(unwritable)?;
    let nothing = OpenOptions::new().read(true).open("/dev/null").map_err(unwritable)?;
    // It fails for who leads a session already, and needs none of its own.
    let _ = rustix::process::setsid();
    // What is said already is for them, too.
    let _ = std::io::stdout().flush();
    let who_waits = std::io::stdout().as_fd().try_clone_to_owned().map_err(unwritable)?;
    let moved = dup2_stdin(&nothing).and_then(|()| dup2_stdout(&log)).and_then(|()| dup2_stderr(&log));
    moved.map_err(|error| unwritable(error.into()))?;
    // Who does not wait any more is no reason to end a mission that is to outlive them.
    let _ = rustix::io::write(&who_waits, &[BEGUN]);
    Ok(())
}

/// Starts a launcher that is to give the terminal back, and passes on what it says until it does. How it ended, if it
/// did instead.
///
/// # Errors
/// It cannot be started.
pub fn wait_until_begun(mut command: Command) -> std::io::Result<Option<ExitStatus>> {
    let mut launcher = command.stdin(Stdio::null()).stdout(Stdio::piped()).spawn()?;
    let mut begun = false;
    if let Some(mut said) = launcher.stdout.take() {
        let mut bytes = [0; 4096];
        while !begun {
            let count = match said.read(&mut bytes) {
                Err(error) if error.kind() == std::io::ErrorKind::Interrupted => continue,
                read => read.unwrap_or(0),
            };
            if count == 0 {
                break;
            }
            let words = bytes[..count].split(|byte| *byte == BEGUN).next().unwrap_or_default();
            begun = words.len() < count;
            // A terminal that has gone is no reason to end a mission that is to outlive it.
            let _ = std::io::stdout().write_all(words);
        }
    }
    if begun { Ok(None) } else { launcher.wait().map(Some) }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn waited_for(script: &str) -> Option<i32> {
        let mut shell = Command::new("sh");
        shell.args(["-c", script]);
        wait_until_begun(shell).unwrap().map(|status| status.code().unwrap())
    }

    #[test]
    fn who_waits_is_released_by_a_launcher_that_has_begun_or_ended() {
        assert_eq!(waited_for("printf 'run x\\n\\0'; exec sleep 5 >/dev/null"), None);
        assert_eq!(waited_for("exit 3"), Some(3));
    }
}
