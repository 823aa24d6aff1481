//! What people see while a mission runs: one line that is written anew on a terminal, lines now and then elsewhere.

use std::io::{IsTerminal, Write};
use std::time::Duration;

use elk_bus::clock::Stopwatch;
use elk_bus::tell;
use elk_outside::text;

use crate::observer::Observer;

/// How often the line is written anew on a terminal.
const TERMINAL_PERIOD: Duration = Duration::from_millis(100);
/// How often a line is written into a pipe.
const PIPE_PERIOD: Duration = Duration::from_secs(5);
/// To the start of the line, and clear it.
const REWIND: &str = "\r\x1b[2K";

/// Shows how far a mission is.
pub(crate) struct Display {
    terminal: bool,
    columns: usize,
    since_last: Option<Stopwatch>,
    complaints_shown: usize,
}

impl Display {
    /// On standard output; `plain`: as if it were a pipe.
    pub fn new(plain: bool) -> Self {
        let out = std::io::stdout();
        let size = rustix::termios::tcgetwinsize(&out);
        let columns = size.ok().map(|size| usize::from(size.ws_col)).filter(|columns| *columns > 0);
        Self {
            terminal: !plain && out.is_terminal(),
            columns: columns.unwrap_or(80),
            since_last: None,
            complaints_shown: 0,
        }
    }

    /// Says something that is to stay.
    pub fn say(&self, words: &str) {
        self.clear();
        tell(words);
    }

    /// Shows what there is to be seen, if it is time.
    pub fn show(&mut self, observed: &Observer, paused: bool) {
        for complaint in &observed.complaints[self.complaints_shown..] {
            self.say(complaint);
        }
        self.complaints_shown = observed.complaints.len();
        let period = if self.terminal { TERMINAL_PERIOD } else { PIPE_PERIOD };
        if self.since_last.is_none_or(|since| since.elapsed() >= period) {
            self.since_last = Some(Stopwatch::start());
            let paused = if paused { "paused | " } else { "" };
            self.write(&text::printable(&format!("{paused}{}", line(observed))));
        }
    }

    /// Leaves the line, so that whatever comes next stands alone.
    pub fn clear(&self) {
        if self.terminal {
            put(REWIND);
        }
    }

    fn write(&self, line: &str) {
        if self.terminal {
            let fitting: String = line.chars().take(self.columns.saturating_sub(1)).collect();
            put(&format!("{REWIND}{fitting}"));
        } else {
            put(&format!("{line}\n"));
        }
    }
}

/// Writes to standard output at once. A terminal or a reader that has gone is no reason to end a mission.
pub(crate) fn put(text: &str) {
    let mut out = std::io::stdout();
    let _ = out.write_all(text.as_bytes()).and_then(|()| out.flush());
}

fn line(observed: &Observer) -> String {
    let (known, frontier) = observed.map.as_ref().map_or((0, 0), |map| (map.free + map.occupied, map.frontier));
    let (scans, way) = observed.progress.as_ref().map_or((0, 0.0), |progress| (progress.scans, progress.path_length_m));
    let step = observed.steps.whole_step();
    let step = step.map_or(String::new(), |step| format!(" | {:.0} ms a step", step.median_ms));
    let alive: Vec<&str> = observed.clients.iter().map(String::as_str).filter(|name| *name != crate::NAME).collect();
    let alive = alive.join(" ");
    format!("{known} known {frontier} frontier | {scans} scans {way:.1} m{step} | alive: {alive}")
}

#[cfg(test)]
mod tests {
    use elk_spatial::messages::{MapStatus, Progress, RayTally};

    use super::*;

    #[test]
    fn the_line_says_what_a_person_wants_to_know() {
        let mut observed = Observer::default();
        assert_eq!(line(&observed), "0 known 0 frontier | 0 scans 0.0 m | alive: ");
        observed.clients = ["Map", "Sensor", "launcher"].map(str::to_owned).into();
        observed.map = Some(MapStatus {
            revision: 3,
            free: 20,
            occupied: 5,
            frontier: 7,
            resolution: 0.1,
            cpu_secs: 0.0,
            full: false,
            rays: RayTally::default(),
        });
        observed.progress =
            Some(Progress { scan: 3, revision: 3, scans: 3, path_length_m: 1.25, free: 20, finished: false });
        observed.steps.note("Controller", 1.0, true);
        observed.steps.note("Controller", 1.5, true);
        assert_eq!(line(&observed), "25 known 7 frontier | 3 scans 1.2 m | 500 ms a step | alive: Map Sensor");
    }
}
