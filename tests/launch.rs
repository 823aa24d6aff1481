//! Launches as people do them: the real program, real processes, real shared memory.

mod common;

use std::time::Duration;

use common::{Elk, alive, kill, processes_of, shared_memory_of};
use rustix::process::Signal;

/// What the launcher says once everyone of an idle mission is there.
const ALL_ALIVE: &str = "alive: Controller Explorer Map Sensor";

/// A mission in which nobody ever commands a pose: its controller is an idle client of the bus. `explorer` is an idle
/// one, too, or what a test wants.
fn idle(elk: &Elk, explorer: Option<&str>) -> String {
    let (program, controller) = elk.idle_client("Controller");
    let explorer = explorer.unwrap_or("<Explorer type=\"Potential\"><Mid>0;0;0</Mid><Dim>5;4;4</Dim></Explorer>");
    format!(
        "<Scenario name=\"Idle\"><Sensor type=\"Simulator\"/><Map type=\"OctoMap\"/>{explorer}\
         <Controller exec=\"{program}\" args=\"{controller}\"/><Logger type=\"none\"/></Scenario>"
    )
}

fn assert_nothing_is_left(elk: &Elk) {
    assert_eq!(processes_of(elk), []);
    assert_eq!(shared_memory_of(elk), [""; 0]);
}

#[test]
fn an_executable_that_is_not_there_fails_the_launch_by_name() {
    let elk = Elk::new("not-there");
    let said = elk.launch_and_fail(&idle(&elk, Some("<Explorer exec=\"./no-such-explorer\"/>")));
    assert!(said.contains("Explorer cannot be started"), "{said}");
    assert!(said.contains("no-such-explorer: No such file or directory"), "{said}");
    assert_nothing_is_left(&elk);
}

#[test]
fn an_executable_that_dies_at_once_fails_the_launch_with_its_last_words() {
    let elk = Elk::new("dies-at-once");
    elk.script("dies.sh", "echo my last words >&2\nexit 3\n");
    let said = elk.launch_and_fail(&idle(&elk, Some("<Explorer exec=\"./dies.sh\"/>")));
    assert!(said.contains("Explorer ended before it registered: exit code 3"), "{said}");
    assert!(said.contains("my last words"), "{said}");
    assert_nothing_is_left(&elk);
}

#[test]
fn an_app_that_is_killed_in_the_midst_of_it_fails_the_mission() {
    let elk = Elk::new("killed-app");
    let mut launcher = elk.launch(&idle(&elk, None));
    launcher.wait_for(ALL_ALIVE);
    kill(launcher.process_of("Map"), Signal::KILL);
    let (code, said) = launcher.end();
    assert_eq!(code, Some(1), "{said}");
    assert!(said.contains("Map ended before the mission was over: signal 9 (SIGKILL)"), "{said}");
    assert_nothing_is_left(&elk);
}

#[test]
fn a_broker_that_is_killed_is_named_and_not_those_who_miss_it() {
    let elk = Elk::new("killed-broker");
    let mut launcher = elk.launch(&idle(&elk, None));
    launcher.wait_for(ALL_ALIVE);
    kill(launcher.process_with("\0db\0"), Signal::KILL);
    let (code, said) = launcher.end();
    assert_eq!(code, Some(1), "{said}");
    assert!(said.contains("db ended before the mission was over: signal 9 (SIGKILL)"), "{said}");
    assert_eq!(processes_of(&elk), []);
    // What the dead broker could not put away, the next run does.
    let mut next = elk.launch(&idle(&elk, None));
    next.wait_for(ALL_ALIVE);
    kill(next.id(), Signal::INT);
    next.end();
    assert_nothing_is_left(&elk);
}

#[test]
fn a_person_stops_a_mission_and_nobody_is_left() {
    let elk = Elk::new("stopped");
    let mut launcher = elk.launch(&idle(&elk, None));
    launcher.wait_for(ALL_ALIVE);
    kill(launcher.id(), Signal::INT);
    let (code, said) = launcher.end();
    assert_eq!(code, Some(1), "{said}");
    assert!(said.ends_with("NOT complete: stopped\n") || said.contains("NOT complete: stopped\n  all of it"), "{said}");
    assert!(!said.contains("killed"), "{said}");
    assert_nothing_is_left(&elk);
}

#[test]
fn nobody_is_left_after_the_launcher_is_killed() {
    let elk = Elk::new("killed-launcher");
    // It listens to no signal, and neither does its child.
    let (program, client) = elk.idle_client("Explorer");
    elk.script("deaf.sh", &format!("trap '' TERM INT\nsleep 1000 &\n{program} {client}\nwait\n"));
    let mut launcher = elk.launch(&idle(&elk, Some("<Explorer exec=\"./deaf.sh\"/>")));
    launcher.wait_for(ALL_ALIVE);
    let descendants = launcher.descendants();
    // Guard, broker, sensor, map, script, its two children, controller.
    assert_eq!(descendants.len(), 8);
    kill(launcher.id(), Signal::KILL);
    launcher.end();
    let gone = || !descendants.iter().any(|id| alive(*id));
    common::wait_until(Duration::from_secs(60), "everyone is gone", gone);
    assert_nothing_is_left(&elk);
}

#[test]
fn a_failing_app_is_started_again_where_the_mission_says_so() {
    let elk = Elk::new("restarted");
    let (program, client) = elk.idle_client("Explorer");
    let tried = elk.folder().join("tried");
    let tried = tried.display();
    // Fails the first time, stays the second.
    elk.script("second.sh", &format!("[ -e {tried} ] || {{ touch {tried}; exit 1; }}\nexec {program} {client}\n"));
    let mission = idle(&elk, Some("<Explorer exec=\"./second.sh\" restart=\"on-failure\"/>"));
    let mut launcher = elk.launch(&mission);
    launcher.wait_for(ALL_ALIVE);
    kill(launcher.id(), Signal::TERM);
    let (_, said) = launcher.end();
    assert!(said.contains("Explorer failed and was started again (1 of 3)"), "{said}");
}

#[test]
fn a_manual_mission_without_a_person_says_what_to_do() {
    let elk = Elk::new("nobody");
    let mission = idle(&elk, None).replace("<Scenario", "<Scenario type=\"manual\"");
    let said = elk.launch_and_fail(&mission);
    assert!(said.contains("a manual mission needs a person who presses Enter"), "{said}");
    assert_nothing_is_left(&elk);
}

#[test]
fn a_mission_that_is_wrong_starts_nothing() {
    let elk = Elk::new("wrong");
    let said = elk.launch_and_fail("<Scenario>\n<Sensor type=\"Simulatr\"/>\n</Scenario>");
    let file = elk.folder().join("mission.xml");
    let place = file.display();
    assert_eq!(
        said,
        format!(
            "elk: {place}:1:1: the Scenario has no <Map>; right is one\n\
             {place}:1:1: the Scenario has no <Explorer>; right is one\n\
             {place}:1:1: the Scenario has no <Controller>; right is one\n\
             {place}:2:15: Sensor has no type \"Simulatr\"; did you mean Simulator?\n"
        )
    );
    assert!(!elk.folder().join("logs").exists());
}
