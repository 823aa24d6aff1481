//! What people see while a mission runs: one line that is written anew on a terminal, lines now and then elsewhere.

use std::collections::VecDeque;
use std::io::{IsTerminal, Write};
use std::time::Duration;

use elk_bus::clock::Stopwatch;
use elk_bus::tell;
use elk_mission::{Mission, Program, element};
use elk_outside::screen::Screen;
use elk_outside::text;

use crate::reports::observer::Observer;

/// How often the line is written anew on a terminal.
const TERMINAL_PERIOD: Duration = Duration::from_millis(100);
/// How often a line is written into a pipe.
const PIPE_PERIOD: Duration = Duration::from_secs(5);
/// How long nothing may have come before that is shown (s).
const SILENCE_SECS: f64 = 2.0;
/// Over how long a time scans are counted (s).
const RATE_SECS: f64 = 5.0;
/// To the start of the line, and clear it.
const REWIND: &str = "\r\x1b[2K";

/// Shows how far a mission is.
pub(crate) struct Display {
    terminal: bool,
    /// Whether the mission is over and there is no line any more.
    closed: bool,
    running: Stopwatch,
    since_last: Option<Stopwatch>,
    complaints_shown: usize,
    what: Shown,
    rate: ScanRate,
}

impl Display {
    /// On standard output; `plain`: as if it were a pipe.
    pub fn new(plain: bool, what: Shown) -> Self {
        Self {
            terminal: !plain && std::io::stdout().is_terminal(),
            closed: false,
            running: Stopwatch::start(),
            since_last: None,
            complaints_shown: 0,
            what,
            rate: ScanRate::default(),
        }
    }

    /// Says something on standard error that is to stay.
    pub fn say(&self, words: &str) {
        self.clear();
        tell(words);
    }

    /// Says something on standard output that is to stay.
    pub fn put(&self, words: &str) {
        self.clear();
        put(&format!("{}\n", text::printable(words)));
    }

    /// Shows what there is to be seen, if it is time.
    pub fn show(&mut self, observed: &Observer, paused: bool) {
        for complaint in &observed.complaints[self.complaints_shown..] {
            self.say(complaint);
        }
        self.complaints_shown = observed.complaints.len();
        let period = if self.terminal { TERMINAL_PERIOD } else { PIPE_PERIOD };
        if !self.closed && self.since_last.is_none_or(|since| since.elapsed() >= period) {
            self.since_last = Some(Stopwatch::start());
            let secs = self.running.elapsed().as_secs_f64();
            self.rate.note(secs, scans(observed));
            let words = self.what.line(observed, secs, self.rate.per_sec(), paused);
            self.write(&text::printable(&words));
        }
    }

    /// Takes the line away for good: what comes from now on stands alone.
    pub fn close(&mut self) {
        self.clear();
        self.closed = true;
    }

    fn clear(&self) {
        if self.terminal && !self.closed {
            put(REWIND);
        }
    }

    fn write(&self, line: &str) {
        match Screen::of(&std::io::stdout()).filter(|_| self.terminal) {
            // The last column stays free: what reaches it may go on in the next line.
            Some(screen) => put(&format!("{REWIND}{}", text::clipped_at_words(line, screen.columns.saturating_sub(1)))),
            None => put(&format!("{line}\n")),
        }
    }
}

/// Writes to standard output at once. A terminal or a reader that has gone is no reason to end a mission.
pub(crate) fn put(text: &str) {
    let mut out = std::io::stdout();
    let _ = out.write_all(text.as_bytes()).and_then(|()| out.flush());
}

/// What of a mission is to be shown.
#[derive(Debug, Default)]
pub(crate) struct Shown {
    /// Names of its apps: whoever else is on the bus is no part of it.
    apps: Vec<String>,
    /// Who plans.
    explorer: String,
    /// The volume that is to be explored (m³), if the mission names one.
    region: Option<f64>,
    /// Whether it explores at all.
    explores: bool,
}

impl Shown {
    /// That of a mission.
    pub fn of(mission: &Mission) -> Self {
        let mut explorers = mission.of_element(element::EXPLORER);
        let size = explorers.find_map(|app| match &app.program {
            Program::Builtin(app_type, params) => app_type.param("Dim").map(|_| params.point("Dim")),
            Program::Foreign { .. } => None,
        });
        let volume = size.map(|[x, y, z]| x * y * z).filter(|volume| *volume > 0.0);
        let explorer = mission.of_element(element::EXPLORER).map(|app| app.name.clone()).next().unwrap_or_default();
        let apps = mission.apps.iter().map(|app| app.name.clone()).collect();
        Self { apps, explorer, region: volume, explores: mission.explores() }
    }

    fn line(&self, observed: &Observer, secs: f64, scans_per_sec: f64, paused: bool) -> String {
        let mut parts = vec![clock(secs)];
        if paused {
            parts.push("paused".to_owned());
        }
        if self.explores {
            parts.push(self.coverage(observed));
            let way = observed.progress.as_ref().map_or(0.0, |progress| progress.path_length_m);
            parts.push(format!("{} scans, {scans_per_sec:.1}/s, {way:.1} m", scans(observed)));
        }
        parts.extend(observed.steps.whole_step().map(|step| format!("{:.0} ms a step", step.median_ms)));
        if let Some((since, plans)) = observed.since_last_word.filter(|_| !paused && !observed.finished()) {
            parts.extend(self.silence(since.elapsed().as_secs_f64(), plans, &observed.last_word));
        }
        let alive: Vec<&str> = observed
            .clients
            .iter()
            .map(String::as_str)
            .filter(|name| self.apps.iter().any(|app| app == name))
            .collect();
        parts.push(if alive.is_empty() { "starting".to_owned() } else { format!("alive: {}", alive.join(" ")) });
        parts.join(" | ")
    }

    /// A word on how long everybody has waited for somebody, if that is long.
    fn silence(&self, secs: f64, plans: bool, last_word: &str) -> Option<String> {
        let words = match plans {
            true => format!("{}: planning for {secs:.0} s", self.explorer),
            false => format!("nothing for {secs:.0} s since {last_word}"),
        };
        (secs >= SILENCE_SECS).then_some(words)
    }

    /// The volume that is known, and how much of the region it is as long as that says something.
    fn coverage(&self, observed: &Observer) -> String {
        let Some(map) = &observed.map else { return "nothing known".to_owned() };
        let known = map.free.saturating_add(map.occupied) as f64 * map.resolution.powi(3);
        let share = self.region.map(|region| known / region).filter(|share| *share <= 1.0);
        let share = share.map(|share| format!(" ({:.0} % of the region)", 100.0 * share)).unwrap_or_default();
        format!("{known:.1} m³ known{share}, {} frontier", map.frontier)
    }
}

fn scans(observed: &Observer) -> u64 {
    observed.progress.as_ref().map_or(0, |progress| progress.scans)
}

/// `2:05`, `1:02:05`
fn clock(secs: f64) -> String {
    let secs = secs as u64;
    let (hours, minutes, secs) = (secs / 3600, secs / 60 % 60, secs % 60);
    if hours > 0 { format!("{hours}:{minutes:02}:{secs:02}") } else { format!("{minutes}:{secs:02}") }
}

/// How many scans a second there were lately.
#[derive(Debug, Default)]
struct ScanRate(VecDeque<(f64, u64)>);

impl ScanRate {
    /// So many scans there were after so many seconds.
    fn note(&mut self, secs: f64, scans: u64) {
        self.0.push_back((secs, scans));
        while self.0.get(1).is_some_and(|(next, _)| secs - next >= RATE_SECS) {
            self.0.pop_front();
        }
    }

    fn per_sec(&self) -> f64 {
        match (self.0.front(), self.0.back()) {
            (Some((from, before)), Some((to, now))) if to > from => now.saturating_sub(*before) as f64 / (to - from),
            _ => 0.0,
        }
    }
}

#[cfg(test)]
mod tests {
    use elk_spatial::CameraInfo;
    use elk_spatial::messages::{MapStatus, Progress};
    use elk_spatial::rays::RayTally;

    use super::*;

    #[test]
    fn the_line_says_what_a_person_wants_to_know() {
        let mut observed = Observer::default();
        let apps = ["Map", "Sensor"].map(str::to_owned).into();
        let what = Shown { apps, explorer: "Explorer".into(), region: Some(0.1), explores: true };
        let line = |observed: &Observer, paused| what.line(observed, 125.9, 2.5, paused);
        assert_eq!(line(&observed, false), "2:05 | nothing known | 0 scans, 2.5/s, 0.0 m | starting");
        observed.clients = ["Map", "Sensor", "launcher", "echo-4711", "top-12"].map(str::to_owned).into();
        observed.map = Some(MapStatus {
            revision: 3,
            free: 20,
            occupied: 5,
            frontier: 7,
            resolution: 0.1,
            cpu_secs: 0.0,
            full: false,
            rays: RayTally::default(),
            camera: CameraInfo::default(),
        });
        observed.progress =
            Some(Progress { scan: 3, revision: 3, scans: 3, path_length_m: 1.25, free: 20, finished: false });
        observed.steps.note("Controller", 1.0, true);
        observed.steps.note("Controller", 1.5, true);
        let rest = "3 scans, 2.5/s, 1.2 m | 500 ms a step | alive: Map Sensor";
        assert_eq!(
            line(&observed, true),
            format!("2:05 | paused | 0.0 m³ known (25 % of the region), 7 frontier | {rest}")
        );
        if let Some(map) = &mut observed.map {
            map.free = 2_000_000;
        }
        assert_eq!(line(&observed, false), format!("2:05 | 2000.0 m³ known, 7 frontier | {rest}"), "beyond the region");
        assert_eq!(clock(3725.0), "1:02:05");
        observed.since_last_word = Some((Stopwatch::start(), true));
        assert_eq!(line(&observed, false), format!("2:05 | 2000.0 m³ known, 7 frontier | {rest}"), "just now");
        assert_eq!(what.silence(12.3, true, "").unwrap(), "Explorer: planning for 12 s");
        assert_eq!(what.silence(5.0, false, "SCAN by Sensor").unwrap(), "nothing for 5 s since SCAN by Sensor");
    }

    #[test]
    fn scans_are_counted_over_the_last_seconds() {
        let mut rate = ScanRate::default();
        assert_eq!(rate.per_sec(), 0.0);
        (0..=100).for_each(|n| rate.note(f64::from(n) * 0.1, n as u64));
        assert!((rate.per_sec() - 10.0).abs() < 1e-9);
        assert!(rate.0.len() < 55, "what is past is let go of");
        (100..=200).for_each(|n| rate.note(f64::from(n) * 0.1, 100));
        assert_eq!(rate.per_sec(), 0.0);
    }
}
