//! Replay as a person sees it: in a real terminal, with keys and a bar.

mod common;

use std::path::Path;
use std::process::Command;

use common::lab::{Lab, wait_for_time};
use common::terminal::Terminal;
use common::{Elk, kill};
use elk_bus::Value;
use elk_log::{LogWriter, Metadata, Record};
use rustix::process::Signal;

/// Bars that are waited for where nothing is to happen: half a second, in which at rate 4 messages would have been due.
const BARS: usize = 10;

/// Eighty numbers from 0, half a second apart: of every skip it is known where it leads.
fn counts() -> Vec<(&'static str, f64)> {
    (0..80).map(|number| ("COUNT", f64::from(number) * 0.5)).collect()
}

/// A log of messages of these variables at these times (s), numbered.
fn write_log(path: &Path, messages: &[(&str, f64)]) {
    let mut log = LogWriter::create(path, &Metadata::default()).unwrap();
    for (number, (key, time)) in (0..).zip(messages) {
        let record = Record {
            key: (*key).into(),
            source: "pCount".into(),
            source_aux: String::new(),
            community: "lab".into(),
            time: *time,
            sequence: number,
            received: *time,
            order: number,
            epoch: 1,
            value: Value::Double(number as f64),
        };
        log.append(&record.as_ref()).unwrap();
    }
    log.finish().unwrap();
}

/// A replay in a terminal, and somebody who hears it.
struct Playback {
    /// Holds the log, which a jump opens again.
    _elk: Elk,
    lab: Lab,
    terminal: Terminal,
    /// Numbers heard so far.
    heard: usize,
}

impl Playback {
    /// Plays a log in a terminal of so many columns.
    fn new(test: &str, messages: &[(&str, f64)], columns: u16) -> Self {
        let playback = Self::with(test, messages, |elk| Terminal::start(replay(elk), columns));
        playback.terminal.wait_until("a bar", |shown| !bars(shown).is_empty());
        assert!(!playback.terminal.is_as_before(), "keys come one by one");
        playback
    }

    fn with(test: &str, messages: &[(&str, f64)], start: impl FnOnce(&Elk) -> Terminal) -> Self {
        let elk = Elk::new(test);
        write_log(&elk.folder().join("log.mcap"), messages);
        let lab = Lab::new(&elk);
        let terminal = start(&elk);
        terminal.wait_until("the log's name", |shown| shown.contains("log.mcap: "));
        Self { _elk: elk, lab, terminal, heard: 0 }
    }

    /// The next numbers.
    fn hear(&mut self, count: usize) -> Vec<f64> {
        let heard = self.lab.hear(count);
        self.note(heard)
    }

    /// The numbers that have come by now.
    fn hear_rest(&mut self) -> Vec<f64> {
        let heard = self.lab.hear_rest();
        self.note(heard)
    }

    fn note(&mut self, heard: Vec<(String, String, Value)>) -> Vec<f64> {
        self.heard += heard.len();
        heard.into_iter().map(|(.., value)| if let Value::Double(number) = value { number } else { f64::NAN }).collect()
    }

    /// Presses keys, and waits until the bar says so.
    fn press(&mut self, keys: &str, words: &str) {
        self.terminal.press(keys);
        self.terminal.wait_until(&format!("{words:?} after {keys:?}"), |shown| last_bar(shown).contains(words));
    }

    /// The community's time, as the listener has heard.
    fn time(&self) -> f64 {
        self.lab.listener.comms.time()
    }

    /// Waits for so many more bars.
    fn let_pass(&self, count: usize) {
        let before = bars(&self.terminal.shown()).len();
        self.terminal.wait_until("more bars", |shown| bars(shown).len() >= before + count);
    }

    /// Lets time pass; the numbers that are heard meanwhile.
    fn listen(&mut self) -> Vec<f64> {
        self.let_pass(BARS);
        self.hear_rest()
    }

    /// The number that one step says.
    fn step(&mut self) -> f64 {
        self.terminal.press(".");
        let said = [self.hear(1), self.listen()].concat();
        assert_eq!(said.len(), 1, "one step is one message: {said:?}");
        said[0]
    }
}

fn replay(elk: &Elk) -> Command {
    elk.command(&["replay", "log.mcap", "--community", elk.community()])
}

/// What stood in the line that changes.
fn bars(shown: &str) -> Vec<&str> {
    let lines = shown.split('\r').filter_map(|line| line.strip_suffix("\x1b[K"));
    lines.filter(|line| line.contains(" s at ")).collect()
}

fn last_bar(shown: &str) -> &str {
    bars(shown).last().copied().unwrap_or_default()
}

#[test]
fn every_key_does_what_the_help_says() {
    let mut playback = Playback::new("keys", &counts(), 100);
    assert!(playback.terminal.shown().contains("space pauses, . steps"));
    assert_eq!(playback.hear(1)[0], 0.0);
    playback.press(" ", " s at 1x, paused, ");
    playback.press("+++", " s at 8x, paused, ");
    playback.press("-", " s at 4x, paused, ");
    playback.let_pass(2);
    playback.hear_rest();
    assert_eq!(playback.listen(), [0.0; 0], "it stands still");

    let here = playback.step();
    assert_eq!(playback.step(), here + 1.0);
    playback.press("\x1b[C", &format!("{:.1} / 39.5 s at 4x, paused", (here + 1.0) * 0.5 + 5.0));
    assert_eq!(playback.step(), here + 11.0, "ten messages are skipped");
    playback.press("\x1b[D", &format!("{:.1} / 39.5 s at 4x, paused", (here + 11.0) * 0.5 - 5.0));
    assert_eq!(playback.step(), here + 1.0, "and what was heard is heard again");
    playback.press("\x1b[H", "] 0.0 / 39.5 s at 4x, paused");
    playback.press("\x1b[D", "] 0.0 / 39.5 s at 4x, paused");
    assert_eq!(playback.step(), 0.0);

    playback.terminal.press(" ");
    let on = playback.hear(3);
    assert_eq!(on[..3], [1.0, 2.0, 3.0]);
    playback.terminal.wait_until("that it goes on", |shown| !last_bar(shown).contains("paused"));
    playback.terminal.press("q");
    let (status, shown) = playback.terminal.end();
    assert_eq!(status.code(), Some(0), "{shown}");
    let said = playback.heard + playback.lab.hear_rest().len();
    assert!(last_bar(&shown).starts_with("[#") && last_bar(&shown).ends_with(&format!(", {said} messages")), "{shown}");
    assert!(shown.contains(&format!("\x1b[K\r\n{said} messages, ")), "the last line is one of its own: {shown:?}");
    playback.lab.end();
}

#[test]
fn the_communitys_clock_stands_still_with_the_replay_and_jumps_with_it() {
    let with_clock = |elk: &Elk| {
        let mut command = replay(elk);
        command.arg("--clock");
        Terminal::start(command, 100)
    };
    let mut playback = Playback::with("clock", &counts(), with_clock);
    playback.hear(2);
    playback.press(" ", "paused");
    playback.listen();
    let here = playback.time();
    assert!((0.5..39.5).contains(&here), "{here}");
    playback.listen();
    assert_eq!(playback.time(), here, "it stands still");
    for (key, time) in [("\x1b[C", here + 5.0), ("\x1b[D", here), ("\x1b[H", 0.0)] {
        playback.press(key, &format!("] {time:.1} / 39.5 s"));
        playback.listen();
        assert!((playback.time() - time).abs() < 1e-6, "{} is not {time}", playback.time());
    }
    playback.terminal.press(" ");
    playback.hear(2);
    assert!((0.5..39.5).contains(&playback.time()), "it goes on: {}", playback.time());
    playback.terminal.press("q");
    playback.terminal.end();
    wait_for_time(&mut playback.lab.listener, |time| time > 1e9);
    playback.lab.end();
}

/// The program's end in a terminal that is its session's, by a key or a signal, from standing still or not.
#[test]
fn whatever_ends_it_the_terminal_is_as_it_was() {
    for (number, end) in ["q", " q", "\x03", " \x03", "SIGTERM", "SIGINT"].into_iter().enumerate() {
        let mut playback = Playback::new(&format!("end-{number}"), &counts(), 100);
        match end {
            "SIGTERM" => kill(playback.terminal.program.id() as i32, Signal::TERM),
            "SIGINT" => kill(playback.terminal.program.id() as i32, Signal::INT),
            keys => playback.terminal.press(keys),
        }
        let (status, shown) = playback.terminal.end();
        assert!(status.success() && shown.contains(" dropped by clients that did not keep up\r\n"), "{end:?}: {shown}");
        playback.lab.end();
    }
}

/// As a shell with jobs has it: Ctrl-Z gives the terminal back, `fg` takes it again.
#[test]
fn a_shell_has_its_terminal_back_while_the_replay_is_stopped() {
    let script = "set -m; \"$@\"; echo stopped; read line; fg; echo over $?";
    let mut playback = Playback::with("stopped", &counts(), |elk| Terminal::start(in_a_shell(script, elk), 100));
    playback.press(" ", "paused");
    playback.terminal.press("\x1a");
    playback.terminal.wait_until("the shell", |shown| shown.contains("stopped\r\n"));
    assert!(playback.terminal.is_as_before(), "the shell has its own settings");
    playback.hear_rest();
    playback.terminal.press("now\n");
    playback.terminal.wait_until("the shell's answer", |shown| shown.contains("now\r\n"));
    playback.press("+", " s at 2x, paused");
    assert!(!playback.terminal.is_as_before());
    playback.step();
    playback.terminal.press(" ");
    playback.hear(1);
    playback.terminal.press("q");
    playback.terminal.wait_until("the end", |shown| shown.contains("over 0\r\n"));
    playback.terminal.end();
    playback.lab.end();
}

/// Who only wants to hear a log puts it into the background, and goes on working.
#[test]
fn in_the_background_it_plays_to_the_end_and_leaves_the_terminal_alone() {
    let script = "set -m; \"$@\" --rate 20 & wait $!; echo over $?";
    let playback = Playback::with("background", &counts(), |elk| Terminal::start(in_a_shell(script, elk), 100));
    assert!(playback.terminal.is_as_before());
    playback.terminal.wait_until("the end", |shown| shown.contains("over 0\r\n"));
    let (_, shown) = playback.terminal.end();
    assert!(shown.contains("80 messages, ") && bars(&shown).is_empty(), "{shown}");
    playback.lab.end();
}

fn in_a_shell(script: &str, elk: &Elk) -> Command {
    let replay = replay(elk);
    let mut shell = Command::new("sh");
    shell.args(["-c", script, "sh"]).arg(replay.get_program()).args(replay.get_args()).current_dir(elk.folder());
    shell
}

#[test]
fn it_ends_when_its_window_is_closed() {
    let mut playback = Playback::new("closed", &counts(), 100);
    playback.terminal.press(" ");
    assert_eq!(playback.terminal.close().code(), Some(1), "in good order, as at SIGTERM; nobody sees its last words");
    playback.lab.end();
    // Whom no signal tells sees it at the next look.
    let start = |elk: &Elk| Terminal::start_without_session(replay(elk), 100);
    let mut playback = Playback::with("closed-unheard", &counts(), start);
    playback.terminal.press(" ");
    playback.terminal.wait_until("a bar", |shown| last_bar(shown).contains("paused"));
    assert_eq!(playback.terminal.close().code(), Some(1), "nobody sees its last words");
    playback.lab.end();
}

#[test]
fn the_bar_stays_within_a_narrow_window() {
    let mut playback = Playback::new("narrow", &counts(), 40);
    let longest = |shown: &str| bars(shown).iter().map(|bar| bar.len()).max();
    playback.press(" ", "paused");
    assert!(longest(&playback.terminal.shown()) < Some(40), "{}", playback.terminal.shown());
    playback.terminal.resize(20);
    playback.let_pass(2);
    assert!(last_bar(&playback.terminal.shown()).len() == 19, "{}", playback.terminal.shown());
    playback.terminal.press("q");
    assert!(playback.terminal.end().0.success());
    playback.lab.end();
}

#[test]
fn one_message_is_a_log_as_well_and_one_that_ends_before_the_first_is_no_failure() {
    let playback = Playback::with("one", &[("COUNT", 5.0)], |elk| Terminal::start(replay(elk), 100));
    let (status, shown) = playback.terminal.end();
    let bar = format!("[{}] 0.0 / 0.0 s at 1x, 1 messages", "#".repeat(30));
    assert!(status.success() && last_bar(&shown) == bar, "{shown}");
    playback.lab.end();
    let mut playback = Playback::new("none", &[("DB_TIME", 0.0), ("COUNT", 1000.0)], 100);
    playback.terminal.press("q");
    let (status, shown) = playback.terminal.end();
    assert!(status.success() && shown.contains("\n0 messages, "), "{shown}");
    playback.lab.end();
}
