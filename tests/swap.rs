//! Orders to running missions: apps stopped, started and swapped in the midst of it, and processes that are killed.

mod common;

use common::car::car;
use common::events::wait_until_gone;
use common::lab::hear;
use common::{Elk, Launcher, alive, kill, processes_of, shared_memory_of};
use elk_bus::Client;
use elk_spatial::keys::{MOTION_MEMORY, PROGRESS};
use rustix::process::Signal;

/// The car, all of whose apps are started again whenever they end; `kind`: `auto`, or `manual`.
fn undying(kind: &str) -> String {
    let text = car(kind).replace("<Scenario", "<Scenario broker-restarts=\"100\"");
    let restarted = |text: String, tag: &str| text.replace(tag, &format!("{tag} restart=\"always\" restarts=\"100\""));
    let text = ["<Sensor", "<Filter", "<Map", "<Explorer", "<Controller"].into_iter().fold(text, restarted);
    text.replace("</Scenario>", "<Logger type=\"Mcap\" restart=\"always\" restarts=\"100\"/></Scenario>")
}

/// Launches the car and waits until a few scans are in the map.
fn under_way(elk: &Elk) -> Launcher {
    let launcher = elk.launch(&undying("auto"));
    let mut watcher = elk.join("watcher");
    watcher.comms.register(&PROGRESS).unwrap();
    hear(&mut watcher, "a few scans", |mail| (mail.decode(&PROGRESS).unwrap().scans >= 3).then_some(()));
    launcher
}

/// Launches the car, which does nothing before the first step, and waits until everybody is there.
fn at_the_start(elk: &Elk, more: &[&str]) -> Launcher {
    let mut launcher = elk.launch_with(&undying("manual"), more);
    launcher.wait_for("Enter takes a step");
    launcher
}

/// Launches the car detached; the launcher that is in the background when the prompt is back.
fn in_the_background(elk: &Elk) -> i32 {
    let (code, said) = elk.launch_with(&undying("manual"), &["--detach"]).end();
    assert_eq!(code, Some(0), "{said}");
    elk.process("launcher")
}

/// The mission ends complete, and leaves nobody behind.
fn assert_completes(elk: &Elk, launcher: Launcher) -> serde_json::Value {
    let (code, said) = launcher.end();
    assert_eq!(code, Some(0), "{said}");
    let summary = elk.summary();
    assert_eq!(summary["complete"], true, "{said}");
    assert_eq!(processes_of(elk), [0; 0]);
    assert_eq!(shared_memory_of(elk), [""; 0]);
    summary
}

#[test]
fn explorers_take_turns_in_mid_mission() {
    let elk = Elk::new("turns");
    let launcher = under_way(&elk);
    let first = elk.process("Explorer");
    let said = elk.obeyed(&["swap", "Explorer", "type=ClosestFrontier"]);
    assert!(said.starts_with("the new Explorer is ready") || said.contains("Explorer is swapped, in "), "{said}");
    let row = elk.row("Explorer");
    assert_eq!((&row["type"], &row["swaps"], &row["restarts"]), (&"ClosestFrontier".into(), &1.into(), &0.into()));
    assert_ne!(row["pid"], first);
    wait_until_gone("the old explorer's end", || alive(first).then_some(first));
    let summary = assert_completes(&elk, launcher);
    assert_eq!(summary["explorer"], "Potential, ClosestFrontier");
    assert_eq!(summary["swapped"], serde_json::json!(["Explorer"]));
}

#[test]
fn every_app_can_be_swapped_for_its_own_kind() {
    let elk = Elk::new("own-kind");
    let launcher = at_the_start(&elk, &[]);
    for app in ["Sensor", "Filter", "Map", "Explorer", "Controller", "Logger"] {
        elk.obeyed(&["step"]);
        let said = elk.obeyed(&["swap", app]);
        assert!(said.contains(&format!("{app} is swapped, in ")), "{said}");
        assert_eq!(elk.row(app)["swaps"], 1);
    }
    elk.obeyed(&["resume"]);
    assert_completes(&elk, launcher);
}

#[test]
fn somebody_elses_program_takes_the_place() {
    let elk = Elk::new("somebody");
    let launcher = under_way(&elk);
    // Another program, from the working directory: what it is told of its parameters it does not hear.
    let program = env!("CARGO_BIN_EXE_elk");
    elk.script(
        "mine.sh",
        &format!("exec {program} explorer --type ClosestFrontier --name $ELK_NAME --community $ELK_COMMUNITY \"$@\"\n"),
    );
    let said = elk.obeyed(&["swap", "Explorer", "exec=./mine.sh"]);
    assert!(said.contains("Explorer is swapped, in "), "{said}");
    assert_eq!(elk.row("Explorer")["type"], "exec");
    let summary = assert_completes(&elk, launcher);
    assert_eq!(summary["explorer"], "Potential, mine.sh");
}

#[test]
fn a_filter_is_stopped_and_started() {
    let elk = Elk::new("stop-start");
    let launcher = under_way(&elk);
    assert_eq!(elk.obeyed(&["stop", "Filter"]), "Filter is stopped\n");
    let row = elk.row("Filter");
    assert_eq!((&row["state"], &row["pid"]), (&"stopped".into(), &serde_json::Value::Null));
    assert_eq!(elk.refused(&["stop", "Filter"]), "elk: Filter is stopped already\n");
    assert_eq!(elk.refused(&["swap", "Filter"]), "elk: Filter is stopped: only an app that runs can be swapped\n");
    assert_eq!(elk.obeyed(&["start", "Filter"]), "Filter runs\n");
    assert_eq!(elk.row("Filter")["state"], "running");
    assert_completes(&elk, launcher);
}

#[test]
fn every_app_can_be_stopped_and_started() {
    let elk = Elk::new("stop-all");
    let launcher = under_way(&elk);
    for app in ["Sensor", "Filter", "Map", "Explorer", "Controller", "Logger"] {
        assert_eq!(elk.obeyed(&["stop", app]), format!("{app} is stopped\n"));
        assert_eq!(elk.obeyed(&["start", app]), format!("{app} runs\n"));
    }
    assert_completes(&elk, launcher);
}

#[test]
fn what_cannot_be_done_is_one_line_and_changes_nothing() {
    let elk = Elk::new("cannot");
    let launcher = at_the_start(&elk, &[]);
    let before = ["Sensor", "Filter", "Map", "Explorer", "Controller", "Logger", "db"].map(|app| elk.process(app));
    let folder = elk.folder().display();
    for (order, said) in [
        (
            vec!["swap", "Explorer", "type=ClosestFrontir"],
            "type=ClosestFrontir: Explorer has no type \"ClosestFrontir\"; did you mean ClosestFrontier?".to_owned(),
        ),
        (
            vec!["swap", "Explorer", "Res=-1"],
            "Res=-1: Res: \"-1\" is out of range; right is a number from 0.001 to 10, in m".to_owned(),
        ),
        (
            vec!["swap", "Explorer", "Rse=1"],
            "Rse=1: Explorer Potential has no parameter Rse; did you mean Res?".to_owned(),
        ),
        (
            vec!["swap", "Explorer", "exec=./mission.xml"],
            format!("exec=./mission.xml: {folder}/./mission.xml is not executable; `chmod +x` makes a program of it"),
        ),
        (
            vec!["swap", "Explorer", "exec=./none"],
            format!("exec=./none: {folder}/./none cannot be run: No such file or directory (os error 2)"),
        ),
        (vec!["swap", "Explorer", "type=Potential", "type=Potential"], "type is said twice; once is enough".to_owned()),
        (vec!["swap", "Explorer", "args=-v"], "args without exec; right is both or neither".to_owned()),
        (
            vec!["swap", "Explorar", "type=Potential"],
            "the mission has no app Explorar; did you mean Explorer?".to_owned(),
        ),
        (vec!["stop", "Flter"], "the mission has no app Flter; did you mean Filter?".to_owned()),
        (vec!["start", "Map"], "Map is running, not stopped".to_owned()),
    ] {
        assert_eq!(elk.refused(&order), format!("elk: {said}\n"));
    }
    let said = elk.refused(&["stop", "db"]);
    assert!(said.starts_with("elk: db is the broker: without it there is no mission"), "{said}");
    let after = ["Sensor", "Filter", "Map", "Explorer", "Controller", "Logger", "db"].map(|app| elk.process(app));
    assert_eq!(after, before);
    elk.obeyed(&["resume"]);
    assert_completes(&elk, launcher);
}

/// Regression: such swaps were made, and the mission stood still without a word.
#[test]
fn what_goes_together_is_not_taken_apart() {
    let elk = Elk::new("apart");
    let launcher = at_the_start(&elk, &[]);
    let apps = ["Sensor", "Filter", "Map", "Explorer", "Controller", "Logger", "db"];
    let before = apps.map(|app| elk.process(app));
    // The words are the mission's own, and tested there.
    for (app, change, said) in [
        ("Map", "Res=0.2", "the same while the mission runs"),
        ("Explorer", "Res=0.2", "the same for Map and Explorer"),
        ("Map", "Input=NOPE", "nobody in the mission publishes NOPE"),
        ("Filter", "Output=SCAN_9", "nobody in the mission publishes SCAN_1"),
        ("Sensor", "Output=FOO", "nobody in the mission publishes SCAN;"),
        ("Controller", "MOOSPoseVarName=ZZ", "the same for Sensor and Controller"),
    ] {
        let refused = elk.refused(&["swap", app, change]);
        assert!(refused.contains(said), "{refused}");
    }
    assert_eq!(apps.map(|app| elk.process(app)), before);
    for order in [["swap", "Map", "Res=0.1"], ["swap", "Explorer", "type=ClosestFrontier"]] {
        let said = elk.obeyed(&order);
        assert!(said.contains(&format!("{} is swapped, in ", order[1])), "{said}");
    }
    elk.obeyed(&["resume"]);
    assert_completes(&elk, launcher);
}

#[test]
fn a_successor_that_dies_or_dawdles_leaves_the_old_one_in_its_place() {
    let elk = Elk::new("in-vain");
    let launcher = at_the_start(&elk, &[]);
    let before = elk.process("Explorer");
    elk.script("dies.sh", "echo my last words\nexit 3\n");
    let said = elk.refused(&["swap", "Explorer", "exec=./dies.sh"]);
    assert!(
        said.starts_with("elk: the new Explorer ended before it was ready: exit code 3; it said:\n    my last words\n"),
        "{said}"
    );
    assert!(said.ends_with("nothing is changed: the old Explorer goes on\n"), "{said}");
    elk.script("dawdles.sh", "sleep 1000\n");
    let said = elk.refused(&["swap", "Explorer", "exec=./dawdles.sh", "--limit", "0.3"]);
    assert!(said.starts_with("elk: the new Explorer was not ready within 0.3 s\n"), "{said}");
    // No program at all, whatever its permissions say.
    elk.script("odd.sh", "");
    std::fs::write(elk.folder().join("odd.sh"), [0x7f, b'E', b'L', b'F', 1, 2]).unwrap();
    let said = elk.refused(&["swap", "Explorer", "exec=./odd.sh"]);
    assert!(said.starts_with("elk: the new Explorer ended") || said.contains("Exec format error"), "{said}");
    assert_eq!(elk.process("Explorer"), before);
    elk.obeyed(&["resume"]);
    assert_completes(&elk, launcher);
}

#[test]
fn a_name_that_is_taken_keeps_an_app_from_starting() {
    let elk = Elk::new("taken");
    let launcher = at_the_start(&elk, &[]);
    elk.obeyed(&["stop", "Filter"]);
    let other = elk.join("Filter");
    let said = elk.refused(&["start", "Filter"]);
    assert!(said.contains("Filter ended before it registered: exit code 1"), "{said}");
    assert!(said.contains("a client named \"Filter\" is already connected"), "{said}");
    assert_eq!(elk.row("Filter")["state"], "stopped");
    drop(other);
    elk.obeyed(&["start", "Filter"]);
    elk.obeyed(&["resume"]);
    assert_completes(&elk, launcher);
}

#[test]
fn every_app_and_the_broker_can_be_killed_and_the_mission_completes() {
    for victim in ["Sensor", "Filter", "Map", "Explorer", "Controller", "Logger", "db"] {
        let elk = Elk::new(&format!("killed-{victim}"));
        let mut launcher = under_way(&elk);
        kill(elk.process(victim), Signal::KILL);
        launcher.wait_for(&format!("{victim} ended: signal 9 (SIGKILL)"));
        launcher.wait_for(&format!("{victim} is back, restarted (1 of 100 in 60 s)"));
        assert_completes(&elk, launcher);
    }
}

#[test]
fn a_paused_mission_stands_still_steps_and_runs_on() {
    let elk = Elk::new("paused");
    let launcher = under_way(&elk);
    let mut watcher = elk.join("watcher");
    watcher.comms.register(&MOTION_MEMORY).unwrap();
    elk.obeyed(&["pause"]);
    let (commands, scans) = stands(&mut watcher, 0);
    for step in 1..=3 {
        elk.obeyed(&["step"]);
        let stood = stands(&mut watcher, commands + step - 1);
        assert_eq!(stood, (commands + step, scans + step), "one pose and one scan a step");
    }
    elk.obeyed(&["resume"]);
    drop(watcher);
    assert_completes(&elk, launcher);
}

/// Waits until the controller, after this many commands, holds the next one back: what was under way has come to its end.
/// How many commands it has given, and how many scans were taken.
fn stands(watcher: &mut Client, after: u64) -> (u64, u64) {
    hear(watcher, "a robot that stands", |mail| {
        let memory = mail.decode(&MOTION_MEMORY).unwrap();
        let stands = memory.commands > memory.allowed && memory.allowed > after;
        stands.then_some((memory.allowed, memory.samples.last().map_or(0, |sample| sample.scans)))
    })
}

#[test]
fn a_detached_mission_outlives_its_launcher_and_is_picked_up() {
    let elk = Elk::new("detached");
    let launcher = in_the_background(&elk);
    let apps = ["Sensor", "Filter", "Map", "Explorer", "Controller", "Logger", "db"];
    let before = apps.map(|app| elk.process(app));
    elk.obeyed(&["stop", "Filter"]);
    kill(launcher, Signal::KILL);
    wait_until_gone("the launcher", || Some(launcher).filter(|id| alive(*id)));
    assert!(elk.refused(&["apps"]).contains("nobody launches community"));
    // One that dies while nobody looks is started again by whoever looks next.
    kill(before[2], Signal::KILL);
    let mut attached = elk.attach();
    attached.wait_for("attached to run");
    attached.wait_for("Map ended: while there was no launcher; it is started again");
    attached.wait_for("Map is back");
    let stayed = ["Sensor", "Explorer", "Controller", "Logger", "db"];
    let expected = [before[0], before[3], before[4], before[5], before[6]];
    assert_eq!(stayed.map(|app| elk.process(app)), expected);
    assert_eq!(elk.row("Filter")["state"], "stopped");
    elk.obeyed(&["start", "Filter"]);
    // An adopted app is watched like a child.
    kill(expected[1], Signal::KILL);
    attached.wait_for("Explorer is back");
    elk.obeyed(&["resume"]);
    let summary = assert_completes(&elk, attached);
    assert_eq!(summary["explorer"], "Potential");
}

/// Regression: what the launcher had left word of was on the bus alone, and died with the broker.
#[test]
fn a_detached_mission_whose_launcher_and_broker_die_at_once_is_picked_up() {
    let elk = Elk::new("both-dead");
    let launcher = in_the_background(&elk);
    let apps = ["Sensor", "Filter", "Map", "Explorer", "Controller", "Logger"];
    let before = apps.map(|app| elk.process(app));
    let broker = elk.process("db");
    kill(launcher, Signal::KILL);
    kill(broker, Signal::KILL);
    wait_until_gone("the launcher", || Some(launcher).filter(|id| alive(*id)));
    let mut attached = elk.attach();
    attached.wait_for("attached to run");
    attached.wait_for("db ended: while there was no launcher; it is started again");
    attached.wait_for("db is back");
    assert_eq!(apps.map(|app| elk.process(app)), before);
    elk.obeyed(&["resume"]);
    assert_completes(&elk, attached);
    // The word of it has gone with the mission.
    let said = elk.refused(&["attach"]);
    assert!(said.starts_with("elk: no broker serves community"), "{said}");
}

#[test]
fn there_is_nothing_to_attach_to_without_a_mission() {
    let elk = Elk::new("no-mission");
    let said = elk.refused(&["attach"]);
    assert!(said.starts_with("elk: no broker serves community"), "{said}");
    for order in [&["apps"][..], &["stop", "Map"], &["swap", "Map"], &["pause"]] {
        let said = elk.refused(order);
        assert!(said.starts_with("elk: nobody launches community") && said.lines().count() == 1, "{said}");
    }
}

#[test]
fn a_mission_inside_one_process_says_that_it_is_one() {
    let elk = Elk::new("one-process");
    let launcher = at_the_start(&elk, &["--in-process"]);
    let said = elk.refused(&["stop", "Map"]);
    assert!(said.starts_with("elk: this mission runs inside one process"), "{said}");
    elk.obeyed(&["resume"]);
    assert_completes(&elk, launcher);
}
