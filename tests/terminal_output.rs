//! What is seen at a terminal: a line that changes and leaves no trace, tables that fit, colours, keys.

mod common;

use std::process::Command;

use common::events::wait_until_gone;
use common::lab::Lab;
use common::small::small;
use common::terminal::Terminal;
use common::{Elk, alive, kill, processes_of};
use rustix::process::Signal;

/// To the start of the line, and clear it.
const REWIND: &str = "\r\x1b[2K";

/// `elk` with these arguments and the test's community, as a person has it who wants colours.
fn elk_command(elk: &Elk, arguments: &[&str]) -> Command {
    let community: &[&str] = if arguments == ["communities"] { &[] } else { &["--community", elk.community()] };
    let mut command = elk.command(&[arguments, community].concat());
    command.env_remove("NO_COLOR").env("TERM", "xterm");
    command
}

/// `elk launch` of a small mission, in a terminal.
fn launch(elk: &Elk, kind: &str, more: &[&str], columns: u16) -> Terminal {
    std::fs::write(elk.folder().join("small.xml"), small(kind, "<Filter type=\"Distance\"/>")).unwrap();
    Terminal::start(elk_command(elk, &[&["launch", "small.xml"], more].concat()), columns)
}

/// What stood in the line that changes: what follows a clearing, up to the next one or the line's end.
fn status_lines(shown: &str) -> Vec<&str> {
    let lines = shown.split(REWIND).skip(1).filter_map(|line| line.lines().next());
    lines.filter(|line| line.contains(":") && line.contains(" scans")).collect()
}

fn has_scanned(line: &str) -> bool {
    line.contains(" scans, ") && !line.contains(" | 0 scans, ")
}

/// Presses Enter until the robot has taken a step: a controller that has yet to begin hears of none.
fn take_a_step(terminal: &mut Terminal) {
    let mut scanned = false;
    while !scanned {
        let before = status_lines(&terminal.shown()).len();
        terminal.press("\n");
        terminal.wait_until("a scan", |shown| {
            let lines = status_lines(shown);
            scanned = lines.iter().any(|line| has_scanned(line));
            scanned || lines.len() > before + 20
        });
    }
}

/// The text without colours.
fn plain(text: &str) -> String {
    let (mut plain, mut rest) = (String::new(), text);
    while let Some((before, escape)) = rest.split_once("\x1b[") {
        plain += before;
        rest = escape.split_once(|letter: char| letter.is_ascii_alphabetic()).map_or("", |(_, after)| after);
    }
    plain + rest
}

/// Regression: `alive: Small: NOT complete`; and of a run that was stopped its policy was "unknown", and what had been covered, what
/// frontier was left and what the robot had touched were not said.
#[test]
fn the_line_that_changes_is_cleared_before_anything_else_and_a_stopped_run_says_what_it_knows() {
    let elk = Elk::new("output-line");
    let mut terminal = launch(&elk, "manual", &[], 100);
    terminal.wait_until("how to step", |shown| shown.contains("Enter takes a step"));
    assert!(terminal.shown().contains(&format!("{REWIND}Enter takes a step")), "{:?}", terminal.shown());
    take_a_step(&mut terminal);
    terminal.press("\x03");
    let (status, shown) = terminal.end();
    assert_eq!(status.code(), Some(1), "{shown}");
    assert!(shown.contains(&format!("{REWIND}\x1b[31mSmall: NOT complete: stopped\x1b[0m\r\n")), "{shown:?}");
    let (_, summary) = shown.rsplit_once(REWIND).unwrap();
    assert!(summary.contains(" scans, ") && summary.contains("explorer ClosestFrontier, policy elk"), "{summary}");
    assert!(!summary.contains("unknown"), "{summary}");
    let known = [
        "% of the free voxels known at the end after",
        " frontier voxels left: 0 unreachable",
        " open, ",
        "contacts 0",
    ];
    known.iter().for_each(|known| assert!(summary.contains(known), "{known}: {summary}"));
    let line = status_lines(&shown).into_iter().find(|line| has_scanned(line)).unwrap();
    assert!(line.contains(":0") && line.contains(" m³ known (") && line.contains(" % of the region), "), "{line}");
    assert_eq!(processes_of(&elk), [0; 0]);
}

#[test]
fn the_line_that_changes_stays_within_the_window_and_ends_with_a_word() {
    let elk = Elk::new("output-narrow");
    let terminal = launch(&elk, "manual", &[], 44);
    let clipped = |line: &&str| line.ends_with(" …") && line.chars().count() < 44;
    terminal.wait_until("a clipped line", |shown| status_lines(shown).iter().any(clipped));
    let before = terminal.shown().len();
    terminal.resize(200);
    let whole = "alive: Controller Explorer Filter Logger Map Sensor";
    terminal
        .wait_until("a whole line", |shown| status_lines(&shown[before..]).iter().any(|line| line.ends_with(whole)));
    kill(terminal.program.id() as i32, Signal::INT);
    let (_, shown) = terminal.end();
    let narrow = status_lines(&shown[..before]);
    assert!(narrow.iter().all(|line| line.chars().count() < 44 && !line.contains("Sensor")), "{narrow:?}");
}

#[test]
fn tables_fit_into_a_narrow_window_and_have_colours_only_where_they_are_wanted() {
    let elk = Elk::new("output-tables");
    let terminal = launch(&elk, "manual", &[], 100);
    terminal.wait_until("how to step", |shown| shown.contains("Enter takes a step"));
    let table = |arguments: &[&str], no_colour: bool| {
        let mut command = elk_command(&elk, arguments);
        if no_colour {
            command.env("NO_COLOR", "1");
        }
        let (status, shown) = Terminal::start(command, 80).end();
        assert!(status.success(), "{shown}");
        shown
    };
    for command in ["apps", "list", "communities"] {
        let shown = table(&[command], false);
        assert!(shown.contains("\x1b[1m"), "the heads are bold: {shown:?}");
        let wide: Vec<String> =
            plain(&shown).lines().skip(1).filter(|l| l.chars().count() > 80).map(str::to_owned).collect();
        assert!(wide.is_empty(), "{command}: {wide:?}");
        assert!(!table(&[command], true).contains('\x1b'), "{command}: NO_COLOR");
        let piped = elk_command(&elk, &[command]).output().unwrap();
        assert!(piped.status.success() && !piped.stdout.contains(&b'\x1b'), "{command}: no terminal");
    }
    let apps = table(&["apps"], true);
    assert!(
        apps.contains("Controller") && apps.contains("STATE") && apps.contains("\r\nno room here for ELEMENT"),
        "{apps}"
    );
    let piped = elk.obeyed(&["apps"]);
    assert!(piped.contains("ELEMENT") && piped.contains("LAST EXIT") && !piped.contains("no room"), "{piped}");
    kill(terminal.program.id() as i32, Signal::INT);
    terminal.end();
}

#[test]
fn an_error_is_red_where_a_person_looks() {
    let elk = Elk::new("output-error");
    let (status, shown) = Terminal::start(elk_command(&elk, &["apps"]), 80).end();
    assert_eq!(status.code(), Some(1));
    assert!(shown.starts_with("\x1b[31melk:\x1b[0m nobody launches community"), "{shown:?}");
    assert!(elk.refused(&["apps"]).starts_with("elk: nobody launches"));
}

#[test]
fn top_and_hz_end_with_q_and_follow_the_window() {
    let elk = Elk::new("output-top");
    let lab = Lab::deaf(&elk);
    for command in ["top", "hz"] {
        let mut terminal = Terminal::start(elk_command(&elk, &[command]), 100);
        terminal.wait_until("a page", |shown| shown.contains("\x1b[J"));
        assert!(!terminal.is_as_before(), "keys come one by one");
        if command == "top" {
            assert!(terminal.shown().contains("BANDWIDTH"), "{:?}", terminal.shown());
            let before = terminal.shown().len();
            terminal.resize(40);
            terminal.wait_until("a narrow page", |shown| shown[before..].matches("\x1b[J").count() >= 2);
            let shown = terminal.shown();
            let (_, narrow) = shown[before..].split_once("\x1b[H\x1b[2J").expect("a screen that is cleared");
            let lines: Vec<String> =
                narrow.split(REWIND).skip(1).map(|line| plain(line).trim_end().to_owned()).collect();
            assert!(lines.iter().all(|line| line.chars().count() <= 40), "{lines:?}");
            assert!(lines.iter().any(|line| line.starts_with("no room here for ")), "{lines:?}");
        }
        terminal.press("xq");
        let (status, shown) = terminal.end();
        assert!(status.success(), "{command}: {shown}");
    }
    lab.end();
}

/// Regression: `--detach` kept the terminal.
#[test]
fn a_detached_mission_gives_the_prompt_back_and_is_brought_back() {
    let elk = Elk::new("output-detach");
    let (status, shown) = launch(&elk, "manual", &["--detach"], 100).end();
    assert!(status.success() && shown.contains("it runs in the background: `elk attach"), "{shown}");
    let (launcher, map) = (elk.process("launcher"), elk.process("Map"));
    assert!(alive(launcher) && alive(map));
    let mut attached = Terminal::start(elk_command(&elk, &["attach"]), 100);
    attached.wait_until("how to step", |shown| shown.contains("Enter takes a step"));
    wait_until_gone("the launcher in the background", || Some(launcher).filter(|id| alive(*id)));
    assert_eq!(elk.process("Map"), map, "the apps go on");
    assert!(elk.refused(&["attach"]).contains("is launched already"), "somebody sits there now");
    take_a_step(&mut attached);
    elk.obeyed(&["resume"]);
    let (status, shown) = attached.end();
    assert!(status.success() && shown.contains("Small: complete"), "{shown}");
    assert_eq!(processes_of(&elk), [0; 0]);
}

#[test]
fn a_detached_mission_that_cannot_start_says_why_and_one_that_is_over_has_its_summary() {
    let elk = Elk::new("output-detach-2");
    let (status, shown) = Terminal::start(elk_command(&elk, &["launch", "no.xml", "--detach"]), 100).end();
    assert!(status.code() == Some(1) && shown.contains("cannot read the mission file no.xml"), "{shown}");
    let (status, shown) = launch(&elk, "auto", &["--detach"], 100).end();
    assert!(status.success(), "{shown}");
    wait_until_gone("the mission", || processes_of(&elk).first().copied());
    assert_eq!(elk.summary()["complete"], true);
    let run = elk.run();
    let said = std::fs::read_to_string(run.join("launcher.log")).unwrap();
    assert!(said.contains("Small: complete") && !said.contains('\0'), "{said}");
}
