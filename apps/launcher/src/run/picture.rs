//! The picture at a run's end, drawn by a process of its own: one that cannot be drawn costs no run, and one that takes too
//! long none of its end.

use std::path::{Path, PathBuf};
use std::process::Command;
use std::time::Duration;

use elk_bus::child::Bond;

use crate::process::child::Process;
use crate::supervisor::Exit;

/// How long a picture may take: it is drawn of what a run has known, in seconds.
const PATIENCE: Duration = Duration::from_secs(60);

/// Has `program` draw the run in `folder`, where its text log goes as well. Whoever draws does not outlive the launcher.
pub(crate) fn draw(program: &Path, folder: &Path) -> Result<PathBuf, String> {
    let mut command = Command::new(program);
    command.arg("picture").arg(folder);
    draw_by(command, &folder.join("picture.log"), PATIENCE).map(|()| folder.join("picture.png"))
}

fn draw_by(command: Command, log: &Path, patience: Duration) -> Result<(), String> {
    let spawned = Process::spawn("the picture", command, log, Bond::Parent);
    let mut artist = spawned.map_err(|error| error.to_string())?;
    if !artist.wait(patience) {
        artist.kill_and_wait();
        return Err(format!("it was not drawn within {} s; `elk picture` does it anew", patience.as_secs()));
    }
    match artist.ended() {
        Some(exit) if exit.fine => Ok(()),
        exit => Err(exit.map_or_else(String::new, Exit::in_short)),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Regression: it ran for minutes after an outlier, and longer than its launcher.
    #[test]
    fn what_is_not_drawn_in_time_is_ended_and_what_fails_says_why() {
        let folder = tempfile::tempdir().unwrap();
        let draw = |script: &str, patience| {
            let mut shell = Command::new("sh");
            shell.args(["-c", script]);
            draw_by(shell, &folder.path().join("picture.log"), patience)
        };
        assert_eq!(draw("exit 0", PATIENCE), Ok(()));
        let failed = draw("echo no map >&2; exit 1", PATIENCE);
        assert_eq!(failed, Err("exit code 1; last line: no map".to_owned()));
        let late = draw("exec sleep 1000", Duration::ZERO).unwrap_err();
        assert!(late.contains("not drawn within 0 s"), "{late}");
    }
}
