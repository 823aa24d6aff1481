//! The picture at a run's end, drawn by a process of its own: one that cannot be drawn costs no run, and one that takes too
//! long none of its end.

use std::io::Read;
use std::path::{Path, PathBuf};
use std::process::{Child, Command, Stdio};
use std::time::Duration;

use elk_bus::clock::Stopwatch;

use crate::process::{Bond, keep_to_itself};

/// How long a picture may take: it is drawn of what a run has known, in seconds.
const PATIENCE: Duration = Duration::from_secs(60);
/// How often it is looked whether it is there.
const LOOK: Duration = Duration::from_millis(10);

/// Has `program` draw the run in `folder`. Whoever draws does not outlive the launcher.
pub(crate) fn draw(program: &Path, folder: &Path) -> Result<PathBuf, String> {
    let mut command = Command::new(program);
    command.arg("picture").arg(folder).stdin(Stdio::null()).stdout(Stdio::null()).stderr(Stdio::piped());
    draw_by(command, PATIENCE).map(|()| folder.join("picture.png"))
}

fn draw_by(mut command: Command, patience: Duration) -> Result<(), String> {
    let name = command.get_program().display().to_string();
    keep_to_itself(&mut command, Bond::Launcher);
    let mut child = command.spawn().map_err(|error| format!("{name}: {error}"))?;
    match ended_well(&mut child, patience) {
        Some(true) => Ok(()),
        Some(false) => Err(last_words(&mut child)),
        None => Err(format!("it was not drawn within {} s; `elk picture` does it anew", patience.as_secs())),
    }
}

/// Whether it ended, and well; `None`: it had to be ended.
fn ended_well(child: &mut Child, patience: Duration) -> Option<bool> {
    let clock = Stopwatch::start();
    while clock.elapsed() < patience {
        match child.try_wait() {
            Ok(Some(status)) => return Some(status.success()),
            Ok(None) => std::thread::sleep(LOOK),
            Err(_) => break,
        }
    }
    // What cannot be killed has ended.
    let _ = child.kill();
    let _ = child.wait();
    None
}

fn last_words(child: &mut Child) -> String {
    let mut words = Vec::new();
    if let Some(said) = &mut child.stderr {
        // What cannot be read was not said.
        let _ = said.take(4096).read_to_end(&mut words);
    }
    String::from_utf8_lossy(&words).trim().to_owned()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn shell(script: &str) -> Command {
        let mut command = Command::new("sh");
        command.args(["-c", script]).stdin(Stdio::null()).stdout(Stdio::null()).stderr(Stdio::piped());
        command
    }

    /// Regression: it ran for minutes after a stray point, and longer than its launcher.
    #[test]
    fn what_is_not_drawn_in_time_is_ended_and_what_fails_says_why() {
        assert_eq!(draw_by(shell("exit 0"), PATIENCE), Ok(()));
        assert_eq!(draw_by(shell("echo no map >&2; exit 1"), PATIENCE), Err("no map".to_owned()));
        let late = draw_by(shell("exec sleep 1000"), Duration::ZERO).unwrap_err();
        assert!(late.contains("not drawn within 0 s"), "{late}");
    }
}
